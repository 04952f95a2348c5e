"""Pure pursuit of the lane's centre line, in vector form."""

from __future__ import annotations

from math import atan

from numba import njit

LOOKAHEAD_TIME = 1.5  # s, how far ahead the driver looks
LOOKAHEAD_LEAST = 8.0  # m, at low speed
STEERING_LIMIT = 0.5  # rad, about what a car's front wheels can turn


@njit(cache=True)
def lookahead_distance(speed: float) -> float:
    """Return the distance to the goal point along the lane.

    Parameters
    ----------
    speed : float
        Own speed (m/s).

    Returns
    -------
    float
        Distance ahead (m).
    """
    return max(LOOKAHEAD_LEAST, LOOKAHEAD_TIME * speed)


@njit(cache=True)
def pure_pursuit(heading_x: float, heading_y: float, goal_x: float, goal_y: float, wheelbase: float) -> float:
    r"""Return the steering angle that leads to the goal.

    The circle through the rear axle that is tangent to the heading :math:`h` and meets the goal
    :math:`g` has the curvature :math:`\kappa = 2\,(h \times g)/|g|^2`, and
    :math:`\delta = \arctan(\ell\kappa)` for the wheelbase :math:`\ell`.

    Parameters
    ----------
    heading_x, heading_y : float
        Heading :math:`h` as a unit vector.
    goal_x, goal_y : float
        Goal :math:`g` as a vector from the rear axle (m); it lies on the lane's centre line ahead.
    wheelbase : float
        Wheelbase :math:`\ell` (m).

    Returns
    -------
    float
        Steering angle (rad, positive to the left), limited to ``STEERING_LIMIT``.

    Notes
    -----
    No angle is formed or wrapped, and a car that heads for the goal keeps its heading exactly.
    Source: Coulter (1992), in the vector form of Lundgren (2003).
    """
    cross = heading_x * goal_y - heading_y * goal_x
    curvature = 2.0 * cross / (goal_x * goal_x + goal_y * goal_y)
    return min(max(atan(wheelbase * curvature), -STEERING_LIMIT), STEERING_LIMIT)
