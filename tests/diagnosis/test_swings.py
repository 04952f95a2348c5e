"""Swings of drivers' own: a bump on the spectrum is found at its period; a curve is none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from idm_sumo.diagnosis import swings as sw
from idm_sumo.diagnosis.plan import PERIODS

DRIVERS = 150


def spectra(rng: np.random.Generator, more: object = 1.0) -> sw.Swings:
    """Spectra of drivers whose noise is ``more`` than that of their replicates; drivers differ in how much they err."""
    part = rng.uniform(0.5, 2.0, (DRIVERS, 2 * len(PERIODS)))
    loud = rng.lognormal(0.0, 0.7, (DRIVERS, 1))
    size = np.tile(np.sqrt(np.broadcast_to(more, len(PERIODS))), 2)
    own = rng.normal(size=part.shape) * np.sqrt(part) * loud
    replicates = rng.normal(size=(4 * DRIVERS, part.shape[1])) * np.sqrt(np.tile(part, (4, 1)))
    return sw.Swings(sw.power(own * size, part), sw.power(replicates, np.tile(part, (4, 1))).mean(axis=0))


def test_power_is_shared_out_whatever_a_driver_errs():
    rng = np.random.default_rng(0)
    score, part = rng.normal(size=(5, 2 * len(PERIODS))), np.ones((5, 2 * len(PERIODS)))
    assert sw.power(score, part).sum(axis=1) == pytest.approx(1.0)
    assert sw.power(7.0 * score, part) == pytest.approx(sw.power(score, part))


@pytest.mark.parametrize(("period", "width"), [(9.0, 0.09), (7.0, 0.09), (12.0, 0.22)])
def test_a_swing_is_found_at_its_period(period, width):
    bump = 1.0 + 0.8 * np.exp(-0.5 * (np.log(PERIODS / period) / width) ** 2)
    found = sw.strongest(spectra(np.random.default_rng(1), bump))
    assert found.low < period < found.high
    assert found.z > norm.isf(1e-4 / sw.tried())


def test_noise_of_another_memory_is_no_swing():
    smooth = np.exp(0.3 * np.log(PERIODS / 10.0) - 0.1 * np.log(PERIODS / 10.0) ** 2)
    seen = [sw.strongest(spectra(np.random.default_rng(n), smooth)).z for n in range(60)]
    assert np.mean([z > norm.isf(0.05 / sw.tried()) for z in seen]) < 0.12
