r"""How far apart two distributions are, with an interval that respects what is independent: vehicles.

Rows of one vehicle resemble each other, so whole vehicles are resampled (a cluster
bootstrap). The values are counted on a fine grid first; both distances are those of the
gridded values.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import wasserstein_distance

Floats = npt.NDArray[np.float64]

CELLS = 500  # of the grid
RESAMPLES = 200
CONFIDENCE = 0.95


class Sample(NamedTuple):
    """Values of many vehicles.

    Attributes
    ----------
    values : float64, shape (n,)
    vehicle : int64, shape (n,)
        Number of the vehicle each belongs to; any numbers, equal for one vehicle.
    """

    values: Floats
    vehicle: npt.NDArray[np.int64]


class Distance(NamedTuple):
    """Two distances of two samples, each with the ends of its 95 % bootstrap interval.

    ``wasserstein`` is the mean distance values must be moved by, in their unit; ``ks`` the
    largest difference of the distribution functions (Kolmogorov-Smirnov). The interval is
    the percentile interval. Resampling adds scatter, so it cannot reach down to zero and lies above
    the estimate where the samples hardly differ.
    """

    wasserstein: float
    wasserstein_low: float
    wasserstein_high: float
    ks: float
    ks_low: float
    ks_high: float


UNKNOWN = Distance(*(np.nan,) * 6)


def distance(
    one: Sample, other: Sample, *, upper: float, rng: np.random.Generator, resamples: int = RESAMPLES
) -> Distance:
    """Return the distances of two samples.

    Parameters
    ----------
    one, other : Sample
    upper : float
        Values below 0 and above this count as 0 and as this.
    rng : numpy.random.Generator
    resamples : int

    Returns
    -------
    Distance
        NaN if a sample is empty.
    """
    if not len(one.values) or not len(other.values):
        return UNKNOWN
    edges = np.linspace(0.0, upper, CELLS + 1)
    counts = _counts(one, edges), _counts(other, edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    w, ks = _distances(middle, counts[0].sum(axis=0), counts[1].sum(axis=0))
    drawn = [_resampled(table, rng, resamples) for table in counts]
    spread = np.array([_distances(middle, a, b) for a, b in zip(*drawn, strict=True)])
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = np.quantile(spread, [tail, 1.0 - tail], axis=0)
    return Distance(w, float(low[0]), float(high[0]), ks, float(low[1]), float(high[1]))


def _counts(sample: Sample, edges: Floats) -> Floats:
    """Return how often each vehicle's values fall in each cell, shape ``(vehicles, cells)``."""
    vehicles, row = np.unique(sample.vehicle, return_inverse=True)
    cells = len(edges) - 1
    cell = np.clip(np.searchsorted(edges, sample.values, side="right") - 1, 0, cells - 1)
    return np.bincount(row * cells + cell, minlength=len(vehicles) * cells).reshape(-1, cells).astype(np.float64)


def _resampled(counts: Floats, rng: np.random.Generator, resamples: int) -> Floats:
    """Return the counts of vehicles drawn with replacement, shape ``(resamples, cells)``."""
    n = len(counts)
    return np.asarray(rng.multinomial(n, np.full(n, 1.0 / n), size=resamples) @ counts)


def _distances(middle: Floats, one: Floats, other: Floats) -> tuple[float, float]:
    """Return Wasserstein's and Kolmogorov and Smirnov's distance of two histograms."""
    w = float(wasserstein_distance(middle, middle, one, other))
    difference = np.cumsum(one) / one.sum() - np.cumsum(other) / other.sum()
    return w, float(np.abs(difference).max())
