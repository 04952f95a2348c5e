"""The longitudinal rollout of one driver, plain and with forward sensitivities, and sums over many.

The same model as :func:`idm_sumo.rollout.drive_idm` (Euler with the old speed, the leader
perceived at the simulated position), with the lateral motion fixed beforehand
(:mod:`idm_sumo.calibration.problem`). Parameters are moved in *search coordinates*, see
:func:`to_search`.
"""

from __future__ import annotations

from math import exp

import numpy as np
import numpy.typing as npt
from numba import njit, prange

from idm_sumo import idm, road
from idm_sumo.calibration import objective as o
from idm_sumo.rollout import perceive
from idm_sumo.traffic import NOBODY

Floats = npt.NDArray[np.float64]

PARAMETERS = 5
T_UNIT, D_UNIT = 1.0, 2.5  # s, m: make a step in every search coordinate weigh about the same
DT = road.FRAME_STEP

LANES = 8  # parameter sets of one driver rolled out side by side
ROWS = 10
X, V, REAR, AHEAD, A, W, T, D0, D1, TOTAL = (row * LANES for row in range(ROWS))


def to_search(parameters: npt.ArrayLike) -> Floats:
    """Return ``log(a), log(b), T, d0, d1``, scaled, of parameters of shape ``(..., 5)``.

    Accelerations act by proportion. The desired gap is linear in the other three, so what they trade against each other is a
    straight valley, which in logarithms would be bent.
    """
    values = np.asarray(parameters, dtype=np.float64)
    return np.concatenate([np.log(values[..., :2]), values[..., 2:] / UNITS], axis=-1)


def from_search(z: npt.ArrayLike) -> Floats:
    """Return the parameters of search coordinates of shape ``(..., 5)``, exactly at a bound where on one."""
    at = np.asarray(z, dtype=np.float64)
    values = np.concatenate([np.exp(at[..., :2]), at[..., 2:] * UNITS], axis=-1)
    return np.asarray(np.clip(values, np.array(idm.LOWER), np.array(idm.UPPER)))


@njit(cache=True, error_model="numpy")
def parameters_at(z):  # type: ignore[no-untyped-def]
    """Return ``a, b, T, d0, d1`` at search coordinates ``z``, shape ``(5,)``; compiled."""
    return exp(z[0]), exp(z[1]), z[2] * T_UNIT, z[3] * D_UNIT, z[4] * D_UNIT


def slopes_at(z: npt.ArrayLike) -> Floats:
    """Return the derivatives of the parameters by their search coordinates, shape ``(..., 5)``."""
    at = np.asarray(z, dtype=np.float64)
    return np.concatenate([np.exp(at[..., :2]), np.broadcast_to(UNITS, (*at.shape[:-1], 3))], axis=-1)


UNITS = np.array([T_UNIT, D_UNIT, D_UNIT])
LOWER, UPPER = to_search(idm.LOWER), to_search(idm.UPPER)


@njit(cache=True)
def look_ahead(p, i, k, x):  # type: ignore[no-untyped-def]
    """Return rear bumper (m) and speed (m/s) of who is ahead of ``x`` at frame ``k``; infinite and 0 without anybody."""
    if p.behind[i, k] <= x < p.ahead[i, k]:
        return p.rear[i, k], p.leader_speed[i, k]
    row, _ = perceive(p.first_cell[i] + k, x, p.own[i], p.offsets, p.x, p.length, p.vehicle)
    if row == NOBODY:
        return np.inf, 0.0
    return p.x[row] - p.length[row], p.speed[row]


@njit(cache=True, error_model="numpy")
def costs_of(p, i, z, smoothing, values):  # type: ignore[no-untyped-def]
    """Fill ``values`` with the mean cost of driver ``i`` at each row of search coordinates ``z``; NaN if no frame counts."""
    lanes = np.empty(ROWS * LANES)
    for first in range(0, z.shape[0], LANES):
        roll_lanes(p, i, z, first, smoothing, lanes)
        for j in range(min(LANES, z.shape[0] - first)):
            values[first + j] = lanes[TOTAL + j]


