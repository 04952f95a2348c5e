"""The ``sumo`` back end of replay: one modelled vehicle at a time among recorded ones.

Every step SUMO is told where all vehicles are, makes a step, and is asked for the modelled
vehicle's leader (a move shows only after the step); then Python drives the modelled vehicle
one step: IDM, pure pursuit and kinematic bicycle, integrated by Euler with the old speed, the
very functions of the ``kernel`` back end. SUMO drives nobody, neither by its car-following
nor by its lane-changing models.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.models import bicycle
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.workers import in_processes
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.driver_parameters import as_driven
from idm_sumo.simulation.extended_rollout import decide, set_out
from idm_sumo.simulation.rollout import Trajectories, control, steer
from idm_sumo.sumo import network
from idm_sumo.sumo.replay.perception import leader_in_lane
from idm_sumo.sumo.replay.stage import Cast, Stage, cast, check_on_network, compass, inside_lane
from idm_sumo.sumo.session import simulation

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

BEHIND = 60.0  # m, the recorded vehicles that surround the modelled one in SUMO
AHEAD = 150.0  # m, in the lanes beside; in its own lane all vehicles ahead are there
EGO = "ego"
CHUNKS_A_JOB = 4  # so that progress shows, and a slow chunk does not keep the others waiting


def replay(
    scenes: Scenes,
    drivers: pd.DataFrame | npt.ArrayLike,
    *,
    desired_speed: npt.ArrayLike | None = None,
    which: npt.NDArray[np.bool_] | Integers | None = None,
    extension: tuple[Recording, ExtendedModel] | None = None,
    jobs: int = 1,
    progress: Progress = silent,
) -> Trajectories:
    """Drive vehicles by IDM and pure pursuit in SUMO, each in a replay of its own.

    Parameters
    ----------
    scenes, drivers, desired_speed
        As of :func:`idm_sumo.simulation.rollout.drive_idm`.
    which : array, optional
        Mask or numbers of the windows to replay; by default all.
    extension : tuple of Recording and ExtendedModel, optional
        Causes beyond the IDM, and the period in which their drivers are looked up
        (:mod:`idm_sumo.simulation.extended_rollout`). What they see beside the leader is where SUMO shows it.
    jobs : int
        Processes; the results do not depend on it.
    progress : Progress
        Told how many vehicles are done.

    Returns
    -------
    Trajectories
        Of the chosen windows, in their order; by Euler with the old speed.

    Raises
    ------
    InputError
        If SUMO or the network cannot be loaded, or a vehicle is or drives off the network.

    Notes
    -----
    *Traffic.* Recorded vehicles of the modelled vehicle's lane and of the lanes next to it are
    injected while they are between ``BEHIND`` and ``AHEAD``, those of its own lane at any
    distance ahead. Perception is along the own lane, so the choice never changes a result; the
    recorded twin is not there.

    *Perception.* SUMO names the leader (:func:`~idm_sumo.sumo.replay.perception.leader_in_lane`); the
    gap is between the positions read back from SUMO, less the leader's recorded length, since
    vehicles are points there (:class:`~idm_sumo.sumo.replay.stage.Stage`). The leader's speed is the
    recorded one: SUMO derives the speed of a moved vehicle from its last displacement, which
    lags half a frame.

    *The lane.* The modelled vehicle perceives along the lane it steers for. While its front is
    beyond that lane's edge, it stands on this edge in SUMO; the result has its true place.
    """
    len(scenes)
    theta, limit = as_driven(scenes, drivers, desired_speed)
    if which is not None:
        scenes, theta, limit = scenes.subset(which), theta[which], limit[which]
    if jobs == 1 or len(scenes) < 2:
        return _replay_serially(scenes, theta, limit, extension, progress)
    chunks = np.array_split(np.arange(len(scenes)), min(len(scenes), jobs * CHUNKS_A_JOB))
    calls = ((scenes.subset(part), theta[part], limit[part], extension) for part in chunks)
    parts = []
    for part in in_processes(jobs, calls, _replay_serially, backend="loky"):
        parts.append(part)
        progress("replay in SUMO", sum(len(done.x) for done in parts), len(scenes))
    return Trajectories.joined(parts)


def _replay_serially(
    scenes: Scenes,
    theta: Floats,
    limit: Floats,
    extension: tuple[Recording, ExtendedModel] | None = None,
    progress: Progress = silent,
) -> Trajectories:
    """Replay one window after the other in one simulation, whose road is empty between them."""
    out, actors = Trajectories.of(scenes), cast(scenes)
    net = network.of(scenes.road)
    with simulation(net=net.file) as sumo:
        drive = _plain(scenes, theta, limit) if extension is None else _extended(sumo, scenes, theta, limit, *extension)
        check_on_network(sumo, actors)
        stage = Stage(sumo, net, as_points=True)
        strips = [net.strip(lane + 1) for lane in range(scenes.road.main_lanes)]
        for i in range(len(scenes)):
            strip = strips[int(scenes.lane[i]) - 1]
            _replay_one(sumo, stage, strip, actors, scenes, i, drive, out)
            stage.clear()
            progress("replay in SUMO", i + 1, len(scenes))
    return out


class Moment(NamedTuple):
    """A driver, its step, what SUMO shows of it, and where it is."""

    i: int
    k: int
    names: list[str]
    rows: Integers
    leader: int
    gap: float
    cx: float
    cy: float
    heading: float
    speed: float
    x: float


Advance = Callable[[Moment], tuple[float, float, float, float, float, float, float, float]]


def _plain(scenes: Scenes, theta: Floats, limit: Floats) -> Advance:
    """Return what drives by the IDM."""
    theta, lane_y, t = np.ascontiguousarray(theta), scenes.road.lane_center(scenes.lane), scenes.traffic

    def drive(now: Moment) -> Any:
        i, leader_speed = now.i, float(t.speed[now.leader]) if now.leader != NOBODY else now.speed
        return advance(
            now.cx, now.cy, now.heading, now.speed, now.gap, leader_speed, theta[i], float(limit[i]),
            float(scenes.length[i]), float(lane_y[i]),
        )  # fmt: skip

    return drive


def _extended(
    sumo: Any, scenes: Scenes, theta: Floats, limit: Floats, recording: Recording, model: ExtendedModel
) -> Advance:
    """Return what drives by an extended model, among the vehicles where SUMO shows them."""
    minds, ground, body = set_out(scenes, recording, model, theta, limit)
    shown = ground._replace(x=ground.x.copy())

    def drive(now: Moment) -> Any:
        if now.names:
            shown.x[now.rows] = [sumo.vehicle.getPosition(name)[0] for name in now.names]
        acceleration = decide(now.i, now.k, now.x, now.speed, now.leader, now.gap, minds, shown, body)
        length = float(body.length[now.i])
        steering = steer(now.cy, now.heading, now.speed, length, float(body.lane_y[now.i]))
        return moved(now.cx, now.cy, now.heading, now.speed, acceleration, steering, length)

    return drive


def _replay_one(
    sumo: Any,
    stage: Stage,
    strip: tuple[str, ...],
    actors: Cast,
    scenes: Scenes,
    i: int,
    drive: Advance,
    out: Trajectories,
) -> None:
    """Drive window ``i`` and write it to ``out``."""
    length, lane, t = float(scenes.length[i]), int(scenes.lane[i]), scenes.traffic
    end = sumo.simulation.getNetBoundary()[1][0]
    right, left = inside_lane(scenes.road, [-np.inf, np.inf], lane).tolist()
    x, y, heading, speed = start_of(scenes, i)
    cx, cy = bicycle.center_of_front(x, y, heading, length)
    for k in range(out.x.shape[1]):
        out.x[i, k], out.y[i, k], out.heading[i, k], out.speed[i, k] = x, y, heading, speed
        if x > end:
            raise InputError(f"vehicle {scenes.vehicle[i]} drives off the network, x = {x:.0f} m; shorten the horizon")
        rows = _rows_around(scenes, i, k, x)
        names, fronts, laterals, angles, lengths, widths = actors.of(rows)
        stage.place(
            [*names, EGO], [*fronts, x], [*laterals, min(max(y, right), left)],
            [*angles, float(compass(heading))], [*lengths, length], [*widths, float(scenes.width[i])],
        )  # fmt: skip
        sumo.simulationStep()
        row, gap = _perceive(sumo, strip, names, rows, t.length)
        out.leader[i, k], out.gap[i, k] = row, gap
        if k == out.acceleration.shape[1]:
            break
        out.acceleration[i, k], out.steering[i, k], cx, cy, heading, speed, x, y = drive(
            Moment(i, k, names, rows, row, gap, cx, cy, heading, speed, x)
        )


def start_of(scenes: Scenes, i: int) -> tuple[float, float, float, float]:
    """Return front bumper (m), heading (rad) and speed (m/s) with which the simulation starts."""
    k = scenes.start
    return float(scenes.x[i, k]), float(scenes.y[i, k]), float(scenes.heading[i, k]), float(scenes.speed[i, k])


def _perceive(sumo: Any, strip: tuple[str, ...], names: list[str], rows: Integers, length: Floats) -> tuple[int, float]:
    """Return the row of the modelled vehicle's leader (or ``NOBODY``) and the gap to it (m)."""
    leader = leader_in_lane(sumo, EGO, strip)
    if leader is None:
        return NOBODY, np.inf
    row = int(rows[names.index(leader)])
    # getLeader's own gap is up to 1 mm off beside the end of an edge, and knows no lengths here.
    front, own_front = sumo.vehicle.getPosition(leader)[0], sumo.vehicle.getPosition(EGO)[0]
    return row, float(front - length[row] - own_front)


