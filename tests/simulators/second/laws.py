"""Car-following laws: acceleration in m/s2 from gap, speed, the leader's speed and a driver's five parameters."""

import math

from numba import njit

LAWS = ("idm", "iidm", "full_velocity_difference", "gipps", "newell_relaxed", "krauss")
V0, T, S0, A, B = range(5)  # columns of a driver: desired speed, time headway, jam distance, acceleration, deceleration
SMALLEST_GAP = 0.3  # m, keeps quotients by the gap finite


@njit(cache=True)
def desired_gap(v, approach, th):
    """Gap in m that the IDM driver wants, the dynamic part never below zero."""
    return th[S0] + max(0.0, v * th[T] + 0.5 * v * approach / math.sqrt(th[A] * th[B]))


@njit(cache=True)
def idm(s, v, vl, th):
    """Intelligent Driver Model (Treiber, Hennecke and Helbing 2000)."""
    return th[A] * (1.0 - (v / th[V0]) ** 4 - (desired_gap(v, v - vl, th) / s) ** 2)


@njit(cache=True)
def iidm(s, v, vl, th):
    """Improved IDM (Treiber and Kesting): the desired gap is kept exactly below the desired speed."""
    z = desired_gap(v, v - vl, th) / s
    if v >= th[V0]:
        free = -th[B] * (1.0 - (th[V0] / v) ** (4.0 * th[A] / th[B]))
        return free if z < 1.0 else free + th[A] * (1.0 - z * z)
    free = th[A] * (1.0 - (v / th[V0]) ** 4)
    if z >= 1.0:
        return th[A] * (1.0 - z * z)
    return free * (1.0 - z ** min(40.0, 2.0 * th[A] / max(free, 1e-6)))


@njit(cache=True)
def full_velocity_difference(s, v, vl, th):
    """Optimal velocity with a speed difference term, and kinematic braking that grows as the gap closes."""
    room = max(0.0, s - th[S0])
    wanted = th[V0] * math.tanh(room / (th[V0] * th[T]))
    closing = max(0.0, v - vl)
    kinematic = 0.5 * closing * closing / max(room, 1.0)
    return min(th[A], (wanted - v) * th[A] / 4.0 + 0.7 * (vl - v) / (1.0 + (s / 50.0) ** 2) - kinematic)


@njit(cache=True)
def gipps(s, v, vl, th):
    """Gipps' safe speed, reached within his reaction time; at rest against the leader the headway is 1.5 tau = T."""
    tau = th[T] / 1.5
    share = v / th[V0]
    faster = v + 2.5 * th[A] * tau * (1.0 - share) * math.sqrt(0.025 + max(0.0, share))
    under = (th[B] * tau) ** 2 + th[B] * (2.0 * (s - th[S0]) - v * tau) + vl * vl
    safe = -th[B] * tau + math.sqrt(max(0.0, under))
    return (min(faster, safe) - v) / tau


@njit(cache=True)
def newell_relaxed(s, v, vl, th):
    """Newell's gap-speed line approached in a third of a time headway, with bounded acceleration (no approach rate)."""
    wanted = min(th[V0], max(0.0, s - th[S0]) / th[T])
    return min(th[A] * (1.0 - 0.5 * v / th[V0]), 3.0 * (wanted - v) / th[T])


@njit(cache=True)
def krauss(s, v, vl, th):
    """Krauss' safe speed reached within a second; the driver's noise is added elsewhere, for all laws alike."""
    safe = vl + (s - th[S0] - vl * th[T]) / ((v + vl) / (2.0 * th[B]) + th[T])
    return min(th[A] * (1.0 - 0.5 * v / th[V0]), min(safe, th[V0]) - v)


@njit(cache=True)
def acceleration(law, s, v, vl, th):
    """Acceleration in m/s2 by the law of that number in `LAWS`."""
    s = max(s, SMALLEST_GAP)
    if law == 0:
        return idm(s, v, vl, th)
    if law == 1:
        return iidm(s, v, vl, th)
    if law == 2:
        return full_velocity_difference(s, v, vl, th)
    if law == 3:
        return gipps(s, v, vl, th)
    return newell_relaxed(s, v, vl, th) if law == 4 else krauss(s, v, vl, th)
