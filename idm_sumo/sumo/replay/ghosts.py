"""Modelled vehicles beside one pass of the recording in SUMO.

The modelled vehicles are not in SUMO and no vehicle sees them (ghosts), so one pass over the recording serves
all of them. Each step SUMO places the recorded vehicles; their positions are read back, and on these the
ghosts perceive and drive together, compiled.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.models import bicycle
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.workers import in_processes
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import as_driven
from idm_sumo.simulation.rollout import Trajectories, perceive
from idm_sumo.sumo import network
from idm_sumo.sumo.network import RoadNetwork
from idm_sumo.sumo.replay.motion import Driver, Motion, advance
from idm_sumo.sumo.replay.scene import SumoScene
from idm_sumo.sumo.replay.traffic_rows import TrafficRows, check_on_network, traffic_rows
from idm_sumo.sumo.session import simulation

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

EXACT = 1e-9  # m, within which SUMO returns the positions it was given
EXACT_ON_BENDS = 0.01  # m, the same where lanes bend: SUMO tells a position by its distance along the lane


def replay_ghosts(
    scenes: Scenes,
    drivers: pd.DataFrame | npt.ArrayLike,
    *,
    desired_speed: npt.ArrayLike | None = None,
    jobs: int = 1,
    progress: Progress = silent,
) -> Trajectories:
    """Drive all vehicles beside one pass of the recording.

    Parameters
    ----------
    scenes, drivers, desired_speed
        As of :func:`idm_sumo.simulation.rollout.drive_idm`.
    jobs : int
        Processes; each plays its share of the recording. The results do not depend on it.
    progress : Progress
        Called with the frames done and their total, by a single process.

    Returns
    -------
    Trajectories
        The same figures as :func:`idm_sumo.sumo.replay.one_vehicle.replay`.

    Raises
    ------
    InputError
        If SUMO or the network cannot be loaded, or a recorded vehicle is off the network.
    RuntimeError
        If SUMO returns a position that it was not given.
    """
    n = len(scenes)
    theta, limit = as_driven(scenes, drivers, desired_speed)
    if jobs == 1 or n < 2:
        return _pass(scenes, theta, limit, progress)
    # Consecutive starts belong together, so that every process plays frames of its own.
    order = np.argsort(scenes.first_frame, kind="stable")
    calls = ((scenes.subset(part), theta[part], limit[part]) for part in np.array_split(order, jobs))
    parts = list(in_processes(jobs, calls, _pass, backend="loky"))
    return Trajectories.joined(parts).rows(np.argsort(order, kind="stable"))


class Ghosts(NamedTuple):
    """Modelled vehicles beside the recorded ones, as arrays.

    Attributes
    ----------
    theta : float64, shape (vehicles, 5)
        ``a, b, T, d0, d1`` (SI units).
    desired_speed, length, lane_y : float64, shape (vehicles,)
        As of :class:`~idm_sumo.sumo.replay.motion.Driver`.
    first_cell : int64, shape (vehicles,)
        The traffic's cell that a vehicle looks into at its start.
    own : int64, shape (vehicles,)
        Number of the recorded vehicle, which the model does not see.
    center : float64, shape (vehicles, 2)
        Centre of mass (m) at present; changed as they drive.
    """

    theta: Floats
    desired_speed: Floats
    length: Floats
    lane_y: Floats
    first_cell: Integers
    own: Integers
    center: Floats


class ShownTraffic(NamedTuple):
    """The scenes' traffic where SUMO shows it.

    Columns of :class:`idm_sumo.scenes.traffic.Traffic`, but for ``x`` (m), which is read back from SUMO.
    """

    offsets: Integers
    x: Floats
    speed: Floats
    length: Floats
    vehicle: Integers


class Paths(NamedTuple):
    """Arrays of :class:`~idm_sumo.simulation.rollout.Trajectories`, written by the kernel."""

    x: Floats
    y: Floats
    heading: Floats
    speed: Floats
    acceleration: Floats
    steering: Floats
    gap: Floats
    leader: Integers


def _pass(scenes: Scenes, theta: Floats, limit: Floats, progress: Progress = silent) -> Trajectories:
    """Play the frames that the ghosts live in, once."""
    out, steps, t = Trajectories.of(scenes), scenes.window.horizon, scenes.traffic
    ghosts, paths = _at_start(scenes, theta, limit, out)
    shown = ShownTraffic(t.offsets, np.full(len(t.x), np.nan), t.speed, t.length, t.vehicle)
    traffic = traffic_rows(scenes)
    begin = scenes.first_frame + scenes.start
    order = np.argsort(begin, kind="stable")
    frames = np.unique((begin[:, None] + np.arange(steps + 1)).ravel())
    on_road = np.searchsorted(begin[order], [frames - steps, frames + 1]).T  # ghosts of each frame
    by_frame = np.argsort(traffic.frame, kind="stable")
    recorded = np.searchsorted(traffic.frame[by_frame], [frames, frames + 1]).T
    net = network.of(scenes.road)
    with simulation(net=net.file) as sumo:
        check_on_network(sumo, traffic, net)
        scene = SumoScene(sumo, net, as_points=True, edge_by_edge=not scenes.road.pieces)
        for done, frame in enumerate(frames.tolist()):
            rows = by_frame[slice(*recorded[done])]
            shown.x[rows] = _play_frame(sumo, net, scene, traffic, rows)
            active = order[slice(*on_road[done])]
            _drive_frame(active, frame - begin[active], ghosts, shown, paths)
            progress("ghosts in SUMO", done + 1, len(frames))
    return out


def _at_start(scenes: Scenes, theta: Floats, limit: Floats, out: Trajectories) -> tuple[Ghosts, Paths]:
    """Return the ghosts at their starts, and their storage."""
    k, center = scenes.start, np.empty((len(scenes), 2))
    for name in ("x", "y", "heading", "speed"):
        getattr(out, name)[:, 0] = getattr(scenes, name)[:, k]
    for i in range(len(scenes)):
        center[i] = bicycle.center_of_front(out.x[i, 0], out.y[i, 0], out.heading[i, 0], scenes.length[i])
    lane_y = scenes.road.lane_center(scenes.lane)
    ghosts = Ghosts(theta, limit, scenes.length, lane_y, scenes.cell + k, scenes.vehicle, center)
    return ghosts, Paths(*(getattr(out, name) for name in Paths._fields))


def _play_frame(sumo: Any, net: RoadNetwork, scene: SumoScene, traffic: TrafficRows, rows: Integers) -> Floats:
    """Place one frame's vehicles and return their ``x`` (m)."""
    names, *where = traffic.of(rows)
    scene.place(names, *where)
    sumo.simulationStep()
    back = net.seen(sumo, names)
    deviation = np.abs(back - np.column_stack([traffic.x[rows], traffic.y[rows]])).max(initial=0.0)
    if deviation > (EXACT if not net.road.pieces else EXACT_ON_BENDS):
        raise RuntimeError(f"SUMO returns positions {deviation:g} m from where vehicles were put")
    return np.asarray(back[:, 0])