@njit(cache=True, error_model="numpy")
def start_lanes(start_x, start_speed, z, first, s):  # type: ignore[no-untyped-def]
    """Fill every lane's start and parameters; lanes beyond ``z`` repeat its last row."""
    for j in range(LANES):
        at = min(first + j, z.shape[0] - 1)
        s[X + j], s[V + j], s[TOTAL + j] = start_x, start_speed, 0.0
        s[A + j], b, s[T + j], s[D0 + j], s[D1 + j] = parameters_at(z[at])
        s[W + j] = idm.closing_weight(s[A + j], b)


@njit(cache=True, error_model="numpy")
def roll_lanes(p, i, z, first, smoothing, s):  # type: ignore[no-untyped-def]
    """Roll out ``LANES`` parameter sets side by side, from row ``first`` of ``z``; their costs end in row ``TOTAL``.

    The state is one flat array, a row a quantity, so that the compiler can use vector
    instructions: three times as fast as one after the other. Inside the loop over frames the
    whole problem is passed on only by lanes that left the corridor: passing it costs more than a step.
    """
    behind, ahead, rear, leader_speed = p.behind[i], p.ahead[i], p.rear[i], p.leader_speed[i]
    target, lateral, counted, forward = p.target[i], p.lateral[i], p.counted[i], p.forward[i]
    objective, loss, scale, inverse, frames = p.objective, p.loss, p.scale, 1.0 / p.desired_speed[i], 0
    start_lanes(p.start_x[i], p.start_speed[i], z, first, s)
    for k in range(len(behind)):
        inside, low, high = 0, behind[k], ahead[k]
        for j in range(LANES):
            x = s[X + j]
            inside += (x >= low) & (x < high)
            s[REAR + j], s[AHEAD + j] = rear[k], leader_speed[k]
        if inside < LANES:
            for j in range(LANES):
                s[REAR + j], s[AHEAD + j] = look_ahead(p, i, k, s[X + j])
        if k > 0 and counted[k - 1]:
            frames += 1
            if objective == o.ADE:
                for j in range(LANES):
                    s[TOTAL + j] += o.distance(s[X + j] - target[k - 1], lateral[k - 1], smoothing)
            else:
                for j in range(LANES):
                    error = o.measured(objective, s[X + j], s[V + j], s[REAR + j]) - target[k - 1]
                    s[TOTAL + j] += o.robust_cost(error, loss, scale)
        if k == len(forward):
            break
        travelled = forward[k] * DT
        for j in range(LANES):
            v = s[V + j]
            rate, gap = v - s[AHEAD + j], s[REAR + j] - s[X + j]
            acceleration = idm.acceleration_of(
                v, rate, gap, s[A + j], s[W + j], s[T + j], s[D0 + j], s[D1 + j], inverse
            )
            s[X + j] += v * travelled
            s[V + j] = max(0.0, v + acceleration * DT)
    for j in range(LANES):
        s[TOTAL + j] /= frames


@njit(cache=True, error_model="numpy")
def roll(p, i, theta, speeds, gaps, rates, positions, rears):  # type: ignore[no-untyped-def]
    """Roll out driver ``i`` with ``theta`` and note what it saw at every frame, from the start on."""
    a, b, headway, d0, d1 = theta
    weight, inverse = idm.closing_weight(a, b), 1.0 / p.desired_speed[i]
    behind, ahead, rear_of, speed_of, forward = p.behind[i], p.ahead[i], p.rear[i], p.leader_speed[i], p.forward[i]
    x, v = p.start_x[i], p.start_speed[i]
    for k in range(len(behind)):
        rear, leader_speed = rear_of[k], speed_of[k]
        if not behind[k] <= x < ahead[k]:
            rear, leader_speed = look_ahead(p, i, k, x)
        positions[k], speeds[k], rears[k], gaps[k], rates[k] = x, v, rear, rear - x, v - leader_speed
        if k < len(forward):
            acceleration = idm.acceleration_of(v, rates[k], gaps[k], a, weight, headway, d0, d1, inverse)
            x += v * forward[k] * DT
            v = max(0.0, v + acceleration * DT)


