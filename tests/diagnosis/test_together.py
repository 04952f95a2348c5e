"""Two causes that hide each other: each must gain beside the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import search, together
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.sizes import Tried, with_cause, without_cause
from tests.helpers.followers import candidate, evidence, followers


def gain(share):
    return Gain("ade_m", 1.0, 1.0 - share, share, (share - 0.01, share + 0.01), 100, False)


@pytest.fixture
def fit():
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    return fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)


@pytest.mark.parametrize(
    ("both", "beside", "z", "named"),
    [
        (0.09, 0.04, 7.5, True),
        (0.005, 0.04, 7.5, False),  # both beside neither
        (0.09, 0.005, 7.5, False),  # what was refused, beside the second
        (0.09, 0.04, 4.0, False),  # not significant alone: nothing to begin with
    ],
)
def test_two_are_named_if_each_gains_beside_the_other(monkeypatch, fit, both, beside, z, named):
    dead_band, asymmetry = candidate(z, value=0.5), candidate(8.0, "acceleration_asymmetry", 0.3)
    dead_band = replace(dead_band, p=1e-9 if z > 5.0 else 0.01)
    refused = Tried(dead_band, with_cause(fit, dead_band), 100.0)
    joint = Tried(asymmetry, with_cause(refused.fit, asymmetry), 200.0)
    gains = [gain(both), gain(beside)]
    models = []

    def gain_of(_, before, after, __):
        models.append((before, after))
        return gains.pop(0)

    monkeypatch.setattr(together.ev, "examine", lambda *_, **__: evidence(0.0))
    monkeypatch.setattr(together.gates, "believed", lambda _: [asymmetry, dead_band])
    monkeypatch.setattr(together.hy, "forms", lambda _, one: [one])
    monkeypatch.setattr(together.choice, "judged", lambda *_: (joint, Accepted(joint, 0.3, 0.01, gain(0.1), ())))
    monkeypatch.setattr(together, "anew", lambda _, fit: fit)
    monkeypatch.setattr(together, "gain_of", gain_of)
    chosen = together.two_together(None, fit, refused, [], np.random.default_rng(0), lambda *_: None)
    assert [cause.candidate.name for cause in chosen] == (
        ["perception_threshold", "acceleration_asymmetry"] if named else []
    )
    if named:
        (neither, with_both), (alone, _) = models
        np.testing.assert_array_equal(neither.by_lane, fit.by_lane)
        np.testing.assert_array_equal(with_both.by_lane, joint.fit.by_lane)
        np.testing.assert_array_equal(alone.by_lane, with_cause(fit, asymmetry).by_lane)


def test_a_cause_taken_out_leaves_the_other(fit):
    dead_band, asymmetry = candidate(9.0, value=0.5), candidate(8.0, "acceleration_asymmetry", 0.3)
    both = with_cause(with_cause(fit, dead_band), asymmetry)
    np.testing.assert_array_equal(
        without_cause(both, "perception_threshold").by_lane, with_cause(fit, asymmetry).by_lane
    )


def test_where_nothing_gains_alone_two_are_asked_for_and_neither_is_told_as_without_gain(monkeypatch, fit):
    first, second = (Tried(candidate(8.0, name), fit, 100.0) for name in ("hysteresis", "acceleration_asymmetry"))
    both = tuple(Accepted(one, 0.5, 0.01, gain(0.1), ()) for one in (first, second))
    monkeypatch.setattr(search.hy, "candidates", lambda _: [first.candidate])
    monkeypatch.setattr(search.hy, "forms", lambda _, one: [one])
    monkeypatch.setattr(search.choice, "judged", lambda *_: (first, None))
    monkeypatch.setattr(search, "two_together", lambda *_: both)
    without = []
    assert search._next(None, fit, evidence(0.0), [], without, [], search.Brief(np.random.default_rng(0))) == both
    assert not without
    beside = [both[1]]  # of a further cause nobody asks
    assert not search._next(None, fit, evidence(0.0), beside, without, [], search.Brief(np.random.default_rng(0)))
    assert [one.name for one in without] == ["hysteresis"]
