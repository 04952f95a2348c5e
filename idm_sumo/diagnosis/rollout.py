"""Compiled closed-loop rollouts of windows, and their linear response to a little more acceleration."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo import idm
from idm_sumo.diagnosis import windows as w
from idm_sumo.effects import slots
from idm_sumo.effects.acceleration import Sight, extended_acceleration
from idm_sumo.effects.reaction_delay import recall
from idm_sumo.road import FRAME_STEP
from idm_sumo.threads import in_threads

Floats = npt.NDArray[np.float64]
PARAMETERS = 5  # a, b, T, d0 and the desired speed; d1 stays zero
NUDGE = 0.1  # m, m/s: of the numerical derivatives by the state; less, and the edge of a dead band looks like a wall
LITTLE = 1e-3  # of a log-parameter
BIN = 5  # frames of one pulse, 0.5 s


@njit(cache=True, error_model="numpy")
def _acted_on(past, k, delay):  # type: ignore[no-untyped-def]
    """Return gap, speed and approach rate that the driver acts on at frame ``k``."""
    if delay > 0.0:
        return (
            recall(past, 0, k, delay, FRAME_STEP), recall(past, 1, k, delay, FRAME_STEP),
            recall(past, 2, k, delay, FRAME_STEP),
        )  # fmt: skip
    return past[k, 0], past[k, 1], past[k, 2]


@njit(cache=True, error_model="numpy")
def _accelerate(seen, k, x, v, past, theta, m):  # type: ignore[no-untyped-def]
    """Return the acceleration at frame ``k`` in the state ``x, v``; row ``k`` of the past is written."""
    past[k, 0], past[k, 1], past[k, 2] = seen[k, w.REAR] - x, v, v - seen[k, w.SPEED]
    gap, speed, approach = _acted_on(past, k, m[slots.DELAY])
    return _law(seen[k], x, gap, speed, approach, theta, m)


@njit(cache=True, error_model="numpy")
def _law(row, x, gap, speed, approach, theta, m):  # type: ignore[no-untyped-def]
    """Return the acceleration of a driver at ``x`` who acts on this gap, speed and approach rate."""
    see = Sight(
        x, row[w.TIME], row[w.ACCELERATION], row[w.KIND], row[w.OWN_KIND], row[w.LANE],
        row[w.SECOND] - x, row[w.SECOND_SPEED], row[w.ADJACENT], x - row[w.BEHIND],
        row[w.JUMP], row[w.SINCE], row[w.UNTIL_CUT_IN], row[w.UNTIL_OWN], row[w.MEAN_SPEED],
    )  # fmt: skip
    return extended_acceleration(speed, approach, gap, see, theta[0], theta[1], theta[2], theta[3], 0.0, theta[4], m)


@njit(cache=True, error_model="numpy")
def _remember(seen, past, begin):  # type: ignore[no-untyped-def]
    """Fill the past with what the recorded twin did before the start."""
    for k in range(begin):
        past[k, 0] = seen[k, w.REAR] - seen[k, w.X]
        past[k, 1] = seen[k, w.V]
        past[k, 2] = seen[k, w.V] - seen[k, w.SPEED]


@njit(cache=True, nogil=True, error_model="numpy")
def _drive(first, last, seen, driver, theta, by_lane, start, pushed, begin, x, v):  # type: ignore[no-untyped-def]
    steps = seen.shape[1] - begin - 1
    past = np.empty((seen.shape[1], 3))
    plain = not by_lane.any()
    for i in range(first, last):
        _remember(seen[i], past, begin)
        own = theta[driver[i]]
        weight, inverse = idm.closing_weight(own[0], own[1]), 1.0 / own[4]
        x[i, 0] = seen[i, begin, w.X] + start[0]
        v[i, 0] = max(seen[i, begin, w.V] + start[1], 0.0)
        for k in range(steps):
            if plain:  # most rollouts, and several times faster
                gap, approach = seen[i, begin + k, w.REAR] - x[i, k], v[i, k] - seen[i, begin + k, w.SPEED]
                a = idm.acceleration_of(v[i, k], approach, gap, own[0], weight, own[2], own[3], 0.0, inverse)
            else:
                m = by_lane[int(seen[i, begin + k, w.LANE])]
                a = _accelerate(seen[i], begin + k, x[i, k], v[i, k], past, own, m)
            if pushed.shape[0] > 0:
                a += pushed[i, k]
            v[i, k + 1] = max(v[i, k] + a * FRAME_STEP, 0.0)
            x[i, k + 1] = x[i, k] + 0.5 * (v[i, k] + v[i, k + 1]) * FRAME_STEP


def drive(
    seen: Floats,
    driver: npt.NDArray[np.int64],
    theta: Floats,
    by_lane: Floats,
    start: Floats,
    pushed: Floats,
    begin: int,
) -> tuple[Floats, Floats]:
    """Return positions and speeds of all windows, each of shape ``(windows, horizon + 1)``.

    Parameters
    ----------
    seen : float64, shape (windows, LEAD + horizon + 1, COLUMNS)
    driver : int64, shape (windows,)
    theta : float64, shape (drivers, 5)
    by_lane : float64, shape (9, slots.COUNT)
        Magnitudes by lane number.
    start : float64, shape (2,)
        Added to the recorded start: m, m/s.
    pushed : float64, shape (windows, horizon) or (0, 0)
        Acceleration (m/s²) added to the driver's own.
    begin : int
        The frame at which the simulation starts.
    """
    x, v = (np.empty((len(seen), seen.shape[1] - begin)) for _ in range(2))
    in_threads(_drive, len(seen), seen, driver, theta, by_lane, start, pushed, begin, x, v)
    return x, v


# What `respond` notes of the base rollout at each step.
BY_T, BY_V0, BASE_A, BASE_V, BASE_X, BY_GAP, BY_V = range(7)


def respond(seen: Floats, driver: npt.NDArray[np.int64], theta: Floats, by_lane: Floats) -> tuple[Floats, Floats]:
    """Return the response of the compared positions to pulses of acceleration, and the base rollout's state.

    Returns
    -------
    response : float64, shape (windows, moments, pulses)
        Metres per m/s² held for one pulse (0.5 s).
    state : float64, shape (windows, horizon, 7)
        Derivatives of the acceleration by log T and log v0 (m/s²), the acceleration, speed and position,
        the derivatives by gap and by own speed.
    """
    steps = seen.shape[1] - w.LEAD - 1
    response = np.zeros((len(seen), steps // w.EVERY, steps // BIN))
    state = np.empty((len(seen), steps, 7))
    in_threads(_respond, len(seen), seen, driver, theta, by_lane, response, state)
    return response, state


@njit(cache=True, nogil=True, error_model="numpy")
def _respond(first, last, seen, driver, theta, by_lane, response, state):  # type: ignore[no-untyped-def]
    steps, pulses = state.shape[1], response.shape[2]
    past = np.empty((seen.shape[1], 3))
    for i in range(first, last):
        _remember(seen[i], past, w.LEAD)
        x, v = seen[i, w.LEAD, w.X], seen[i, w.LEAD, w.V]
        p = theta[driver[i]].copy()
        dx, dv = np.zeros((steps + 1, pulses)), np.zeros((steps + 1, pulses))
        for k in range(steps):
            now = w.LEAD + k
            m, row = by_lane[int(seen[i, now, w.LANE])], seen[i, now]
            a = _accelerate(seen[i], now, x, v, past, p, m)
            gap, speed, rate = _acted_on(past, now, m[slots.DELAY])
            nearer = _law(row, x + NUDGE, gap - NUDGE, speed, rate, p, m)
            by_x = (nearer - _law(row, x - NUDGE, gap + NUDGE, speed, rate, p, m)) / (2.0 * NUDGE)
            faster = _law(row, x, gap, speed + NUDGE, rate + NUDGE, p, m)
            by_v = (faster - _law(row, x, gap, speed - NUDGE, rate - NUDGE, p, m)) / (2.0 * NUDGE)
            p[2] *= 1.0 + LITTLE
            state[i, k, BY_T] = (_law(row, x, gap, speed, rate, p, m) - a) / LITTLE
            p[2] = theta[driver[i], 2]
            p[4] *= 1.0 + LITTLE
            state[i, k, BY_V0] = (_law(row, x, gap, speed, rate, p, m) - a) / LITTLE
            p[4] = theta[driver[i], 4]
            ago = k - int(np.rint(m[slots.DELAY] / FRAME_STEP))
            state[i, k, BASE_A], state[i, k, BASE_V], state[i, k, BASE_X] = a, v, x
            state[i, k, BY_GAP], state[i, k, BY_V] = -by_x, by_v
            new = v + a * FRAME_STEP
            moving = 1.0 if new > 0.0 else 0.0
            for j in range(min(k // BIN + 1, pulses)):
                change = 1.0 if k // BIN == j else 0.0
                if ago >= 0:
                    change += by_x * dx[ago, j] + by_v * dv[ago, j]
                dv[k + 1, j] = (dv[k, j] + change * FRAME_STEP) * moving
                dx[k + 1, j] = dx[k, j] + 0.5 * (dv[k, j] + dv[k + 1, j]) * FRAME_STEP
            x += 0.5 * (v + max(new, 0.0)) * FRAME_STEP
            v = max(new, 0.0)
            if (k + 1) % w.EVERY == 0:
                for j in range(pulses):
                    response[i, (k + 1) // w.EVERY - 1, j] = dx[k + 1, j]


NO_PUSH = np.empty((0, 0))
PLAIN = np.zeros((9, slots.COUNT))


def positions(windows: w.Windows, theta: Floats, by_lane: Floats, dx: float = 0.0, dv: float = 0.0) -> Floats:
    """Return the simulated positions (m) at the compared moments, shape ``(windows, moments)``."""
    x, _ = drive(windows.seen, windows.driver, theta, by_lane, np.array([dx, dv]), NO_PUSH, w.LEAD)
    return np.ascontiguousarray(x[:, w.EVERY :: w.EVERY])
