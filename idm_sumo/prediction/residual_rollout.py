"""The rollout of drivers with a residual, and its derivatives.

As :mod:`idm_sumo.calibration.kernel`: Euler with the old speed, the leader perceived at the simulated position, the
lateral motion fixed beforehand. The derivatives are those by the residual's weights.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration import objective as o
from idm_sumo.calibration.lanes import DT, START, look_ahead
from idm_sumo.calibration.problem import Problem
from idm_sumo.models import idm
from idm_sumo.models import residual as r
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]

DIRECTIONS = r.REGRESSORS + r.OWN


class Shared(NamedTuple):
    """What all drivers share.

    Attributes
    ----------
    pooled : float64, shape (5,)
        ``a, b, T, d0, d1`` of the IDM that the residual is added to.
    center, scale : float64, shape (5,)
        Means and standard deviations of the state.
    """

    pooled: Floats
    center: Floats
    scale: Floats


@njit(cache=True, error_model="numpy")
def _roll(p, i, shared, weights, own, leader_acceleration, derivatives, errors, slopes):  # type: ignore[no-untyped-def]
    """Fill one driver's errors, and their derivatives if wanted."""
    a, b, headway, d0, d1 = shared.pooled
    weight, inverse = idm.closing_weight(a, b), 1.0 / p.desired_speed[i]
    x, v = p.start_x[i], p.start_speed[i]
    dx, dv, by = np.zeros(DIRECTIONS), np.zeros(DIRECTIONS), np.zeros(DIRECTIONS)
    state, by_speed, by_gap, by_state = np.empty(r.STATE), np.empty(r.STATE), np.empty(r.STATE), np.empty(r.STATE)
    fades = by[r.REGRESSORS :]
    rear, leader_speed = look_ahead(p, i, START, x)
    known = leader_acceleration
    for k in range(errors.shape[0]):
        rate, gap, travelled = v - leader_speed, rear - x, p.forward[i, k] * DT
        acceleration = idm.acceleration_of(v, rate, gap, a, weight, headway, d0, d1, inverse)
        extra, extra_v, extra_d = 0.0, 0.0, 0.0
        followed = gap > idm.SMALLEST_GAP and gap < np.inf
        if followed:
            r.standard_state(v, rate, gap, known, shared.center, shared.scale, state, by_speed, by_gap)
            r.regressors(state, by)
            r.fading(k * DT, fades)
            for j in range(r.REGRESSORS):
                extra += weights[j] * by[j]
            for j in range(r.OWN):
                extra += own[j] * fades[j]
        total = max(acceleration + extra, -idm.EMERGENCY_BRAKING)
        new = v + DT * total
        if derivatives:
            by_v, by_d, _, _, _, _, _ = idm.acceleration_partials(v, rate, gap, a, weight, headway, d0, d1, inverse)
            free = 1.0 if total > -idm.EMERGENCY_BRAKING else 0.0
            if followed:
                r.shared_slopes(state, weights, by_state)
                for j in range(r.STATE):
                    extra_v += by_state[j] * by_speed[j]
                    extra_d += by_state[j] * by_gap[j]
            else:
                by[:] = 0.0
            by_v, by_d = free * (by_v + extra_v), free * (by_d + extra_d)
            moves = 1.0 if new > 0.0 else 0.0
            for j in range(DIRECTIONS):
                slope = by_v * dv[j] - by_d * dx[j] + free * by[j]
                dx[j] += dv[j] * travelled
                dv[j] = moves * (dv[j] + slope * DT)
        x, v = x + v * travelled, max(0.0, new)
        before = leader_speed
        rear, leader_speed = look_ahead(p, i, k + 1, x)
        known = r.followed_acceleration(known, before, leader_speed, DT)
        counted = p.counted[i, k]
        errors[k] = x - p.target[i, k] if counted else 0.0
        if derivatives:
            for j in range(DIRECTIONS):
                slopes[k, j] = dx[j] if counted else 0.0


@njit(cache=True, nogil=True)
def _errors(first, last, p, shared, weights, own, leader_acceleration, errors):  # type: ignore[no-untyped-def]
    nothing = np.empty((0, 0))
    for i in range(first, last):
        w = weights[i if weights.shape[0] > 1 else 0]
        _roll(p, i, shared, w, own[i], leader_acceleration[i], False, errors[i], nothing)


@njit(cache=True, nogil=True, error_model="numpy")
def _normals(first, last, p, shared, weights, own, leader_acceleration, smoothing, values, gradients, normals):  # type: ignore[no-untyped-def]
    h = p.target.shape[1]
    errors, slopes = np.empty(h), np.empty((h, DIRECTIONS))
    for i in range(first, last):
        w = weights[i if weights.shape[0] > 1 else 0]
        _roll(p, i, shared, w, own[i], leader_acceleration[i], True, errors, slopes)
        frames = p.counted[i].sum()
        values[i], gradients[i, :] = 0.0, 0.0
        for k in range(h):
            weight = 0.0
            if p.counted[i, k]:
                off = o.distance(errors[k], p.lateral[i, k], smoothing)
                weight = 1.0 / (off * frames)
                values[i] += off / frames
            for j in range(DIRECTIONS):
                gradients[i, j] += weight * errors[k] * slopes[k, j]
                slopes[k, j] *= np.sqrt(weight)
        normals[i] = slopes.T @ slopes


def errors_of(problem: Problem, shared: Shared, weights: Floats, own: Floats, leader_acceleration: Floats) -> Floats:
    """Return every driver's errors along the road.

    Parameters
    ----------
    problem : Problem
        Of the ADE.
    shared : Shared
    weights : float64, shape (n, 20) or (1, 20)
        Each driver's own or the same for all.
    own : float64, shape (n, 3)
        The drivers' own numbers (m/s²).
    leader_acceleration : float64, shape (n,)
        At the start (m/s²).

    Returns
    -------
    float64, shape (n, h)
        m; 0 in frames that do not count.
    """
    errors = np.empty(problem.target.shape)
    in_threads(_errors, len(errors), problem, shared, weights, own, leader_acceleration, errors)
    return errors


def costs(problem: Problem, shared: Shared, weights: Floats, own: Floats, leader_acceleration: Floats) -> Floats:
    """Return every driver's ADE.

    Parameters
    ----------
    problem, shared, weights, own, leader_acceleration
        As of :func:`errors_of`.

    Returns
    -------
    float64, shape (n,)
        m.
    """
    errors = errors_of(problem, shared, weights, own, leader_acceleration)
    counted = problem.counted
    return np.asarray(np.where(counted, np.hypot(errors, problem.lateral), 0.0).sum(axis=1) / counted.sum(axis=1))


def costs_and_derivatives(
    problem: Problem, shared: Shared, weights: Floats, own: Floats, leader_acceleration: Floats, smoothing: float
) -> tuple[Floats, Floats, Floats]:
    """Return every driver's ADE, its gradient and Gauss-Newton matrix.

    Parameters
    ----------
    problem, shared, weights, own, leader_acceleration
        As of :func:`errors_of`.
    smoothing : float
        Of the distance (m).

    Returns
    -------
    value : float64, shape (n,)
    gradient : float64, shape (n, 23)
        By the shared weights, then by the driver's own numbers.
    matrix : float64, shape (n, 23, 23)
        Of reweighted least squares.
    """
    n = len(problem.start_x)
    values, gradients, normals = np.empty(n), np.empty((n, DIRECTIONS)), np.empty((n, DIRECTIONS, DIRECTIONS))
    in_threads(
        _normals, n, problem, shared, weights, own, leader_acceleration, float(smoothing), values, gradients, normals
    )
    return values, gradients, normals
