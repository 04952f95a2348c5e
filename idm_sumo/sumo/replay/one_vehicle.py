"""Modelled vehicles in SUMO, each among recorded ones.

Every step SUMO is told where all vehicles are, makes a step, and is asked for the modelled vehicle's leader (a move
shows only after the step). Then Python drives the modelled vehicle one frame.
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
from idm_sumo.models.residual import REGRESSORS, followed_acceleration
from idm_sumo.prediction.residual_drive import ROOM, ResidualDrivers, driven
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.workers import in_processes
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.driver_parameters import as_driven
from idm_sumo.simulation.extended_rollout import decide, set_out
from idm_sumo.simulation.rollout import Trajectories, steer
from idm_sumo.sumo import network
from idm_sumo.sumo.network import RoadNetwork
from idm_sumo.sumo.replay.motion import Driver, Motion, advance, moved, start_of
from idm_sumo.sumo.replay.perception import leader_in_lane
from idm_sumo.sumo.replay.scene import SumoScene, compass
from idm_sumo.sumo.replay.traffic_rows import TrafficRows, check_on_network, inside_lane, traffic_rows
from idm_sumo.sumo.session import simulation

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

BEHIND = 60.0  # m, the recorded vehicles that surround the modelled one in SUMO
AHEAD = 150.0  # m, in the lanes beside; in its own lane all vehicles ahead are there
EGO = "ego"
CHUNKS_A_JOB = 4  # so that progress shows, and a slow chunk does not keep the others waiting


def replay(
    scenes: Scenes,
    drivers: pd.DataFrame | npt.ArrayLike | ResidualDrivers,
    *,
    desired_speed: npt.ArrayLike | None = None,
    which: npt.NDArray[np.bool_] | Integers | None = None,
    extension: tuple[Recording, ExtendedModel] | None = None,
    jobs: int = 1,
    progress: Progress = silent,
) -> Trajectories:
    """Drive vehicles in SUMO, each in its own replay.

    Parameters
    ----------
    scenes, drivers, desired_speed
        As of :func:`idm_sumo.simulation.rollout.drive_idm`; or predicted drivers with a residual, which bring their
        desired speed along.
    which : array, optional
        Mask or numbers of the windows to replay; by default all.
    extension : tuple of Recording and ExtendedModel, optional
        Effects beyond the IDM, and the period in which their drivers are looked up
        (:mod:`idm_sumo.simulation.extended_rollout`). Vehicles beside the leader are seen where SUMO shows them.
    jobs : int
        Processes; the results do not depend on it.
    progress : Progress
        Called with the vehicles done and their total.

    Returns
    -------
    Trajectories
        Of the chosen windows, in their order.

    Raises
    ------
    InputError
        If SUMO or the network cannot be loaded, or a vehicle is or drives off the network.

    Notes
    -----
    *Traffic.* Recorded vehicles of the modelled vehicle's lane and of the lanes next to it are in SUMO while they are
    between ``BEHIND`` and ``AHEAD``, those of its own lane at any distance ahead. Perception is along the own lane, so
    the choice never changes a result. The recorded vehicle that the model replaces is left out.

    *Perception.* SUMO names the leader (:func:`~idm_sumo.sumo.replay.perception.leader_in_lane`). The gap is between
    the positions read back from SUMO, less the leader's recorded length, since vehicles are points there
    (:class:`~idm_sumo.sumo.replay.scene.SumoScene`). The leader's speed is the recorded one: SUMO derives the speed of
    a moved vehicle from its last displacement, which lags half a frame.

    *The lane.* The modelled vehicle perceives along the lane it steers for. While its front is beyond that lane's edge,
    it stands on this edge in SUMO; the result has its true place.
    """
    residual = drivers if isinstance(drivers, ResidualDrivers) else None
    plain = drivers if residual is None else residual.model.pooled
    theta, limit = as_driven(scenes, plain, desired_speed if residual is None else residual.model.desired_speed)
    everybody = np.arange(len(scenes))
    chosen = everybody if which is None else everybody[which]
    pieces = 1 if jobs == 1 else max(1, min(len(chosen), jobs * CHUNKS_A_JOB))
    chunks = np.array_split(chosen, pieces)
    calls = (
        (scenes.subset(part), theta[part], limit[part], extension, None if residual is None else residual.rows(part))
        for part in chunks
    )
    if len(chunks) == 1:
        return _replay_serially(*next(calls), progress)
    parts = []
    for part in in_processes(jobs, calls, _replay_serially, backend="loky"):
        parts.append(part)
        progress("replay in SUMO", sum(len(done.x) for done in parts), len(chosen))
    return Trajectories.joined(parts)


def _replay_serially(
    scenes: Scenes,
    theta: Floats,
    limit: Floats,
    extension: tuple[Recording, ExtendedModel] | None = None,
    residual: ResidualDrivers | None = None,
    progress: Progress = silent,
) -> Trajectories:
    """Replay one window after the other in one simulation.

    Its road is empty between them.
    """
    out, traffic = Trajectories.of(scenes), traffic_rows(scenes)
    net = network.of(scenes.road)
    with simulation(net=net.file) as sumo:
        drive = _plain(scenes, theta, limit)
        if extension is not None:
            drive = _extended(sumo, net, scenes, theta, limit, *extension)
        if residual is not None:
            drive = _residual(scenes, residual)
        check_on_network(sumo, traffic, net)
        scene = SumoScene(sumo, net, as_points=True)
        strips = [net.strip(lane + 1) for lane in range(scenes.road.main_lanes)]
        for i in range(len(scenes)):
            strip = strips[int(scenes.lane[i]) - 1]
            _replay_one(sumo, net, scene, strip, traffic, scenes, i, drive, out)
            scene.clear()
            progress("replay in SUMO", i + 1, len(scenes))
    return out


class Moment(NamedTuple):
    """A modelled vehicle at one step, with its surroundings.

    Attributes
    ----------
    i, k : int
        Number of the window; step of its simulation.
    names, rows : list of str, int64
        The recorded vehicles in SUMO: their names, and their rows of the traffic.
    leader : int
        Row of the leader, or ``NOBODY``.
    gap : float
        Bumper to bumper (m), infinite without a leader.
    motion : Motion
    x : float
        Front bumper (m).
    """

    i: int
    k: int
    names: list[str]
    rows: Integers
    leader: int
    gap: float
    motion: Motion
    x: float


# From a moment to acceleration, steering, the motion one frame later, and the front bumper's x and y there.
Drive = Callable[[Moment], tuple[float, float, Motion, float, float]]


def _plain(scenes: Scenes, theta: Floats, limit: Floats) -> Drive:
    """Return what drives by the IDM."""
    theta, lane_y, t = np.ascontiguousarray(theta), scenes.road.lane_center(scenes.lane), scenes.traffic

    def drive(now: Moment) -> Any:
        i, leader_speed = now.i, float(t.speed[now.leader]) if now.leader != NOBODY else now.motion.speed
        driver = Driver(theta[i], float(limit[i]), float(scenes.length[i]), float(lane_y[i]))
        return advance(now.motion, now.gap, leader_speed, driver)

    return drive


def _residual(scenes: Scenes, drivers: ResidualDrivers) -> Drive:
    """Return what drives by the pooled IDM and a residual."""
    model, weights, lane_y = drivers.model, drivers.shared_weights(), scenes.road.lane_center(scenes.lane)
    scratch, leader = np.empty((ROOM, REGRESSORS)), {"acceleration": 0.0, "speed": 0.0}

    def drive(now: Moment) -> Any:
        i, motion = now.i, now.motion
        speed = float(scenes.traffic.speed[now.leader]) if now.leader != NOBODY else 0.0
        known = float(drivers.leader_acceleration[i])
        if now.k > 0:
            known = followed_acceleration(leader["acceleration"], leader["speed"], speed, FRAME_STEP)
        leader.update(acceleration=known, speed=speed)
        acceleration = driven(
            motion.speed, speed, now.gap, known, now.k * FRAME_STEP, model.shared, weights[i], drivers.own[i],
            model.desired_speed, scratch,
        )  # fmt: skip
        length = float(scenes.length[i])
        steering = steer(motion.y, motion.heading, motion.speed, length, float(lane_y[i]))
        return acceleration, steering, *moved(motion, acceleration, steering, length)

    return drive


def _extended(
    sumo: Any,
    net: RoadNetwork,
    scenes: Scenes,
    theta: Floats,
    limit: Floats,
    recording: Recording,
    model: ExtendedModel,
) -> Drive:
    """Return what drives by an extended model.

    It sees the other vehicles where SUMO shows them.
    """
    drivers, view, vehicles = set_out(scenes, recording, model, theta, limit)
    shown = view._replace(x=view.x.copy())

    def drive(now: Moment) -> Any:
        if now.names:
            shown.x[now.rows] = net.seen(sumo, now.names)[:, 0]
        i, motion = now.i, now.motion
        acceleration = decide(i, now.k, now.x, motion.speed, now.leader, now.gap, drivers, shown, vehicles)
        length = float(vehicles.length[i])
        steering = steer(motion.y, motion.heading, motion.speed, length, float(vehicles.lane_y[i]))
        return acceleration, steering, *moved(motion, acceleration, steering, length)

    return drive


def _replay_one(
    sumo: Any,
    net: RoadNetwork,
    scene: SumoScene,
    strip: tuple[str, ...],
    traffic: TrafficRows,
    scenes: Scenes,
    i: int,
    drive: Drive,
    out: Trajectories,
) -> None:
    """Drive window ``i`` and write it to ``out``."""
    length, lane, t = float(scenes.length[i]), int(scenes.lane[i]), scenes.traffic
    end = net.reach(sumo)[1]
    right, left = inside_lane(scenes.road, [-np.inf, np.inf], lane).tolist()
    x, y, heading, speed = start_of(scenes, i)
    motion = Motion(*bicycle.center_of_front(x, y, heading, length), heading, speed)
    for k in range(out.x.shape[1]):
        out.x[i, k], out.y[i, k], out.heading[i, k], out.speed[i, k] = x, y, motion.heading, motion.speed
        if x > end:
            raise InputError(f"vehicle {scenes.vehicle[i]} drives off the network, x = {x:.0f} m; shorten the horizon")
        rows = _rows_around(scenes, i, k, x)
        names, fronts, laterals, angles, lengths, widths = traffic.of(rows)
        scene.place(
            [*names, EGO], [*fronts, x], [*laterals, min(max(y, right), left)],
            [*angles, float(compass(motion.heading))], [*lengths, length], [*widths, float(scenes.width[i])],
        )  # fmt: skip
        sumo.simulationStep()
        row, gap = _perceive(sumo, net, strip, names, rows, t.length)
        out.leader[i, k], out.gap[i, k] = row, gap
        if k == out.acceleration.shape[1]:
            break
        now = Moment(i, k, names, rows, row, gap, motion, x)
        out.acceleration[i, k], out.steering[i, k], motion, x, y = drive(now)


def _perceive(
    sumo: Any, net: RoadNetwork, strip: tuple[str, ...], names: list[str], rows: Integers, length: Floats
) -> tuple[int, float]:
    """Return the leader's row (or ``NOBODY``) and gap (m)."""
    leader = leader_in_lane(sumo, EGO, strip)
    if leader is None:
        return NOBODY, np.inf
    row = int(rows[names.index(leader)])
    # getLeader's own gap is up to 1 mm off beside the end of an edge, and knows no lengths here.
    front, own_front = net.seen(sumo, [leader, EGO])[:, 0]
    return row, float(front - length[row] - own_front)


