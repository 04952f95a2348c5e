"""Replay with an extended model: the ``kernel`` back end.

The ``sumo`` back end shares the step of a driver.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.models import bicycle
from idm_sumo.models.effects import ExtendedModel, extended_acceleration
from idm_sumo.models.effects.lane_change_relaxation import headway_after
from idm_sumo.models.effects.reaction_delay import acted_on, follow_another, knows_new_leader
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import Trajectories, perceive, steer
from idm_sumo.simulation.surroundings import RecordedDrivers, TrafficDetails, what_is_seen
from idm_sumo.simulation.traffic_around import NOBODY_YET, look

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class DriverState(NamedTuple):
    """What extended drivers know and remember; changed as they drive.

    Attributes
    ----------
    magnitudes : float64, shape (windows, slots.COUNT)
        Of the model in each driver's lane.
    theta : float64, shape (windows, 5)
        ``a, b, T, d0, d1`` in SI units.
    limit : float64, shape (windows,)
        Desired speed, m/s.
    past : float64, shape (windows, start + T + 1, 3)
        Gap (m), speed and approach rate (m/s), frame by frame from the window's first.
    leader : int64, shape (windows,)
        Number of the last leader, ``NOBODY_YET`` before the first look.
    changed : float64, shape (windows, 3)
        By how much the last leader change shortened the gap (m), its time since the start and the
        time headway right after it (s); NaN for none.
    driven : float64, shape (windows, 2)
        Sum of the speeds up to now (m/s) and their number.
    """

    magnitudes: Floats
    theta: Floats
    limit: Floats
    past: Floats
    leader: Integers
    changed: Floats
    driven: Floats


class TrafficView(NamedTuple):
    """The traffic as compiled drivers see it.

    Attributes
    ----------
    offsets, x, speed, length, vehicle, frames
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.
    alone : bool
        Whether every window has a lane of its own, with nobody beside or behind.
    others : TrafficDetails
        What is known of the traffic's rows beyond that.
    recorded : RecordedDrivers
        What each window's recorded vehicle brings along.
    """

    offsets: Integers
    x: Floats
    speed: Floats
    length: Floats
    vehicle: Integers
    frames: int
    alone: bool
    others: TrafficDetails
    recorded: RecordedDrivers


class VehicleState(NamedTuple):
    """The vehicles and where their windows begin.

    Attributes
    ----------
    vehicle, lane : int64, shape (windows,)
        Number, main lane.
    length : float64, shape (windows,)
        m.
    lane_y : float64, shape (windows,)
        The lane's middle (m).
    cell : int64, shape (windows,)
        The traffic's cell at the window's first frame.
    start : int
        Frame of the window at which the simulation starts.
    """

    vehicle: Integers
    lane: Integers
    length: Floats
    lane_y: Floats
    cell: Integers
    start: int


def set_out(
    scenes: Scenes,
    recording: Recording | tuple[TrafficDetails, RecordedDrivers],
    model: ExtendedModel,
    parameters: npt.ArrayLike,
    desired_speed: npt.ArrayLike | None,
) -> tuple[DriverState, TrafficView, VehicleState]:
    """Return drivers, traffic and vehicles at the start.

    Parameters
    ----------
    scenes : Scenes
    recording : Recording, or what :func:`idm_sumo.simulation.surroundings.what_is_seen` returns of it
        The period they were cut from.
    model : ExtendedModel
    parameters : array_like, shape (windows, 5) or (5,)
        Of each driver; the model's own belong to the median driver.
    desired_speed : array_like, shape (windows,) or (), optional
        m/s; by default the road's speed limit.

    Returns
    -------
    drivers : DriverState
    view : TrafficView
    vehicles : VehicleState
    """
    n, t, limit = len(scenes), scenes.traffic, scenes.road.desired_speed(desired_speed)
    others, recorded = what_is_seen(recording, scenes) if isinstance(recording, Recording) else recording
    rows = scenes.start + scenes.window.horizon + 1
    drivers = DriverState(
        magnitudes=np.ascontiguousarray(model.magnitudes_by_lane(scenes.road.main_lanes)[scenes.lane]),
        theta=np.ascontiguousarray(np.broadcast_to(np.asarray(parameters, dtype=np.float64), (n, 5))),
        limit=np.ascontiguousarray(np.broadcast_to(np.asarray(limit, dtype=np.float64), (n,))),
        past=np.full((n, rows, 3), np.nan),
        leader=np.full(n, NOBODY_YET, dtype=np.int64),
        changed=np.column_stack([recorded.jump, -recorded.since, recorded.accepted]),
        driven=np.column_stack([recorded.driven, recorded.moments]),
    )
    alone = scenes.leader_source != LEADER_FROM_LANE
    vehicles = VehicleState(
        scenes.vehicle, scenes.lane, scenes.length, scenes.road.lane_center(scenes.lane), scenes.cell, scenes.start
    )
    view = TrafficView(t.offsets, t.x, t.speed, t.length, t.vehicle, t.frames, alone, others, recorded)
    _remember_observed(drivers, view, vehicles, scenes.x, scenes.speed)
    return drivers, view, vehicles


def drive_extended(
    scenes: Scenes,
    recording: Recording | tuple[TrafficDetails, RecordedDrivers],
    model: ExtendedModel,
    parameters: npt.ArrayLike,
    *,
    desired_speed: npt.ArrayLike | None = None,
) -> Trajectories:
    """Drive every vehicle by an extended model over the horizon.

    The same equations of motion, perception and result as :func:`idm_sumo.simulation.rollout.drive_idm`;
    without causes the same figures.

    Parameters
    ----------
    scenes : Scenes
    recording : Recording, or what :func:`idm_sumo.simulation.surroundings.what_is_seen` returns of it
        The period they were cut from.
    model : ExtendedModel
    parameters : array_like, shape (windows, 5) or (5,)
        Of each driver; the model's own belong to the median driver.
    desired_speed : array_like, shape (windows,) or (), optional
        m/s; by default the road's speed limit.

    Returns
    -------
    Trajectories
    """
    drivers, view, vehicles = set_out(scenes, recording, model, parameters, desired_speed)
    out = Trajectories.of(scenes)
    start = np.stack([getattr(scenes, name)[:, scenes.start] for name in ("x", "y", "heading", "speed")], axis=1)
    _drive_all(
        drivers,
        view,
        vehicles,
        start,
        out.x,
        out.y,
        out.heading,
        out.speed,
        out.acceleration,
        out.steering,
        out.gap,
        out.leader,
    )
    return out


@njit(cache=True)
def _remember_observed(drivers, view, vehicles, x, speed):  # type: ignore[no-untyped-def]
    """Fill the past with what was seen before the start."""
    for i in range(len(x)):
        past, before = drivers.past[i], drivers.leader[i]
        for k in range(vehicles.start):
            row, gap = perceive(
                vehicles.cell[i] + k, x[i, k], vehicles.vehicle[i], view.offsets, view.x, view.length, view.vehicle
            )
            leader_speed = view.speed[row] if row != NOBODY else speed[i, k]
            note(past[k], gap, speed[i, k], speed[i, k] - leader_speed)
            who = view.others.who[row] if row != NOBODY else 0
            meet(past, k, before, who, drivers.magnitudes[i])
            before = who
        drivers.leader[i] = before


@njit(cache=True)
def note(row, first, second, third):  # type: ignore[no-untyped-def]
    """Write three numbers into a row.

    Assigned at once they could be too many or too few: numba then compiles the words of that error into every kernel.

    Parameters
    ----------
    row : float64, shape (3,)
        Changed.
    first, second, third : float
    """
    row[0], row[1], row[2] = first, second, third


@njit(cache=True)
def meet(past, now, before, who, m):  # type: ignore[no-untyped-def]
    """Return whether the leader is another one.

    A driver that knows where the new leader was before has that in its past.

    Parameters
    ----------
    past : float64, shape (frames, 3)
        Gap (m), speed and approach rate (m/s) of one driver, changed.
    now : int
        Row of ``past``.
    before, who : int
        Numbers of the last and the present leader, 0 or less for none.
    m : float64, shape (slots.COUNT,)
        Magnitudes.

    Returns
    -------
    bool
    """
    another = before > 0 and who > 0 and who != before
    if another and knows_new_leader(m):
        follow_another(past[:, 0], past[:, 1], past[:, 2], now, FRAME_STEP)
    return another


@njit(cache=True)
def decide(i, k, front, speed, row, gap, drivers, view, vehicles):  # type: ignore[no-untyped-def]
    """Return the acceleration (m/s²) of one driver.

    Parameters
    ----------
    i, k : int
        Driver and step. The driver remembers what it sees.
    front, speed : float
        m, m/s.
    row : int
        Of the leader in the traffic, or ``NOBODY``.
    gap : float
        m.
    drivers, view, vehicles
        Of :func:`set_out`.

    Returns
    -------
    float
    """
    m, theta, recorded, now = drivers.magnitudes[i], drivers.theta[i], view.recorded, vehicles.start + k
    past, elapsed = drivers.past[i], k * FRAME_STEP
    leader_speed = view.speed[row] if row != NOBODY else speed
    note(past[now], gap, speed, speed - leader_speed)
    who = view.others.who[row] if row != NOBODY else 0
    gap_before = past[now - 1, 0]
    if meet(past, now, drivers.leader[i], who, m):
        note(drivers.changed[i], gap_before - gap, elapsed, headway_after(gap, speed))
    drivers.leader[i] = who
    drivers.driven[i, 0] += speed
    drivers.driven[i, 1] += 1.0
    see = look(
        view.offsets, view.x, view.speed, view.length, view.vehicle, view.others, vehicles.cell[i] + now,
        view.frames, vehicles.lane[i], view.alone, vehicles.vehicle[i], vehicles.length[i], front, row, gap,
        recorded.time[i] + elapsed, recorded.own_class[i], drivers.changed[i, 0], elapsed - drivers.changed[i, 1],
        drivers.changed[i, 2],
        recorded.cut_in[i] - elapsed, recorded.own_change[i] - elapsed, drivers.driven[i, 0] / drivers.driven[i, 1],
    )  # fmt: skip
    then_gap, then_speed, then_rate = acted_on(past, now, m, FRAME_STEP)
    return extended_acceleration(then_speed, then_rate, then_gap, see, theta, drivers.limit[i], m)


@njit(cache=True)
def _drive_all(  # type: ignore[no-untyped-def]
    drivers, view, vehicles, start, x, y, heading, speed, acceleration, steering, gap, leader
):
    steps = acceleration.shape[1]
    for i in range(len(start)):
        x[i, 0], y[i, 0], psi, v = start[i]
        heading[i, 0], speed[i, 0] = psi, v
        cx, cy = bicycle.center_of_front(x[i, 0], y[i, 0], psi, vehicles.length[i])
        axles = bicycle.wheelbase(vehicles.length[i])
        for k in range(steps + 1):
            row, d = perceive(
                vehicles.cell[i] + vehicles.start + k, x[i, k], vehicles.vehicle[i],
                view.offsets, view.x, view.length, view.vehicle,
            )  # fmt: skip
            leader[i, k], gap[i, k] = row, d
            if k == steps:
                break
            acc = decide(i, k, x[i, k], v, row, d, drivers, view, vehicles)
            delta = steer(cy, psi, v, vehicles.length[i], vehicles.lane_y[i])
            acceleration[i, k], steering[i, k] = acc, delta
            cx, cy, psi, v = bicycle.step(cx, cy, psi, v, acc, delta, axles, FRAME_STEP)
            x[i, k + 1], y[i, k + 1] = bicycle.front_of_center(cx, cy, psi, vehicles.length[i])
            heading[i, k + 1], speed[i, k + 1] = psi, v
