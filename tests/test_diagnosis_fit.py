"""Fits of drivers: no step makes one worse, and who is lost is found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.fit import LOWER, UPPER, elsewhere, fit_drivers, improve, linearise, misfits
from tests.test_diagnosis_rollout import DRIVERS, followers

START = np.array([1e-4, 1e-4])
LOST = np.array([3, 17])


@pytest.fixture(name="fitted", scope="module")
def make_fitted():
    windows, _ = followers(ro.PLAIN, np.random.default_rng(4))
    return windows, fit_drivers(windows, ro.PLAIN.copy(), START, rounds=8)


def left(windows, fit, like):
    """Return what is left of each driver, weighed as at the fit ``like``."""
    simulated = ro.positions(windows, fit.theta, fit.by_lane)[:, :, None]
    return misfits(windows, like, linearise(windows, like).whitener, fit.own[:, :, None], simulated)[:, 0]


def test_who_is_lost_is_found_again_and_nobody_else_is_moved(fitted):
    windows, fit = fitted
    own = fit.own.copy()
    own[LOST] = np.log([5.5, 8.0, 3.5, 8.0, 13.0])
    lost = replace(fit, own=own)
    found = elsewhere(windows, lost)
    assert (left(windows, found, fit)[LOST] < 0.5 * left(windows, lost, fit)[LOST]).all()
    better = found
    for _ in range(6):
        better = improve(windows, better, hyper=False, new_mean=False)
    off = np.abs(ro.positions(windows, better.theta, ro.PLAIN) - windows.target).mean(axis=1)
    assert off[np.isin(windows.driver, LOST)].max() < 0.1
    moved = np.flatnonzero((found.own != lost.own).any(axis=1))
    assert set(LOST) <= set(moved)
    assert len(moved) < DRIVERS // 2
    assert (left(windows, found, fit) <= left(windows, lost, fit)).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_step_leaves_no_driver_worse_than_it_was(fitted, seed):
    windows, fit = fitted
    rng = np.random.default_rng(seed)
    away = replace(fit, own=np.clip(fit.own + 0.8 * rng.standard_normal(fit.own.shape), LOWER, UPPER))
    step = improve(windows, away, hyper=False, new_mean=False)
    assert (left(windows, step, away) <= left(windows, away, away) + 1e-9).all()
    assert left(windows, step, away).sum() < 0.8 * left(windows, away, away).sum()
