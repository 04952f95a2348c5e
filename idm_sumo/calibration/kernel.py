"""The longitudinal rollout of many drivers and its derivatives.

The same model as :func:`idm_sumo.simulation.rollout.drive_idm` (Euler with the old speed, the leader
perceived at the simulated position), with the lateral motion fixed beforehand
(:mod:`idm_sumo.calibration.problem`), at search coordinates
(:mod:`idm_sumo.calibration.coordinates`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration import objective as o
from idm_sumo.calibration.coordinates import (
    D_UNIT,
    LOWER,
    PARAMETERS,
    T_UNIT,
    UPPER,
    from_search,
    parameters_at,
    slopes_at,
    to_search,
)
from idm_sumo.calibration.lanes import (
    DT,
    GRADIENT,
    LANES,
    NORMAL,
    START,
    TOTAL,
    WHOLE,
    costs_of,
    look_ahead,
    roll_with_derivatives,
)
from idm_sumo.calibration.problem import Problem
from idm_sumo.models import idm
from idm_sumo.runtime.threads import in_threads

__all__ = [
    "LOWER", "PARAMETERS", "UPPER", "cost", "cost_and_derivatives", "costs", "costs_and_derivatives",
    "costs_of", "costs_of_designs", "from_search", "look_ahead", "parameters_at", "sensitivities", "slopes_at",
    "start_sensitivities", "to_search",
]  # fmt: skip

Floats = npt.NDArray[np.float64]

DIRECTIONS = PARAMETERS + 2  # derivatives by the parameters, then by the start's position and speed


@njit(cache=True, error_model="numpy")
def sensitivities_of(p, i, z, errors, slopes):  # type: ignore[no-untyped-def]
    """Fill one driver's errors and their derivatives.

    As :func:`~idm_sumo.calibration.lanes.step_with_tangents`, one parameter set, every frame kept.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (5,)
        Search coordinates.
    errors : float64, shape (h,)
        Filled; 0 in frames that do not count.
    slopes : float64, shape (7, h)
        Filled with the errors' derivatives by search coordinates, by the start's position and by its speed.
    """
    a, b, headway, d0, d1 = parameters_at(z)
    weight, inverse, objective = idm.closing_weight(a, b), 1.0 / p.desired_speed[i], p.objective
    x, v, dx, dv, by = p.start_x[i], p.start_speed[i], np.zeros(DIRECTIONS), np.zeros(DIRECTIONS), np.zeros(DIRECTIONS)
    dx[PARAMETERS], dv[PARAMETERS + 1] = 1.0, 1.0
    rear, leader_speed = look_ahead(p, i, START, x)
    for k in range(errors.shape[0]):
        rate, gap, travelled = v - leader_speed, rear - x, p.forward[i, k] * DT
        new = v + DT * idm.acceleration_of(v, rate, gap, a, weight, headway, d0, d1, inverse)
        by_v, by_d, by[0], by[1], by_T, by_d0, by_d1 = idm.acceleration_partials(
            v, rate, gap, a, weight, headway, d0, d1, inverse
        )
        by[2], by[3], by[4] = T_UNIT * by_T, D_UNIT * by_d0, D_UNIT * by_d1
        x, v, moves = x + v * travelled, max(0.0, new), 1.0 if new > 0.0 else 0.0
        rear, leader_speed = look_ahead(p, i, k + 1, x)
        by_x, by_speed = o.measured_partials(objective, x, rear)
        counted = p.counted[i, k]
        errors[k] = o.measured(objective, x, v, rear) - p.target[i, k] if counted else 0.0
        for j in range(DIRECTIONS):
            slope = by_v * dv[j] - by_d * dx[j] + by[j]
            dx[j] += dv[j] * travelled
            dv[j] = moves * (dv[j] + slope * DT)
            slopes[j, k] = by_x * dx[j] + by_speed * dv[j] if counted else 0.0


@njit(cache=True, nogil=True)
def _sensitivities(first, last, p, z, errors, slopes):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        sensitivities_of(p, i, z[i], errors[i], slopes[i])


def sensitivities(problem: Problem, z: Floats) -> tuple[Floats, Floats]:
    """Return every driver's errors and their derivatives.

    Parameters
    ----------
    problem : Problem
    z : float64, shape (n, 5)
        Search coordinates.

    Returns
    -------
    errors : float64, shape (n, h)
        In the objective's unit; 0 in frames that do not count.
    slopes : float64, shape (n, 5, h)
        By search coordinates.
    """
    errors, slopes = start_sensitivities(problem, z)
    return errors, slopes[:, :PARAMETERS]


def start_sensitivities(problem: Problem, z: Floats) -> tuple[Floats, Floats]:
    """Return errors and derivatives, those by the start included.

    Parameters
    ----------
    problem : Problem
    z : float64, shape (n, 5)
        Search coordinates.

    Returns
    -------
    errors : float64, shape (n, h)
        In the objective's unit; 0 in frames that do not count.
    slopes : float64, shape (n, 7, h)
        By search coordinates, by the position and by the speed at the start.
    """
    n, h = problem.target.shape
    errors, slopes = np.empty((n, h)), np.empty((n, DIRECTIONS, h))
    in_threads(_sensitivities, n, problem, np.ascontiguousarray(z), errors, slopes)
    return errors, slopes


@njit(cache=True, error_model="numpy")
def cost_and_derivatives(p, i, z, smoothing, gradient, normal):  # type: ignore[no-untyped-def]
    """Return one driver's mean cost; fill gradient and matrix.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (5,)
        Search coordinates.
    smoothing : float
        Of the distance (m), see :func:`~idm_sumo.calibration.objective.distance`.
    gradient : float64, shape (5,)
        Filled.
    normal : float64, shape (5, 5)
        Filled with the matrix of reweighted least squares (:mod:`idm_sumo.calibration.objective`).

    Returns
    -------
    float
        In the objective's unit; NaN if no frame counts.
    """
    lanes, same = np.empty(WHOLE), np.empty((LANES, PARAMETERS))
    for lane in range(LANES):
        for j in range(PARAMETERS):
            same[lane, j] = z[j]
    roll_with_derivatives(p, i, same, smoothing, 0.0, lanes)
    pair = NORMAL
    for j in range(PARAMETERS):
        gradient[j] = lanes[GRADIENT + j * LANES]
        for m in range(j + 1):
            normal[j, m] = normal[m, j] = lanes[pair]
            pair += LANES
    return lanes[TOTAL]


@njit(cache=True, nogil=True)
def _costs_and_derivatives(first, last, p, z, smoothing, values, gradients, normals):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        values[i] = cost_and_derivatives(p, i, z[i], smoothing, gradients[i], normals[i])


def costs_and_derivatives(problem: Problem, z: Floats, smoothing: float) -> tuple[Floats, Floats, Floats]:
    """Return every driver's mean cost, gradient and matrix.

    Parameters
    ----------
    problem : Problem
    z : float64, shape (n, 5)
        Search coordinates.
    smoothing : float
        Of the distance (m).

    Returns
    -------
    value : float64, shape (n,)
    gradient : float64, shape (n, 5)
    matrix : float64, shape (n, 5, 5)
        Of reweighted least squares (:mod:`idm_sumo.calibration.objective`).
    """
    n = len(problem.start_x)
    values, gradients, normals = np.empty(n), np.empty((n, PARAMETERS)), np.empty((n, PARAMETERS, PARAMETERS))
    in_threads(
        _costs_and_derivatives, n, problem, np.ascontiguousarray(z), float(smoothing), values, gradients, normals
    )
    return values, gradients, normals


@njit(cache=True, nogil=True)
def _costs(first, last, p, z, smoothing, values):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        costs_of(p, i, z[i if z.shape[0] > 1 else 0], smoothing, values[i])


def costs(problem: Problem, z: Floats, smoothing: float) -> Floats:
    """Return every driver's mean cost at several search coordinates.

    Parameters
    ----------
    problem : Problem
    z : float64, shape (n, m, 5) or (1, m, 5)
        Search coordinates, each driver's own or the same for all.
    smoothing : float
        Of the distance (m).

    Returns
    -------
    float64, shape (n, m)
    """
    values = np.empty((len(problem.start_x), z.shape[1]))
    in_threads(_costs, len(values), problem, np.ascontiguousarray(z), float(smoothing), values)
    return values


def costs_of_designs(problem: Problem, designs: Floats, smoothing: float) -> Floats:
    """Return every driver's mean cost at every design point.

    Parameters
    ----------
    problem : Problem
    designs : float64, shape (m, 5)
        Search coordinates.
    smoothing : float
        Of the distance (m).

    Returns
    -------
    float64, shape (n, m)
    """
    return costs(problem, designs[None], smoothing)


def cost(problem: Problem, i: int, z: Floats, smoothing: float) -> float:
    """Return the mean cost of one driver.

    Parameters
    ----------
    problem : Problem
    i : int
        The driver.
    z : float64, shape (5,)
        Search coordinates.
    smoothing : float
        Of the distance (m).

    Returns
    -------
    float
        NaN if no frame counts.
    """
    value = np.empty(1)
    costs_of(problem, i, np.ascontiguousarray(z).reshape(1, PARAMETERS), float(smoothing), value)
    return float(value[0])
