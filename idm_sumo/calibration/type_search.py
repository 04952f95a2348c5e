"""Search among vehicle types: ``a, b, T, d0`` without ``d1``."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration import integrators
from idm_sumo.models import idm

Floats = npt.NDArray[np.float64]

DESIGN = 128  # starts that are screened
# Search coordinates: accelerations act by proportion, so their logarithms; the gap is linear
# in T and d0, so these themselves, in units that make a step weigh about the same.
T_UNIT, D_UNIT = 1.0, 2.5  # s, m
FIRST_STEP, LAST_STEP = 0.4, 2e-3  # of the search, in those coordinates
SMALLEST_DROP = 1e-3  # relative: a sweep that gains less halves the step


def design_of_types() -> Floats:
    """Return search coordinates that cover all types without ``d1``.

    Shape ``(points, 4)``.
    """
    from scipy.stats import qmc  # here: scipy.stats takes long to load

    return np.asarray(LOWER + qmc.Sobol(4, scramble=True, rng=20050615).random(DESIGN) * (UPPER - LOWER))


def to_search(parameters: npt.ArrayLike) -> Floats:
    """Return the search coordinates, without ``d1``, of parameters.

    Parameters
    ----------
    parameters : array_like, shape (..., 5)
        ``a, b, T, d0, d1``.

    Returns
    -------
    float64, shape (..., 4)
    """
    values = np.asarray(parameters, dtype=np.float64)
    return np.concatenate([np.log(values[..., :2]), values[..., 2:3] / T_UNIT, values[..., 3:4] / D_UNIT], axis=-1)


LOWER, UPPER = to_search(idm.LOWER), to_search(idm.UPPER)


@njit(cache=True)
def from_search(z):  # type: ignore[no-untyped-def]
    """Return ``a, b, T, d0, 0``.

    Parameters
    ----------
    z : float64, shape (4,)
        Search coordinates.
    """
    return np.array([np.exp(z[0]), np.exp(z[1]), z[2] * T_UNIT, z[3] * D_UNIT, 0.0])


@njit(cache=True)
def mean_ade(p, begin, end, z, scheme):  # type: ignore[no-untyped-def]
    """Return the mean ADE (m) of some windows.

    Parameters
    ----------
    p : Problem
    begin, end : int
        First window, and the one after the last.
    z : float64, shape (4,)
        Search coordinates.
    scheme : int
        Code of the integration.
    """
    theta, total = from_search(z), 0.0
    for i in range(begin, end):
        total += integrators.ade_one(p, i, theta, scheme)
    return total / (end - begin)


@njit(cache=True)
def compass_search(p, begin, end, z, scheme):  # type: ignore[no-untyped-def]
    """Lower the ADE along the axes, in place.

    In steps that halve when none leads down. After a sweep that moved, the whole move is made once more
    (Hooke and Jeeves, 1961), which follows narrow valleys that lie across the axes.

    Parameters
    ----------
    p : Problem
    begin, end : int
        First window, and the one after the last.
    z : float64, shape (4,)
        Search coordinates.
    scheme : int
        Code of the integration.
    """
    value, step = mean_ade(p, begin, end, z, scheme), FIRST_STEP
    while step > LAST_STEP:
        before, was, trial = z.copy(), value, z.copy()
        for axis in range(4):
            for sign in (1.0, -1.0):
                trial[axis] = min(max(z[axis] + sign * step, LOWER[axis]), UPPER[axis])
                new = mean_ade(p, begin, end, trial, scheme)
                if new < value:
                    value, z[axis] = new, trial[axis]
                    break
            trial[axis] = z[axis]
        trial[:] = np.minimum(np.maximum(2.0 * z - before, LOWER), UPPER)
        new = mean_ade(p, begin, end, trial, scheme)
        if new < value:
            value, z[:] = new, trial
        if not value < (1.0 - SMALLEST_DROP) * was:
            step *= 0.5
    return value
