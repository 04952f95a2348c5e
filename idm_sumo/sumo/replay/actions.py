"""Vehicles in SUMO driven by given accelerations and steering angles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from idm_sumo.models import bicycle
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import Trajectories
from idm_sumo.sumo import network
from idm_sumo.sumo.replay.motion import Motion, moved, start_of
from idm_sumo.sumo.replay.one_vehicle import EGO
from idm_sumo.sumo.replay.scene import SumoScene, compass
from idm_sumo.sumo.replay.traffic_rows import check_on_network, traffic_rows
from idm_sumo.sumo.session import simulation

Floats = npt.NDArray[np.float64]


def replay_controls(scenes: Scenes, acceleration: Floats, steering: Floats) -> Trajectories:
    """Drive vehicles in SUMO by given controls, one by one.

    Each has a replay of its own among all recorded vehicles but its own.

    Parameters
    ----------
    scenes : Scenes
    acceleration, steering : float64, shape (vehicles, horizon)
        Controls of each step (m/s², rad).

    Returns
    -------
    Trajectories
        Every step starts from the place that SUMO returns, so that an error of SUMO's would
        show and grow. ``gap`` and ``leader`` are not recorded (infinite, ``NOBODY``).

    Raises
    ------
    InputError
        If SUMO or the network cannot be loaded, or a recorded vehicle is off the network.
    """
    out, traffic = Trajectories.of(scenes), traffic_rows(scenes)
    out.acceleration[:], out.steering[:], out.gap[:], out.leader[:] = acceleration, steering, np.inf, NOBODY
    net = network.of(scenes.road)
    with simulation(net=net.file) as sumo:
        check_on_network(sumo, traffic, net)
        scene = SumoScene(sumo, net, as_points=True)
        for i in range(len(scenes)):
            x, y, heading, speed = start_of(scenes, i)
            length = float(scenes.length[i])
            for k in range(out.x.shape[1]):
                rows = _around(scenes, i, k)
                names, fronts, laterals, angles, lengths, widths = traffic.of(rows)
                scene.place(
                    [*names, EGO], [*fronts, x], [*laterals, y], [*angles, float(compass(heading))],
                    [*lengths, length], [*widths, float(scenes.width[i])],
                )  # fmt: skip
                sumo.simulationStep()
                x, y = net.seen(sumo, [EGO])[0].tolist()
                heading = float(np.radians(90.0 - sumo.vehicle.getAngle(EGO)))
                out.x[i, k], out.y[i, k], out.heading[i, k], out.speed[i, k] = x, y, heading, speed
                if k == out.acceleration.shape[1]:
                    break
                motion = Motion(*bicycle.center_of_front(x, y, heading, length), heading, speed)
                motion, x, y = moved(motion, acceleration[i, k], steering[i, k], length)
                heading, speed = motion.heading, motion.speed
            scene.clear()
    return out


def _around(scenes: Scenes, i: int, k: int) -> npt.NDArray[np.int64]:
    """Return the rows of the other recorded vehicles.

    They are those of step ``k`` of window ``i``.
    """
    t = scenes.traffic
    cells = scenes.cell[i : i + 1] + scenes.start + k
    if scenes.leader_source == LEADER_FROM_LANE:
        cells = t.cell(np.arange(1, scenes.road.main_lanes + 1), scenes.first_frame[i] + scenes.start + k)
    rows = np.concatenate([np.arange(t.offsets[cell], t.offsets[cell + 1]) for cell in cells])
    return np.asarray(rows[t.vehicle[rows] != scenes.vehicle[i]])
