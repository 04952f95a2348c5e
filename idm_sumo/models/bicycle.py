r"""Kinematic bicycle model at the centre of mass, Euler step with the old speed.

Source: Kong, Pfeiffer, Schildbach and Borrelli (2015), as printed in the paper's transition
model. A recorded position is the front bumper's centre; :func:`center_of_front` and
:func:`front_of_center` convert at the border.
"""

from __future__ import annotations

from math import asin, atan, cos, hypot, sin, tan
from typing import NamedTuple

from numba import njit

WHEELBASE_SHARE = 0.6  # of the vehicle's length; 2.8 m for a car of 4.7 m
REAR_SHARE = 0.5  # l_r / (l_f + l_r): the centre of mass lies amid the axles, and amid the car


class State(NamedTuple):
    """Where the centre of mass is and how it moves: ``x``, ``y`` (m), ``heading`` (rad), ``speed`` (m/s)."""

    x: float
    y: float
    heading: float
    speed: float


@njit(cache=True)
def wheelbase(length: float) -> float:
    """Return ``l_f + l_r`` (m) of a vehicle ``length`` m long; no recording has it, so it is assumed."""
    return WHEELBASE_SHARE * length


@njit(cache=True)
def center_of_front(front_x: float, front_y: float, heading: float, length: float) -> tuple[float, float]:
    """Return the centre of mass (m) of the vehicle whose front bumper's centre is given."""
    return front_x - 0.5 * length * cos(heading), front_y - 0.5 * length * sin(heading)


@njit(cache=True)
def front_of_center(x: float, y: float, heading: float, length: float) -> tuple[float, float]:
    """Return the front bumper's centre (m); the inverse of :func:`center_of_front`."""
    return x + 0.5 * length * cos(heading), y + 0.5 * length * sin(heading)


@njit(cache=True)
def step(
    x: float, y: float, heading: float, speed: float, acceleration: float, steering: float, axles: float, dt: float
) -> tuple[float, float, float, float]:
    r"""Return the state ``dt`` seconds later.

    .. math:: \beta = \arctan(\tfrac{l_r}{l_f+l_r}\tan\delta),\quad
        x' = x + v\cos(\psi+\beta)\,dt,\quad y' = y + v\sin(\psi+\beta)\,dt,\quad
        \psi' = \psi + \tfrac{v}{l_r}\sin\beta\,dt,\quad v' = \max(0, v + a\,dt)

    ``axles`` is the wheelbase ``l_f + l_r`` (m). A car does not roll backwards: the speed
    stops at zero, which the printed equations leave open.
    """
    slip = atan(REAR_SHARE * tan(steering))
    return (
        x + speed * cos(heading + slip) * dt,
        y + speed * sin(heading + slip) * dt,
        heading + speed / (REAR_SHARE * axles) * sin(slip) * dt,
        max(0.0, speed + acceleration * dt),
    )


def controls_between(before: State, after: State, axles: float, dt: float) -> tuple[float, float]:
    """Return acceleration (m/s²) and steering (rad) that lead from one state to the next.

    The inverse of :func:`step`. At standstill every steering angle leads to the same state
    and 0 is returned.
    """
    acceleration = (after.speed - before.speed) / dt
    if hypot(after.x - before.x, after.y - before.y) == 0.0 or before.speed == 0.0:
        return acceleration, 0.0
    slip = asin((after.heading - before.heading) * REAR_SHARE * axles / (before.speed * dt))
    return acceleration, atan(tan(slip) / REAR_SHARE)
