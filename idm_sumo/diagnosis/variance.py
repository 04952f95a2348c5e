"""Where or when drivers are less steady than their null replicates: second moments of the pulses' scores.

Who looks aside, or cannot make up their mind, does not drive faster or slower on average: only the spread tells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis.free_fields import Family
from idm_sumo.diagnosis.pulses import Pulses
from idm_sumo.diagnosis.rollout import BASE_A, BIN

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ALONG = ("position", "time")  # single lanes have too few blocks of drivers
LARGEST = 25.0  # of a squared score, in its own variances: a single outlier is not a place
NARROWEST, WIDEST = 2, 0.7  # bins; share of all
LEAST_SHARE = 0.02  # of the expected squares, in a stretch that is looked at
LEAST_RATIO = 1.2
# m/s², of the model's own acceleration: where it brakes hard, another law than the model's shows more, wherever that is.
EFFORT = np.array([-0.8, -0.4, -0.1, 0.1, 0.4])


class Spread(NamedTuple):
    """Sums of squared scores, and how many there are, both of shape ``(blocks, bins)``."""

    squares: Floats
    counts: Floats


def concerns(family: Family) -> bool:
    """Return whether the spread is looked at along the bins of a family."""
    return family.covariate in ALONG and not family.content


def spread(pulses: Pulses, number: Integers, count: int) -> Spread:
    """Return the squared scores of the pulses, by block of drivers and by the bin in which each pulse begins.

    As shares of what is usual for how hard the model brakes or accelerates then.
    """
    square = np.minimum(pulses.score**2 / np.maximum(pulses.variance, 1e-12), LARGEST)
    block = pulses.windows.platoon[pulses.windows.driver]
    cell = block[:, None] * count + number[:, ::BIN]
    there = (number[:, ::BIN] >= 0) & (pulses.variance > 0.0)
    effort = np.searchsorted(EFFORT, pulses.state[:, ::BIN, BASE_A])
    moments = np.bincount(effort[there], minlength=len(EFFORT) + 1)
    usual = np.bincount(effort[there], square[there], len(EFFORT) + 1) / np.maximum(moments, 1)
    square /= np.maximum(usual, 1e-12)[effort]
    size = (int(pulses.windows.platoon.max()) + 1) * count
    squares = np.asarray(np.bincount(cell[there], square[there], size).reshape(-1, count), dtype=np.float64)
    return Spread(squares, np.bincount(cell[there], minlength=size).reshape(-1, count).astype(np.float64))


class Unsteady(NamedTuple):
    """Bins ``first`` to ``last`` (exclusive) in which the variance is ``ratio`` times the replicates', with its standard errors."""

    first: int
    last: int
    looks: int
    ratio: float
    z: float


def most_unsteady(found: Spread, replicates: Floats, number: int) -> Unsteady | None:
    """Return the stretch in which the spread most surely exceeds the replicates'.

    Parameters
    ----------
    found : Spread
        Of the recording.
    replicates : float64, shape (bins,)
        Mean sum of squares of the replicates; only its course along the bins counts.
    number : int
        Of replicates.
    """
    total, count = found.squares.sum(axis=0), found.counts.sum(axis=0)
    expected = replicates * total.sum() / max(replicates.sum(), 1e-300)
    first, last = np.triu_indices(len(total) + 1, 1)
    known = np.concatenate([[0.0], expected.cumsum()])
    fits = (last - first >= NARROWEST) & (last - first <= WIDEST * len(total))
    fits &= known[last] - known[first] > LEAST_SHARE * known[-1]
    if not fits.any():
        return None
    first, last = first[fits], last[fits]
    own = found.squares - found.counts * total / np.maximum(count, 1.0)
    sums = np.concatenate([np.zeros((len(own), 1)), own.cumsum(axis=1)], axis=1)
    least = 2.0 * (known[last] - known[first]) * total.sum() / max(count.sum(), 1.0)  # of independent squares
    blocks = ((sums[:, last] - sums[:, first]) ** 2).sum(axis=0)
    error = np.sqrt(np.maximum(blocks, least) * (1.0 + 1.0 / number))
    more = np.concatenate([[0.0], (total - expected).cumsum()])
    z = (more[last] - more[first]) / np.maximum(error, 1e-300)
    best = int(np.argmax(z))
    a, b = int(first[best]), int(last[best])
    return Unsteady(a, b, len(z), float(1.0 + (more[b] - more[a]) / (known[b] - known[a])), float(z[best]))
