"""The vehicle type nearest to all windows of a driver.

Damped Gauss-Newton steps on the mean ADE: every frame's error is weighted by its inverse, which makes squares of
absolute values, and weighted anew at each step. Steps along the axes finish, where the error has corners.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration import integrators
from idm_sumo.calibration.problem import Problem
from idm_sumo.calibration.type_search import (
    LOWER,
    UPPER,
    compass_search,
    design_of_types,
    from_search,
    mean_ade,
    to_search,
)
from idm_sumo.models import idm
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

STARTS = 3  # of the design, beside the driver's own
COORDINATES = 4
DIFFERENCE = 1e-5  # of search coordinates, for derivatives
SMALLEST_ERROR = 1e-3  # m; smaller errors weigh no more than this one
STEPS, SMALLEST_DROP = 40, 1e-4  # at most so many steps, until one lowers the error by less than this share
DAMPING, EASED, STIFFENED, STIFFEST = 1e-2, 0.2, 8.0, 1e8  # first; after a step that led down, and up; last


def fit_types(problem: Problem, begin: Integers, own: Floats, *, integration: str) -> Floats:
    """Fit each driver's ``a, b, T, d0`` to its windows.

    Parameters
    ----------
    problem : Problem
        With the objective ``"ade"``; every window has frames that count.
    begin : int64, shape (drivers + 1,)
        First window of each driver, and the number of windows: those of a driver follow each other.
    own : float64, shape (drivers, 5)
        Parameters that the search begins with, beside the best of a fixed design.
    integration : {"euler", "ballistic", "paper", "krauss", "eidm"}

    Returns
    -------
    float64, shape (drivers, 5)
        With the smallest mean ADE over the driver's windows; the last column is 0.
    """
    first = to_search(np.clip(own, idm.LOWER, idm.UPPER))
    found = np.empty((len(first), COORDINATES + 1))
    in_threads(_fit_all, len(first), found, problem, begin, first, design_of_types(), integrators.code(integration))
    return np.asarray(np.clip(found, idm.LOWER, idm.UPPER))


@njit(cache=True, nogil=True)
def _fit_all(first, last, found, p, begin, own, design, scheme):  # type: ignore[no-untyped-def]
    """Write the best parameters of some drivers into ``found``.

    Of the drivers ``first`` up to ``last``; ``found`` has shape ``(n, 5)``.
    """
    for i in range(first, last):
        start, end = begin[i], begin[i + 1]
        screened = np.empty(design.shape[0])
        for k in range(design.shape[0]):
            screened[k] = mean_ade(p, start, end, design[k], scheme)
        order = np.argsort(screened)
        best, z = np.inf, own[i].copy()
        for k in range(STARTS + 1):
            trial = own[i].copy() if k == 0 else design[order[k - 1]].copy()
            value = _descend(p, start, end, trial, scheme)
            if value < best:
                best, z = value, trial
        compass_search(p, start, end, z, scheme)
        _descend(p, start, end, z, scheme)
        found[i] = from_search(z)


@njit(cache=True)
def _descend(p, begin, end, z, scheme):  # type: ignore[no-untyped-def]
    """Lower the mean ADE in place; returns it.

    By damped Gauss-Newton steps.
    """
    value, damping = mean_ade(p, begin, end, z, scheme), DAMPING
    gradient, normal = _derivatives(p, begin, end, z, scheme)
    for _ in range(STEPS):
        matrix, right = normal.copy(), -gradient
        for j in range(COORDINATES):
            matrix[j, j] += damping * normal[j, j] + 1e-12
            if (z[j] <= LOWER[j] and gradient[j] > 0.0) or (z[j] >= UPPER[j] and gradient[j] < 0.0):
                matrix[j, :], matrix[:, j], right[j] = 0.0, 0.0, 0.0
                matrix[j, j] = 1.0
        trial = np.minimum(np.maximum(z + np.linalg.solve(matrix, right), LOWER), UPPER)
        new = mean_ade(p, begin, end, trial, scheme)
        if new < value:
            settled = value - new < SMALLEST_DROP * value
            z[:], value, damping = trial, new, damping * EASED
            if settled:
                break
            gradient, normal = _derivatives(p, begin, end, z, scheme)
        elif damping > STIFFEST:
            break
        else:
            damping *= STIFFENED
    return value


@njit(cache=True)
def _derivatives(p, begin, end, z, scheme):  # type: ignore[no-untyped-def]
    """Return gradient and Gauss-Newton matrix of the mean ADE.

    By differences of rollouts.
    """
    frames = p.target.shape[1]
    gradient, normal = np.zeros(COORDINATES), np.zeros((COORDINATES, COORDINATES))
    x, speed = np.empty(frames + 1), np.empty(frames + 1)
    slopes = np.empty((COORDINATES, frames + 1))
    for i in range(begin, end):
        integrators.drive_one(p, i, from_search(z), scheme, x, speed)
        for j in range(COORDINATES):
            moved = z.copy()
            step = DIFFERENCE if z[j] + DIFFERENCE <= UPPER[j] else -DIFFERENCE
            moved[j] += step
            integrators.drive_one(p, i, from_search(moved), scheme, slopes[j], speed)
            slopes[j] = (slopes[j] - x) / step
        share = 1.0 / (p.counted[i].sum() * (end - begin))
        for k in range(frames):
            if p.counted[i, k]:
                error = x[k + 1] - p.target[i, k]
                weight = share / max(np.hypot(error, p.lateral[i, k]), SMALLEST_ERROR)
                for j in range(COORDINATES):
                    gradient[j] += weight * error * slopes[j, k + 1]
                    for m in range(COORDINATES):
                        normal[j, m] += weight * slopes[j, k + 1] * slopes[m, k + 1]
    return gradient, normal
