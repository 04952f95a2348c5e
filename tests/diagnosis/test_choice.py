"""Which effect it is: the cause that drives nearest is chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import choice
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.chance import Noises
from idm_sumo.diagnosis.choice import Known, at_sizes, strongest
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.noise import QUIET
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.sizes import Tried, gain_of, with_cause
from idm_sumo.models.effects import slots
from tests.helpers.followers import candidate, followers


def test_the_cause_that_drives_clearly_nearer_is_chosen():
    m = ro.PLAIN.copy()
    m[:, slots.BAND] = 1.0
    windows, _ = followers(m, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=8)
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    right = candidate(9.0, "perception_threshold", 0.8, ((slots.BAND, 0.6),))
    wrong = candidate(9.0, "acceleration_asymmetry", 0.3)
    rng = np.random.default_rng(0)
    best, _ = strongest(subject, base, [wrong, right], [], rng)
    assert best.candidate.name == "perception_threshold"
    assert gain_of(subject, base, best.fit, rng).ci95[0] > 0.0


def test_which_of_two_places_is_meant_support_decides_unless_both_have_it(monkeypatch):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=2)
    worse = with_cause(base, candidate(9.0, "acceleration_asymmetry", 0.8))
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    rng = np.random.default_rng(0)

    def chosen(*names, support=20.0):
        each = [Tried(candidate(9.0, name, value), fit, support) for name, (value, fit, support) in zip(
            names, ((-0.2, worse, 50.0), (0.1, base, support)), strict=True)]  # fmt: skip
        monkeypatch.setattr(choice, "climbed", lambda *_: each.pop(0))
        return strongest(subject, base, [one.candidate for one in each], [], rng)[0].candidate

    assert chosen("location", "location").value == -0.2
    assert chosen("location", "location", support=40.0).value == -0.2
    assert chosen("location", "location", support=45.0).value == 0.1  # drives clearly nearer
    assert chosen("location", "time_of_day").value == 0.1  # drives clearly nearer


@pytest.mark.parametrize(
    ("first", "second", "support", "value"),
    [
        ("perception_threshold", "perception_threshold", 40.0, 0.6),
        ("perception_threshold", "perception_threshold", 70.0, 0.3),
        ("perception_threshold", "hysteresis", 40.0, 0.3),
        ("reaction_delay", "reaction_delay", 10.0, 0.6),
        ("speed_dependent_headway", "follower_pressure", 30.0, 0.6),
        ("speed_dependent_headway", "follower_pressure", 40.0, 0.3),
        ("reaction_delay", "hysteresis", 70.0, 0.6),
        ("reaction_delay", "hysteresis", 90.0, 0.3),
        ("hysteresis", "reaction_delay", 70.0, 0.3),
        ("reaction_delay", "acceleration_asymmetry", 30.0, 0.6),
        ("reaction_delay", "acceleration_asymmetry", 40.0, 0.3),
        ("lane_change_relaxation", "pre_insertion", 30.0, 0.3),
    ],
)
def test_a_form_or_a_shadow_with_less_support_is_not_taken_however_it_drives(
    monkeypatch, first, second, support, value
):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=2)
    worse = with_cause(base, candidate(9.0, "acceleration_asymmetry", 0.8))
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    each = [Tried(candidate(9.0, first, 0.6), worse, 100.0), Tried(candidate(9.0, second, 0.3), base, support)]
    monkeypatch.setattr(choice, "climbed", lambda *_: each.pop(0))
    best, _ = strongest(subject, base, [one.candidate for one in each], [], np.random.default_rng(0))
    assert best.candidate.value == value


def test_of_an_effects_forms_only_those_count_that_are_there(monkeypatch):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)
    monkeypatch.setattr(choice, "anew", lambda _subject, fit: fit)
    sure, faint = candidate(6.0, "location", -0.15), replace(candidate(4.0, "location", 0.05), p=0.1)

    def chosen(*each):
        tried = [Tried(one, base, support) for one, support in each]
        monkeypatch.setattr(choice, "climbed", lambda *_: tried.pop(0))
        return strongest(None, base, [one for one, _ in each], [], np.random.default_rng(0))[0].candidate

    assert chosen((sure, 60.0), (faint, 63.0)) is sure
    assert chosen((faint, 63.0), (replace(faint, value=-0.05), 50.0)) is faint


def test_forms_are_compared_at_rest(monkeypatch):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=6)
    on_the_way = replace(base, spread=1e-4 * base.spread)  # drivers are thought to be all the same still
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    each = [
        Tried(candidate(9.0), on_the_way, 100.0),
        Tried(candidate(9.0, value=0.3), with_cause(base, candidate(9.0, "acceleration_asymmetry", 0.2)), 60.0),
    ]
    assert gain_of(subject, each[0].fit, each[1].fit, np.random.default_rng(0)).ci95[0] > 0.0
    monkeypatch.setattr(choice, "climbed", lambda *_: each.pop(0))
    best, _ = strongest(subject, base, [one.candidate for one in each], [], np.random.default_rng(0))
    assert best.candidate.value == 0.5
    assert gain_of(subject, on_the_way, best.fit, np.random.default_rng(0)).ci95[0] > 0.0


def test_candidates_climb_to_their_sizes_once(monkeypatch):
    came, known = [], Known()
    monkeypatch.setattr(
        choice, "climbed", lambda _subject, _fit, one, _lucks: came.append(one) or Tried(one, None, 1.0)
    )
    delay, band = candidate(9.0, "reaction_delay"), candidate(9.0)
    first = at_sizes(None, None, [delay, band], [], known)
    assert at_sizes(None, None, [band, delay], [], known) == first[::-1]
    assert sorted(came, key=str) == sorted([delay, band], key=str)


@pytest.mark.parametrize(("replicates", "evaluated"), [(0, 0), (1, 1), (2, 1), (3, 2), (5, 2)])
def test_on_the_way_to_a_size_one_replicate_of_two_and_two_of_more_are_evaluated(monkeypatch, replicates, evaluated):
    came = []
    monkeypatch.setattr(
        choice, "climbed", lambda _subject, _fit, one, chances: came.append(len(chances)) or Tried(one, None, 1.0)
    )
    choice.at_sizes(None, None, [candidate(6.0)], [None] * replicates, {})
    assert came == [evaluated]


def climb_to(monkeypatch, supports):
    """Have delays climb to another size, with the support of what is known in spite of them."""
    monkeypatch.setattr(
        choice, "climbed",
        lambda _subject, _fit, one, _lucks: Tried(replace(one, value=0.5), None, supports[one.regressor.fixed[1:]]),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("own_speed", "new_leader", "asked"),
    [(120.0, 130.0, True), (90.0, 130.0, True), (90.0, 95.0, False), (130.0, None, True)],
)
def test_who_is_late_and_knows_both_is_asked_for_where_one_alone_says_more(monkeypatch, own_speed, new_leader, asked):
    known = ((slots.OWN_SPEED_KNOWN, 1.0), (slots.NEW_LEADER_KNOWN, 1.0))
    supports = {(): 100.0, known[:1]: own_speed, known[1:]: new_leader, known: 140.0}
    each = [
        candidate(9.0, "reaction_delay", 0.4, ((slots.DELAY, 0.4), *form))
        for form, support in supports.items()
        if support is not None
    ]
    climb_to(monkeypatch, supports)
    tried = at_sizes(None, None, each, [], Known())
    assert (140.0 in [one.support for one in tried]) is asked
    assert len(tried) == len(each) - (not asked)


@pytest.mark.parametrize(
    ("own", "in_rate", "both", "asked"),
    [
        (120.0, 125.0, 135.0, True),
        (120.0, 115.0, 135.0, True),
        (120.0, 125.0, 110.0, True),
        (90.0, 125.0, 135.0, True),
        (120.0, 115.0, 110.0, False),
        (90.0, 125.0, 110.0, False),
    ],
)
def test_all_that_may_be_known_is_asked_for_where_some_of_it_says_more(monkeypatch, own, in_rate, both, asked):
    one, new, rate = rg.KNOWN
    supports = {(): 100.0, (one,): own, (new,): 130.0, (one, rate): in_rate, (one, new): both, (one, new, rate): 140.0}
    each = [candidate(9.0, "reaction_delay", 0.4, ((slots.DELAY, 0.4), *form)) for form in supports]
    climb_to(monkeypatch, supports)
    assert (140.0 in [one.support for one in at_sizes(None, None, each, [], Known())]) is asked


@pytest.mark.parametrize(("support", "chosen"), [(90.0, "hysteresis"), (70.0, "perception_threshold")])
def test_of_causes_with_nearly_as_much_support_the_one_that_drives_best_is_taken(monkeypatch, support, chosen):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=2)
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    each = [
        Tried(candidate(9.0), with_cause(base, candidate(9.0, "acceleration_asymmetry", 0.8)), 100.0),
        Tried(candidate(9.0, "hysteresis", 0.2), base, support),
    ]
    monkeypatch.setattr(choice, "climbed", lambda *_: each.pop(0))
    unclear = Gain("ade_m", 1.0, 0.99, 0.01, (-0.01, 0.03), 100, False)
    monkeypatch.setattr(choice, "gain_of", lambda *_: unclear)
    best, rivals = strongest(subject, base, [one.candidate for one in each], [], np.random.default_rng(0))
    assert best.candidate.name == chosen
    assert rivals == (("perception_threshold",) if chosen == "hysteresis" else ())


def test_what_says_less_at_its_size_is_not_held_against_the_best():
    late = Tried(candidate(10.3, "reaction_delay"), None, 333.0)
    tried = [late, Tried(candidate(10.8, "acceleration_asymmetry"), None, 310.0), Tried(candidate(7.0), None, 400.0),
             Tried(candidate(9.0, "hysteresis"), None, 50.0), Tried(candidate(9.0, "hysteresis", fixed=((1, 1.0),)), None, 340.0)]  # fmt: skip
    there = [one.candidate for one in tried] + [candidate(6.0, "location")]
    left = choice._not_outdone(there, late, {one.candidate: one for one in tried})
    # Some form of a hysteresis says more, nobody has brought the place to its size, and it is itself no rival of its own.
    assert {one.name for one in left} == {"reaction_delay", "perception_threshold", "hysteresis", "location"}
