"""Null twins: the same traffic, driven by the fitted model, measured and smoothed as the recording was.

Whatever effect a twin shows was made by noise, smoothing and refitting, for none is in it beyond those already accepted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls
from scipy.signal import savgol_filter

from idm_sumo.diagnosis import noise as no
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit, improve
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.rollout import drive, positions
from idm_sumo.smoothing import ORDER

Floats = npt.NDArray[np.float64]


def make_twin(
    windows: w.Windows,
    fit: Fit,
    measurement: Noise,
    driver: Noise,
    rng: np.random.Generator,
    *,
    is_smooth: bool = False,
) -> w.Windows:
    """Return the windows of a recording in which every follower drives by its fitted model.

    Parameters
    ----------
    windows : Windows
        Their leaders are taken for true.
    fit : Fit
    measurement, driver : Noise
        Of positions (m²) and of accelerations (m²/s⁴).
    rng : numpy.random.Generator
    is_smooth : bool, keyword-only
        Whether the recording was smooth as it came, so that nothing is smoothed.
    """
    count, frames = windows.seen.shape[:2]
    pushed = driver.draw(count, frames - 1, rng)
    x, v = drive(windows.seen, windows.driver, fit.theta, fit.by_lane, np.zeros(2), pushed, 0)
    seen = windows.seen.copy()
    seen[:, :, w.X], seen[:, :, w.V] = x, v
    if not is_smooth:
        seen[:, :, w.X] = savgol_filter(seen[:, :, w.X], windows.smoothing, ORDER, axis=1)
        seen[:, :, w.V] = savgol_filter(seen[:, :, w.V], windows.smoothing, ORDER, axis=1)
    own, ahead, second = (
        no.smoothed(measurement.draw(count, frames + 2 * no.MARGIN, rng), windows.smoothing) for _ in range(3)
    )
    seen[:, :, w.X] += own[0]
    seen[:, :, w.V] = np.maximum(seen[:, :, w.V] + own[1], 0.0)
    seen[:, :, w.REAR] = windows.blurred[:, :, 0] + ahead[0]
    seen[:, :, w.SPEED] = np.maximum(windows.blurred[:, :, 1] + ahead[1], 0.0)
    seen[:, :, w.ACCELERATION] += ahead[2]
    seen[:, :, w.SECOND] = windows.blurred[:, :, 2] + second[0]
    seen[:, :, w.SECOND_SPEED] = np.maximum(seen[:, :, w.SECOND_SPEED] + second[1], 0.0)
    return replace(windows, seen=seen)


TRIAL = 0.04  # m^2/s^4, variance of the trial noises
TRIAL_WINDOWS = 1000


def refit(twin: w.Windows, fit: Fit) -> Fit:
    """Return the twin's drivers, fitted as the recording's were: same spreads, same weights."""
    return improve(twin, improve(twin, fit, hyper=False), hyper=False)


def driver_noise(
    windows: w.Windows, fit: Fit, measurement: Noise, rng: np.random.Generator, *, is_smooth: bool = False
) -> Noise:
    """Return the drivers' acceleration noise (m²/s⁴) that leaves the residuals that the recording leaves.

    One trial twin for each memory, and one without; the covariances of what is left after refitting are
    mixed by non-negative least squares.
    """
    some = np.arange(min(windows.drivers, max(40, TRIAL_WINDOWS * windows.drivers // max(len(windows.seen), 1))))
    part = windows.of_drivers(some)
    kept = np.isin(windows.driver, some)
    own = replace(fit, own=fit.own[some], weight=fit.weight[kept])
    left = []
    for variance in (None, *np.eye(len(no.DRIVER_MEMORIES)) * TRIAL):
        noise = Noise(0.0, np.zeros(len(no.DRIVER_MEMORIES)) if variance is None else variance, no.DRIVER_MEMORIES)
        twin = make_twin(part, own, measurement, noise, rng, is_smooth=is_smooth)
        left.append(_left_over(twin, refit(twin, own)))
    wanted = _left_over(part, own)
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    upper = np.triu_indices(len(wanted))
    design = np.stack([((one - left[0]) / scale)[upper] for one in left[1:]], axis=1)
    solved, _ = nnls(design, ((wanted - left[0]) / scale)[upper])
    return Noise(0.0, TRIAL * solved, no.DRIVER_MEMORIES)


def _left_over(windows: w.Windows, fit: Fit) -> Floats:
    """Return the weighted second moments of what the fit leaves (m²), shape ``(moments, moments)``."""
    error = windows.target - positions(windows, fit.theta, fit.by_lane)
    return np.asarray((error * fit.weight[:, None]).T @ error / len(error))
