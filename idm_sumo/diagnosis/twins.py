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
from idm_sumo.diagnosis.fit import LOWER, UPPER, Fit, improve
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.rollout import drive, positions
from idm_sumo.road import FRAME_STEP
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
    """Return the windows of a recording in which every follower drives by the model of ``fit``.

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
    x, v = drive(_sharpened(windows), windows.driver, fit.theta, fit.by_lane, np.zeros(2), pushed, 0)
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
    seen[:, :, w.REAR] += ahead[0]
    seen[:, :, w.SPEED] = np.maximum(seen[:, :, w.SPEED] + ahead[1], 0.0)
    seen[:, :, w.ACCELERATION] += ahead[2]
    seen[:, :, w.SECOND] += second[0]
    seen[:, :, w.SECOND_SPEED] = np.maximum(seen[:, :, w.SECOND_SPEED] + second[1], 0.0)
    return replace(windows, seen=seen)


def _sharpened(windows: w.Windows) -> Floats:
    """Return what the twin's driver sees: leaders that look like the recorded ones once they are smoothed.

    What a second smoothing takes away is put on top (one step of van Cittert's deconvolution): the driver of a recording answered
    the true leader, of which the recording shows the smoothed one.
    """
    seen = windows.seen.copy()
    for column, name in enumerate((w.REAR, w.SPEED, w.SECOND)):
        there = np.isfinite(windows.seen[:, :, name]) & np.isfinite(windows.blurred[:, :, column])
        np.subtract(2.0 * windows.seen[:, :, name], windows.blurred[:, :, column], out=seen[:, :, name], where=there)
    seen[:, :, w.SPEED] = np.maximum(seen[:, :, w.SPEED], 0.0)
    gained = seen[:, :, w.SPEED] - windows.seen[:, :, w.SPEED]
    seen[:, :, w.ACCELERATION] += np.gradient(gained, FRAME_STEP, axis=1)
    return seen


def drawn_anew(fit: Fit, rng: np.random.Generator) -> Fit:
    """Return the fit with drivers drawn from its population.

    Fitted drivers carry a part of whatever differs between them: who followed a truck has been fitted a longer headway. Their
    twins show that part again, so for such effects twins of drawn drivers are the null.
    """
    own = rng.multivariate_normal(fit.mean, fit.spread, len(fit.own), method="cholesky")
    return replace(fit, own=np.clip(own, LOWER, UPPER))


def placed_for(windows: w.Windows, fitted: Fit, drawn: Fit) -> w.Windows:
    """Return the windows, their starts moved by as much as the drawn drivers keep other gaps than the fitted ones."""
    seen = windows.seen.copy()
    speed, gap = seen[:, 0, w.V], seen[:, 0, w.REAR] - seen[:, 0, w.X]
    more = _steady_gap(drawn.theta[windows.driver], speed) - _steady_gap(fitted.theta[windows.driver], speed)
    seen[:, 0, w.X] -= np.clip(more, -CLOSER * gap, FARTHER * gap)
    return replace(windows, seen=seen)


def _steady_gap(theta: Floats, speed: Floats) -> Floats:
    """Return the gap (m) at which each driver would keep the speed (m/s); parameters a, b, T, d0, v0."""
    free = np.maximum(1.0 - (speed / theta[:, 4]) ** 4, 0.2)
    return np.asarray((theta[:, 3] + speed * theta[:, 2]) / np.sqrt(free))


CLOSER, FARTHER = 0.4, 0.8  # of the recorded gap, by which a drawn driver may start otherwise
TRIAL = 0.04  # m^2/s^4, variance of the trial noises
TRIAL_WINDOWS = 1000


def refit(twin: w.Windows, fit: Fit) -> Fit:
    """Return the twin's drivers and weights, fitted as the recording's were; spreads and covariance are the recording's."""
    fitted = improve(twin, improve(twin, fit, hyper=False))
    return replace(fitted, spread=fit.spread, residual=fit.residual)


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
