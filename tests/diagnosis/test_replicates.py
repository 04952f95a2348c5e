"""Replicates: the drivers' noise that is put in is found again, how large and how fast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Noises
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.noise import DRIVER_MEMORIES, QUIET
from idm_sumo.diagnosis.replicates import driver_noise
from tests.helpers.followers import followers


def pushed(rows: int, frames: int, sd: float, memory: float, rng: np.random.Generator) -> np.ndarray:
    """Return an Ornstein-Uhlenbeck noise, step by step."""
    out = np.empty((rows, frames))
    out[:, 0] = sd * rng.standard_normal(rows)
    for k in range(1, frames):
        kept = np.exp(-0.1 / memory)
        out[:, k] = kept * out[:, k - 1] + sd * np.sqrt(1 - kept**2) * rng.standard_normal(rows)
    return out


def found_again(sd: float, memory: float) -> np.ndarray:
    """Return variances (m²/s⁴) that are found of drivers with this noise, by memory."""
    rng = np.random.default_rng(1)
    windows, theta = followers(ro.PLAIN, rng)
    noise = pushed(len(windows.seen), windows.seen.shape[2] - 1, sd, memory, rng)
    seen = windows.seen.copy()
    seen[:, w.X], seen[:, w.V] = ro.drive(seen, windows.driver, theta, ro.PLAIN, np.zeros(2), noise, 0)
    windows = replace(windows, seen=seen)
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=12)
    return driver_noise(windows, fit, Noises(QUIET, QUIET), rng, is_smooth=True).variance


def test_noise_of_drivers_is_found_again_how_large_and_how_fast():
    fast, slow = found_again(0.2, 1.4), found_again(0.1, 5.0)
    for found, planted in ((fast, 0.2**2 * 1.4), (slow, 0.1**2 * 5.0)):  # of slow changes, which move a vehicle
        assert 0.6 < (found @ DRIVER_MEMORIES) / planted < 1.7
    assert fast.sum() > 2.0 * slow.sum()
    assert fast @ DRIVER_MEMORIES / fast.sum() < 0.5 * (slow @ DRIVER_MEMORIES / slow.sum())


def test_drivers_without_noise_have_none():
    windows, _ = followers(ro.PLAIN, np.random.default_rng(2))
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=12)
    found = driver_noise(windows, fit, Noises(QUIET, QUIET), np.random.default_rng(3), is_smooth=True)
    assert found.variance.sum() < 0.02**2
