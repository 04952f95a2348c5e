"""Bins of place, time or any covariate, as accelerations that act in one bin each."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.diagnosis.rollout import BIN
from idm_sumo.threads import in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


def edges_of(values: Floats, width: float) -> Floats:
    """Return bin edges of about ``width`` that cover the values."""
    low, high = float(values.min()), float(values.max())
    return np.linspace(low, high + 1e-9, max(2, round((high - low) / width) + 1))


def numbered(values: Floats, edges: Floats) -> Integers:
    """Return the number of the bin that each value is in, -1 for none."""
    number = np.searchsorted(edges, values, side="right") - 1
    return np.where(number < len(edges) - 1, number, -1)


def pulses_by_bin(number: Integers, count: int, value: Floats | None = None) -> Floats:
    """Return the mean over each pulse of a field that acts in one bin only, for each bin.

    Parameters
    ----------
    number : int64, shape (windows, horizon)
        Bin of each frame, -1 for none.
    count : int
        Number of bins.
    value : float64, shape (windows, horizon), optional
        The field; 1 if not given.

    Returns
    -------
    float64, shape (windows, pulses, count)
    """
    out = np.zeros((len(number), number.shape[1] // BIN, count))
    field = np.ones(number.shape) if value is None else np.ascontiguousarray(value)
    in_threads(_fill, len(number), np.ascontiguousarray(number), field, out)
    return out


@njit(cache=True, nogil=True)
def _fill(first, last, number, value, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for k in range(out.shape[1] * BIN):
            if number[i, k] >= 0:
                out[i, k // BIN, number[i, k]] += value[i, k] / BIN
