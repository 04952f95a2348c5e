"""The interval, or the rectangle, in which a field says most: plain algebra on scores and their Gram matrix."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

LEAST_INFORMATION = 2e-3  # of the most informative interval's: what is known less about is not looked at


class Stretch(NamedTuple):
    """Bins ``first`` to ``last`` (exclusive) along each axis, how many such were compared, and what they say."""

    first: tuple[int, ...]
    last: tuple[int, ...]
    looks: int
    score: float
    information: float

    def inside(self, shape: tuple[int, ...]) -> Floats:
        """Return 1 in the bins of the stretch and 0 elsewhere, flat."""
        mask = np.zeros(shape)
        mask[tuple(slice(a, b) for a, b in zip(self.first, self.last, strict=True))] = 1.0
        return mask.ravel()


def best_stretch(
    total: Floats, gram: Floats, shape: tuple[int, ...], narrowest: int = 1, widest: float = 1.0, of_sign: float = 0.0
) -> Stretch | None:
    """Return the stretch of neighbouring bins with the largest score over its standard error.

    Parameters
    ----------
    total : float64, shape (bins,)
    gram : float64, shape (bins, bins)
    shape : tuple of int
        Bins along one axis, or along two.
    narrowest : int
        Bins along each axis.
    widest : float
        Share of the bins along each axis.
    of_sign : float
        Of the score; 0 for either.

    Returns
    -------
    Stretch or None
        None if nothing is known about any, or nothing is there.
    """
    sums = _prefix(total.reshape(shape), range(len(shape)))
    both = _prefix(gram.reshape(shape + shape), range(2 * len(shape)))
    first, last = _stretches(shape)
    fits = np.ones(len(first[0]), dtype=bool)
    for a, b, count in zip(first, last, shape, strict=True):
        fits &= (b - a >= min(narrowest, count)) & (b - a <= max(widest * count, 1.0))
    first, last = tuple(a[fits] for a in first), tuple(b[fits] for b in last)
    corners = _corners(first, last)
    score = np.sum([sign * sums[at] for sign, at in corners], axis=0)
    information = np.sum([s * t * both[a + b] for s, a in corners for t, b in corners], axis=0)
    if not len(information) or information.max() <= 1e-6:
        return None
    known = information > LEAST_INFORMATION * information.max()
    known &= of_sign * score >= 0.0
    squared = np.where(known, score**2 / np.maximum(information, 1e-9), 0.0)
    best = int(np.argmax(squared))
    if squared[best] == 0.0:
        return None
    return Stretch(
        tuple(int(a[best]) for a in first), tuple(int(b[best]) for b in last), int(known.sum()), float(score[best]),
        float(information[best]),
    )  # fmt: skip


def beyond_margins(total: Floats, gram: Floats, stretch: Stretch, shape: tuple[int, ...]) -> float:
    """Return the standard errors of a rectangle's score beyond what whole rows and whole columns of bins say.

    Parameters as of :func:`best_stretch`.
    """
    row, column = np.indices(shape).reshape(2, -1)
    margins: Floats = np.hstack([np.eye(shape[0])[row], np.eye(shape[1])[column]])
    field = stretch.inside(shape)
    held = np.linalg.pinv(margins.T @ gram @ margins, hermitian=True) @ (margins.T @ (gram @ field))
    rest = field - margins @ held
    return float(rest @ total / np.sqrt(np.maximum(rest @ gram @ rest, 1e-9)))


def _prefix(values: Floats, axes: range) -> Floats:
    """Return the sums of everything before each edge."""
    for axis in axes:
        values = np.insert(values.cumsum(axis=axis), 0, 0.0, axis=axis)
    return values


def _stretches(shape: tuple[int, ...]) -> tuple[tuple[Integers, ...], tuple[Integers, ...]]:
    """Return first and last edge of all stretches, by axis."""
    each = [np.triu_indices(count + 1, 1) for count in shape]
    grids = np.meshgrid(*(np.arange(len(first)) for first, _ in each), indexing="ij")
    return (
        tuple(first[g.ravel()] for (first, _), g in zip(each, grids, strict=True)),
        tuple(last[g.ravel()] for (_, last), g in zip(each, grids, strict=True)),
    )


def _corners(first: tuple[Integers, ...], last: tuple[Integers, ...]) -> list[tuple[float, tuple[Integers, ...]]]:
    """Return the corners of stretches with the signs of inclusion and exclusion."""
    corners: list[tuple[float, tuple[Integers, ...]]] = [(1.0, ())]
    for a, b in zip(first, last, strict=True):
        corners = [(s * t, (*at, edge)) for s, at in corners for t, edge in ((1.0, b), (-1.0, a))]
    return corners


def corrected_p(z: float, looks: int) -> float:
    """Return the two-sided p-value of so many standard errors, corrected for the number of looks (Bonferroni)."""
    return float(min(1.0, looks * 2.0 * norm.sf(abs(z))))
