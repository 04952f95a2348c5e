"""Rollouts of one driver with several parameter sets at once.

With and without derivatives. The state is one flat array, a row a quantity, a column a parameter
set, so that the compiler uses vector instructions: eight rollouts with all derivatives take as long
as one after the other without vectors. A loop over lanes is written only where it is long enough
for that, and whatever does not depend on the lane is a scalar before it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.calibration import objective as o
from idm_sumo.calibration.coordinates import D_UNIT, PARAMETERS, T_UNIT, parameters_at
from idm_sumo.models import idm
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.simulation.rollout import perceive

DT = FRAME_STEP
LANES = L = 8  # parameter sets side by side: two vectors of four
START = np.int64(0)  # a literal 0 would be one more type to numba
PAIRS = PARAMETERS * (PARAMETERS + 1) // 2  # of a symmetric matrix, row by row of its lower triangle

# Rows of a plain rollout, and further ones for derivatives: of position and speed by the
# parameters (DX, DV), of the error (DE); the frame's weights; sums over frames.
X, V, REAR, AHEAD, OUT, A, W, T, D0, D1, TOTAL = (row * L for row in range(11))
PLAIN = 11 * L
DX, DV, DE = 11 * L, 16 * L, 21 * L
PULL, WEIGHT = 26 * L, 27 * L
GRADIENT, NORMAL = 28 * L, 33 * L
WHOLE = NORMAL + PAIRS * L


@njit(cache=True)
def look_ahead(p, i, k, x):  # type: ignore[no-untyped-def]
    """Return rear bumper and speed of the leader.

    Parameters
    ----------
    p : Problem
    i, k : int
        Driver, and frame after the start.
    x : float
        Front bumper (m).

    Returns
    -------
    rear, speed : float
        m, m/s; infinite and 0 without a leader.
    """
    if p.behind[i, k] <= x < p.ahead[i, k]:
        return p.rear[i, k], p.leader_speed[i, k]
    row, _ = perceive(p.first_cell[i] + k, x, p.own[i], p.offsets, p.x, p.length, p.vehicle)
    if row == NOBODY:
        return np.inf, 0.0
    return p.x[row] - p.length[row], p.speed[row]


@njit(cache=True, error_model="numpy")
def start_lanes(p, i, z, first, s):  # type: ignore[no-untyped-def]
    """Fill every lane's start and parameters.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (m, 5)
        Search coordinates. Lanes beyond the last row repeat it.
    first : int
        Row of ``z`` for the first lane.
    s : float64, shape (PLAIN,) or (WHOLE,)
        The state; what derivatives need becomes 0.
    """
    for row in range(PLAIN, s.shape[0]):
        s[row] = 0.0
    for j in range(L):
        s[X + j], s[V + j], s[TOTAL + j] = p.start_x[i], p.start_speed[i], 0.0
        s[A + j], b, s[T + j], s[D0 + j], s[D1 + j] = parameters_at(z[min(first + j, z.shape[0] - 1)])
        s[W + j] = idm.closing_weight(s[A + j], b)
        s[REAR + j], s[AHEAD + j] = look_ahead(p, i, START, s[X + j])


@njit(cache=True, error_model="numpy")
def bounds_of_speed(p, i):  # type: ignore[no-untyped-def]
    """Return a step's largest braking and the highest speed.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.

    Returns
    -------
    brake, top : float
        m/s; infinite but in SUMO.
    """
    if p.in_sumo:
        return idm.EMERGENCY_BRAKING * DT, p.desired_speed[i]
    return np.inf, np.inf


@njit(cache=True, error_model="numpy", forceinline=True)
def look_outside(p, i, k, s):  # type: ignore[no-untyped-def]
    """Search the leaders of lanes that left the corridor.

    Parameters
    ----------
    p : Problem
        :class:`~idm_sumo.calibration.problem.Problem` says what the corridor is.
    i, k : int
        Driver, and frame after the start.
    s : float64, shape (PLAIN,) or (WHOLE,)
        The state, changed.
    """
    outside = 0.0
    for j in range(L):
        outside += s[OUT + j]
    if outside > 0.0:
        for j in range(L):
            if s[OUT + j] > 0.0:
                s[REAR + j], s[AHEAD + j] = look_ahead(p, i, k, s[X + j])


@njit(cache=True, error_model="numpy")
def roll_lanes(p, i, z, first, smoothing, s):  # type: ignore[no-untyped-def]
    """Roll out ``LANES`` parameter sets and sum their costs.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (m, 5)
        Search coordinates.
    first : int
        Row of ``z`` for the first lane.
    smoothing : float
        Of the distance (m).
    s : float64, shape (PLAIN,) or (WHOLE,)
        The state; the mean costs end in row ``TOTAL``.
    """
    is_ade, loss, scale, inverse, frames = p.objective == o.ADE, p.loss, p.scale, 1.0 / p.desired_speed[i], 0
    brake, top = bounds_of_speed(p, i)
    start_lanes(p, i, z, first, s)
    for k in range(p.forward.shape[1]):
        low, high, rear, speed = p.behind[i, k + 1], p.ahead[i, k + 1], p.rear[i, k + 1], p.leader_speed[i, k + 1]
        target, lateral, travelled = p.target[i, k], p.lateral[i, k], p.forward[i, k] * DT
        by_old, by_new = (1.0 - p.share) * travelled, p.share * travelled
        counts = 1.0 if p.counted[i, k] and is_ade else 0.0
        frames += p.counted[i, k]
        for j in range(L):
            v = s[V + j]
            acceleration = idm.acceleration_of(
                v, v - s[AHEAD + j], s[REAR + j] - s[X + j], s[A + j], s[W + j], s[T + j], s[D0 + j], s[D1 + j], inverse
            )
            new = max(max(0.0, v - brake), min(v + acceleration * DT, top))
            x = s[X + j] + v * by_old + new * by_new
            s[X + j], s[V + j], s[REAR + j], s[AHEAD + j] = x, new, rear, speed
            s[OUT + j] = 0.0 if (x >= low) & (x < high) else 1.0
            s[TOTAL + j] += counts * o.distance(x - target, lateral, smoothing)
        look_outside(p, i, k + 1, s)
        if p.counted[i, k] and not is_ade:
            for j in range(L):
                error = o.measured(p.objective, s[X + j], s[V + j], s[REAR + j]) - target
                s[TOTAL + j] += o.robust_cost(error, loss, scale)
    for j in range(L):
        s[TOTAL + j] /= frames


@njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def step_with_tangents(  # type: ignore[no-untyped-def]
    s, inverse, by_old, by_new, brake, top, d1_unit, low, high, rear, speed, target, lateral, smoothing, floor, counts
):  # fmt: skip
    r"""Move every lane, and its derivatives, by one step.

    Forward sensitivities: with :math:`s = \partial(x, v)/\partial z`, differentiating the
    Euler step gives :math:`s_x' = s_x + s_v\,dt` and :math:`s_v' = s_v + (\dot v_v s_v -
    \dot v_d s_x + \dot v_z)\,dt`, or 0 where the speed is held at a bound; SUMO's steps have the new
    :math:`s_v'` in :math:`s_x'`, wholly or half. Where the leader
    changes, position and speed are continuous and so are the sensitivities.

    Then note the distance from the recorded vehicle: the frame's weight, and its pull, weight times error.

    Parameters
    ----------
    s : float64, shape (WHOLE,)
        The state, changed.
    inverse : float
        Of the desired speed (s/m).
    by_old, by_new : float
        Metres along the road in the step per m/s of the speed before and after it.
    brake, top : float
        Bounds of the speed (:func:`bounds_of_speed`).
    d1_unit : float
        Metres of ``d1`` a search coordinate; 0 holds it.
    low, high : float
        The corridor at the step's end (m).
    rear, speed : float
        Of the corridor's leader at the step's end (m, m/s).
    target, lateral : float
        Recorded position (m) and the fixed lateral error (m).
    smoothing : float
        Of the distance (m).
    floor : float
        Distance (m) below which a frame's weight grows no more.
    counts : float
        1 if the frame counts, else 0.
    """
    for j in range(L):
        v = s[V + j]
        rate, gap, a, weight = v - s[AHEAD + j], s[REAR + j] - s[X + j], s[A + j], s[W + j]
        new = v + DT * idm.acceleration_of(v, rate, gap, a, weight, s[T + j], s[D0 + j], s[D1 + j], inverse)
        by_v, by_d, by_a, by_b, by_T, by_d0, by_d1 = idm.acceleration_partials(
            v, rate, gap, a, weight, s[T + j], s[D0 + j], s[D1 + j], inverse
        )
        least = max(0.0, v - brake)
        moves = 1.0 if (new > least) & (new < top) else 0.0
        new = max(least, min(new, top))
        x = s[X + j] + v * by_old + new * by_new
        s[X + j], s[V + j], s[REAR + j], s[AHEAD + j] = x, new, rear, speed
        s[OUT + j] = 0.0 if (x >= low) & (x < high) else 1.0
        dx, dv = s[DX + j], s[DV + j]
        s[DV + j] = moves * (dv + DT * (by_v * dv - by_d * dx + by_a))
        s[DX + j] = s[DE + j] = dx + dv * by_old + s[DV + j] * by_new
        dx, dv = s[DX + L + j], s[DV + L + j]
        s[DV + L + j] = moves * (dv + DT * (by_v * dv - by_d * dx + by_b))
        s[DX + L + j] = s[DE + L + j] = dx + dv * by_old + s[DV + L + j] * by_new
        dx, dv = s[DX + 2 * L + j], s[DV + 2 * L + j]
        s[DV + 2 * L + j] = moves * (dv + DT * (by_v * dv - by_d * dx + T_UNIT * by_T))
        s[DX + 2 * L + j] = s[DE + 2 * L + j] = dx + dv * by_old + s[DV + 2 * L + j] * by_new
        dx, dv = s[DX + 3 * L + j], s[DV + 3 * L + j]
        s[DV + 3 * L + j] = moves * (dv + DT * (by_v * dv - by_d * dx + D_UNIT * by_d0))
        s[DX + 3 * L + j] = s[DE + 3 * L + j] = dx + dv * by_old + s[DV + 3 * L + j] * by_new
        dx, dv = s[DX + 4 * L + j], s[DV + 4 * L + j]
        s[DV + 4 * L + j] = moves * (dv + DT * (by_v * dv - by_d * dx + d1_unit * by_d1))
        s[DX + 4 * L + j] = s[DE + 4 * L + j] = dx + dv * by_old + s[DV + 4 * L + j] * by_new
        off = o.distance(x - target, lateral, smoothing)
        weight = counts / max(off, floor)
        s[TOTAL + j] += counts * off
        s[WEIGHT + j], s[PULL + j] = weight, weight * (x - target)


@njit(cache=True, error_model="numpy")
def measure_error(s, objective, loss, scale, target):  # type: ignore[no-untyped-def]
    """Note every lane's error by an objective other than ADE.

    Parameters
    ----------
    s : float64, shape (WHOLE,)
        The state; its error, weight and the error's derivatives are changed.
    objective, loss : int
        Codes of :mod:`idm_sumo.calibration.objective`.
    scale : float
        Of a robust loss, in the unit of the error.
    target : float
        What the objective compares with.
    """
    for j in range(L):
        x, v, rear = s[X + j], s[V + j], s[REAR + j]
        error = o.measured(objective, x, v, rear) - target
        by_x, by_v = o.measured_partials(objective, x, rear)
        weight = o.robust_weight(error, loss, scale)
        s[TOTAL + j] += o.robust_cost(error, loss, scale)
        s[WEIGHT + j], s[PULL + j] = weight, weight * error
        for m in range(PARAMETERS):
            s[DE + m * L + j] = by_x * s[DX + m * L + j] + by_v * s[DV + m * L + j]


@njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def add_frame(s):  # type: ignore[no-untyped-def]
    """Add a frame to every lane's gradient and matrix.

    Parameters
    ----------
    s : float64, shape (WHOLE,)
        The state; the matrix sums weighted products of the error's derivatives.
    """
    for j in range(L):
        pull, weight = s[PULL + j], s[WEIGHT + j]
        e0, e1, e2 = s[DE + j], s[DE + L + j], s[DE + 2 * L + j]
        e3, e4 = s[DE + 3 * L + j], s[DE + 4 * L + j]
        s[GRADIENT + j] += pull * e0
        s[GRADIENT + L + j] += pull * e1
        s[GRADIENT + 2 * L + j] += pull * e2
        s[GRADIENT + 3 * L + j] += pull * e3
        s[GRADIENT + 4 * L + j] += pull * e4
        w0, w1, w2, w3, w4 = weight * e0, weight * e1, weight * e2, weight * e3, weight * e4
        s[NORMAL + j] += w0 * e0
        s[NORMAL + L + j] += w1 * e0
        s[NORMAL + 2 * L + j] += w1 * e1
        s[NORMAL + 3 * L + j] += w2 * e0
        s[NORMAL + 4 * L + j] += w2 * e1
        s[NORMAL + 5 * L + j] += w2 * e2
        s[NORMAL + 6 * L + j] += w3 * e0
        s[NORMAL + 7 * L + j] += w3 * e1
        s[NORMAL + 8 * L + j] += w3 * e2
        s[NORMAL + 9 * L + j] += w3 * e3
        s[NORMAL + 10 * L + j] += w4 * e0
        s[NORMAL + 11 * L + j] += w4 * e1
        s[NORMAL + 12 * L + j] += w4 * e2
        s[NORMAL + 13 * L + j] += w4 * e3
        s[NORMAL + 14 * L + j] += w4 * e4


@njit(cache=True, error_model="numpy")
def roll_with_derivatives(p, i, z, smoothing, floor, s):  # type: ignore[no-untyped-def]
    """Roll out ``LANES`` parameter sets with all derivatives.

    The matrix is the mean over frames of weight times the product of the error's derivatives:
    that of reweighted least squares.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (LANES, 5)
        Search coordinates.
    smoothing : float
        Of the distance (m).
    floor : float
        Distance (m) below which a frame's weight grows no more.
    s : float64, shape (WHOLE,)
        The state; mean costs, gradients and matrices by search coordinates end in it.
    """
    objective = p.objective
    is_ade, inverse, frames = objective == o.ADE, 1.0 / p.desired_speed[i], 0
    brake, top = bounds_of_speed(p, i)
    d1_unit = D_UNIT * p.moves_d1
    start_lanes(p, i, z, START, s)
    for k in range(p.forward.shape[1]):
        low, high, rear, speed = p.behind[i, k + 1], p.ahead[i, k + 1], p.rear[i, k + 1], p.leader_speed[i, k + 1]
        counts = 1.0 if p.counted[i, k] and is_ade else 0.0
        step_with_tangents(
            s,
            inverse,
            (1.0 - p.share) * (p.forward[i, k] * DT),
            p.share * (p.forward[i, k] * DT),
            brake,
            top,
            d1_unit,
            low,
            high,
            rear,
            speed,
            p.target[i, k],
            p.lateral[i, k],
            smoothing,
            floor,
            counts,
        )
        look_outside(p, i, k + 1, s)
        if p.counted[i, k]:
            frames += 1
            if not is_ade:
                measure_error(s, objective, p.loss, p.scale, p.target[i, k])
            add_frame(s)
    share = 1.0 / frames
    for j in range(L):
        s[TOTAL + j] *= share
    for row in range(GRADIENT, WHOLE):
        s[row] *= share


@njit(cache=True, error_model="numpy")
def costs_of(p, i, z, smoothing, values):  # type: ignore[no-untyped-def]
    """Fill the mean costs of one driver.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (m, 5)
        Search coordinates.
    smoothing : float
        Of the distance (m).
    values : float64, shape (m,)
        Filled; NaN if no frame counts.
    """
    lanes = np.empty(PLAIN)
    for first in range(0, z.shape[0], L):
        roll_lanes(p, i, z, first, smoothing, lanes)
        for j in range(min(L, z.shape[0] - first)):
            values[first + j] = lanes[TOTAL + j]
