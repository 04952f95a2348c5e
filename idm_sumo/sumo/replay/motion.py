"""One frame of a modelled vehicle: controls and bicycle, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.models import bicycle
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import control

Floats = npt.NDArray[np.float64]


class Driver(NamedTuple):
    """What a modelled vehicle is driven by.

    Attributes
    ----------
    theta : float64, shape (5,)
        ``a, b, T, d0, d1`` (SI units).
    desired_speed : float
        m/s.
    length : float
        Length of the vehicle (m).
    lane_y : float
        Middle of the lane it steers for (m).
    """

    theta: Floats
    desired_speed: float
    length: float
    lane_y: float


class Motion(NamedTuple):
    """Motion of a modelled vehicle.

    Attributes
    ----------
    x, y : float
        Centre of mass (m).
    heading : float
        rad.
    speed : float
        m/s.
    """

    x: float
    y: float
    heading: float
    speed: float


def start_of(scenes: Scenes, i: int) -> tuple[float, float, float, float]:
    """Return the state with which a window's simulation starts.

    Parameters
    ----------
    scenes : Scenes
    i : int
        Number of the window.

    Returns
    -------
    x, y : float
        Front bumper (m).
    heading : float
        rad.
    speed : float
        m/s.
    """
    k = scenes.start
    return float(scenes.x[i, k]), float(scenes.y[i, k]), float(scenes.heading[i, k]), float(scenes.speed[i, k])


@njit(cache=True)
def advance(motion, gap, leader_speed, driver):  # type: ignore[no-untyped-def]
    """Drive a vehicle one frame by IDM and pure pursuit.

    Parameters
    ----------
    motion : Motion
        State at the beginning of the frame.
    gap : float
        Bumper to bumper to the leader (m), infinite without one.
    leader_speed : float
        m/s; the own speed without a leader.
    driver : Driver

    Returns
    -------
    acceleration, steering : float
        Controls of the frame (m/s², rad), of :func:`idm_sumo.simulation.rollout.control`.
    motion : Motion
        State one frame later.
    front_x, front_y : float
        Front bumper (m) one frame later.
    """
    acceleration, steering = control(
        motion.x, motion.y, motion.heading, motion.speed, gap, leader_speed,
        driver.theta, driver.desired_speed, driver.length, driver.lane_y,
    )  # fmt: skip
    after, front_x, front_y = moved(motion, acceleration, steering, driver.length)
    return acceleration, steering, after, front_x, front_y


@njit(cache=True)
def moved(motion, acceleration, steering, length):  # type: ignore[no-untyped-def]
    """Move a vehicle one frame by given controls.

    Parameters
    ----------
    motion : Motion
        State at the beginning of the frame.
    acceleration, steering : float
        Controls (m/s², rad).
    length : float
        Length of the vehicle (m).

    Returns
    -------
    motion : Motion
        State one frame later, of :func:`idm_sumo.models.bicycle.step`.
    front_x, front_y : float
        Front bumper (m) one frame later.
    """
    x, y, heading, speed = bicycle.step(
        motion.x, motion.y, motion.heading, motion.speed, acceleration, steering, bicycle.wheelbase(length), FRAME_STEP
    )
    front_x, front_y = bicycle.front_of_center(x, y, heading, length)
    return Motion(x, y, heading, speed), front_x, front_y
