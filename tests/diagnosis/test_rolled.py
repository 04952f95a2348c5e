"""Rollouts that a fit keeps: the next step begins with them, and with no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import fit as fits
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.fit import elsewhere, fit_drivers, improve, rollouts
from idm_sumo.diagnosis.rolled import NUDGES, STEP, roll
from tests.helpers.followers import followers

START = np.array([1e-4, 1e-4])


@pytest.fixture(name="fitted", scope="module")
def make_fitted():
    windows, _ = followers(ro.PLAIN, np.random.default_rng(4))
    return windows, fit_drivers(windows, ro.PLAIN.copy(), START, rounds=4)


def test_what_is_driven_beside_are_the_derivatives_of_the_positions(fitted):
    windows, fit = fitted
    rolled = roll(windows, fit.own, fit.by_lane)
    base = ro.positions(windows, fit.theta, fit.by_lane)
    np.testing.assert_array_equal(rolled.base, base)
    for n in range(ro.PARAMETERS):
        more = ro.positions(windows, np.exp(fit.own + STEP * np.eye(ro.PARAMETERS)[n]), fit.by_lane)
        np.testing.assert_allclose(rolled.by_own[:, :, n], (more - base) / STEP, atol=1e-9)
    for n, nudge in enumerate(np.diag(NUDGES)):
        x, _ = ro.drive(windows.seen, windows.driver, fit.theta, fit.by_lane, nudge, ro.NO_PUSH, ro.w.LEAD, ro.w.EVERY)
        np.testing.assert_allclose(rolled.by_start[:, :, n], (x[:, 1:] - base) / NUDGES[n], atol=1e-9)


def test_with_some_drivers_elsewhere_only_they_are_driven_again(fitted):
    windows, fit = fitted
    own = fit.own.copy()
    own[[2, 9]] += 0.2
    rolled = roll(windows, fit.own, fit.by_lane)
    which = np.array([2, 9])
    some = rolled.with_drivers(which, windows.of_drivers(which), own[which])
    np.testing.assert_array_equal(some.own, own)
    np.testing.assert_array_equal(some.beside, roll(windows, own, fit.by_lane).beside)
    nobody = which[:0]
    assert rolled.with_drivers(nobody, windows.of_drivers(nobody), own[nobody]) is rolled


@pytest.mark.parametrize("hyper", [True, False])
def test_a_step_ends_with_the_rollouts_of_its_drivers(fitted, hyper):
    windows, fit = fitted
    rng = np.random.default_rng(1)
    away = replace(
        fit, own=fit.own + 0.5 * rng.standard_normal(fit.own.shape)
    )  # some go back a part, or all, of the step
    for step in (improve(windows, away, hyper=hyper), elsewhere(windows, away)):
        kept = rollouts(windows, step)
        assert kept is step.rolled
        np.testing.assert_array_equal(kept.beside, roll(windows, step.own, step.by_lane).beside)


def test_drivers_elsewhere_another_model_and_other_windows_are_driven_anew(fitted):
    windows, fit = fitted
    by_lane = fit.by_lane.copy()
    by_lane[:, ro.slots.DELAY] = 0.4
    others = (windows, replace(fit, own=fit.own + 0.1)), (windows, replace(fit, by_lane=by_lane))
    for seen, changed in (*others, (replace(windows, seen=windows.seen + 0.0), fit)):
        anew = rollouts(seen, changed)
        assert anew is not fit.rolled
        assert anew.windows is seen
        np.testing.assert_array_equal(anew.base, ro.positions(seen, changed.theta, changed.by_lane))


def test_a_step_drives_most_windows_once(fitted, monkeypatch):
    """The next begins where it ended: what judges a step is what the next one asks."""
    windows, fit = fitted
    driven = []
    monkeypatch.setattr(fits, "roll", lambda seen, own, by_lane: driven.append(seen) or roll(seen, own, by_lane))
    for _ in range(3):
        fit = improve(windows, fit)
    assert len(driven) == 3
