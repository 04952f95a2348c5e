r"""A driver's acceleration beyond the pooled IDM, as compiled kernels.

.. math:: \dot v = \dot v_\mathrm{IDM}(v, \Delta v, d) + r(s, t),\qquad
    r = c_0 + c_1 e^{-t/1\,\mathrm s} + c_2 e^{-t/3\,\mathrm s} + \sum_j w_j\psi_j(s)

The :math:`\psi_j` are the present state :math:`s` in standard units, its squares and its products, with weights
:math:`w` that all drivers share. The three :math:`c` belong to the driver: what was observed of it, lasting and fading.
Without a leader the residual is 0.
"""

from __future__ import annotations

from math import exp, log

from numba import njit

STATE = 5  # speed, logarithm of the gap, approach rate, time gap, leader's acceleration
SQUARES = STATE * (STATE + 1) // 2
REGRESSORS = STATE + SQUARES
OWN = 3  # numbers of a driver
FADING = (1.0, 3.0)  # s, within which two of them decay to 1/e

FURTHEST = 3.0  # standard deviations: a value counts as this at most
LEAST_GAP = 0.5  # m
SLOWEST = 3.0  # m/s, below it a time gap is the gap by this
LONGEST = 6.0  # s, the longest time gap that is told apart
NEW_LEADER = 10.0  # m/s^2: a leader's speed that changes faster is another leader's
LEADER_MEMORY = 0.3  # s, over which a leader's acceleration is averaged


@njit(cache=True, error_model="numpy")
def standard_state(speed, rate, gap, leader_acceleration, center, scale, state, by_speed, by_gap):  # type: ignore[no-untyped-def]
    """Fill the state in standard units, and its derivatives.

    Parameters
    ----------
    speed, rate, gap, leader_acceleration : float
        m/s, own speed less the leader's (m/s), m, m/s².
    center, scale : float64, shape (5,)
        Mean and standard deviation of each.
    state, by_speed, by_gap : float64, shape (5,)
        Filled; the derivatives are those at a fixed speed of the leader, 0 where a value is cut off.
    """
    d, v = max(gap, LEAST_GAP), max(speed, SLOWEST)
    state[0], by_speed[0], by_gap[0] = speed, 1.0, 0.0
    state[1], by_speed[1], by_gap[1] = log(d), 0.0, (1.0 / d if gap > LEAST_GAP else 0.0)
    state[2], by_speed[2], by_gap[2] = rate, 1.0, 0.0
    state[3] = min(d / v, LONGEST)
    inside = 1.0 if d / v < LONGEST else 0.0
    by_speed[3] = -inside * d / (v * v) if speed > SLOWEST else 0.0
    by_gap[3] = inside / v if gap > LEAST_GAP else 0.0
    state[4], by_speed[4], by_gap[4] = leader_acceleration, 0.0, 0.0
    for j in range(STATE):
        value = (state[j] - center[j]) / scale[j]
        kept = 1.0 / scale[j] if abs(value) < FURTHEST else 0.0
        state[j] = min(max(value, -FURTHEST), FURTHEST)
        by_speed[j] *= kept
        by_gap[j] *= kept


@njit(cache=True, error_model="numpy")
def regressors(state, values):  # type: ignore[no-untyped-def]
    """Fill the state, its squares and its products.

    Parameters
    ----------
    state : float64, shape (5,)
        In standard units.
    values : float64, shape (20,)
        Filled.
    """
    at = STATE
    for j in range(STATE):
        values[j] = state[j]
        for k in range(j + 1):
            values[at] = state[j] * state[k]
            at += 1


@njit(cache=True, error_model="numpy")
def shared_slopes(state, weights, slopes):  # type: ignore[no-untyped-def]
    """Fill the derivatives of the shared part by the state.

    Parameters
    ----------
    state : float64, shape (5,)
        In standard units.
    weights : float64, shape (20,)
    slopes : float64, shape (5,)
        Filled (m/s² per standard unit).
    """
    at = STATE
    for j in range(STATE):
        slopes[j] = weights[j]
    for j in range(STATE):
        for k in range(j + 1):
            slopes[j] += weights[at] * state[k]
            slopes[k] += weights[at] * state[j]
            at += 1


@njit(cache=True, error_model="numpy")
def fading(time, values):  # type: ignore[no-untyped-def]
    """Fill what the driver's own numbers are multiplied by.

    Parameters
    ----------
    time : float
        Since the last observed frame (s).
    values : float64, shape (3,)
        Filled.
    """
    values[0], values[1], values[2] = 1.0, exp(-time / FADING[0]), exp(-time / FADING[1])


@njit(cache=True, error_model="numpy")
def followed_acceleration(before, speed_before, speed, step):  # type: ignore[no-untyped-def]
    """Return the leader's acceleration as a driver knows it.

    Parameters
    ----------
    before : float
        As it was known a step ago (m/s²).
    speed_before, speed : float
        The leader's (m/s).
    step : float
        s.

    Returns
    -------
    float
        m/s²: an average over what the leader did so far; 0 if the leader is another one.
    """
    now = (speed - speed_before) / step
    if abs(now) > NEW_LEADER:
        return 0.0
    return before + min(step / LEADER_MEMORY, 1.0) * (now - before)
