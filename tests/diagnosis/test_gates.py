"""Gates: what is believed, and what is something else's shadow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import gates
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.regressors import Regressor
from tests.helpers.followers import evidence, free, tried


def test_a_delay_is_not_held_against_what_it_looks_like_itself():
    late, there = tried(8.0, "reaction_delay").candidate, tried(5.0, "hysteresis").candidate
    early = tried(-9.8, "multi_leader_anticipation", -0.1).candidate
    assert gates.surest_beside(late, [late, there, early]) == 5.0
    assert gates.surest_beside(there, [late, there, early]) == 9.8
    assert gates.surest_beside(late, [late, tried(9.0, "multi_leader_anticipation", 0.1).candidate]) == 9.0
    assert gates.surest_beside(late, []) == 0.0


@pytest.mark.parametrize(
    ("lane", "freely", "own", "named"), [(2, -9.8, -4.0, 2), (1, -9.8, -4.0, 1), (2, -6.9, -4.0, 1), (2, 9.8, -4.0, 1)]
)
def test_a_desired_speed_is_that_of_the_lane_that_stands_out_freely(lane, freely, own, named):
    """Of the lane in which drivers stay it says less than of the others: they have fitted a speed of their own to it."""
    free_lane = replace(free("lane", freely), range=(float(lane), float(lane)), value=np.sign(freely) * 0.2)
    seen = replace(evidence(0.0), free=(free_lane,))
    regressors = [*seen.regressors, *(Regressor("desired_speed", lane=number) for number in (1, 2))]
    totals = np.hstack([seen.u, evidence(1.7 * own).u, evidence(own).u])
    part, gram = np.hstack([seen.part] * 3), np.eye(3) * seen.gram[0, 0]
    both = replace(seen, regressors=regressors, u=totals, part=part, replicates=np.zeros((2, 3)), gram=gram)
    wanted = next(one for one in gates.believed(both) if one.name == "desired_speed")
    assert wanted.regressor.lane == named
    assert wanted.z == pytest.approx(freely if lane == named and abs(freely) > 7.0 else 1.7 * own, rel=0.1)


def test_where_there_is_hysteresis_a_fainter_delay_is_tried_too():
    loop, late, band = (tried(z, name).candidate for z, name in
        ((9.2, "hysteresis"), (4.0, "reaction_delay"), (3.8, "perception_threshold")))  # fmt: skip
    assert gates.with_what_it_may_hide([loop], [loop, late, band]) == [loop, late]
    assert gates.with_what_it_may_hide([loop, late], [loop, late, band]) == [loop, late]
    assert gates.with_what_it_may_hide([band], [band, late]) == [band]


@pytest.mark.parametrize(
    ("name", "in_model", "longer", "is_rest"),
    [
        ("hysteresis", True, 9.0, True), ("hysteresis", True, 2.0, False), ("hysteresis", False, 9.0, False),
        ("perception_threshold", True, 9.0, False),
    ],
)  # fmt: skip
def test_what_a_delay_leaves_that_is_too_short_is_no_hysteresis(name, in_model, longer, is_rest):
    seen = evidence(longer)
    (late,) = seen.regressors
    seen = replace(seen, regressors=[replace(late, name="local:" + late.name)] if in_model else [late])
    assert gates.is_rest_of_delay(tried(8.0, name).candidate, seen) is is_rest


@pytest.mark.parametrize(
    ("falling", "delay", "is_believed"),
    [(-12.0, 0.0, True), (-7.0, 0.0, False), (-12.0, -9.0, False), (8.0, -9.0, True)],
)
def test_a_headway_that_falls_with_speed_must_be_far_surer_than_what_cannot_be(falling, delay, is_believed):
    seen, name = evidence(delay), "speed_dependent_headway"
    regressors = [*seen.regressors, Regressor(name)]
    u, part = np.hstack([seen.u, seen.u * 0.0 + evidence(falling).u]), np.hstack([seen.part] * 2)
    both = replace(
        seen, regressors=regressors, u=u, part=part, replicates=np.zeros((2, 2)), gram=np.eye(2) * seen.gram[0, 0]
    )
    speed = next(one for one in gates.believed(both) if one.name == name)
    assert abs(speed.z) == pytest.approx(abs(falling), rel=0.1)
    assert (speed.p < gates.SIGNIFICANT) is is_believed


@pytest.mark.parametrize(("z", "there"), [(4.5, False), (6.0, True)])
@pytest.mark.parametrize("name", ["multi_leader_anticipation", "lane_change_relaxation"])
def test_what_stands_out_beyond_recordings_with_nothing_hidden_may_be_there(name, z, there):
    one = tried(z, name, 0.2 if name == "lane_change_relaxation" else 0.06, 60.0)
    assert gates.is_there(one) is there


@pytest.mark.parametrize(
    ("name", "z", "p", "as_first", "further"),
    [
        ("time_of_day", 6.0, 1e-6, True, True),
        ("time_of_day", 4.3, 1e-4, True, True),  # significant, not clear: it must gain
        ("time_of_day", 4.3, 0.016, True, True),
        ("time_of_day", 4.3, 0.03, False, False),
        ("hysteresis", 4.3, 1e-4, True, False),
        ("hysteresis", 4.3, 0.016, False, False),  # other laws look like it
    ],
)
def test_who_where_and_when_are_tried_before_they_are_significant(name, z, p, as_first, further):
    one = replace(tried(z, name, 0.12).candidate, p=p)
    assert gates.is_worth_trying(one, is_first=True) is as_first
    assert gates.is_worth_trying(one, is_first=False) is further


@pytest.mark.parametrize(
    ("name", "z", "value", "support", "likely", "there"),
    [
        ("lane_change_relaxation", 8.0, 0.3, 60.0, True, True),  # sure as it is
        ("lane_change_relaxation", 5.0, 0.3, 60.0, True, False),  # what drivers of another law do after a cut-in
        ("lane_change_relaxation", 4.0, 0.3, 300.0, True, True),  # underrated near zero
        ("lane_change_relaxation", 4.0, 0.1, 300.0, True, False),  # too small
        ("lane_change_relaxation", 4.0, -0.3, 300.0, False, False),
        ("lane_change_relaxation", 3.0, 0.3, 300.0, False, True),
        ("hysteresis", 4.0, 0.01, 20.0, False, False),
        ("multi_leader_anticipation", 5.0, 0.2, 20.0, False, False),
        ("desired_speed", 5.0, 0.2, 20.0, True, False),  # how drivers of another law come near to theirs
        ("desired_speed", -5.2, -0.2, 155.0, True, True),  # who keeps to a lane has fitted a speed to it
        ("desired_speed", 8.0, 0.2, 20.0, True, True),
        ("desired_speed", 8.0, 1.0, 600.0, True, False),  # no speed would be enough: another approach to it
        ("speed_dependent_headway", -10.0, -0.4, 600.0, True, True),
        ("speed_dependent_headway", -10.0, -1.0, 600.0, True, False),
        ("location", -6.0, -1.4, 60.0, True, True),
        ("location", -6.0, -1.5, 60.0, True, False),  # no place makes everybody drive so
    ],
)
def test_what_is_underrated_near_zero_is_judged_at_its_size(name, z, value, support, likely, there):
    one = tried(z, name, value, support)
    assert gates.is_likely(one.candidate) is likely
    assert gates.is_there(one) is there


@pytest.mark.parametrize(
    ("name", "first", "left", "another"),
    [
        ("location", 10.0, 9.0, True),
        ("location", 10.0, 5.0, False),
        ("location", 4.5, 3.2, False),
        ("hysteresis", 10.0, 9.0, False),
    ],
)
def test_a_place_that_is_still_there_beside_the_one_in_the_model_is_no_interval(name, first, left, another):
    bins = [Regressor(name, low=100.0 * n, high=100.0 * (n + 1)) for n in range(6)]
    u = np.zeros((30, 6))
    u[:, :2] = evidence(left).u / np.sqrt(2.0)
    seen = Evidence(bins, u, np.zeros((2, 6)), 1e4 * np.eye(6), np.full((30, 6), 1e4 / 30), np.arange(30))
    assert gates.is_another(Candidate(name, 0.1, 0.01, first, 1e-9, bins[0]), seen) is another


@pytest.mark.parametrize(
    ("low", "high", "value", "another"),
    [
        (0.0, 300.0, 0.1, False),  # more in the first two thirds of it: a form that rises and falls
        (0.0, 300.0, -0.1, True),
        (0.0, 600.0, 0.1, True),  # a third of it: one of several
        (400.0, 600.0, 0.1, True),
    ],
)
def test_more_of_the_same_in_most_of_an_interval_is_no_other_one(low, high, value, another):
    bins = [Regressor("time_of_day", low=100.0 * n, high=100.0 * (n + 1)) for n in range(6)]
    u = np.zeros((30, 6))
    u[:, :2] = evidence(9.0).u / np.sqrt(2.0)
    seen = Evidence(bins, u, np.zeros((2, 6)), 1e4 * np.eye(6), np.full((30, 6), 1e4 / 30), np.arange(30))
    first = Candidate("time_of_day", value, 0.01, 10.0, 1e-9, Regressor("time_of_day", low=low, high=high))
    assert gates.is_another(first, seen) is another


@pytest.mark.parametrize(
    ("value", "low", "high", "accepted", "unseen"),
    [
        (0.1, 0.0, 100.0, "lane_change_relaxation", True),
        (-0.1, 100.0, 600.0, "lane_change_relaxation", True),
        (-0.1, 100.0, 570.0, "lane_change_relaxation", True),
        (-0.1, 100.0, 550.0, "lane_change_relaxation", False),
        (-0.1, 0.0, 100.0, "lane_change_relaxation", False),
        (0.1, 200.0, 300.0, "lane_change_relaxation", False),
        (0.1, 0.0, 100.0, "time_of_day", False),
    ],
)
def test_who_pushes_behind_the_entry_may_relax_from_a_change_before_it(value, low, high, accepted, unseen):
    bins = [Regressor("location", low=100.0 * n, high=100.0 * (n + 1)) for n in range(6)]
    place = Candidate("location", value, 0.01, 9.0, 1e-9, Regressor("location", low=low, high=high))
    assert gates.is_past_unseen(place, replace(evidence(0.0), regressors=bins), {accepted}) is unseen
