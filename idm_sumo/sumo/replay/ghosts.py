"""The routine replay in SUMO: all recorded vehicles once, all modelled vehicles as ghosts.

Ghosts are not in SUMO and nobody sees them, so one pass over the recording serves all of
them. Each step SUMO is told where the recorded vehicles are and makes a step; their positions
are read back, and on these the ghosts perceive and are driven together, compiled.
"""

from __future__ import annotations

from typing import Any

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
from idm_sumo.sumo.replay.one_vehicle import advance
from idm_sumo.sumo.replay.stage import Cast, Stage, cast, check_on_network
from idm_sumo.sumo.session import simulation

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

EXACT = 1e-9  # m, within which SUMO returns the positions it was given


def replay_ghosts(
    scenes: Scenes,
    drivers: pd.DataFrame | npt.ArrayLike,
    *,
    desired_speed: npt.ArrayLike | None = None,
    jobs: int = 1,
    progress: Progress = silent,
) -> Trajectories:
    """Drive all vehicles by IDM and pure pursuit beside one single pass of the recording in SUMO.

    Parameters
    ----------
    scenes, drivers, desired_speed
        As of :func:`idm_sumo.simulation.rollout.drive_idm`.
    jobs : int
        Processes; each plays its share of the recording. The results do not depend on it.
    progress : Progress
        Told how many frames are done, by a single process.

    Returns
    -------
    Trajectories
        The same figures as :func:`idm_sumo.sumo.replay.one_vehicle.replay`; by Euler with the old speed.

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


def _pass(scenes: Scenes, theta: Floats, limit: Floats, progress: Progress = silent) -> Trajectories:
    """Play the frames that the ghosts live in, once."""
    steps = scenes.window.horizon
    out, center = _at_start(scenes)
    actors, t, lane_y = cast(scenes), scenes.traffic, scenes.road.lane_center(scenes.lane)
    begin = scenes.first_frame + scenes.start
    order = np.argsort(begin, kind="stable")
    frames = np.unique((begin[:, None] + np.arange(steps + 1)).ravel())
    ghosts = np.searchsorted(begin[order], [frames - steps, frames + 1]).T  # those on the road at each frame
    by_frame = np.argsort(actors.frame, kind="stable")
    recorded = np.searchsorted(actors.frame[by_frame], [frames, frames + 1]).T
    x = np.full(len(t.x), np.nan)
    net = network.of(scenes.road)
    with simulation(net=net.file) as sumo:
        check_on_network(sumo, actors)
        stage = Stage(sumo, net, as_points=True, edge_by_edge=True)
        for done, frame in enumerate(frames.tolist()):
            rows = by_frame[slice(*recorded[done])]
            x[rows] = _play_frame(sumo, stage, actors, rows)
            active = order[slice(*ghosts[done])]
            _drive_frame(
                active, frame - begin[active], theta, limit, scenes.length, lane_y, scenes.cell + scenes.start,
                scenes.vehicle, t.offsets, x, t.speed, t.length, t.vehicle, center,
                out.x, out.y, out.heading, out.speed, out.acceleration, out.steering, out.gap, out.leader,
            )  # fmt: skip
            progress("ghosts in SUMO", done + 1, len(frames))
    return out


def _at_start(scenes: Scenes) -> tuple[Trajectories, Floats]:
    """Return storage that holds the starts, and the centres of mass (m), shape (vehicles, 2)."""
    out, k = Trajectories.of(scenes), scenes.start
    center = np.empty((len(scenes), 2))
    for name in ("x", "y", "heading", "speed"):
        getattr(out, name)[:, 0] = getattr(scenes, name)[:, k]
    for i in range(len(scenes)):
        center[i] = bicycle.center_of_front(out.x[i, 0], out.y[i, 0], out.heading[i, 0], scenes.length[i])
    return out, center


def _play_frame(sumo: Any, stage: Stage, actors: Cast, rows: Integers) -> Floats:
    """Put the recorded vehicles of one frame on the road and return their ``x`` (m), read back."""
    names, *where = actors.of(rows)
    stage.place(names, *where)
    sumo.simulationStep()
    position = sumo.vehicle.getPosition
    back = np.array([position(name) for name in names]).reshape(-1, 2)
    deviation = np.abs(back - np.column_stack([actors.x[rows], actors.y[rows]])).max(initial=0.0)
    if deviation > EXACT:
        raise RuntimeError(f"SUMO returns positions {deviation:g} m from where vehicles were put")
    return np.asarray(back[:, 0])


@njit(cache=True)
def _drive_frame(  # type: ignore[no-untyped-def]
    active, step, theta, limit, length, lane_y, first_cell, own,
    offsets, traffic_x, traffic_speed, traffic_length, traffic_vehicle, center,
    x, y, heading, speed, acceleration, steering, gap, leader,
):  # fmt: skip
    """Let the ghosts ``active`` perceive at their ``step`` and drive them to the next."""
    for i, k in zip(active, step):  # noqa: B905 (numba has no strict)
        row, d = perceive(first_cell[i] + k, x[i, k], own[i], offsets, traffic_x, traffic_length, traffic_vehicle)
        leader[i, k], gap[i, k] = row, d
        if k == acceleration.shape[1]:
            continue
        v = speed[i, k]
        leader_speed = traffic_speed[row] if row != NOBODY else v
        (
            acceleration[i, k], steering[i, k], center[i, 0], center[i, 1],
            heading[i, k + 1], speed[i, k + 1], x[i, k + 1], y[i, k + 1],
        ) = advance(
            center[i, 0], center[i, 1], heading[i, k], v, d, leader_speed, theta[i], limit[i], length[i], lane_y[i]
        )  # fmt: skip
