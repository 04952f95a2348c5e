"""Replay with an extended model: the ``kernel`` back end, and the step of a driver that the ``sumo`` one shares."""

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
from idm_sumo.simulation.surroundings import NOBODY_YET, Others, Twin, look, what_is_seen

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Minds(NamedTuple):
    """What extended drivers know and remember; changed as they drive.

    Attributes
    ----------
    magnitudes : float64, shape (windows, slots.COUNT)
        Of the model in each driver's lane.
    theta : float64, shape (windows, 5)
    limit : float64, shape (windows,)
        Desired speed, m/s.
    past : float64, shape (windows, start + T + 1, 3)
        Gap (m), speed and approach rate (m/s), frame by frame from the window's first.
    leader : int64, shape (windows,)
        Number of the last leader, ``NOBODY_YET`` before the first look.
    changed : float64, shape (windows, 3)
        By how much the last leader change shortened the gap (m), its time since the start and the time headway right after it
        (s); NaN for none.
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


class Road(NamedTuple):
    """The traffic, as compiled functions take it, and what is known beyond it."""

    offsets: Integers
    x: Floats
    speed: Floats
    length: Floats
    vehicle: Integers
    frames: int
    alone: bool
    others: Others
    twin: Twin


class Body(NamedTuple):
    """The vehicles; arrays of shape (windows,): number, lane, length (m), lane's middle (m), first cell, first frame."""

    vehicle: Integers
    lane: Integers
    length: Floats
    lane_y: Floats
    cell: Integers
    start: int


def set_out(
    scenes: Scenes,
    recording: Recording | tuple[Others, Twin],
    model: ExtendedModel,
    parameters: npt.ArrayLike,
    desired_speed: npt.ArrayLike | None,
) -> tuple[Minds, Road, Body]:
    """Return drivers, road and vehicles at the start.

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
    """
    n, t, limit = len(scenes), scenes.traffic, scenes.road.desired_speed(desired_speed)
    others, twin = what_is_seen(recording, scenes) if isinstance(recording, Recording) else recording
    rows = scenes.start + scenes.window.horizon + 1
    minds = Minds(
        magnitudes=np.ascontiguousarray(model.magnitudes_by_lane(scenes.road.main_lanes)[scenes.lane]),
        theta=np.ascontiguousarray(np.broadcast_to(np.asarray(parameters, dtype=np.float64), (n, 5))),
        limit=np.ascontiguousarray(np.broadcast_to(np.asarray(limit, dtype=np.float64), (n,))),
        past=np.full((n, rows, 3), np.nan),
        leader=np.full(n, NOBODY_YET, dtype=np.int64),
        changed=np.column_stack([twin.jump, -twin.since, twin.accepted]),
        driven=np.column_stack([twin.driven, twin.moments]),
    )
    alone = scenes.leader_source != LEADER_FROM_LANE
    body = Body(
        scenes.vehicle, scenes.lane, scenes.length, scenes.road.lane_center(scenes.lane), scenes.cell, scenes.start
    )
    ground = Road(t.offsets, t.x, t.speed, t.length, t.vehicle, t.frames, alone, others, twin)
    _remember_observed(minds, ground, body, scenes.x, scenes.speed)
    return minds, ground, body