@njit(cache=True, error_model="numpy")
def sensitivities_of(p, i, z, errors, slopes):  # type: ignore[no-untyped-def]
    r"""Roll out driver ``i`` and fill the error of every frame and its derivatives by search coordinates.

    Forward sensitivities: with :math:`s = \partial(x, v)/\partial z`, differentiating the
    Euler step gives :math:`s_x' = s_x + s_v\,dt` and :math:`s_v' = s_v + (\dot v_v s_v -
    \dot v_d s_x + \dot v_z)\,dt`, or 0 where the speed is held at 0. Where the leader
    changes, position and speed are continuous and so are the sensitivities.

    Parameters
    ----------
    errors : float64, shape (h,)
        0 in frames that do not count.
    slopes : float64, shape (5, h)

    Notes
    -----
    Three passes, each fast: the rollout, the model's partial derivatives at all frames
    (independent of each other, so in vector instructions), the linear recurrence.
    """
    target, counted, forward, objective, h = p.target[i], p.counted[i], p.forward[i], p.objective, p.target.shape[1]
    a, b, headway, d0, d1 = theta = parameters_at(z)
    by_z = (1.0, 1.0, T_UNIT, D_UNIT, D_UNIT)  # of log(a), log(b), and the scaled T, d0, d1
    weight, inverse = idm.closing_weight(a, b), 1.0 / p.desired_speed[i]
    seen, partials = np.empty((5, h + 1)), np.empty((7, h))
    speeds, gaps, rates, positions, rears = seen[0], seen[1], seen[2], seen[3], seen[4]
    roll(p, i, theta, speeds, gaps, rates, positions, rears)
    by_v, by_d, by_a, by_b, by_T = partials[0], partials[1], partials[2], partials[3], partials[4]
    by_d0, by_d1 = partials[5], partials[6]
    for k in range(h):
        by_v[k], by_d[k], by_a[k], by_b[k], by_T[k], by_d0[k], by_d1[k] = idm.acceleration_partials(
            speeds[k], rates[k], gaps[k], a, weight, headway, d0, d1, inverse
        )
    sx, sv = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    for k in range(h):
        travelled, moves = forward[k] * DT, 1.0 if speeds[k + 1] > 0.0 else 0.0
        use = 1.0 if counted[k] else 0.0
        x, rear = positions[k + 1], rears[k + 1]
        by_x, by_speed = o.measured_partials(objective, x, rear)
        errors[k] = o.measured(objective, x, speeds[k + 1], rear) - target[k] if counted[k] else 0.0
        for j in range(PARAMETERS):
            slope = by_v[k] * sv[j] - by_d[k] * sx[j] + partials[2 + j, k] * by_z[j]
            sx[j] += sv[j] * travelled
            sv[j] = moves * (sv[j] + slope * DT)
            slopes[j, k] = use * (by_x * sx[j] + by_speed * sv[j])


