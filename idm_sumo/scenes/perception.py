"""Who is ahead along a path, modelled or recorded.

One definition for metrics and driving codes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.scenes.traffic import NOBODY, leader_row
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes

Floats = npt.NDArray[np.float64]


class LeadersAlong(NamedTuple):
    """The leader at every step of many paths.

    Attributes
    ----------
    gap : float64, shape (vehicles, steps)
        Bumper to bumper (m), infinite without a leader.
    speed : float64, shape (vehicles, steps)
        m/s, NaN without a leader.
    """

    gap: Floats
    speed: Floats


def leaders_along(scenes: Scenes, x: Floats, y: Floats, first: int) -> LeadersAlong:
    """Return gap to and speed of each path's leader.

    Parameters
    ----------
    scenes : Scenes
    x, y : float64, shape (vehicles, steps)
        Front bumper (m), modelled or recorded.
    first : int
        Frame of the window that column 0 belongs to.

    Returns
    -------
    LeadersAlong
        Arrays of shape ``(vehicles, steps)``.

    Notes
    -----
    The leader is the first recorded vehicle ahead in the lane that holds the front *at that
    step*, the driver's own recorded vehicle excepted. Where only the headway of the recorded vehicle
    is known (``leader_source == "twin"``), it is the recorded vehicle's leader, whatever the lane.
    """
    cells = _cells_along(scenes, y, first)
    gap, speed = np.empty(x.shape), np.empty(x.shape)
    t = scenes.traffic
    _look_ahead(
        np.ascontiguousarray(x), cells, scenes.vehicle, t.offsets, t.x, t.speed, t.length, t.vehicle, gap, speed
    )
    return LeadersAlong(gap, speed)


def leader_rows_along(scenes: Scenes, x: Floats, y: Floats, first: int) -> npt.NDArray[np.int64]:
    """Return the traffic's rows of the paths' leaders.

    -1 for none.

    Parameters
    ----------
    scenes : Scenes
    x, y : float64, shape (vehicles, steps)
        Front bumper (m).
    first : int
        Frame of the window that column 0 belongs to.

    Returns
    -------
    int64, shape (vehicles, steps)
    """
    rows, t = np.empty(x.shape, dtype=np.int64), scenes.traffic
    cells = _cells_along(scenes, y, first)
    _leader_rows(np.ascontiguousarray(x), cells, scenes.vehicle, t.offsets, t.x, t.vehicle, rows)
    return rows


def _cells_along(scenes: Scenes, y: Floats, first: int) -> npt.NDArray[np.int64]:
    """Return the cell that holds each point of the paths."""
    steps = first + np.arange(y.shape[1])
    if scenes.leader_source == LEADER_FROM_LANE:
        return scenes.cells(scenes.road.lane_at(y), steps)
    return scenes.cell[:, None] + steps


@njit(cache=True)
def _leader_rows(x, cells, own, offsets, traffic_x, traffic_vehicle, rows):  # type: ignore[no-untyped-def]
    for i in range(x.shape[0]):
        for k in range(x.shape[1]):
            rows[i, k] = leader_row(offsets, traffic_x, traffic_vehicle, cells[i, k], x[i, k], own[i])


@njit(cache=True)
def _look_ahead(x, cells, own, offsets, traffic_x, traffic_speed, traffic_length, traffic_vehicle, gap, speed):  # type: ignore[no-untyped-def]
    for i in range(x.shape[0]):
        for k in range(x.shape[1]):
            row = leader_row(offsets, traffic_x, traffic_vehicle, cells[i, k], x[i, k], own[i])
            gap[i, k], speed[i, k] = np.inf, np.nan
            if row != NOBODY:
                gap[i, k], speed[i, k] = traffic_x[row] - traffic_length[row] - x[i, k], traffic_speed[row]
