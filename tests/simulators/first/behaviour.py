"""How a simulated driver accelerates: three car-following models, and the effects by a flat vector ``e``."""

from __future__ import annotations

import numpy as np
from numba import njit

from tests.simulators.first.plans import SIZES

INDEX = {name: number for number, name in enumerate(SIZES)}
DELAY, SECOND, RELAX, ASYM, TRUCK_AHEAD, SPEED_T, BAND, HYST, FRICTION, PLACE, TIME, LIMIT, OWN_TRUCK, MEMORY, \
    PRESSURE, COURTESY, PREPARE, _, DISTRACT, THROTTLE, ENFORCE, BESIDE, LATE, ACROSS, WEARY \
    = range(len(SIZES))  # fmt: skip

# What a driver sees, one row a driver: what is ahead, beside, behind, and what came before.
(REAR, AHEAD_V, AHEAD_ACC, AHEAD_SLOW_ACC, AHEAD_TRUCK, SECOND_REACH, SECOND_V, JUMP, SINCE, MEAN_V, IN_TIME, COURTEOUS,
 PREPARING, BESIDE_V, TRUCK_BESIDE, TAIL, ANGLE, SPECIAL_LANE, BRAKING_ACROSS, UNREST,
 ACCEPTED_T) = range(21)  # fmt: skip
SEEN = 21
USUAL, OTHER, THIRD = range(3)  # forms, as in `plans.FORMS`


@njit(cache=True)
def base_acceleration(kind, v, s, dv, v0, T, a, b, s0):  # type: ignore[no-untyped-def]
    """Follow at gap ``s``, closing in by ``dv``; ``kind`` 0 is an IDM, 1 full velocity difference, 2 Gipps."""
    s = max(s, 0.3)
    if kind == 0:
        want = s0 + max(0.0, v * T + 0.5 * v * dv / np.sqrt(a * b))
        acc = a * (1.0 - (v / v0) ** 4 - (want / s) ** 2)
        return max(acc, -8.0)
    if kind == 2:
        ahead = max(0.0, v - dv)
        safe = -b * T + np.sqrt((b * T) ** 2 + ahead * ahead + 2.0 * b * max(s - s0, 0.0))
        return max(-8.0, min(a * (1.0 - v / v0), (safe - v) / 0.9))
    ideal = min(v0, max(0.0, (s - s0) / T))
    acc = (0.2 + 0.25 * a) * (ideal - v) - 0.35 * b * dv * min(1.0, 40.0 / s)
    if dv > 0.0 and dv * dv / (2.0 * s) > b:  # would not stop comfortably
        acc = min(acc, -dv * dv / (2.0 * s))
    if s < 1.5 and v > 0.3:
        acc = min(acc, -4.0)
    return max(-8.0, min(acc, 1.3 * a))


@njit(cache=True)
def ramp(value, low, high, width):  # type: ignore[no-untyped-def]
    """Return 1 between ``low`` and ``high``, 0 outside, with edges of ``width``."""
    return min(1.0, max(0.0, (value - low) / width + 0.5)) * min(1.0, max(0.0, (high - value) / width + 0.5))


@njit(cache=True)
def dead(dv, band, form):  # type: ignore[no-untyped-def]
    """Return the approach rate that is noticed."""
    if form == THIRD:  # what is noticed is what goes beyond
        return np.sign(dv) * max(0.0, abs(dv) - band)
    if form == OTHER:  # a soft threshold: small rates fade
        return dv * dv * dv / (dv * dv + 0.5 * band * band) if band > 0.0 else dv
    return 0.0 if abs(dv) < band else dv


@njit(cache=True)
def headway(T, v, e, form, al, al_slow, truck_ahead, own_truck, slow_mean, in_time, courteous, preparing):  # type: ignore[no-untyped-def]
    """Return the time headway with everything that stretches it."""
    if e[TRUCK_AHEAD] > 0.0 and truck_ahead and form != OTHER:
        T *= 1.0 + e[TRUCK_AHEAD]
    if e[SPEED_T] > 0.0:
        lean = (v - 8.0) / 10.0
        T *= 1.0 + e[SPEED_T] * (1.2 * np.tanh(lean / 1.2) if form == OTHER else -lean if form == THIRD else lean)
    if e[HYST] > 0.0:
        T *= 1.0 + e[HYST] * (
            max(-1.0, min(1.0, al)) if form == THIRD else np.tanh((al_slow if form == OTHER else al) / 0.5)
        )
    T *= 1.0 + e[TIME] * in_time
    if own_truck:
        T *= 1.0 + e[OWN_TRUCK]
    T *= 1.0 + e[MEMORY] * max(0.0, 1.0 - slow_mean / 15.0)
    if courteous:
        T *= 1.0 + e[COURTESY]
    if preparing:
        T *= 1.0 + e[PREPARE]
    return max(T, 0.3)


