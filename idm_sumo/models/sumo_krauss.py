r"""SUMO's default car-following model, without its imperfection.

A driver keeps a speed from which it can stop behind its leader, should that one brake as hard as itself: SUMO's
development of Krauss (1998), stepwise as SUMO reckons it. It has the IDM's ``a, b, T, d0``.
"""

from __future__ import annotations

from math import floor, sqrt

from numba import njit

from idm_sumo.models import idm

SLACK = 1e-3  # m and m/s²: SUMO's ``NUMERICAL_EPS``
EMERGENCY_SHARE = 1.2  # of what is needed, when b does not suffice: SUMO's ``EMERGENCY_DECEL_AMPLIFIER``


@njit(cache=True)
def acceleration(speed, approach_rate, gap, a, b, T, d0, dt):  # type: ignore[no-untyped-def]
    """Return the acceleration over a step.

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m), infinite without a leader.
    a, b, T, d0 : float
        Maximum acceleration, deceleration (m/s²), time headway (s) and jam distance (m).
    dt : float
        Length of the step (s).

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    Source: SUMO, ``MSCFModel::maximumSafeFollowSpeed`` with the Euler update, ``sigma`` of 0 and a leader of the same
    deceleration.
    """
    if gap == float("inf"):
        return a
    room, ahead = gap - d0, max(0.0, speed - approach_rate)
    if room < 0.0:
        return -idm.EMERGENCY_BRAKING
    safe = stopping_speed(room + braking_distance(ahead, b, dt), b, T, dt)
    wanted = (speed - safe) / dt
    if wanted > b + SLACK:
        needed = max(EMERGENCY_SHARE * emergency_braking(room, speed, ahead, b), b)
        return -min(needed, wanted)
    return min(a, -wanted)


@njit(cache=True)
def braking_distance(speed, b, dt):  # type: ignore[no-untyped-def]
    """Return the distance (m) to a stop with ``b``.

    Parameters
    ----------
    speed : float
        m/s.
    b : float
        m/s².
    dt : float
        s.
    """
    steps = floor(speed / (b * dt))
    return dt * (steps * speed - b * dt * steps * (steps + 1.0) / 2.0)


@njit(cache=True)
def stopping_speed(room, b, T, dt):  # type: ignore[no-untyped-def]
    """Return the highest speed (m/s) that stops within a room.

    Parameters
    ----------
    room : float
        m.
    b : float
        m/s².
    T : float
        Time until the driver brakes (s).
    dt : float
        s.
    """
    left = room - SLACK
    if left <= 0.0:
        return 0.0
    lost = b * dt
    steps = floor(0.5 + 0.5 * sqrt(dt * dt + 4.0 * (dt * (2.0 * left / lost - T) + T * T)) / dt - T / dt)
    travelled = 0.5 * steps * (steps - 1.0) * lost * dt + steps * lost * T
    return steps * lost + (left - travelled) / (steps * dt + T)


@njit(cache=True)
def emergency_braking(room, speed, ahead, b):  # type: ignore[no-untyped-def]
    """Return the deceleration (m/s²) without which it collides.

    Parameters
    ----------
    room : float
        Gap beyond the jam distance (m), not negative.
    speed, ahead : float
        Own and the leader's (m/s).
    b : float
        The leader's deceleration (m/s²); it brakes harder if the driver must.
    """
    if room == 0.0:
        return idm.EMERGENCY_BRAKING
    alone = 0.5 * speed * speed / (room + 0.5 * ahead * ahead / b)
    if alone <= b:
        return alone
    return 0.5 * (speed * speed - ahead * ahead) / room
