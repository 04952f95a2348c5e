"""What a vehicle sees of the traffic around a place.

Kernels for a replay and for the closed loop.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import Stimuli
from idm_sumo.models.effects.adjacent_lane_friction import AHEAD, BESIDE
from idm_sumo.scenes.traffic import NOBODY, first_ahead

NOBODY_YET = -2  # number of the leader before anybody was looked at


@njit(cache=True)
def behind(offsets, x, vehicle, cell, front, own):  # type: ignore[no-untyped-def]
    """Return the row of the follower, or ``NOBODY``.

    The last vehicle of the cell whose front is not ahead.

    Parameters
    ----------
    offsets, x, vehicle
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.
    cell : int
    front : float
        Front bumper (m).
    own : int
        Number of the modelled vehicle.

    Returns
    -------
    int
    """
    row, first = first_ahead(offsets, x, cell, front) - 1, offsets[cell]
    while row >= first and vehicle[row] == own:
        row -= 1
    return row if row >= first else NOBODY


@njit(cache=True)
def mean_speed_near(offsets, x, speed, vehicle, cell, front, own):  # type: ignore[no-untyped-def]
    """Return the mean speed (m/s) within ``BESIDE`` of a position.

    Parameters
    ----------
    offsets, x, speed, vehicle
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.
    cell : int
    front : float
        Front bumper (m).
    own : int
        Number of the modelled vehicle.

    Returns
    -------
    float
        NaN without anybody there.
    """
    total, count = 0.0, 0
    for row in range(offsets[cell], offsets[cell + 1]):
        if abs(x[row] - front) <= BESIDE and vehicle[row] != own:
            total += speed[row]
            count += 1
    return total / count if count else np.nan


@njit(cache=True)
def next_speed(offsets, x, speed, vehicle, cell, front, own):  # type: ignore[no-untyped-def]
    """Return the speed (m/s) of the next vehicle ahead.

    Parameters
    ----------
    offsets, x, speed, vehicle
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.
    cell : int
    front : float
        Front bumper (m).
    own : int
        Number of the modelled vehicle.

    Returns
    -------
    float
        NaN without anybody up to ``AHEAD`` of the position.
    """
    row = first_ahead(offsets, x, cell, front)
    while row < offsets[cell + 1] and vehicle[row] == own:
        row += 1
    return speed[row] if row < offsets[cell + 1] and x[row] - front <= AHEAD else np.nan


@njit(cache=True)
def slower(one, other):  # type: ignore[no-untyped-def]
    """Return the lower of two speeds.

    Parameters
    ----------
    one, other : float
        m/s; either may be unknown (NaN).

    Returns
    -------
    float
    """
    return other if other == other and not other >= one else one


@njit(cache=True)
def slower_beside(offsets, x, speed, vehicle, cell, frames, lane, front, own):  # type: ignore[no-untyped-def]
    """Return the lower speeds of the adjacent lanes.

    Parameters
    ----------
    offsets, x, speed, vehicle
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.
    cell, frames : int
        The own lane's cell, and cells per lane.
    lane : int
        Main lane.
    front : float
        Front bumper (m).
    own : int
        Number of the modelled vehicle.

    Returns
    -------
    mean, next : float
        The lower mean speed near and that of the slower next vehicle (m/s); NaN without anybody there.
    """
    mean, next_one = np.nan, np.nan
    lanes = (len(offsets) - 1) // frames
    for side in (-1, 1):
        if 1 <= lane + side <= lanes:
            there = cell + side * frames
            mean = slower(mean, mean_speed_near(offsets, x, speed, vehicle, there, front, own))
            next_one = slower(next_one, next_speed(offsets, x, speed, vehicle, there, front, own))
    return mean, next_one


@njit(cache=True)
def look(  # type: ignore[no-untyped-def]
    offsets, x, speed, length, vehicle, others, cell, frames, lane, alone, own, own_length, front, row, gap, t,
    own_class, jump, since, accepted, until_cut_in, until_own_change, mean_speed,
):  # fmt: skip
    """Return what a driver sees at its simulated place.

    Parameters
    ----------
    offsets, x, speed, length, vehicle
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.
    others : TrafficDetails
    cell, frames : int
        The own lane's cell, and cells per lane.
    lane : int
        Main lane.
    alone : bool
        Whether the driver has a lane of its own, with nobody beside or behind.
    own, own_length : int, float
        Number and length (m) of the modelled vehicle.
    front : float
        Front bumper (m).
    row, gap : int, float
        The leader's row, or ``NOBODY``, and the gap to it (m).
    t : float
        Since the first frame of the period (s).
    own_class : float
    jump, since, accepted : float
        By how much the last leader change shortened the gap (m), the time since and the time headway
        right after it (s); NaN for none.
    until_cut_in, until_own_change : float
        s; NaN for none.
    mean_speed : float
        Of the driver up to now (m/s).

    Returns
    -------
    Stimuli
    """
    leader_acceleration, leader_acceleration_mean, leader_class = 0.0, 0.0, np.nan
    second_gap, second_speed, rear_gap = np.inf, np.nan, np.nan
    adjacent_speed, next_adjacent_speed = np.nan, np.nan
    if row != NOBODY:
        leader_acceleration, leader_class = others.acceleration[row], others.vehicle_class[row]
        leader_acceleration_mean = others.acceleration_of_late[row]
        second = row + 1
        while second < offsets[cell + 1] and vehicle[second] == own:
            second += 1
        if second < offsets[cell + 1]:
            second_gap = gap + x[second] - length[second] - x[row]
            second_speed = speed[second]
    if not alone:
        adjacent_speed, next_adjacent_speed = slower_beside(offsets, x, speed, vehicle, cell, frames, lane, front, own)
        rear = behind(offsets, x, vehicle, cell, front, own)
        rear_gap = front - own_length - x[rear] if rear != NOBODY else np.inf
    return Stimuli(
        front, t, leader_acceleration, leader_class, own_class, float(lane), second_gap, second_speed, adjacent_speed,
        rear_gap, jump, since, accepted, until_cut_in, until_own_change, mean_speed, next_adjacent_speed,
        leader_acceleration_mean,
    )  # fmt: skip
