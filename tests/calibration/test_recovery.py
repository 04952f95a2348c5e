"""Known drivers behind noise: what is found, and whether the intervals keep their promise."""

import numpy as np
import pytest

from idm_sumo.calibration import calibrate
from idm_sumo.models import idm
from tests.helpers.known_drivers import known_drivers

NAMES = list(idm.IDMParameters._fields)


def deviations(table, theta):
    """Return estimate minus truth in standard deviations (of ``a, b``: in logarithms), NaN where undetermined."""
    found, sd = table[NAMES].to_numpy(), table[[f"{name}_sd" for name in NAMES]].to_numpy()
    logs = found * (np.log(np.maximum(found, 1e-9)) - np.log(np.maximum(theta, 1e-9)))
    off = np.where(np.arange(5) < 2, logs, found - theta) / sd
    doubtful = [[name in row.split(",") for name in NAMES] for row in table["undetermined"]]
    return np.where(doubtful, np.nan, off)


def test_without_noise_drivers_are_found_again():
    scenes, theta = known_drivers(60, seconds=60, seed=21)
    table = calibrate(scenes)
    off = np.abs(table[NAMES].to_numpy() - theta)
    assert table["ade_m"].max() < 0.02
    assert np.all(np.quantile(off, 0.9, axis=0) < [0.02, 0.05, 0.03, 0.2, 0.6])


@pytest.mark.parametrize("seconds", [10, 30, 60])
def test_95_percent_intervals_cover_90_to_98(seconds):
    scenes, theta = known_drivers(500, seconds=seconds, noise=0.15, seed=22)
    off = deviations(calibrate(scenes), theta)
    known = np.isfinite(off)
    covered = np.where(known, np.abs(off) <= 1.96, np.nan)
    assert known.sum() > 300
    assert 0.90 <= np.nanmean(covered) <= 0.98
    often = known.sum(axis=0) >= 100  # each by itself, less what chance makes of 100 to 500 drivers
    assert often[[0, 2]].all()
    each = np.nanmean(covered[:, often], axis=0)
    assert np.all((each >= 0.88) & (each <= 0.996)), each


def test_longer_windows_determine_more():
    doubtful, error = [], []
    for seconds in (10, 30, 60):
        scenes, theta = known_drivers(100, seconds=seconds, noise=0.15, seed=23)
        table = calibrate(scenes)
        doubtful.append(table["undetermined"].str.split(",").explode().isin(NAMES).sum())
        error.append(np.abs(table[NAMES].to_numpy() - theta).mean(axis=0))
    assert doubtful[0] > 1.3 * doubtful[1] > 1.3 * doubtful[2]
    assert np.all(error[0][:4] > error[2][:4])


def test_steady_following_determines_hardly_anything():
    """Behind a leader at constant speed only the gap is seen, and it does not tell ``T`` from ``d0`` and ``d1``."""
    from idm_sumo.scenes.windows import Window
    from tests.helpers.known_drivers import scenes_of

    t = 0.1 * np.arange(110)
    rng = np.random.default_rng(3)
    leader = np.tile(100.0 + 10.0 * t, (20, 1))
    x = leader - 4.5 - 16.0 + np.cumsum(rng.normal(0.0, 0.003, leader.shape), axis=1)
    table = calibrate(scenes_of(x, np.full_like(x, 10.0), leader, np.full_like(x, 10.0), Window()))
    doubtful = table["undetermined"].str.split(",").explode().value_counts()
    assert all(doubtful[name] >= 15 for name in ("b", "d0", "d1"))