@njit(cache=True)
def credit(e, jump, since, form):  # type: ignore[no-untyped-def]
    """Return the gap (m) that a driver who was cut in on does not miss yet."""
    if e[RELAX] == 0.0 or jump <= 0.0 or form == THIRD:
        return 0.0
    fade = max(0.0, 1.0 - since / 24.0) if form == OTHER else np.exp(-since / 12.0)
    return e[RELAX] * min(jump, 40.0) * fade


@njit(cache=True)
def resigned_to(T, e, jump, since, accepted, form):  # type: ignore[no-untyped-def]
    """Return the time headway (s) on the way back from the one that was accepted at a leader change."""
    if e[RELAX] == 0.0 or jump <= 0.0 or form != THIRD:
        return T
    return T - e[RELAX] * max(0.0, T - accepted) * np.exp(-since / 15.0)


@njit(cache=True)
def respond(model, form, e, theta, limit, own_truck, seen, where, x, v, own, s, dv):  # type: ignore[no-untyped-def]
    """Return the acceleration of a driver at ``x`` with speed ``v`` who acts on ``own`` speed, gap ``s`` and ``dv``.

    ``seen`` is what else there is to see (the columns above); driver noise comes on top.
    """
    v0, T, a, b, s0 = theta[0] * limit, theta[1], theta[2], theta[3], theta[4]
    truck = seen[AHEAD_TRUCK] > 0.0
    T = headway(
        T, own, e, form, seen[AHEAD_ACC], seen[AHEAD_SLOW_ACC], truck, own_truck, seen[MEAN_V], seen[IN_TIME],
        seen[COURTEOUS] > 0.0, seen[PREPARING] > 0.0,
    )  # fmt: skip
    T *= 1.0 + e[WEARY] * min(1.0, seen[UNREST])
    if form == THIRD:  # keeps more distance there, in place of braking
        T *= 1.0 + e[PLACE] * ramp(x, where[0], where[1], 0.1)
    T = resigned_to(T, e, seen[JUMP], seen[SINCE], seen[ACCEPTED_T], form)
    if form == OTHER and truck:
        s0 += e[TRUCK_AHEAD] * theta[1] * 9.0
    room = s + credit(e, seen[JUMP], seen[SINCE], form)
    new = base_acceleration(model, own, room, dead(dv, e[BAND], form), v0, T, a, b, s0)
    w = e[SECOND]
    if w > 0.0 and np.isfinite(seen[SECOND_V]):
        if form == OTHER:
            new = base_acceleration(
                model, own, room, own - (1 - w) * seen[AHEAD_V] - w * seen[SECOND_V], v0, T, a, b, s0
            )
        else:
            far = 0.5 * (seen[SECOND_REACH] - x)
            new = (1 - w) * new + w * base_acceleration(model, own, far, own - seen[SECOND_V], v0, T, a, b, s0)
    if e[ASYM] > 0.0 and new > 0.0:
        new *= 1.0 - e[ASYM] * (min(1.0, new / 0.3) if form == OTHER else 1.0)
    if e[PLACE] > 0.0 and form != THIRD:
        inside = ramp(x, where[0], where[1], 30.0 if form == OTHER else 0.1)
        new -= e[PLACE] * inside
    if v > seen[BESIDE_V]:
        new -= e[FRICTION] * (3.0 * np.tanh((v - seen[BESIDE_V]) / 3.0) if form == OTHER else v - seen[BESIDE_V])
    new -= e[BESIDE] * seen[TRUCK_BESIDE] + e[ACROSS] * seen[BRAKING_ACROSS]
    if e[PRESSURE] > 0.0 and np.isfinite(seen[TAIL]):
        new += e[PRESSURE] * max(0.0, 1.0 - (x - seen[TAIL]) / 15.0)
    new -= e[ENFORCE] * seen[IN_TIME] * seen[SPECIAL_LANE]
    return new + e[THROTTLE] * np.sin(seen[ANGLE])