def _rows_around(scenes: Scenes, i: int, k: int, front: float) -> Integers:
    """Return the rows of the traffic around window ``i`` at step ``k``."""
    t, lane, cell = scenes.traffic, int(scenes.lane[i]), int(scenes.cell[i]) + scenes.start + k
    beside = [cell + t.frames * side for side in (-1, 1) if 1 <= lane + side <= scenes.road.main_lanes]
    if scenes.leader_source != LEADER_FROM_LANE:
        beside = []  # the window's private lane has no neighbours
    cells = np.array([cell, *beside], dtype=np.int64)
    return np.asarray(_rows_in_reach(t.offsets, t.x, t.vehicle, cells, front, int(scenes.vehicle[i])))


@njit(cache=True)
def _rows_in_reach(offsets, x, vehicle, cells, front, own):  # type: ignore[no-untyped-def]
    """Return the rows of ``cells`` in reach of ``front`` (m); of the first cell all that are ahead."""
    rows = [0 for _ in range(0)]
    for number, cell in enumerate(cells):
        for row in range(offsets[cell], offsets[cell + 1]):
            near = number == 0 or x[row] < front + AHEAD
            if near and x[row] > front - BEHIND and vehicle[row] != own:
                rows.append(row)
    return np.array(rows, dtype=np.int64)


@njit(cache=True)
def advance(cx, cy, heading, speed, gap, leader_speed, theta, limit, length, lane_y):  # type: ignore[no-untyped-def]
    """Return controls, centre of mass, heading, speed and front bumper one frame later."""
    acceleration, steering = control(cx, cy, heading, speed, gap, leader_speed, theta, limit, length, lane_y)
    return moved(cx, cy, heading, speed, acceleration, steering, length)


@njit(cache=True)
def moved(cx, cy, heading, speed, acceleration, steering, length):  # type: ignore[no-untyped-def]
    """Return the same for given controls."""
    axles = bicycle.wheelbase(length)
    cx, cy, heading, speed = bicycle.step(cx, cy, heading, speed, acceleration, steering, axles, FRAME_STEP)
    x, y = bicycle.front_of_center(cx, cy, heading, length)
    return acceleration, steering, cx, cy, heading, speed, x, y
