"""Null replicates: the same traffic, driven by the fitted model, measured and smoothed as the recording was.

Whatever effect a replicate shows was made by noise, smoothing and refitting, for none is in it beyond those already accepted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.optimize import nnls

from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import noise as no
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Chance, Noises, draw
from idm_sumo.diagnosis.fit import LOWER, UPPER, Fit, improve
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.rollout import drive, positions
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]


def make_replicate(
    windows: w.Windows, fit: Fit, chance: Chance, *, is_smooth: bool = False, behind: Floats | float = 0.0
) -> w.Windows:
    """Return the windows of a recording in which every follower drives by the model of ``fit``.

    ``is_smooth`` says that the recording was smooth as it came, so that nothing is smoothed; ``behind`` (m) is by how much each
    window's follower starts behind the recorded one.
    """
    seen = windows.seen.copy()  # first with what the replicates' drivers see, then with what is recorded of it
    in_threads(_add_to_leaders, len(seen), chance.hidden, seen)
    seen[:, w.X, 0] -= behind
    x, v = drive(seen, windows.driver, fit.theta, fit.by_lane, np.zeros(2), chance.pushed, 0)
    if not is_smooth:
        x, v, _ = windows.own.within(x, v)
    seen[:, w.LEADERS] = windows.blurred
    in_threads(_add_to_leaders, len(seen), chance.shown, seen)
    seen[:, w.X], seen[:, w.V] = x + chance.error[0], np.maximum(v + chance.error[1], 0.0)
    return replace(windows, seen=seen)


# The driver of a recording answered the true leader, of which the recording shows a smoothed one. So the replicate's driver answers
# one that may have been smoothed to the recorded one, and the replicate's recording shows that, measured and smoothed anew.
@njit(cache=True, nogil=True)
def _add_to_leaders(first, last, more, seen):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for n in range(len(w.LEADERS)):
            for k in range(seen.shape[2]):
                seen[i, w.LEADERS[n], k] += more[i, n, k]
        for name in (w.SPEED, w.SECOND_SPEED):
            for k in range(seen.shape[2]):
                if seen[i, name, k] < 0.0:  # not of one that is not there (NaN)
                    seen[i, name, k] = 0.0


def drawn_anew(fit: Fit, chance: Chance) -> Fit:
    """Return the fit with drivers drawn from its population.

    Fitted drivers carry a part of whatever differs between them: who followed a truck has been fitted a longer headway. Their
    replicates show that part again, so for such effects replicates of drawn drivers are the null.
    """
    own = fit.mean + chance.drivers @ np.linalg.cholesky(fit.spread).T
    return replace(fit, own=np.clip(own, LOWER, UPPER))


def driven_again(
    windows: w.Windows,
    fit: Fit,
    chance: Chance,
    *,
    drawn: bool,
    is_smooth: bool,
    having: Callable[[Fit], Fit] = lambda fit: fit,
) -> tuple[w.Windows, Fit]:
    """Return the windows, driven once more by the fitted drivers or by ``drawn`` ones, and those drivers.

    What they are ``having`` beside, they drive with; the drivers that are returned are without it.
    """
    drivers = drawn_anew(fit, chance) if drawn else fit
    behind = start_behind(windows, fit, drivers) if drawn else 0.0
    return make_replicate(windows, having(drivers), chance, is_smooth=is_smooth, behind=behind), drivers


def start_behind(windows: w.Windows, fitted: Fit, drawn: Fit) -> Floats:
    """Return by how much (m) drawn drivers start behind where the recorded ones did: as much as they keep larger gaps."""
    speed, gap = windows.seen[:, w.V, 0], windows.seen[:, w.REAR, 0] - windows.seen[:, w.X, 0]
    more = _steady_gap(drawn.theta[windows.driver], speed) - _steady_gap(fitted.theta[windows.driver], speed)
    return np.asarray(np.clip(more, -CLOSER * gap, FARTHER * gap))


def _steady_gap(theta: Floats, speed: Floats) -> Floats:
    """Return the gap (m) at which each driver would keep the speed (m/s); parameters a, b, T, d0, v0."""
    free = np.maximum(1.0 - (speed / theta[:, 4]) ** 4, 0.2)
    return np.asarray((theta[:, 3] + speed * theta[:, 2]) / np.sqrt(free))


CLOSER, FARTHER = 0.4, 0.8  # of the recorded gap, by which a drawn driver may start otherwise
TRIAL = 0.04  # m^2/s^4, variance of the trial noises
TRIAL_WINDOWS = 1000
LEAST_LEFT = 1e-6  # of what is left altogether, along every direction


def refit(replicate: w.Windows, fit: Fit) -> Fit:
    """Return the replicate's drivers and weights, fitted as the recording's were; spreads and covariance are the recording's."""
    fitted = improve(replicate, improve(replicate, fit, hyper=False))
    return replace(fitted, spread=fit.spread, residual=fit.residual)


def driver_noise(
    windows: w.Windows, fit: Fit, noises: Noises, rng: np.random.Generator, *, is_smooth: bool = False
) -> Noise:
    """Return the drivers' acceleration noise (m²/s⁴) that leaves the residuals that the recording leaves.

    One trial replicate for each memory, and one without, of the same chance otherwise; the covariances of what is left after refitting
    are mixed by non-negative least squares, each direction by what the recording leaves along it (generalised least squares:
    where errors are large they vary together, and would drown how fast drivers change).
    """
    some = np.arange(min(windows.drivers, max(40, TRIAL_WINDOWS * windows.drivers // max(len(windows.seen), 1))))
    part = windows.of_drivers(some)
    kept = np.isin(windows.driver, some)
    own = replace(fit, own=fit.own[some], weight=fit.weight[kept])
    chance = draw(part, replace(noises, driver=no.QUIET), rng)

    def left(noise: Noise) -> Floats:
        pushed = noise.draw(len(chance.pushed), chance.pushed.shape[1], rng)
        replicate = make_replicate(part, own, replace(chance, pushed=pushed), is_smooth=is_smooth)
        return _left_over(replicate, refit(replicate, own))

    without, wanted = left(no.QUIET), _left_over(part, own)
    white = gls.whitener((wanted + LEAST_LEFT * np.trace(wanted) * np.eye(len(wanted)))[None])[0]

    def along(covariance: Floats) -> Floats:
        return np.asarray(white @ (covariance - without) @ white.T).ravel()

    trials = [left(Noise(0.0, variance, no.DRIVER_MEMORIES)) for variance in np.eye(len(no.DRIVER_MEMORIES)) * TRIAL]
    solved, _ = nnls(np.stack([along(trial) for trial in trials], axis=1), along(wanted))
    return Noise(0.0, TRIAL * solved, no.DRIVER_MEMORIES)


def _left_over(windows: w.Windows, fit: Fit) -> Floats:
    """Return the weighted second moments of what the fit leaves (m²), shape ``(moments, moments)``."""
    error = windows.target - positions(windows, fit.theta, fit.by_lane)
    return np.asarray((error * fit.weight[:, None]).T @ error / len(error))
