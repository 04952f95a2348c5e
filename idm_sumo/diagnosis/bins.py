"""Bins of place, time or any covariate, as accelerations that act in one bin each."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.diagnosis.rollout import BIN
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


def edges_of(values: Floats, width: float, most: int) -> Floats:
    """Return bin edges of about ``width``, or wider for ``most`` bins, that cover the values."""
    low, high = float(values.min()), float(values.max())
    return np.linspace(low, high + 1e-9, 1 + min(max(1, round((high - low) / width)), most))


def numbered(values: Floats, edges: Floats) -> Integers:
    """Return the number of the bin that each value is in, -1 for none."""
    number = np.empty(values.shape, dtype=np.int64)
    _find(values.ravel(), edges, number.ravel())
    return number


@njit(cache=True, nogil=True)
def _find(values, edges, number):  # type: ignore[no-untyped-def]
    """Fill in bin numbers: a guess as if bins were even, then the way from there."""
    low, high = edges[0], edges[-1]
    scale, most = (len(edges) - 1) / (high - low), len(edges) - 2
    for n in range(len(values)):
        value = values[n]
        if not low <= value < high:
            number[n] = -1
            continue
        place = min(int((value - low) * scale), most)
        while edges[place] > value:
            place -= 1
        while edges[place + 1] <= value:
            place += 1
        number[n] = place


def pulse_means(field: Floats) -> Floats:
    """Return the means over pulses of a field by frame; shape ``(windows, horizon)`` to ``(windows, pulses)``."""
    return np.ascontiguousarray(field.reshape(len(field), -1, BIN).mean(axis=2))


def sums_by_bin(number: Integers, value: Floats, count: int) -> Floats:
    """Return the sums of values over all frames that are in each bin, shape ``(count,)``."""
    out = np.zeros(count)
    _add(number.reshape(-1), value.reshape(-1), out)
    return out


@njit(cache=True, nogil=True)
def _add(number, value, out):  # type: ignore[no-untyped-def]
    for n in range(len(number)):
        if number[n] >= 0:
            out[number[n]] += value[n]


def response_by_bin(response: Floats, number: Integers, value: Floats | None, out: Floats) -> None:
    """Add the response to a field that acts in one bin only, for each bin.

    Parameters
    ----------
    response : float64, shape (windows, moments, pulses)
        Of :func:`idm_sumo.diagnosis.rollout.respond`.
    number : int64, shape (windows, horizon)
        Bin of each frame, -1 for none.
    value : float64, shape (windows, horizon), optional
        The field; 1 if not given.
    out : float64, shape (windows, moments, bins or more)
    """
    field = np.ones(number.shape) if value is None else np.ascontiguousarray(value)
    in_threads(_respond, len(number), response, np.ascontiguousarray(number), field, out)


@njit(cache=True, nogil=True)
def _respond(first, last, response, number, value, out):  # type: ignore[no-untyped-def]
    """Add up window by window: only the few bins that a window is in take part."""
    for i in range(first, last):
        for p in range(response.shape[2]):
            k, end = p * BIN, (p + 1) * BIN
            while k < end:
                place, whole = number[i, k], 0.0
                while k < end and number[i, k] == place:
                    whole += value[i, k] / BIN
                    k += 1
                if place >= 0:
                    for moment in range(response.shape[1]):
                        out[i, moment, place] += response[i, moment, p] * whole
