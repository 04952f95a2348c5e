"""From a recording to its diagnosis: what the law, asked once more, makes of causes."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.chance import Noises
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.law import Followed, beneath, of
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.noise import QUIET
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.search import Found
from idm_sumo.diagnosis.sizes import Tried, with_cause
from idm_sumo.models import laws
from idm_sumo.models.effects import BY_NAME
from tests.helpers.followers import candidate, evidence, followers, free

diagnosing = sys.modules["idm_sumo.diagnosis.diagnose"]  # the package's name is that of the function


@pytest.fixture
def beyond():
    """What a search finds, and the subject: nothing, and a dead band."""
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)
    tried = Tried(candidate(6.0), with_cause(fit, candidate(6.0)), 60.0)
    cause = Accepted(tried, 0.5, 0.01, Gain("ade_m", 1.0, 0.99, 0.01, (0.0, 0.02), 10, False), ())
    nothing = Found(fit, fit, (), (), evidence(0.0), evidence(0.0), ())
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    return subject, nothing, replace(nothing, fit=tried.fit, accepted=(cause,))


def named(found, name):
    """What was found, its one cause by another name."""
    (cause,) = found.accepted
    return replace(found, accepted=(replace(cause, tried=replace(cause.tried, candidate=candidate(8.0, name, 0.4))),))


FORMS = tuple(of(number) for number in range(len(laws.NAMES)))


def asked_again(monkeypatch, subject, found, again, likelier, rival, runner_up=None):
    """What comes of a search when the law is asked again; ``likelier`` so much, give or take one."""
    gain = Gain("unlikelihood", 10.0, 10.0 - likelier, likelier, (likelier - 2.0, likelier + 2.0), 10, False)
    monkeypatch.setattr(diagnosing.law, "rival", lambda *_: rival)
    monkeypatch.setattr(diagnosing, "search", lambda *_: again)
    monkeypatch.setattr(diagnosing.law, "likelihood_gain", lambda *_: gain)
    followed = Followed(found.base, None, {}, FORMS, runner_up)
    rng = np.random.default_rng(0)
    return diagnosing._by_the_law_with_causes(subject, followed, found.base, found, rng, lambda *_: None)[1]


@pytest.mark.parametrize(
    ("names_again", "likelier", "outcome"),
    [
        (False, 0.2, "without gain"),  # another law, no cause, and likelier
        (False, -0.2, "named"),
        (True, 0.2, "named"),  # beyond the other law, too
        (True, 5.0, "again"),  # surely likelier
    ],
)
def test_what_is_named_beyond_one_law_and_not_beyond_a_likelier_one_is_no_cause(
    monkeypatch, beyond, names_again, likelier, outcome
):
    subject, nothing, found = beyond
    again = replace(found) if names_again else nothing
    after = asked_again(monkeypatch, subject, found, again, likelier, laws.KRAUSS)
    if outcome == "without gain":
        assert after.fit is found.base
        assert not after.accepted
        assert [one.name for one in after.without_gain] == ["perception_threshold"]
    else:
        assert after is (again if outcome == "again" else found)


@pytest.mark.parametrize(
    ("likelier", "rival", "taken"), [(5.0, None, True), (2.0, None, False), (5.0, laws.KRAUSS, False)]
)
def test_where_nothing_is_named_beyond_another_law_causes_beyond_the_idm_may_be(
    monkeypatch, beyond, likelier, rival, taken
):
    subject, nothing, by_idm = beyond
    other = replace(nothing, fit=replace(nothing.fit, by_lane=beneath(nothing.fit.by_lane, of(laws.KRAUSS))))
    after = asked_again(monkeypatch, subject, other, by_idm, likelier, rival)
    assert after is (by_idm if taken else other)


@pytest.mark.parametrize(
    ("name", "likelier", "taken"),
    [("courtesy_yielding", 2.5, True), ("courtesy_yielding", 1.5, False), ("location", 2.5, False)],
)
def test_what_no_law_looks_like_need_not_be_surely_likelier_beyond_the_idm(monkeypatch, beyond, name, likelier, taken):
    """Full velocity difference had taken up room made for others: with it an IDM was likelier by 2.9 standard errors."""
    subject, nothing, by_idm = beyond
    again = named(by_idm, name)
    other = replace(nothing, fit=replace(nothing.fit, by_lane=beneath(nothing.fit.by_lane, of(laws.KRAUSS))))
    after = asked_again(monkeypatch, subject, other, again, likelier, laws.KRAUSS if taken else None)
    assert after is (again if taken else other)


@pytest.mark.parametrize(("before", "taken"), [("perception_threshold", True), ("pre_insertion", False)])
def test_what_no_law_looks_like_says_nothing_of_the_law_where_it_was_named_before(monkeypatch, beyond, before, taken):
    """In three splits of real drivers, before their own lane change, another law was likelier than an IDM by 2.6 to 2.9 standard errors."""
    subject, _, found = beyond
    named_before, named_again = (named(found, name) for name in (before, "pre_insertion"))
    by_krauss = replace(found.fit, by_lane=beneath(found.fit.by_lane, of(laws.KRAUSS)))
    named_before = replace(named_before, fit=by_krauss)
    after = asked_again(monkeypatch, subject, named_before, named_again, 2.5, laws.IDM)
    assert after is (named_again if taken else named_before)


@pytest.mark.parametrize(
    ("runner_up", "likelier", "rival", "taken"),
    [
        (laws.KRAUSS, 5.0, None, True),
        (None, 5.0, None, False),  # nobody asked for another law
        (laws.KRAUSS, 2.0, None, False),  # with its causes not surely likelier
        (laws.KRAUSS, 5.0, laws.IDM, False),  # an IDM with the same causes is likelier
    ],
)
def test_where_nothing_is_named_beyond_the_idm_causes_beyond_a_likelier_law_may_be(
    monkeypatch, beyond, runner_up, likelier, rival, taken
):
    subject, nothing, again = beyond
    after = asked_again(monkeypatch, subject, nothing, again, likelier, rival, runner_up)
    assert after is (again if taken else nothing)


@pytest.mark.parametrize(
    ("beyond_one", "beyond_other", "taken"),
    [
        ("since_standing", "headway over since_standing", False),  # who starts slowly does not do so by either law
        ("since_standing", "rear_gap", True),
        ("rear_gap", "rear_gap", True),  # of which a cause may be in the other law
    ],
)
def test_what_is_strange_beyond_either_law_is_told_whatever_is_named_beyond_the_other(
    monkeypatch, beyond, beyond_one, beyond_other, taken
):
    subject, nothing, again = beyond
    found = replace(nothing, unexplained=(free(beyond_one, -9.5),))
    again = replace(again, first=evidence(0.0, free(beyond_other, 8.0)))
    after = asked_again(monkeypatch, subject, found, again, 5.0, None, laws.KRAUSS)
    assert after is (again if taken else found)


@pytest.mark.parametrize(
    ("name", "likelier", "searched"),
    [
        ("acceleration_asymmetry", None, laws.FULL_VELOCITY_DIFFERENCE),  # the form of any law
        ("perception_threshold", None, None),
        ("acceleration_asymmetry", laws.GIPPS, laws.GIPPS),
    ],
)
def test_where_the_form_of_any_law_is_named_first_the_likeliest_other_law_is_searched_beyond(
    monkeypatch, beyond, name, likelier, searched
):
    """Full velocity difference and headways that grow with speed came as a smooth one and an asymmetry of 0.28."""
    subject, _, found = beyond
    (cause,) = found.accepted
    named = replace(cause, tried=replace(cause.tried, candidate=replace(cause.candidate, name=name)))
    monkeypatch.setattr(diagnosing.law, "rival", lambda *_: likelier)
    followed = Followed(found.base, None, {}, FORMS, laws.FULL_VELOCITY_DIFFERENCE)
    chosen = diagnosing._rival(subject.windows, followed, replace(found, accepted=(named,)), np.random.default_rng(0))
    assert chosen == searched


@pytest.mark.parametrize("own", [laws.IDM, laws.SMOOTH_VELOCITY_DIFFERENCE])
@pytest.mark.parametrize("likelier", [None, laws.IDM, laws.FULL_VELOCITY_DIFFERENCE])
def test_what_is_there_without_gain_may_be_a_cause_beyond_the_law_that_is_likeliest_with_it(
    monkeypatch, beyond, own, likelier
):
    """A smooth optimal velocity had taken up headways that grow with speed, of drivers whose optimal velocity is not smooth."""
    subject, nothing, _ = beyond
    base = replace(nothing.fit, by_lane=beneath(nothing.fit.by_lane, of(own)))
    there = candidate(9.0, "speed_dependent_headway", 0.4)
    found = replace(nothing, fit=base, base=base, without_gain=(candidate(4.0), there))
    asked = []
    monkeypatch.setattr(diagnosing.law, "rival", lambda _, fit, names, *__: asked.append((fit, names)) or likelier)
    followed = Followed(base, None, {}, FORMS, laws.KRAUSS)
    chosen = diagnosing._rival(subject.windows, followed, found, np.random.default_rng(0))
    assert chosen == (likelier if likelier is not None else laws.KRAUSS if own == laws.IDM else laws.IDM)
    ((fit, names),) = asked
    assert names == ["speed_dependent_headway"]
    np.testing.assert_array_equal(fit.by_lane, with_cause(base, there).by_lane)


@pytest.mark.parametrize(
    ("spared", "drivers", "kept"),
    [
        (0.2, 30.0, ["perception_threshold", "hysteresis"]),
        (0.0, 30.0, ["perception_threshold"]),  # the further one spares nothing
        (0.2, 3.0, []),  # nor may three drivers name anything
    ],
)
def test_each_cause_must_spare_held_out_drivers_something_by_itself(monkeypatch, beyond, spared, drivers, kept):
    subject, _, found = beyond
    (cause,) = found.accepted
    further = replace(cause, tried=replace(cause.tried, candidate=candidate(8.0, "hysteresis", 0.2)))
    found = replace(found, accepted=(cause, further))
    ade = np.linspace(0.5, 1.5, subject.windows.drivers)
    monkeypatch.setattr(diagnosing, "driven", lambda *_: SimpleNamespace(ade_m=ade * (1.0 + spared)))
    monkeypatch.setattr(diagnosing.hy, "effective_drivers", lambda *_: drivers)
    extended, rng = SimpleNamespace(ade_m=ade), np.random.default_rng(0)
    after = diagnosing._each_by_itself(found, subject.windows, extended, rng)
    assert [one.candidate.name for one in after.accepted] == kept
    left_out = {"perception_threshold", "hysteresis"} - set(kept)
    assert {one.name for one in after.without_gain} == left_out
    for name in left_out:
        assert not np.any(after.fit.by_lane[:, [p.slot for p in BY_NAME[name].parameters]])


def test_what_is_there_without_gain_is_asked_for_beyond_another_law(monkeypatch, beyond):
    subject, nothing, _ = beyond
    found = replace(nothing, without_gain=(candidate(9.0, "speed_dependent_headway", 0.4),))
    asked = []
    monkeypatch.setattr(diagnosing.law, "rival", lambda *_: laws.KRAUSS)
    monkeypatch.setattr(diagnosing, "search", lambda *given: asked.append(given[-1]) or nothing)
    followed = Followed(nothing.base, None, {}, FORMS, None)
    diagnosing._by_the_law_with_causes(
        subject, followed, nothing.base, found, np.random.default_rng(0), lambda *_: None
    )
    assert asked == [["speed_dependent_headway"]]
