"""Null twins: the same traffic, driven by the fitted model, measured and smoothed as the recording was.

Whatever effect a twin shows was made by noise, smoothing and refitting, for none is in it beyond those already accepted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from idm_sumo.diagnosis import noise as no
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import LOWER, UPPER, Fit, improve
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.rollout import drive, positions
from idm_sumo.diagnosis.smoother import LONGEST, derivatives
from idm_sumo.road import FRAME_STEP

Floats = npt.NDArray[np.float64]

MARGIN = LONGEST // 2  # frames on each side of what is drawn: the smoother sees less at the ends


@dataclass(frozen=True)
class Noises:
    """What makes a recording beside the model: measurement errors (m²), drivers' and leaders' own motion (m²/s⁴).

    ``leader`` is None where leaders were not smoothed, so that nothing of theirs is hidden.
    """

    measurement: Noise
    driver: Noise
    leader: Noise | None = None


def make_twin(
    windows: w.Windows, fit: Fit, noises: Noises, rng: np.random.Generator, *, is_smooth: bool = False
) -> w.Windows:
    """Return the windows of a recording in which every follower drives by the model of ``fit``.

    ``is_smooth`` says that the recording was smooth as it came, so that nothing is smoothed.
    """
    count, frames = windows.seen.shape[:2]
    truth, seen = _leaders(windows, noises, rng)
    pushed = noises.driver.draw(count, frames - 1, rng)
    x, v = drive(truth, windows.driver, fit.theta, fit.by_lane, np.zeros(2), pushed, 0)
    if not is_smooth:
        x, v, _ = derivatives(x, windows.smoothing)
    error = measured(noises.measurement, windows.smoothing, count, frames, rng)
    seen[:, :, w.X], seen[:, :, w.V] = x + error[0], np.maximum(v + error[1], 0.0)
    return replace(windows, seen=seen)


Path = tuple[Floats, Floats, Floats]  # position (m), speed (m/s) and acceleration (m/s²), shapes (rows, frames)


def measured(noise: Noise, smoothing: int, rows: int, frames: int, rng: np.random.Generator) -> Path:
    """Return what measurement errors are smoothed to."""
    return _inner(derivatives(noise.draw(rows, frames + 2 * MARGIN, rng), smoothing))


def _inner(path: Path) -> Path:
    one, two, three = (part[:, MARGIN:-MARGIN] for part in path)
    return one, two, three


def hidden(noises: Noises, smoothing: int, rows: int, frames: int, rng: np.random.Generator) -> tuple[Path, Path]:
    """Return what a smoothed leader really did beside what is shown of it, and what is shown of that.

    The first is a motion of the leaders' own spectrum less what the smoother makes of its measurement: on top of a smoothed path
    it is one of the paths that the recording allows. The second is that, measured anew and smoothed.

    References
    ----------
    Durbin and Koopman (2002), A simple and efficient simulation smoother for state space time series analysis.
    """
    if noises.leader is None:
        return (np.zeros((rows, frames)),) * 3, measured(noises.measurement, smoothing, rows, frames, rng)
    longer = frames + 4 * MARGIN
    acceleration = noises.leader.draw(rows, longer, rng)
    speed = np.cumsum(acceleration, axis=1) * FRAME_STEP
    position = np.cumsum(speed, axis=1) * FRAME_STEP
    shown = derivatives(position + noises.measurement.draw(rows, longer, rng), smoothing)
    one, two, three = (true - part for true, part in zip((position, speed, acceleration), shown, strict=True))
    truth = _inner((one, two, three))
    again = derivatives(truth[0] + noises.measurement.draw(rows, longer - 2 * MARGIN, rng), smoothing)
    return _inner(truth), _inner(again)


def _leaders(windows: w.Windows, noises: Noises, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return what the twins' drivers see, and what is recorded of it.

    The driver of a recording answered the true leader, of which the recording shows a smoothed one. So the twin's driver answers
    one that may have been smoothed to the recorded one, and the twin's recording shows that, measured and smoothed anew.
    """
    truth, seen = windows.seen.copy(), windows.seen.copy()
    seen[:, :, w.LEADERS] = np.where(np.isfinite(windows.blurred), windows.blurred, seen[:, :, w.LEADERS])
    rows, frames = seen.shape[:2]
    for columns in (w.LEADERS[:3], w.LEADERS[3:]):
        more, shown = hidden(noises, windows.smoothing, rows, frames, rng)
        for column, true, part in zip(columns, more, shown, strict=False):
            truth[:, :, column] += true
            seen[:, :, column] += part
    for name in (w.SPEED, w.SECOND_SPEED):
        np.maximum(truth[:, :, name], 0.0, out=truth[:, :, name])
        np.maximum(seen[:, :, name], 0.0, out=seen[:, :, name])
    return truth, seen


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
    windows: w.Windows, fit: Fit, noises: Noises, rng: np.random.Generator, *, is_smooth: bool = False
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
        twin = make_twin(part, own, replace(noises, driver=noise), rng, is_smooth=is_smooth)
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
