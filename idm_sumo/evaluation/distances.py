"""Distances of two distributions, with bootstrap intervals over vehicles.

The rows of one vehicle are not independent, so whole vehicles are resampled (a cluster
bootstrap). The values are counted on a fine grid first, and both distances are those of the
gridded values.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

CELLS = 500  # of the grid
RESAMPLES = 200
CONFIDENCE = 0.95


class Sample(NamedTuple):
    """Values of many vehicles.

    Attributes
    ----------
    values : float64, shape (n,)
        Values.
    vehicle : int64, shape (n,)
        Label of the vehicle that each belongs to.
    """

    values: Floats
    vehicle: npt.NDArray[np.int64]


class Distance(NamedTuple):
    """Two distances of two samples, with 95 % bootstrap intervals.

    The intervals are percentile intervals. Resampling adds scatter, so an interval does not reach zero
    and lies above the estimate where the samples hardly differ.

    Attributes
    ----------
    wasserstein, wasserstein_low, wasserstein_high : float
        Mean distance by which values must be moved, in their unit.
    ks, ks_low, ks_high : float
        Largest difference of the distribution functions (Kolmogorov-Smirnov).
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
        Samples in the same unit.
    upper : float
        Values below 0 count as 0, and above this as this.
    rng : numpy.random.Generator
        Source of the bootstrap's draws.
    resamples : int
        Bootstrap draws.

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
    """Return the histogram of each vehicle, shape ``(vehicles, cells)``."""
    vehicles, row = np.unique(sample.vehicle, return_inverse=True)
    cells = len(edges) - 1
    cell = np.clip(np.searchsorted(edges, sample.values, side="right") - 1, 0, cells - 1)
    return np.bincount(row * cells + cell, minlength=len(vehicles) * cells).reshape(-1, cells).astype(np.float64)


def _resampled(counts: Floats, rng: np.random.Generator, resamples: int) -> Floats:
    """Return histograms of vehicles drawn with replacement.

    The shape is ``(resamples, cells)``.
    """
    n = len(counts)
    return np.asarray(rng.multinomial(n, np.full(n, 1.0 / n), size=resamples) @ counts)


def _distances(middle: Floats, one: Floats, other: Floats) -> tuple[float, float]:
    """Return the Wasserstein and Kolmogorov-Smirnov distances of two histograms."""
    from scipy.stats import wasserstein_distance  # here: scipy.stats takes long to load

    w = float(wasserstein_distance(middle, middle, one, other))
    difference = np.cumsum(one) / one.sum() - np.cumsum(other) / other.sum()
    return w, float(np.abs(difference).max())
