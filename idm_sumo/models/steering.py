"""Pure pursuit of the lane's centre line, in vector form."""

from __future__ import annotations

from math import atan

from numba import njit

LOOKAHEAD_TIME = 1.5  # s, how far ahead the driver looks
LOOKAHEAD_LEAST = 8.0  # m, at low speed
STEERING_LIMIT = 0.5  # rad, about what a car's front wheels can turn


@njit(cache=True)
def lookahead_distance(speed: float) -> float:
    """Return how far ahead (m) along the lane the goal point lies."""
    return max(LOOKAHEAD_LEAST, LOOKAHEAD_TIME * speed)


@njit(cache=True)
def pure_pursuit(heading_x: float, heading_y: float, goal_x: float, goal_y: float, wheelbase: float) -> float:
    r"""Return the steering angle (rad, positive to the left) that leads to the goal.

    The circle through the rear axle, tangent to the heading :math:`h` (a unit vector), that
    meets the goal :math:`g` (a vector from the rear axle, m) has the curvature
    :math:`\kappa = 2\,(h \times g)/|g|^2`, and :math:`\delta = \arctan(\ell\kappa)` for the
    wheelbase :math:`\ell` (m). No angle is formed or wrapped, and a car that already heads
    for the goal keeps its heading exactly. Source: Coulter (1992), in Lundgren's (2003)
    vector form; the goal lies on the lane's centre line ahead.
    """
    cross = heading_x * goal_y - heading_y * goal_x
    curvature = 2.0 * cross / (goal_x * goal_x + goal_y * goal_y)
    return min(max(atan(wheelbase * curvature), -STEERING_LIMIT), STEERING_LIMIT)
