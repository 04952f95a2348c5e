"""Statements: how sure a size is, and of which law the car-following."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.law import beneath, of
from idm_sumo.diagnosis.regressors import Regressor
from idm_sumo.diagnosis.result import Estimate, Gain
from idm_sumo.diagnosis.search import Found
from idm_sumo.diagnosis.statements import (
    FORM_DOUBT,
    LAW_DOUBT,
    causes,
    form_doubt,
    model_of,
    other_law,
    ruled_out,
    why_not,
    without_gain,
)
from idm_sumo.models import laws
from idm_sumo.models.effects import BY_NAME, slots
from tests.helpers.followers import FIT, evidence, free, tried


@pytest.mark.parametrize(("delay", "doubt"), [(-6.0, LAW_DOUBT), (-2.0, FORM_DOUBT), (6.0, FORM_DOUBT)])
def test_a_size_is_less_sure_where_drivers_seem_to_act_before_their_leader(delay, doubt):
    assert form_doubt(evidence(delay)) == doubt


@pytest.mark.parametrize(("delay", "said"), [(-6.0, True), (-3.5, False), (6.0, False)])
def test_who_surely_acts_before_the_leader_has_another_law(delay, said):
    law = other_law(evidence(delay))
    assert (law is not None) is said
    if law is not None:
        assert (law.name, law.symbol, law.unit) == ("reaction_delay", "tau", "s")
        assert law.value < 0.0
        assert law.standard_errors == pytest.approx(6.0, rel=0.01)


def found(*named, left=()):
    gain = Gain("ade_m", 1.0, 0.9, 0.1, (0.05, 0.15), 10, False)
    accepted = tuple(Accepted(one, one.candidate.value, 0.01, gain, ()) for one in named)
    return Found(FIT, FIT, accepted, (), evidence(2.0), evidence(2.0), left)


def test_what_some_drivers_have_is_told_with_how_many_they_are_and_is_in_the_model_so():
    late, place = tried(9.0, "reaction_delay", 0.8), tried(9.0, "location", -0.1)
    by_lane = np.tile(ro.PLAIN, (2, 1))
    by_lane[: ro.ROWS, slots.DELAY] = 0.8
    by_lane[:, slots.PLACE] = -0.1
    share = Estimate(0.4, "1", (0.35, 0.45))
    several = replace(found(late, place), fit=replace(FIT, by_lane=by_lane), share=share)
    some, everybody = causes(several, {"reaction_delay": 0.7, "location": 0.3})
    assert next(iter(some.parameters)) == "tau"
    assert some.parameters["share"] == share
    assert "40% of the drivers have it" in some.evidence
    assert "share" not in everybody.parameters
    model = model_of(several.fit, several.accepted, "", share)
    assert {cause.name: cause.share for cause in model.causes} == {"reaction_delay": 0.4, "location": 1.0}


NOTHING, PLACE, STRANGE = found(), found(tried(20.0, "location")), found(left=(free("position", 8.0),))


@pytest.mark.parametrize(
    ("regressor", "said"),
    [
        (Regressor("desired_speed", lane=2), " in lane 2: "),
        (
            Regressor("desired_speed", fixed=((slots.DESIRED_SPEED, 1.0), (slots.DESIRED_SPEED_ACROSS, 4.0))),
            ", from nothing in lane 1 to all of it in lane 4: ",
        ),
    ],
)
def test_the_lanes_of_a_desired_speed_are_said(regressor, said):
    slower = tried(9.0, "desired_speed", -0.3)
    (cause,) = causes(
        found(replace(slower, candidate=replace(slower.candidate, regressor=regressor))), {"desired_speed": 1.0}
    )
    assert f"has another desired speed than the limit{said}delta = -0.3," in cause.evidence


@pytest.mark.parametrize(
    ("name", "value", "z", "p", "beside", "said"),
    [
        ("hysteresis", 0.1, 2.0, 0.2, NOTHING, "chance makes as much"),
        ("hysteresis", -0.1, -8.0, 1e-9, NOTHING, "of a sign that it cannot have"),
        ("speed_dependent_headway", -0.3, -7.9, 1e-9, NOTHING, "other car-following laws have as much"),
        ("speed_dependent_headway", -0.3, -8.1, 1e-9, NOTHING, "looks like what did not make rollouts better"),
        ("hysteresis", 0.001, 8.0, 1e-9, NOTHING, "smaller than what is named (0.02)"),
        ("lane_change_relaxation", 0.5, 4.9, 1e-5, NOTHING, "less than the 5 standard errors asked of what smoothing"),
        ("hysteresis", 0.1, 4.9, 1e-5, PLACE, "less than the 5 standard errors asked of a further cause"),
        ("hysteresis", 0.1, 8.0, 1e-9, PLACE, "may be what location leaves over"),
        ("hysteresis", 0.1, 8.0, 1e-9, STRANGE, "what is unexplained says more"),
        ("hysteresis", 0.1, 8.0, 1e-9, NOTHING, "looks like what did not make rollouts better"),
    ],
)
def test_what_is_not_claimed_has_its_reason(name, value, z, p, beside, said):
    candidate = replace(tried(z, name, value).candidate, p=p)
    assert why_not(candidate, beside, [candidate]).startswith(said)


@pytest.mark.parametrize(
    ("name", "law", "is_told"),
    [
        ("hysteresis", laws.IDM, True),
        ("hysteresis", laws.FULL_VELOCITY_DIFFERENCE, False),
        ("location", laws.FULL_VELOCITY_DIFFERENCE, True),
        ("follower_pressure", laws.IDM, False),
    ],
)
def test_what_is_present_without_gain_is_nothing_that_another_law_leaves_over(name, law, is_told):
    one = tried(7.0, name)
    base = replace(FIT, by_lane=beneath(FIT.by_lane, of(law)))
    refused = replace(NOTHING, base=base, fit=base, without_gain=(one.candidate,))
    assert [c.name for c in without_gain(refused)] == [name] * is_told
    if not is_told:
        assert why_not(one.candidate, refused, [one.candidate]).startswith(
            "did not make rollouts better, and something else"
        )


def test_what_is_ruled_out_says_its_size_and_why():
    (late,) = ruled_out(NOTHING)
    assert (late.name, late.why) == ("reaction_delay", "chance makes as much")
    assert late.estimate.ci95[0] < late.estimate.value < late.estimate.ci95[1]


def test_no_interval_ends_beyond_a_bound_and_a_size_at_one_says_so():
    lower = next(p for p in BY_NAME["pre_insertion"].parameters if p.symbol == "c").lower
    by_lane = ro.PLAIN.copy()
    by_lane[:, slots.PRE_INSERTION] = lower
    several = replace(found(tried(9.0, "pre_insertion", lower)), fit=replace(FIT, by_lane=by_lane))
    (cause,) = causes(several, {"pre_insertion": 1.0})
    low, high = cause.parameters["c"].ci95
    assert low == cause.parameters["c"].value == lower
    assert high > lower
    assert cause.at_bound
    assert "at the bound of what is searched" in cause.evidence


def test_what_one_driver_alone_says_is_not_told_as_present():
    one = tried(7.0, "reaction_delay").candidate
    by_all, by_one = evidence(7.0), evidence(7.0)
    u = np.zeros_like(by_one.u)
    u[3] = by_one.u.sum(axis=0)
    refused = replace(NOTHING, first=by_all, without_gain=(one,))
    assert [cause.name for cause in without_gain(refused)] == ["reaction_delay"]
    refused = replace(refused, first=replace(by_one, u=u))
    assert not without_gain(refused)
    assert why_not(replace(one, p=1e-9), refused, [one]) == "rests on fewer than 5 drivers"
