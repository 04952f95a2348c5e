"""Fits of drivers: no step makes one worse, and who is lost is found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import law
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.fit import LOWER, UPPER, elsewhere, fit_drivers, for_rollouts, improve, linearise, misfits
from idm_sumo.models import laws
from idm_sumo.models.effects import slots
from tests.helpers.followers import DRIVERS, followers

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


@pytest.fixture(name="krauss", scope="module")
def make_krauss():
    return followers(law.of(laws.KRAUSS, 0.8), np.random.default_rng(4))[0]


@pytest.mark.parametrize("begin", [0.5, 1.0, 1.6])
def test_what_all_drivers_of_a_law_share_is_fitted_with_their_population(krauss, begin):
    fit = fit_drivers(krauss, law.of(laws.KRAUSS, begin), START, rounds=10)
    assert law.reaction_of(fit) == pytest.approx(0.8, abs=0.03)
    assert (fit.by_lane[:, slots.REACTION_CHANGE] == fit.by_lane[0, slots.REACTION_CHANGE]).all()


def test_what_drivers_share_stays_with_the_population_s_mean_and_where_a_law_has_nothing_of_it(krauss, fitted):
    fit = fit_drivers(krauss, law.of(laws.KRAUSS), START, rounds=2)
    assert (improve(krauss, fit, new_mean=False).by_lane == fit.by_lane).all()
    assert not (improve(krauss, fit).by_lane == fit.by_lane).all()
    windows, by_idm = fitted
    assert (by_idm.by_lane == ro.PLAIN).all()
    assert linearise(windows, by_idm).shared.shape[2] == 0


def test_the_derivative_by_what_drivers_share_is_that_of_the_rollouts(krauss):
    fit = fit_drivers(krauss, law.of(laws.KRAUSS), START, rounds=2)
    more = fit.by_lane.copy()
    more[:, slots.REACTION_CHANGE] += 1e-4
    moved = (ro.positions(krauss, fit.theta, more) - ro.positions(krauss, fit.theta, fit.by_lane)) / 1e-4
    np.testing.assert_allclose(linearise(krauss, fit).shared[:, :, 0], moved, atol=0.05 * np.abs(moved).max())


def test_fitted_for_rollouts_no_driver_is_excused_by_where_it_may_have_started(fitted):
    windows, fit = fitted
    near, far = (for_rollouts(windows, replace(fit, start_variance=start)) for start in (0.0 * START, 1e4 * START))
    assert np.array_equal(near.own, far.own)
