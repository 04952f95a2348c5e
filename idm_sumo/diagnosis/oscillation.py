"""A driver's own oscillation: a line in the spectrum of the pulses' scores that the null twins have not.

A throttle that swings with a period of its own has no mean along any covariate, and its phase is every driver's own. But within
a driver it keeps its phase over all windows, which noise of some memory does not: its power gathers in one line. Where each has
another period, no line stands out on average, but each driver's strongest one does. Where each is seen for two or three periods only, as in
light traffic, no line of one driver is narrow, but that of all together is a swell around the periods that they have.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.pulses import Pulses
from idm_sumo.diagnosis.rollout import BIN
from idm_sumo.road import FRAME_STEP

Floats = npt.NDArray[np.float64]

PERIODS = np.geomspace(4.0, 40.0, 40)  # s; faster swings are what unstable following and smoothing leave
NEAR, AROUND = 2, 8  # periods that a line covers to each side, and up to which it is compared
LEAST_BESIDE = 3  # of them, on each side: at the end of a falling spectrum anything would be a line
# Of a line to what is around it, and of the drivers' strongest lines to the twins'. (Of 118 recordings with nothing hidden the largest were
# 1.20 and 1.05.)
LEAST_RATIO, LEAST_OWN_RATIO = 1.22, 1.07
# The factor of a period up to which a swell reaches; periods near it, and up to which it is compared; its power to that of either side. (Of 20
# recordings with nothing hidden the largest was 1.16, of US-101 and the surrogate 0.92; of five in which each driver of light traffic had a
# period of its own three had 1.38 to 1.57, and two 1.08 and 1.11.)
SWELL, NEAR_SWELL, AROUND_SWELL = 1.2, 6, 16
LEAST_SWELL = 1.28
OWN_BAND = (PERIODS > 5.0) & (PERIODS < 14.0)  # in which each driver may have a period of its own


def spectrum(pulses: Pulses) -> Floats:
    """Return each driver's power at ``PERIODS``, as shares of its whole; shape ``(drivers, periods)``."""
    windows = pulses.windows
    middle = np.arange(BIN).mean() + BIN * np.arange(
        pulses.score.shape[1]
    )  # frames from the start to each pulse's middle
    turned = np.exp(2j * np.pi * FRAME_STEP * middle[:, None] / PERIODS)
    begin = np.exp(2j * np.pi * windows.seen[:, w.TIME, w.LEAD][:, None] / PERIODS)
    power = np.abs(gls.by_driver(begin * (pulses.score @ turned), windows.driver, windows.drivers)) ** 2
    return np.asarray(power / np.maximum(power.sum(axis=1, keepdims=True), 1e-300))


def _beside(excess: Floats, near: int, around: int) -> Floats:
    """Return the larger median of what is to either side of each period, farther than ``near`` periods and up to ``around``."""
    number = np.arange(len(excess))
    far = number - number[:, None]
    sides = [(side * far > near) & (side * far <= around) for side in (-1, 1)]
    return np.asarray(np.max([[_median(excess[row]) for row in side] for side in sides], axis=0))


def _median(values: Floats) -> float:
    """Return the median of periods on one side; infinite if they are too few to compare with."""
    return float(np.median(values)) if len(values) >= LEAST_BESIDE else np.inf


class Line(NamedTuple):
    """A line of the spectrum: edges of its period (s), its power over that around it, standard errors; whether it is strong enough."""

    low: float
    high: float
    ratio: float
    z: float
    is_strong: bool


def line(found: Floats, twins: Floats) -> Line:
    """Return the strongest line: what is more than the periods to either side of it are.

    Parameters
    ----------
    found : float64, shape (drivers, periods)
        Of the recording.
    twins : float64, shape (periods,)
        Mean over the twins' drivers.
    """
    excess = found.mean(axis=0) / np.maximum(twins, 1e-300)
    usual = _beside(excess, NEAR, AROUND)
    ratio = excess / usual
    error = found.std(axis=0) / np.sqrt(len(found)) / np.maximum(twins * usual, 1e-300)
    best = int(np.argmax(ratio))
    edges = (PERIODS[max(best - 1, 0)], PERIODS[min(best + 1, len(PERIODS) - 1)])
    z = float((ratio[best] - 1.0) / error[best])
    return Line(float(edges[0]), float(edges[1]), float(ratio[best]), z, bool(ratio[best] > LEAST_RATIO))


def own_lines(found: Floats, twins: Sequence[Floats]) -> Line:
    """Return by how much each driver's strongest line, at whatever period, is stronger than in the twins.

    Parameters
    ----------
    found : float64, shape (drivers, periods)
        Of the recording.
    twins : sequence of float64, shape (drivers, periods)
        Of each twin.
    """
    own, theirs = _log_peaks(found), np.concatenate([_log_peaks(twin) for twin in twins])
    more = own.mean() - theirs.mean()
    z = more / np.sqrt(max(own.var() / len(own) + theirs.var() / len(theirs), 1e-300))
    low, high = PERIODS[OWN_BAND][[0, -1]]
    return Line(float(low), float(high), float(np.exp(more)), float(z), bool(np.exp(more) > LEAST_OWN_RATIO))


def swell(found: Floats, twins: Floats) -> Line:
    """Return the strongest swell: periods around which there is more than far off on either side; of the same as :func:`line`."""
    excess = found.mean(axis=0) / np.maximum(twins, 1e-300)
    usual, periods = _beside(excess, NEAR_SWELL, AROUND_SWELL)[OWN_BAND], PERIODS[OWN_BAND]
    inside = np.abs(np.log(PERIODS[:, None] / periods)) < np.log(SWELL)
    core = inside / inside.sum(axis=0)
    each = (found @ core) / np.maximum((twins @ core) * usual, 1e-300)
    best = int(np.argmax(each.mean(axis=0)))
    ratio, error = float(each[:, best].mean()), float(each[:, best].std() / np.sqrt(len(each)))
    low, high = float(periods[best] / SWELL), float(periods[best] * SWELL)
    return Line(low, high, ratio, (ratio - 1.0) / max(error, 1e-300), ratio > LEAST_SWELL)


def _log_peaks(power: Floats) -> Floats:
    """Return the logarithm of each driver's strongest line over its mean; of a spectrum that is flat for all together."""
    flat = power[:, OWN_BAND] / np.maximum(power[:, OWN_BAND].mean(axis=0), 1e-300)
    return np.asarray(np.log(np.maximum(flat.max(axis=1), 1e-300) / np.maximum(flat.mean(axis=1), 1e-300)))