def drive_extended(
    scenes: Scenes,
    recording: Recording | tuple[Others, Twin],
    model: ExtendedModel,
    parameters: npt.ArrayLike,
    *,
    desired_speed: npt.ArrayLike | None = None,
) -> Trajectories:
    """Drive every vehicle by an extended model and pure pursuit from its start over the horizon.

    The same equations of motion, perception and result as :func:`idm_sumo.simulation.rollout.drive_idm`; without causes the
    same figures. Parameters as in :func:`set_out`.
    """
    minds, ground, body = set_out(scenes, recording, model, parameters, desired_speed)
    out = Trajectories.of(scenes)
    start = np.stack([getattr(scenes, name)[:, scenes.start] for name in ("x", "y", "heading", "speed")], axis=1)
    _drive_all(
        minds,
        ground,
        body,
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
def _remember_observed(minds, ground, body, x, speed):  # type: ignore[no-untyped-def]
    """Fill the past with what the recorded twin saw before the start."""
    for i in range(len(x)):
        past, before = minds.past[i], NOBODY_YET
        for k in range(body.start):
            row, gap = perceive(
                body.cell[i] + k, x[i, k], body.vehicle[i], ground.offsets, ground.x, ground.length, ground.vehicle
            )
            leader_speed = ground.speed[row] if row != NOBODY else speed[i, k]
            past[k] = (gap, speed[i, k], speed[i, k] - leader_speed)
            who = ground.others.who[row] if row != NOBODY else 0
            meet(past, k, before, who, minds.magnitudes[i])
            before = who
        minds.leader[i] = before


@njit(cache=True)
def meet(past, now, before, who, m):  # type: ignore[no-untyped-def]
    """Return whether the leader is another one; who knows where that was has it in the past."""
    another = before > 0 and who > 0 and who != before
    if another and knows_new_leader(m):
        follow_another(past[:, 0], past[:, 1], past[:, 2], now, FRAME_STEP)
    return another


@njit(cache=True)
def decide(i, k, front, speed, row, gap, minds, ground, body):  # type: ignore[no-untyped-def]
    """Return the acceleration (m/s²) of driver ``i`` at step ``k``, who remembers what it saw.

    Parameters
    ----------
    i, k : int
    front, speed : float
        m, m/s.
    row : int
        Of the leader in the traffic, or ``NOBODY``.
    gap : float
        m.
    minds, ground, body
        Of :func:`set_out`.
    """
    m, theta, twin, now = minds.magnitudes[i], minds.theta[i], ground.twin, body.start + k
    past, elapsed = minds.past[i], k * FRAME_STEP
    leader_speed = ground.speed[row] if row != NOBODY else speed
    past[now] = (gap, speed, speed - leader_speed)
    who = ground.others.who[row] if row != NOBODY else 0
    gap_before = past[now - 1, 0]
    if meet(past, now, minds.leader[i], who, m):
        minds.changed[i] = (gap_before - gap, elapsed, headway_after(gap, speed))
    minds.leader[i] = who
    minds.driven[i, 0] += speed
    minds.driven[i, 1] += 1.0
    see = look(
        ground.offsets, ground.x, ground.speed, ground.length, ground.vehicle, ground.others, body.cell[i] + now,
        ground.frames, body.lane[i], ground.alone, body.vehicle[i], body.length[i], front, row, gap,
        twin.time[i] + elapsed, twin.own_class[i], minds.changed[i, 0], elapsed - minds.changed[i, 1], minds.changed[i, 2],
        twin.cut_in[i] - elapsed, twin.own_change[i] - elapsed, minds.driven[i, 0] / minds.driven[i, 1],
    )  # fmt: skip
    then_gap, then_speed, then_rate = acted_on(past, now, m, FRAME_STEP)
    return extended_acceleration(then_speed, then_rate, then_gap, see, theta, minds.limit[i], m)


@njit(cache=True)
def _drive_all(  # type: ignore[no-untyped-def]
    minds, ground, body, start, x, y, heading, speed, acceleration, steering, gap, leader
):
    steps = acceleration.shape[1]
    for i in range(len(start)):
        x[i, 0], y[i, 0], psi, v = start[i]
        heading[i, 0], speed[i, 0] = psi, v
        cx, cy = bicycle.center_of_front(x[i, 0], y[i, 0], psi, body.length[i])
        axles = bicycle.wheelbase(body.length[i])
        for k in range(steps + 1):
            row, d = perceive(
                body.cell[i] + body.start + k, x[i, k], body.vehicle[i],
                ground.offsets, ground.x, ground.length, ground.vehicle,
            )  # fmt: skip
            leader[i, k], gap[i, k] = row, d
            if k == steps:
                break
            acc = decide(i, k, x[i, k], v, row, d, minds, ground, body)
            delta = steer(cy, psi, v, body.length[i], body.lane_y[i])
            acceleration[i, k], steering[i, k] = acc, delta
            cx, cy, psi, v = bicycle.step(cx, cy, psi, v, acc, delta, axles, FRAME_STEP)
            x[i, k + 1], y[i, k + 1] = bicycle.front_of_center(cx, cy, psi, body.length[i])
            heading[i, k + 1], speed[i, k + 1] = psi, v