@njit(cache=True, error_model="numpy")
def cost_and_derivatives(p, i, z, smoothing, gradient, normal, curved, errors, slopes):  # type: ignore[no-untyped-def]
    """Return the mean cost; fill its gradient and two matrices, by search coordinates; NaN if no frame counts.

    Parameters
    ----------
    gradient : float64, shape (5,)
    normal : float64, shape (5, 5)
        The mean over frames of weight × outer product of the error's derivatives: the
        matrix of reweighted least squares, which never takes too long a step.
    curved : float64, shape (5, 5)
        The same with the cost's curvature for weight: Newton's matrix but for the rollout's
        own curvature, which takes longer steps.
    errors, slopes : float64, shapes (h,) and (5, h)
        As filled by :func:`sensitivities_of`.
    """
    sensitivities_of(p, i, z, errors, slopes)
    lateral, counted, objective, loss, scale = p.lateral[i], p.counted[i], p.objective, p.loss, p.scale
    total, frames, h = 0.0, 0, len(errors)
    weights, curvatures = np.zeros(h), np.zeros(h)
    for k in range(h):
        if counted[k]:
            frames += 1
            total += o.frame_cost(objective, loss, scale, errors[k], lateral[k], smoothing)
            weights[k], curvatures[k] = o.frame_weights(objective, loss, scale, errors[k], lateral[k], smoothing)
    for j in range(PARAMETERS):
        slope, uphill = slopes[j], 0.0
        for k in range(h):
            uphill += weights[k] * errors[k] * slope[k]
        gradient[j] = uphill / frames
        for m in range(j + 1):
            other, weighted, curving = slopes[m], 0.0, 0.0
            for k in range(h):
                product = slope[k] * other[k]
                weighted += weights[k] * product
                curving += curvatures[k] * product
            normal[j, m], curved[j, m] = weighted / frames, curving / frames
            normal[m, j], curved[m, j] = normal[j, m], curved[j, m]
    return total / frames


@njit(cache=True)
def cost(p, i, z, smoothing):  # type: ignore[no-untyped-def]
    """Return the mean cost of driver ``i`` at search coordinates ``z``, shape ``(5,)``."""
    value = np.empty(1)
    costs_of(p, i, z.reshape(1, PARAMETERS), smoothing, value)
    return value[0]


# The index of a prange is unsigned; as a signed one it needs no second version of all it is passed to.


@njit(cache=True, parallel=True)
def costs(p, z, smoothing):  # type: ignore[no-untyped-def]
    """Return every driver's mean cost at each of its own search coordinates: ``z`` is ``(n, m, 5)``, the result ``(n, m)``."""
    result = np.empty(z.shape[:2])
    for i in prange(z.shape[0]):
        costs_of(p, np.int64(i), z[i], smoothing, result[i])
    return result


@njit(cache=True, parallel=True)
def costs_of_designs(p, designs, smoothing):  # type: ignore[no-untyped-def]
    """Return the mean cost of every driver at every design point, shape ``(n, designs)``."""
    values = np.empty((p.start_x.shape[0], designs.shape[0]))
    for i in prange(values.shape[0]):
        costs_of(p, np.int64(i), designs, smoothing, values[i])
    return values


@njit(cache=True, parallel=True)
def costs_and_derivatives(p, z, smoothing):  # type: ignore[no-untyped-def]
    """Return every driver's mean cost, gradient and Gauss-Newton matrix: shapes ``(n,), (n, 5), (n, 5, 5)``."""
    n, h = p.target.shape
    values, gradients, normals = np.empty(n), np.empty((n, PARAMETERS)), np.empty((n, PARAMETERS, PARAMETERS))
    for i in prange(n):
        curved, errors, slopes = np.empty((PARAMETERS, PARAMETERS)), np.empty(h), np.empty((PARAMETERS, h))
        values[i] = cost_and_derivatives(
            p, np.int64(i), z[i], smoothing, gradients[i], normals[i], curved, errors, slopes
        )
    return values, gradients, normals


@njit(cache=True, parallel=True)
def sensitivities(p, z):  # type: ignore[no-untyped-def]
    """Return every driver's errors and their derivatives by search coordinates: shapes ``(n, h)`` and ``(n, 5, h)``."""
    n, h = p.target.shape
    errors, slopes = np.empty((n, h)), np.empty((n, PARAMETERS, h))
    for i in prange(n):
        sensitivities_of(p, np.int64(i), z[i], errors[i], slopes[i])
    return errors, slopes