@njit(cache=True)
def _drive_frame(active, step, ghosts, shown, paths):  # type: ignore[no-untyped-def]
    """Let the ``active`` ghosts perceive and drive one frame."""
    for i, k in zip(active, step):  # noqa: B905 (numba has no strict)
        row, gap = perceive(
            ghosts.first_cell[i] + k, paths.x[i, k], ghosts.own[i], shown.offsets, shown.x, shown.length, shown.vehicle
        )
        paths.leader[i, k], paths.gap[i, k] = row, gap
        if k == paths.acceleration.shape[1]:
            continue
        speed, center = paths.speed[i, k], ghosts.center[i]
        leader_speed = shown.speed[row] if row != NOBODY else speed
        driver = Driver(ghosts.theta[i], ghosts.desired_speed[i], ghosts.length[i], ghosts.lane_y[i])
        motion = Motion(center[0], center[1], paths.heading[i, k], speed)
        acceleration, steering, after, front_x, front_y = advance(motion, gap, leader_speed, driver)
        paths.acceleration[i, k], paths.steering[i, k] = acceleration, steering
        paths.x[i, k + 1], paths.y[i, k + 1] = front_x, front_y
        paths.heading[i, k + 1], paths.speed[i, k + 1] = after.heading, after.speed
        center[0], center[1] = after.x, after.y
