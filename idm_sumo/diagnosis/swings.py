"""Swings of drivers' own: periods at which their accelerations vary more than null replicates' do.

Each driver swings at a phase of one's own, so that no mean along any covariate shows it. But within a driver the phase is kept over all
windows, which noise of some memory does not: power gathers around a period. The logarithmic spectrum of drivers over that of their
replicates is a smooth curve where only the memory of the noise is off; a bump on it is a swing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis.plan import PERIODS

Floats = npt.NDArray[np.float64]

WIDTHS = (
    0.09,
    0.22,
)  # of the logarithm of a period: of a line of drivers seen for a minute or longer; of periods of one's own
LEAST = 1e-9  # of a variance, where nothing varies
SMOOTH = 3  # powers of the logarithm of the period, of the curve
RIDGE = 0.1  # of the variances, added to the covariance of the drivers' spectra, which few drivers tell


class Swings(NamedTuple):
    """Power at :data:`~idm_sumo.diagnosis.plan.PERIODS`, as shares of each driver's whole.

    Attributes
    ----------
    own : float64, shape (drivers, periods)
    usual : float64, shape (periods,)
        Mean over the replicates' drivers.
    """

    own: Floats
    usual: Floats


class Swing(NamedTuple):
    """The strongest swing: edges of its period (s), how much more than usual the power is, standard errors."""

    low: float
    high: float
    more: float
    z: float


def power(scores: Floats, part: Floats) -> Floats:
    """Return each driver's power by period, as shares of the whole, shape ``(drivers, periods)``; sines come first."""
    sine, cosine = np.split(scores**2 / np.maximum(part, 1e-12), 2, axis=1)
    return np.asarray((sine + cosine) / np.maximum((sine + cosine).sum(axis=1, keepdims=True), 1e-300))


def tried() -> int:
    """Return how many bumps are compared."""
    return len(WIDTHS) * len(_middles())


def strongest(swings: Swings) -> Swing:
    """Return the bump of most standard errors, beside a smooth curve (generalised least squares)."""
    ratio = swings.own / np.maximum(swings.usual, 1e-300)
    mean, count = ratio.mean(axis=0), len(ratio)
    covariance = np.cov(ratio.T) / count
    white = gls.whitener((covariance + np.diag(RIDGE * np.diag(covariance) + LEAST))[None])[0]
    period = np.log(PERIODS)
    curve = np.vander(period - period.mean(), SMOOTH)
    best = Swing(0.0, 0.0, 0.0, -np.inf)
    for width in WIDTHS:
        for middle in _middles():
            bump = np.exp(-0.5 * ((period - period[middle]) / width) ** 2)
            design = white @ np.column_stack([bump, curve])
            inverse = np.linalg.inv(design.T @ design)
            size = (inverse @ (design.T @ (white @ mean)))[0]
            z = float(size / np.sqrt(inverse[0, 0]))
            if z > best.z:
                low, high = (float(np.exp(period[middle] + side * width)) for side in (-1.0, 1.0))
                best = Swing(low, high, float(size), z)
    return best


def _middles() -> range:
    """Return the numbers of periods that have some on both sides: at the end of a falling spectrum anything would be a bump."""
    return range(SMOOTH, len(PERIODS) - SMOOTH)
