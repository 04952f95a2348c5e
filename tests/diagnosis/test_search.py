"""The search: what is tried, refused, accepted and left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import search
from idm_sumo.diagnosis.chance import Noises
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.noise import QUIET
from idm_sumo.diagnosis.regressors import Regressor
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.search import Brief, _next
from idm_sumo.diagnosis.sizes import Tried, with_cause
from idm_sumo.models.effects import slots
from tests.helpers.followers import candidate, evidence, followers, free


@pytest.mark.parametrize(("support", "named"), [(68.0, False), (120.0, True)])
def test_the_shadow_of_what_was_refused_is_no_cause(monkeypatch, support, named):
    fit = fit_drivers(
        followers(ro.PLAIN, np.random.default_rng(5))[0], ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1
    )
    refused, shadow = Tried(candidate(8.0, "hysteresis"), fit, 180.0), Tried(candidate(5.0), fit, support)
    nothing = Gain("ade_m", 1.0, 1.0, 0.0, (-0.1, 0.1), 10, False)
    answers = [(refused, None), (shadow, Accepted(shadow, 0.5, 0.01, nothing, ()))]
    monkeypatch.setattr(search.hy, "candidates", lambda _: [refused.candidate, shadow.candidate])
    monkeypatch.setattr(search.hy, "forms", lambda _, one: [one])
    monkeypatch.setattr(search.choice, "judged", lambda *_: answers.pop(0))
    monkeypatch.setattr(search, "two_together", lambda *_: ())
    without = []
    chosen = _next(None, fit, evidence(0.0), [], without, [], Brief(np.random.default_rng(0)))
    assert bool(chosen) is named
    assert [one.name for one in without] == ["hysteresis"]


def test_a_shadow_may_be_a_cause_together_with_what_was_refused(monkeypatch):
    """Drivers who relax drive no better by that alone, and an asymmetry without it takes up a fifth of what it says."""
    fit = fit_drivers(
        followers(ro.PLAIN, np.random.default_rng(5))[0], ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1
    )
    refused = Tried(candidate(8.1, "lane_change_relaxation"), fit, 512.0)
    shadow = Tried(candidate(5.6, "acceleration_asymmetry"), fit, 103.0)
    nothing = Gain("ade_m", 1.0, 1.0, 0.0, (-0.1, 0.1), 10, False)
    answers = [(refused, None), (shadow, Accepted(shadow, 0.2, 0.01, nothing, ()))]
    both = tuple(Accepted(one, 0.5, 0.01, nothing, ()) for one in (refused, shadow))
    monkeypatch.setattr(search.hy, "candidates", lambda _: [refused.candidate, shadow.candidate])
    monkeypatch.setattr(search.hy, "forms", lambda _, one: [one])
    monkeypatch.setattr(search.choice, "judged", lambda *_: answers.pop(0))
    monkeypatch.setattr(search, "two_together", lambda _subject, _fit, first, *_: both if first is refused else ())
    without = []
    assert _next(None, fit, evidence(0.0), [], without, [], Brief(np.random.default_rng(0))) == both
    assert not without


@pytest.mark.parametrize(
    ("name", "with_it", "named"),
    [
        ("time_of_day", 0.2, True),
        ("pre_insertion", 0.2, True),
        ("time_of_day", 0.1, False),  # what was refused takes it away
        ("time_of_day", -0.2, False),  # or turns it round
        ("hysteresis", 0.2, False),  # motion may make it up
    ],
)
def test_a_time_that_what_was_refused_leaves_is_no_shadow_and_that_is_asked_again(monkeypatch, name, with_it, named):
    """A dead band of which drivers drive worse as long as the time is not in the model, and better beside it."""
    fit = fit_drivers(
        followers(ro.PLAIN, np.random.default_rng(5))[0], ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1
    )
    refused, other = Tried(candidate(18.0), fit, 1500.0), Tried(candidate(8.0, name, 0.2), fit, 400.0)
    nothing = Gain("ade_m", 1.0, 1.0, 0.0, (-0.1, 0.1), 10, False)
    answers = [(refused, None), (other, Accepted(other, 0.2, 0.01, nothing, ()))]
    beside = replace(other.candidate, value=with_it, z=8.0 * with_it / 0.2)
    looks = [[refused.candidate, other.candidate], [beside]]
    monkeypatch.setattr(search.hy, "candidates", lambda _: looks.pop(0))
    monkeypatch.setattr(search.hy, "forms", lambda _, one: [one])
    monkeypatch.setattr(search.choice, "judged", lambda *_: answers.pop(0))
    monkeypatch.setattr(search.ev, "examine", lambda *_, **__: evidence(0.0))
    monkeypatch.setattr(search, "two_together", lambda *_: ())
    without = []
    chosen = _next(None, fit, evidence(0.0), [], without, [], Brief(np.random.default_rng(0)))
    assert bool(chosen) is named
    assert [one.name for one in without] == ([] if named else ["perception_threshold"])


def test_a_place_that_may_be_a_past_nobody_saw_is_tried_with_the_other_sign_elsewhere(monkeypatch):
    fit = fit_drivers(
        followers(ro.PLAIN, np.random.default_rng(5))[0], ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1
    )
    before, after = (
        replace(candidate(6.0, "location", value), regressor=Regressor("location", low=low))
        for value, low in ((0.1, 0.0), (-0.1, 90.0))
    )
    nothing = Gain("ade_m", 1.0, 1.0, 0.0, (-0.1, 0.1), 10, False)
    relaxation = Accepted(Tried(candidate(9.0, "lane_change_relaxation"), fit, 200.0), 0.5, 0.01, nothing, ())
    asked = []
    monkeypatch.setattr(search.hy, "candidates", lambda _: [before])
    monkeypatch.setattr(search.hy, "forms", lambda *_: [before, after])
    monkeypatch.setattr(search.gates, "is_past_unseen", lambda one, *_: one is before)

    def judged(_subject, _fit, forms, *_):
        asked.append(forms)
        tried = Tried(forms[0], fit, 100.0)
        return tried, Accepted(tried, -0.1, 0.01, nothing, ())

    monkeypatch.setattr(search.choice, "judged", judged)
    chosen = _next(None, fit, evidence(0.0), [relaxation], [], [], Brief(np.random.default_rng(0)))
    assert asked == [[after]]
    assert chosen
    monkeypatch.setattr(search.hy, "forms", lambda *_: [before])
    assert not _next(None, fit, evidence(0.0), [relaxation], [], [], Brief(np.random.default_rng(0)))


@pytest.mark.parametrize("others", [(), ("hysteresis",)])
def test_a_place_that_is_not_so_at_all_times_is_no_cause_and_other_causes_stay(monkeypatch, others):
    m = ro.PLAIN.copy()
    m[:, slots.PLACE], m[:, slots.PLACE_END] = -0.2, 80.0
    m[:, slots.HYSTERESIS] = 0.1 if others else 0.0
    start = np.array([1e-4, 1e-4])
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base, fit = (fit_drivers(windows, one, start, rounds=1) for one in (ro.PLAIN.copy(), m))
    nothing = Gain("ade_m", 1.0, 1.0, 0.0, (-0.1, 0.1), 10, False)
    causes = tuple(
        Accepted(Tried(candidate(9.0, name), fit, 200.0), 0.1, 0.01, nothing, ()) for name in ("location", *others)
    )
    assert search._interval(fit, "location") == ff.Interval("position", 0.0, 80.0, ff.ACCELERATION, -1.0)
    last = evidence(0.0, free("position and time within the place", -12.0))
    found = search.Found(base, fit, causes, (), evidence(0.0), last, ())
    monkeypatch.setattr(search, "refined", lambda _subject, fit, *_: fit)
    monkeypatch.setattr(search, "_examined", lambda *_: evidence(0.0))
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    brief = Brief(np.random.default_rng(0))
    assert search._without(found, (), subject, [], brief) is found
    left = search._without(found, last.free, subject, [], brief)
    assert left.unexplained == last.free
    assert [one.candidate.name for one in left.accepted] == list(others)
    assert not left.fit.by_lane[:, slots.PLACE].any()
    assert left.fit.by_lane[0, slots.HYSTERESIS] == m[0, slots.HYSTERESIS]


@pytest.mark.parametrize("asked", [(), ("lane_change_relaxation",)])
def test_what_was_named_beyond_another_law_is_tried_however_sure_it_is(monkeypatch, asked):
    faint, tries = candidate(3.3, "lane_change_relaxation"), []
    monkeypatch.setattr(search.hy, "candidates", lambda _: [faint])
    monkeypatch.setattr(search.hy, "forms", lambda *_: [faint])

    def judged(_subject, _fit, forms, *_):
        tries.append(forms)
        return Tried(forms[0], None, 10.0), None

    monkeypatch.setattr(search.choice, "judged", judged)
    monkeypatch.setattr(search, "two_together", lambda *_: ())
    assert not _next(None, None, evidence(0.0), [], [], [], Brief(np.random.default_rng(0), asked=asked))
    assert tries == [[faint]] * len(asked)


@pytest.mark.parametrize(
    ("on_average", "support", "margin", "named"),
    [(0.1, -80.0, 0.01, True), (0.1, -80.0, 0.04, False), (0.1, 80.0, 0.04, True), (0.04, -80.0, 0.01, False), (0.04, 80.0, 0.04, True),
     (0.04, 15.0, 0.01, False), (0.1, 15.0, 0.01, True)],
)  # fmt: skip
def test_what_some_drivers_have_the_likelihood_may_refuse_but_they_drive_clearly_nearer(
    monkeypatch, on_average, support, margin, named
):
    fit = fit_drivers(
        followers(ro.PLAIN, np.random.default_rng(5))[0], ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1
    )
    late = Tried(candidate(8.0, "reaction_delay", 0.4), fit, support)
    gain = Gain("ade_m", 1.0, 0.97, 0.03, (0.03 - margin, 0.03 + margin), 100, False)
    monkeypatch.setattr(search.hy, "candidates", lambda _: [replace(late.candidate, value=on_average)])
    monkeypatch.setattr(search.hy, "forms", lambda _, one: [one])
    monkeypatch.setattr(search.choice, "strongest", lambda *_: (late, ()))
    monkeypatch.setattr(search.choice, "anew", lambda _, fit: fit)
    monkeypatch.setattr(search.choice, "gain_of", lambda *_: gain)
    monkeypatch.setattr(search, "two_together", lambda *_: ())
    chosen = _next(None, fit, evidence(0.0), [], [], [], Brief(np.random.default_rng(0)))
    assert bool(chosen) is named


@pytest.mark.parametrize("which_holds", [0, 1, None])
def test_where_one_interval_does_not_hold_it_the_other_sign_in_another_is_tried(monkeypatch, which_holds):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    less, more = (Regressor("time_of_day", low=low, high=low + 40.0) for low in (40.0, 80.0))
    found = search.Found(base, base, (), (), evidence(0.0), evidence(0.0), ())
    monkeypatch.setattr(search.ev, "examine", lambda *_, **__: evidence(0.0))
    monkeypatch.setattr(search, "_outside", lambda *_: ())
    left_out = []

    def answer(*given):
        left_out.append(given[-1].but)
        fails = which_holds is None or len(left_out) - 1 < which_holds
        return search.NoInterval((less, more)[len(left_out) - 1], (candidate(5.0),)) if fails else found

    monkeypatch.setattr(search, "search_on", answer)
    result = search.search(subject, base, np.random.default_rng(0), lambda *_: None)
    assert left_out == [(), (less,)][: 1 if which_holds == 0 else 2]
    assert (result is found) is (which_holds is not None)
    assert result.accepted == ()


@pytest.mark.parametrize(("tau", "large"), [(0.105, False), (0.13, True)])
def test_what_its_refined_size_makes_too_small_is_no_cause(tau, large):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)
    came = candidate(6.0, "reaction_delay", 0.13, ((slots.DELAY, 0.5),))
    nothing = Gain("ade_m", 1.0, 1.0, 0.0, (-0.1, 0.1), 10, False)
    cause = Accepted(Tried(came, base, 60.0), 0.13, 0.01, nothing, ())
    assert search._is_still_large(cause, with_cause(base, came, tau)) is large


@pytest.mark.parametrize(
    ("supports", "left", "is_outside"),
    [
        ((300.0,), (4.0,), False),  # the first takes it away
        ((300.0, 200.0), (11.0, 4.0), False),  # the second does
        ((300.0, 200.0), (11.0, 10.0), True),
        ((300.0, 100.0), (11.0, 4.0), True),  # the second says less than what is left
        ((120.0, 200.0), (11.0, 4.0), True),  # so does the first
        ((300.0,), (11.0,), True),  # there is no second
    ],
)
def test_what_two_effects_together_take_away_is_not_outside_the_catalogue(monkeypatch, supports, left, is_outside):
    strange, beside = free("position and time", 12.0), []
    names = ("lane_change_relaxation", "location")
    best = [Tried(candidate(9.0, name), None, support) for name, support in zip(names, supports, strict=False)]
    looks = [evidence(0.0, free("position and time", z)) for z in left]

    def most_supported(*given):
        beside.append(list(given[4]))
        return best.pop(0) if best else None

    monkeypatch.setattr(search.choice, "most_supported", most_supported)
    monkeypatch.setattr(search, "sharpened", lambda _, fit, __: fit)
    monkeypatch.setattr(search, "anew", lambda _, fit: fit)
    monkeypatch.setattr(search.ev, "examine", lambda *_, **__: looks.pop(0))
    found = search._outside(None, None, evidence(0.0, strange), [], search.Known(), lambda *_: None)
    assert found == ((strange,) if is_outside else ())
    assert beside == [[], ["lane_change_relaxation"]][: len(beside)]


@pytest.mark.parametrize("periods", [1, 2])
def test_a_place_is_asked_whether_it_is_so_at_all_times_of_one_period_only(monkeypatch, periods):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    names = np.array(["p", "q"])[np.arange(windows.drivers) % periods]
    subject = Subject(replace(windows, period=names), Noises(QUIET, QUIET), rg.grid_of(windows), True)
    place = Candidate("location", -0.2, 0.01, 8.0, 1e-9, Regressor("location", low=50.0, high=90.0))
    fit = with_cause(fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1), place)
    cause = Accepted(Tried(place, fit, 60.0), -0.2, 0.01, Gain("ade_m", 1.0, 0.9, 0.1, (0.0, 0.2), 10, False), ())
    asked = []
    monkeypatch.setattr(search.ev, "examine", lambda *_, free, **__: asked.append(free))
    search._examined(subject, fit, [cause], [], lambda *_: None)
    assert (asked[0] is not None) is (periods == 1)
