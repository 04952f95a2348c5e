"""Edges of places and times: the likelihood of slices finds them, and an effect cut too long or too short is put right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Noises
from idm_sumo.diagnosis.edges import best_edges, sharpened
from idm_sumo.diagnosis.fit import fit_drivers, improve
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.noise import QUIET
from idm_sumo.models.effects import BY_NAME, slots
from tests.helpers.followers import followers


def test_slices_in_which_more_is_wanted_are_taken_in_and_others_left_out():
    slices = np.arange(9.0)
    wanted = np.array([0, 0, 1, 1, 1, 1, 0, 0])  # between 2 and 6
    acts = np.array([0, 0, 0, 0, 1, 1, 1, 0])  # between 4 and 7
    gram = np.eye(8) + 0.2
    assert best_edges(gram @ (wanted - acts), gram, slices, 4.0, 7.0) == (2.0, 6.0)


def test_an_effect_does_not_leave_its_place():
    slices = np.arange(7.0)
    score = np.array([-9.0, -9.0, -9.0, -9.0, 9.0, 9.0])
    begin, end = best_edges(score, np.eye(6), slices, 2.0, 4.0)
    assert (begin < 4.0) & (end > 2.0)


def one_after_the_other(by_lane: np.ndarray) -> w.Windows:
    """Return windows that begin a second after each other, driven with the given magnitudes."""
    windows, theta = followers(ro.PLAIN, np.random.default_rng(7))
    seen = windows.seen.copy()
    seen[:, w.TIME] += np.arange(len(seen))[:, None]
    x, v = ro.drive(seen, windows.driver, theta, by_lane, np.zeros(2), ro.NO_PUSH, 0)
    seen[:, w.X], seen[:, w.V] = x, v
    return replace(windows, seen=seen)


@pytest.mark.parametrize(("name", "symbol", "size", "ends", "width"), [
    ("location", "alpha", -0.4, (45.0, 97.0), rg.PLACE_BIN), ("location", "theta", 0.6, (45.0, 97.0), rg.PLACE_BIN),
    ("time_of_day", "theta", 0.4, (31.0, 66.0), rg.TIME_BIN),
])  # fmt: skip
def test_edges_are_found_between_those_of_bins(name, symbol, size, ends, width):
    magnitude, begin, end = (parameter.slot for parameter in BY_NAME[name].named_by([symbol]))
    planted = ro.PLAIN.copy()
    planted[:, [magnitude, begin, end]] = size, *ends
    windows = one_after_the_other(planted)
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    off = planted.copy()
    off[:, begin] += 0.4 * width
    off[:, end] -= 0.4 * width
    fit = fit_drivers(windows, off, np.array([1e-4, 1e-4]), rounds=8)
    for _ in range(2):
        fit = improve(windows, sharpened(subject, fit, [name]))
    np.testing.assert_allclose(fit.by_lane[0, [begin, end]], ends, atol=0.15 * width)


def test_a_drift_ends_with_the_recording():
    planted = ro.PLAIN.copy()
    planted[:, [slots.PERIOD_DRIFT, slots.PERIOD_BEGIN, slots.PERIOD_END]] = 0.3, 10.0, 60.0
    windows = one_after_the_other(planted)
    fit = fit_drivers(windows, planted, np.array([1e-4, 1e-4]), rounds=1)
    assert sharpened(Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True), fit, ["time_of_day"]) is fit


def test_what_has_no_edges_is_left_alone():
    windows, _ = followers(ro.PLAIN, np.random.default_rng(7))
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)
    assert sharpened(Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True), fit, ["hysteresis"]) is fit
    assert not fit.by_lane[:, slots.PLACE].any()
