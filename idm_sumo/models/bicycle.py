"""Kinematic bicycle model at the centre of mass.

The step is an Euler step with the old speed. Source: Kong, Pfeiffer, Schildbach and Borrelli
(2015), as printed in the paper's transition model. A recorded position is the centre of the
front bumper; :func:`center_of_front` and :func:`front_of_center` convert between the two points.
"""

from __future__ import annotations

from math import atan, cos, sin, tan

from numba import njit

WHEELBASE_SHARE = 0.6  # of the vehicle's length; 2.8 m for a car of 4.7 m
REAR_SHARE = 0.5  # l_r / (l_f + l_r): the centre of mass lies halfway between the axles, at the middle of the car


@njit(cache=True)
def wheelbase(length: float) -> float:
    """Return the assumed wheelbase of a vehicle.

    Recordings hold the length only, so the wheelbase is taken as a fixed share of it.

    Parameters
    ----------
    length : float
        Vehicle length (m).

    Returns
    -------
    float
        Wheelbase :math:`l_f + l_r` (m).
    """
    return WHEELBASE_SHARE * length


@njit(cache=True)
def center_of_front(front_x: float, front_y: float, heading: float, length: float) -> tuple[float, float]:
    """Convert the front bumper's centre to the centre of mass.

    Parameters
    ----------
    front_x, front_y : float
        Centre of the front bumper (m).
    heading : float
        Heading (rad).
    length : float
        Vehicle length (m).

    Returns
    -------
    x, y : float
        Centre of mass (m).
    """
    return front_x - 0.5 * length * cos(heading), front_y - 0.5 * length * sin(heading)


@njit(cache=True)
def front_of_center(x: float, y: float, heading: float, length: float) -> tuple[float, float]:
    """Convert the centre of mass to the front bumper's centre.

    Parameters
    ----------
    x, y : float
        Centre of mass (m).
    heading : float
        Heading (rad).
    length : float
        Vehicle length (m).

    Returns
    -------
    front_x, front_y : float
        Centre of the front bumper (m).
    """
    return x + 0.5 * length * cos(heading), y + 0.5 * length * sin(heading)


@njit(cache=True)
def step(
    x: float, y: float, heading: float, speed: float, acceleration: float, steering: float, axles: float, dt: float
) -> tuple[float, float, float, float]:
    r"""Return the state one time step later.

    .. math:: \beta = \arctan(\tfrac{l_r}{l_f+l_r}\tan\delta),\quad
        x' = x + v\cos(\psi+\beta)\,dt,\quad y' = y + v\sin(\psi+\beta)\,dt,\quad
        \psi' = \psi + \tfrac{v}{l_r}\sin\beta\,dt,\quad v' = \max(0, v + a\,dt)

    Parameters
    ----------
    x, y : float
        Centre of mass (m).
    heading : float
        Heading :math:`\psi` (rad).
    speed : float
        Speed :math:`v` (m/s).
    acceleration : float
        Acceleration :math:`a` (m/s²).
    steering : float
        Steering angle :math:`\delta` (rad, positive to the left).
    axles : float
        Wheelbase :math:`l_f + l_r` (m).
    dt : float
        Time step (s).

    Returns
    -------
    x, y, heading, speed : float
        State after the step.

    Notes
    -----
    The speed stops at zero because a car does not roll backwards; the printed equations leave this open.
    Source: Kong et al. (2015), eqs. 2-3.
    """
    slip = atan(REAR_SHARE * tan(steering))
    return (
        x + speed * cos(heading + slip) * dt,
        y + speed * sin(heading + slip) * dt,
        heading + speed / (REAR_SHARE * axles) * sin(slip) * dt,
        max(0.0, speed + acceleration * dt),
    )
