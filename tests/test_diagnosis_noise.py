"""Noise: what is put in is found again."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from idm_sumo import columns as c
from idm_sumo.diagnosis import noise as no
from idm_sumo.recording import Recording


def recording(noise: no.Noise, *, is_smooth: bool = False) -> Recording:
    rng = np.random.default_rng(3)
    vehicles, frames = 60, 512
    time = 0.1 * np.arange(frames)
    phase = rng.uniform(0, 6, (vehicles, 1))
    x = 10.0 * time + 12.0 * np.sin(0.25 * time + phase) + noise.draw(vehicles, frames, rng)
    table = pd.DataFrame({
        c.PERIOD: "p", c.VEHICLE: np.repeat(np.arange(1, vehicles + 1), frames), c.FRAME: np.tile(np.arange(frames), vehicles),
        c.TIME: np.tile(time, vehicles), c.X: x.ravel(), c.Y: -2.0, c.SPEED: 10.0, c.ACCELERATION: 0.0, c.HEADING: 0.0,
        c.LENGTH: 4.5, c.WIDTH: 2.0, c.CLASS: 2, c.LANE: 1, c.LEADER: 0, c.HEADWAY: np.nan,
    })  # fmt: skip
    return Recording(Recording.from_table(table).table, is_smooth=is_smooth)


def variance_after_smoothing(noise: no.Noise) -> np.ndarray:
    drawn = no.smoothed(noise.draw(400, 300, np.random.default_rng(1)))
    return np.array([part.std() for part in drawn])


@pytest.mark.parametrize(
    "planted",
    [
        no.Noise(0.09, np.zeros(1), np.array([1.0])),
        no.Noise(0.0, np.array([0.09]), np.array([0.6])),
        no.Noise(0.01, np.array([0.04]), np.array([0.3])),
    ],
)
def test_white_and_correlated_noise_are_told_apart_by_the_spectrum(planted):
    found = no.measurement_noise(recording(planted))
    np.testing.assert_allclose(variance_after_smoothing(found), variance_after_smoothing(planted), rtol=0.25)


def test_a_smooth_recording_has_none():
    quiet = no.measurement_noise(recording(no.Noise(0.0, np.zeros(1), np.ones(1)), is_smooth=True))
    assert quiet.white + quiet.variance.sum() < 1e-4


def test_noise_is_stationary_from_the_first_step():
    drawn = no.Noise(0.0, np.array([0.25]), np.array([5.0])).draw(20_000, 30, np.random.default_rng(0))
    np.testing.assert_allclose(drawn[:, [0, 29]].std(axis=0), 0.5, rtol=0.03)
