"""Vehicles as rectangles: where they stand, and whether two overlap."""

from __future__ import annotations

from math import cos, sin

from numba import njit

from idm_sumo.models.bicycle import center_of_front


@njit(cache=True)
def rectangle(front_x: float, front_y: float, heading: float, length: float, width: float):  # type: ignore[no-untyped-def]
    """Return the rectangle of a vehicle.

    Parameters
    ----------
    front_x, front_y : float
        Centre of the front bumper (m).
    heading, length, width : float
        Heading (rad) and size (m).

    Returns
    -------
    x, y : float
        Middle (m).
    cos, sin : float
        Direction.
    half_length, half_width : float
        Half sizes (m).
    """
    x, y = center_of_front(front_x, front_y, heading, length)
    return x, y, cos(heading), sin(heading), 0.5 * length, 0.5 * width


@njit(cache=True)
def separation(one, other, axis_x, axis_y):  # type: ignore[no-untyped-def]
    """Return the distance of two rectangles along an axis.

    Parameters
    ----------
    one, other : tuple of float
        Rectangles of :func:`rectangle`.
    axis_x, axis_y : float
        Unit vector of the axis.

    Returns
    -------
    float
        Distance of their projections (m), negative where these overlap.
    """
    between = abs((other[0] - one[0]) * axis_x + (other[1] - one[1]) * axis_y)
    return between - _half_shadow(one, axis_x, axis_y) - _half_shadow(other, axis_x, axis_y)


@njit(cache=True)
def _half_shadow(rect, axis_x, axis_y):  # type: ignore[no-untyped-def]
    along = abs(rect[2] * axis_x + rect[3] * axis_y)
    across = abs(rect[2] * axis_y - rect[3] * axis_x)
    return rect[4] * along + rect[5] * across


@njit(cache=True)
def overlap(one, other) -> bool:  # type: ignore[no-untyped-def]
    """Return whether two rectangles share area.

    They do if no edge of either separates them (separating axis theorem).

    Parameters
    ----------
    one, other : tuple of float
        Rectangles of :func:`rectangle`.

    Returns
    -------
    bool
        False also where they only touch.
    """
    for rect in (one, other):
        along, across = separation(one, other, rect[2], rect[3]), separation(one, other, -rect[3], rect[2])
        if along >= 0.0 or across >= 0.0:
            return False
    return True
