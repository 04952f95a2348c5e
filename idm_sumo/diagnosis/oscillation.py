"""A driver's own oscillation: a line in the spectrum of the pulses' scores that the null replicates have not.

A throttle that swings with a period of its own has no mean along any covariate, and its phase is every driver's own. But within
a driver it keeps its phase over all windows, which noise of some memory does not: its power gathers in one line. Where each has
another period, no line stands out on average, but each driver's strongest one does. Where each is seen for two or three periods only, as in
light traffic, no line of one driver is narrow, but those of all together are a swell around the periods that they have.
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
from idm_sumo.recordings.columns import FRAME_STEP

Floats = npt.NDArray[np.float64]

PERIODS = np.geomspace(4.0, 40.0, 40)  # s; faster swings are what unstable following and smoothing leave
NEAR, AROUND = 2, 8  # periods that a line covers to each side, and up to which it is compared
LEAST_BESIDE = 3  # of them, on each side: at the end of a falling spectrum anything would be a line
# Of a line to what is around it, and of the drivers' strongest lines to the replicates'. (Of 118 recordings with nothing hidden the largest were
# 1.20 and 1.05.)
LEAST_RATIO, LEAST_OWN_RATIO = 1.22, 1.07
# Of a swell: its width, of the logarithm of a period; periods in which it may have its middle, and among which it is looked for; and how much
# it must be of the power around it. (Of 64 recordings with nothing hidden the largest was 0.18, with 3.3 standard errors; of seven in which each
# driver of light traffic had a period of its own five had 0.29 to 0.53, with 4.0 to 6.9, and two less than 0.14, with less than 2.)
SWELL_WIDTH, SWELLS, AROUND_SWELL = 0.22, np.geomspace(6.5, 12.0, 10), (PERIODS > 4.5) & (PERIODS < 30.0)
LEAST_SWELL = 0.25
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


def usual(replicates: Sequence[Floats]) -> Floats:
    """Return the mean over drivers and replicates, shape ``(periods,)``, of replicates' spectra."""
    return np.asarray(np.mean([replicate.mean(axis=0) for replicate in replicates], axis=0))


def _beside(excess: Floats) -> Floats:
    """Return the larger median of what is to either side of each period, farther than ``NEAR`` periods and up to ``AROUND``."""
    number = np.arange(len(excess))
    far = number - number[:, None]
    sides = [(side * far > NEAR) & (side * far <= AROUND) for side in (-1, 1)]
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


def line(found: Floats, replicates: Floats) -> Line:
    """Return the strongest line: what is more than the periods to either side of it are.

    Parameters
    ----------
    found : float64, shape (drivers, periods)
        Of the recording.
    replicates : float64, shape (periods,)
        Mean over the replicates' drivers.
    """
    excess = found.mean(axis=0) / np.maximum(replicates, 1e-300)
    around = _beside(excess)
    ratio = excess / around
    error = found.std(axis=0) / np.sqrt(len(found)) / np.maximum(replicates * around, 1e-300)
    best = int(np.argmax(ratio))
    edges = (PERIODS[max(best - 1, 0)], PERIODS[min(best + 1, len(PERIODS) - 1)])
    z = float((ratio[best] - 1.0) / error[best])
    return Line(float(edges[0]), float(edges[1]), float(ratio[best]), z, bool(ratio[best] > LEAST_RATIO))


def own_lines(found: Floats, replicates: Sequence[Floats]) -> Line:
    """Return by how much each driver's strongest line, at whatever period, is stronger than in the replicates.

    Parameters
    ----------
    found : float64, shape (drivers, periods)
        Of the recording.
    replicates : sequence of float64, shape (drivers, periods)
        Of each replicate.
    """
    own, theirs = _log_peaks(found), np.concatenate([_log_peaks(replicate) for replicate in replicates])
    more = own.mean() - theirs.mean()
    z = more / np.sqrt(max(own.var() / len(own) + theirs.var() / len(theirs), 1e-300))
    low, high = PERIODS[OWN_BAND][[0, -1]]
    return Line(float(low), float(high), float(np.exp(more)), float(z), bool(np.exp(more) > LEAST_OWN_RATIO))


def swell(found: Floats, replicates: Sequence[Floats]) -> Line:
    """Return the surest swell: what is more around some period than a smooth spectrum, of the same as :func:`own_lines`.

    Noise of some memory may be another's than the replicates' have, but it is smooth: a parabola, over the logarithm of the period.
    """
    expected = usual(replicates)
    each = _flat(found, expected) / usual([_flat(replicate, expected) for replicate in replicates])
    weights = np.array([_weights_of_swell(np.log(PERIODS[AROUND_SWELL] / middle)) for middle in SWELLS])
    shares = each[:, AROUND_SWELL] @ weights.T
    size, error = shares.mean(axis=0), np.maximum(shares.std(axis=0) / np.sqrt(len(shares)), 1e-300)
    best = int(np.argmax(size / error))
    low, high = SWELLS[best] * np.exp([-SWELL_WIDTH, SWELL_WIDTH])
    return Line(
        float(low),
        float(high),
        float(1.0 + size[best]),
        float(size[best] / error[best]),
        bool(size[best] > LEAST_SWELL),
    )


def _flat(power: Floats, expected: Floats) -> Floats:
    """Return each driver's power over what is expected at its period, and over its mean."""
    excess = power / np.maximum(expected, 1e-300)
    return np.asarray(excess / np.maximum(excess.mean(axis=1, keepdims=True), 1e-300))


def _weights_of_swell(far: Floats) -> Floats:
    """Return the weights by which periods so far (of the logarithm) from a middle say how large a swell there is, beside a parabola."""
    swell = np.exp(-0.5 * (far / SWELL_WIDTH) ** 2)
    return np.asarray(np.linalg.pinv(np.column_stack([swell, np.ones_like(far), far, far**2]))[0])


def _log_peaks(power: Floats) -> Floats:
    """Return the logarithm of each driver's strongest line over its mean; of a spectrum that is flat for all together."""
    flat = power[:, OWN_BAND] / np.maximum(power[:, OWN_BAND].mean(axis=0), 1e-300)
    return np.asarray(np.log(np.maximum(flat.max(axis=1), 1e-300) / np.maximum(flat.mean(axis=1), 1e-300)))