def _rows_around(scenes: Scenes, i: int, k: int, front: float) -> Integers:
    """Return the rows of the traffic around a window's step."""
    t, lane, cell = scenes.traffic, int(scenes.lane[i]), int(scenes.cell[i]) + scenes.start + k
    beside = [cell + t.frames * side for side in (-1, 1) if 1 <= lane + side <= scenes.road.main_lanes]
    if scenes.leader_source != LEADER_FROM_LANE:
        beside = []  # the window's private lane has no neighbours
    cells = np.array([cell, *beside], dtype=np.int64)
    return np.asarray(_rows_in_reach(t.offsets, t.x, t.vehicle, cells, front, int(scenes.vehicle[i])))


@njit(cache=True)
def _rows_in_reach(offsets, x, vehicle, cells, front, own):  # type: ignore[no-untyped-def]
    """Return the rows of ``cells`` in reach of ``front`` (m).

    Of the first cell these are all that are ahead.
    """
    rows = [0 for _ in range(0)]
    for number, cell in enumerate(cells):
        for row in range(offsets[cell], offsets[cell + 1]):
            near = number == 0 or x[row] < front + AHEAD
            if near and x[row] > front - BEHIND and vehicle[row] != own:
                rows.append(row)
    return np.array(rows, dtype=np.int64)
