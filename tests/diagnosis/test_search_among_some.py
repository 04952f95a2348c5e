"""The search among some drivers: where it is asked for, and that what it finds is told apart in the windows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import search_among_some as sas
from idm_sumo.diagnosis import some_drivers as sd
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.search import Found
from idm_sumo.models.effects import slots
from idm_sumo.runtime.progress import silent
from tests.helpers.followers import DRIVERS, FIT, evidence, followers, free, tried

GAIN = Gain("ade_m", 1.0, 0.9, 0.1, (0.05, 0.15), 10, False)
HAS = np.arange(DRIVERS) % 2 == 0


def found(*accepted, left=()):
    return Found(FIT, FIT, accepted, (), evidence(2.0), evidence(2.0), left)


def named(name, *rivals):
    return Accepted(tried(9.0, name), 0.5, 0.01, GAIN, rivals)


@pytest.mark.parametrize(
    ("what", "asked"),
    [
        (found(), True),
        (found(named("acceleration_asymmetry")), True),
        (found(named("hysteresis")), True),
        (found(named("location", "time_of_day")), True),
        (found(named("location")), False),
        (found(named("reaction_delay")), False),
        (found(left=(free("position", 9.0),)), False),
    ],
)
def test_it_is_asked_for_where_nothing_is_surely_named_or_strange(what, asked, monkeypatch):
    questions = []
    monkeypatch.setattr(sd, "some_who_differ", lambda *_: questions.append(1))
    windows, _ = followers(ro.PLAIN, np.random.default_rng(4))
    subject = Subject(windows, None, None, True)
    assert sas.search_among_some(subject, what, np.random.default_rng(0), silent) is what
    assert bool(questions) is asked


@pytest.mark.parametrize("kept", [True, False])
def test_what_is_found_is_looked_at_beside_with_the_others_told_apart(kept, monkeypatch):
    windows, theta = followers(ro.PLAIN, np.random.default_rng(4))
    drivers = replace(FIT, own=np.log(theta), by_lane=np.tile(ro.PLAIN, (2, 1)))
    drivers.by_lane[: ro.ROWS, slots.DELAY] = 0.8
    cause = replace(named("reaction_delay"), tried=replace(tried(9.0, "reaction_delay"), fit=drivers))
    monkeypatch.setattr(sd, "some_who_differ", lambda *_: sd.Some("reaction_delay", 0.5, HAS))
    monkeypatch.setattr(sd, "gain_of_each", lambda *_: np.where(HAS, 20.0, -20.0))
    monkeypatch.setattr(sas, "_as_they_show_it", lambda *_: cause)
    monkeypatch.setattr(sas, "anew", lambda _, fit: fit)
    went_on = []

    def search_on(subject, base, first, strange, chances, known, brief, begin):
        went_on.append((subject.windows, begin))
        return found(*(begin if kept else ()))

    monkeypatch.setattr(sas, "search_on", search_on)
    nothing = found()
    again = sas.search_among_some(Subject(windows, None, None, True), nothing, np.random.default_rng(0), silent)
    ((told_apart, begin),) = went_on
    np.testing.assert_array_equal(told_apart.seen[:, -1, 0] == 0.0, HAS[windows.driver])
    assert [one.candidate.name for one in begin] == ["reaction_delay"]
    if kept:
        assert again.share is not None
        assert again.share.value == pytest.approx(0.5, abs=1e-3)
    else:
        assert again is nothing
