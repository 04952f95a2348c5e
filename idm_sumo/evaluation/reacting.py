"""Modelled vehicles with followers that react.

A replayed vehicle cannot react to a modelled vehicle that deviates from its recorded path. Here the
first recorded vehicles that come to be behind the modelled vehicle in its lane are modelled from
then on, too: they keep the lane and follow the next vehicle ahead by the IDM. All others are
replayed. The difference to a plain replay shows the effect of followers that do not react.

The modelled vehicle looks ahead only, so its path is the same in both cases, except where a
replayed follower drives through it and then becomes its leader.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.evaluation.metrics import score
from idm_sumo.models import bicycle
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.traffic import NOBODY, Traffic, sort_into_cells
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import Trajectories, control, drive_idm, perceive

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

STATE = (c.X, c.Y, c.HEADING, c.SPEED)


def score_with_reacting(
    scenes: Scenes, parameters: npt.ArrayLike, followers: pd.DataFrame | npt.ArrayLike, *, reacting: int = 3,
    desired_speed: float | None = None,
) -> pd.DataFrame:  # fmt: skip
    """Score every vehicle with followers that react.

    Parameters
    ----------
    scenes : Scenes
        With all vehicles of the surroundings (``leader_source == "lane"``).
    parameters : array_like, shape (vehicles, 5) or (5,)
        ``a, b, T, d0, d1`` of the modelled vehicles.
    followers : pandas.DataFrame or array_like, shape (5,)
        Parameters of the followers: a table with ``vehicle, a, b, T, d0, d1``, one row each and, for all
        others, a row with vehicle 0; or one set for all.
    reacting : int
        Largest number of followers that react, the first ones.
    desired_speed : float, optional
        Desired speed of all vehicles (m/s); by default the road's speed limit.

    Returns
    -------
    pandas.DataFrame
        :func:`idm_sumo.evaluation.metrics.score`, and ``followers``: how many vehicles reacted.

    Raises
    ------
    InputError
        If the recording does not hold the surroundings.
    """
    if scenes.leader_source != LEADER_FROM_LANE:
        raise InputError("the recording does not hold the vehicles behind, so they cannot react")
    theta = np.broadcast_to(np.asarray(parameters, dtype=np.float64), (len(scenes), 5))
    limit = float(scenes.road.desired_speed(desired_speed))
    replayed = drive_idm(scenes, theta, desired_speed=limit)
    rows = []
    for index in range(len(scenes)):
        one = scenes.subset(np.array([index]))
        behind = vehicles_behind(one, replayed.x[index], reacting)
        own = np.vstack([theta[index], parameters_of_followers(followers, one.traffic.vehicle[behind.row])])
        driven, traffic = _drive_chain(one, behind, own, limit)
        around = replace(one, traffic=traffic, cell=(one.lane - 1) * traffic.frames)
        rows.append(score(around, driven).assign(followers=len(behind.row)))
    return pd.concat(rows, ignore_index=True)


class ReactingVehicles(NamedTuple):
    """Vehicles behind a driver, and when they begin to react.

    Attributes
    ----------
    row : int64, shape (followers,)
        Row of the traffic in which each begins to react.
    step : int64, shape (followers,)
        Step of the simulation at that moment.
    """

    row: Integers
    step: Integers


def vehicles_behind(scenes: Scenes, x: Floats, most: int) -> ReactingVehicles:
    """Return the first vehicles that come behind a driver.

    Parameters
    ----------
    scenes : Scenes
        Window of one driver.
    x : float64, shape (steps + 1,)
        Its simulated path (m).
    most : int
        Largest number of vehicles.

    Returns
    -------
    ReactingVehicles
        In the order in which they come.
    """
    t, found = scenes.traffic, dict[int, tuple[int, int]]()
    for step in range(len(x) - 1):
        cell = int(scenes.cell[0]) + scenes.start + step
        end = t.offsets[cell] + np.searchsorted(t.x[t.offsets[cell] : t.offsets[cell + 1]], x[step])
        for row in range(int(end) - 1, int(t.offsets[cell]) - 1, -1):
            number = int(t.vehicle[row])
            if len(found) < most and number != scenes.vehicle[0] and number not in found:
                found[number] = (row, step)
        if len(found) >= most:
            break
    rows = np.array(list(found.values()), dtype=np.int64).reshape(-1, 2)
    return ReactingVehicles(rows[:, 0], rows[:, 1])


def parameters_of_followers(followers: pd.DataFrame | npt.ArrayLike, number: Integers) -> Floats:
    """Return the parameters of vehicles by number.

    Parameters
    ----------
    followers : pandas.DataFrame or array_like, shape (5,)
        As in :func:`score_with_reacting`.
    number : int64, shape (followers,)
        Vehicle numbers.

    Returns
    -------
    float64, shape (followers, 5)
        ``a, b, T, d0, d1``.
    """
    if not isinstance(followers, pd.DataFrame):
        return np.array(np.broadcast_to(np.asarray(followers, dtype=np.float64), (len(number), 5)))
    by_vehicle = followers.set_index(c.VEHICLE)[["a", "b", "T", "d0", "d1"]]
    return np.asarray(by_vehicle.loc[np.where(np.isin(number, by_vehicle.index), number, 0)], dtype=np.float64)


def _drive_chain(
    scenes: Scenes, behind: ReactingVehicles, theta: Floats, desired_speed: float
) -> tuple[Trajectories, Traffic]:
    """Drive one vehicle and those behind it.

    Returns its path and the traffic around it, with the reacting vehicles.
    """
    t, lane = scenes.traffic, int(scenes.lane[0])
    own = [getattr(scenes, name)[0, scenes.start] for name in STATE]
    start = np.array([own, *np.column_stack([getattr(t, name)[behind.row] for name in STATE])])
    length = np.array([scenes.length[0], *t.length[behind.row]])
    begin = np.array([0, *behind.step])
    others = _others(scenes, behind)
    out = Trajectories.empty(len(begin), scenes.window.horizon)
    _chain(
        theta, desired_speed, start, begin, length, float(scenes.road.lane_center(lane)),
        (lane - 1) * others.frames + scenes.start,
        others.offsets, others.x, others.speed, others.length, others.vehicle,
        out.x, out.y, out.heading, out.speed, out.acceleration, out.steering, out.gap,
    )  # fmt: skip
    out.leader[:] = NOBODY
    ego = Trajectories(*(np.ascontiguousarray(getattr(out, name)[:1]) for name in Trajectories.__dataclass_fields__))
    return ego, _with_reacting(scenes, others, out, behind)


def _rows_of_window(scenes: Scenes) -> tuple[Integers, Integers]:
    """Return a window's rows of the traffic and their cells.

    Cells are counted from the window's first frame.
    """
    t, frames = scenes.traffic, scenes.window.frames
    rows, cells = [], []
    for lane in range(1, scenes.road.main_lanes + 1):
        begin = int(scenes.cells(lane, 0)[0])
        span = t.offsets[begin : begin + frames + 1]
        rows.append(np.arange(span[0], span[-1]))
        cells.append((lane - 1) * frames + np.repeat(np.arange(frames), np.diff(span)))
    return np.concatenate(rows), np.concatenate(cells)


def _others(scenes: Scenes, behind: ReactingVehicles) -> Traffic:
    """Return a window's traffic that is replayed.

    It is without the recorded vehicle that is modelled, and without reacting vehicles once they react.
    """
    rows, cells = _rows_of_window(scenes)
    number, step = scenes.traffic.vehicle[rows], cells % scenes.window.frames - scenes.start
    kept = number != scenes.vehicle[0]
    for row, begin in zip(behind.row, behind.step, strict=True):
        kept &= (number != scenes.traffic.vehicle[row]) | (step < begin)
    columns = {name: getattr(scenes.traffic, name)[rows[kept]] for name in (*STATE, c.LENGTH, c.WIDTH, c.VEHICLE)}
    return _sorted(scenes, cells[kept], columns)


def _sorted(scenes: Scenes, cells: Integers, columns: dict[str, npt.NDArray[np.generic]]) -> Traffic:
    frames = scenes.window.frames
    numbers = {name: np.asarray(values, dtype=np.float64) for name, values in columns.items() if name != c.VEHICLE}
    vehicle = np.asarray(columns[c.VEHICLE], dtype=np.int64)
    return sort_into_cells(cells, scenes.road.main_lanes * frames, numbers, vehicle, int(scenes.first_frame[0]), frames)


def _with_reacting(scenes: Scenes, others: Traffic, out: Trajectories, behind: ReactingVehicles) -> Traffic:
    """Return the others and the reacting vehicles as one traffic."""
    steps = out.x.shape[1]
    there = np.arange(steps) >= behind.step[:, None]
    cell = np.repeat(np.arange(len(others.offsets) - 1), np.diff(others.offsets))
    lane = scenes.road.lane_at(out.y[1:][there])
    added_cell = (lane - 1) * others.frames + scenes.start + np.nonzero(there)[1]
    size = {
        name: np.repeat(getattr(scenes.traffic, name)[behind.row], there.sum(axis=1))
        for name in (c.LENGTH, c.WIDTH, c.VEHICLE)
    }
    added = {name: getattr(out, name)[1:][there] for name in STATE} | size
    columns = {name: np.concatenate([getattr(others, name), values]) for name, values in added.items()}
    return _sorted(scenes, np.concatenate([cell, added_cell]), columns)


@njit(cache=True)
def _chain(  # type: ignore[no-untyped-def]
    theta, desired_speed, start, begin, length, lane_y, first_cell,
    offsets, traffic_x, traffic_speed, traffic_length, traffic_vehicle,
    x, y, heading, speed, acceleration, steering, gap,
):  # fmt: skip
    """Fill the paths of a vehicle and its followers.

    Each begins at step ``begin``. At every step all vehicles decide before any of them moves.
    """
    n, steps = acceleration.shape
    center = np.empty((n, 2))
    for k in range(steps + 1):
        for j in range(n):
            if k == begin[j]:
                x[j, k], y[j, k], heading[j, k], speed[j, k] = start[j]
                center[j] = bicycle.center_of_front(x[j, k], y[j, k], heading[j, k], length[j])
        for j in range(n):
            if k < begin[j]:
                continue
            row, d = perceive(first_cell + k, x[j, k], NOBODY, offsets, traffic_x, traffic_length, traffic_vehicle)
            leader_speed = traffic_speed[row] if row != NOBODY else speed[j, k]
            for other in range(n):  # a vehicle of the chain that is ahead and nearer than the recorded one
                if k < begin[other] or x[other, k] <= x[j, k]:
                    continue
                rear = x[other, k] - length[other] - x[j, k]
                if rear < d:
                    d, leader_speed = rear, speed[other, k]
            gap[j, k] = d
            if k < steps:
                acceleration[j, k], steering[j, k] = control(
                    center[j, 0], center[j, 1], heading[j, k], speed[j, k], d, leader_speed, theta[j], desired_speed,
                    length[j], lane_y,
                )  # fmt: skip
        if k == steps:
            break
        for j in range(n):
            if k < begin[j]:
                continue
            cx, cy, psi, v = bicycle.step(
                center[j, 0], center[j, 1], heading[j, k], speed[j, k], acceleration[j, k], steering[j, k],
                bicycle.wheelbase(length[j]), FRAME_STEP,
            )  # fmt: skip
            center[j, 0], center[j, 1] = cx, cy
            x[j, k + 1], y[j, k + 1] = bicycle.front_of_center(cx, cy, psi, length[j])
            heading[j, k + 1], speed[j, k + 1] = psi, v
