"""How close a modelled car comes to others, beside, ahead and behind: what a gap to the leader does not tell."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.evaluation.collisions import rectangle, separation
from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.features import first_row_from
from idm_sumo.models import bicycle
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

Floats = npt.NDArray[np.float64]

FAR = 30.0  # m, how far to look


def closest_approaches(scenes: Scenes, trajectories: Trajectories) -> pd.DataFrame:
    """Return how close each modelled car comes to any other vehicle but its recorded twin.

    Returns
    -------
    pandas.DataFrame
        One row a driver: ``clearance_m``, the smallest distance over all steps after the start
        between the rectangles of the car and of another (the largest separation along the
        edges of either: exact unless corner faces corner, then a little less; negative where
        they overlap; infinite where nobody is within 30 m), ``lateral`` (whether the other was
        beside it, overlapping along the road, at that moment), ``step`` and ``other`` (vehicle
        number, 0 for nobody or a leader known by its headway only).
    """
    episodes, around = episodes_of([scenes])
    n = len(scenes)
    clearance, beside = np.full(n, np.inf), np.zeros(n, dtype=np.bool_)
    step, row = np.zeros(n, dtype=np.int64), np.full(n, -1)
    _closest(trajectories.x, trajectories.y, trajectories.heading, episodes, around, clearance, beside, step, row)
    other = np.where(row >= 0, around.vehicle[row], 0) if len(around.vehicle) else np.zeros(n, dtype=np.int64)
    return pd.DataFrame({"clearance_m": clearance, "lateral": beside, "step": step, "other": other})


@njit(cache=True)
def _closest(x, y, heading, episodes, around, clearance, beside, when, which):  # type: ignore[no-untyped-def]
    for i in range(x.shape[0]):
        length = episodes.length[i]
        for k in range(1, x.shape[1]):
            ego = rectangle(x[i, k], y[i, k], heading[i, k], length, episodes.width[i])
            for lane in range(episodes.lanes[i]):
                cell = episodes.cell[i] + k + lane * episodes.stride[i]
                row, end = around.offsets[cell], around.offsets[cell + 1]
                row = first_row_from(around.front, row, end, x[i, k] - length - FAR)
                while row < end and around.front[row] < x[i, k] + around.reach + FAR:
                    if around.vehicle[row] != episodes.own[i]:
                        psi, long = around.heading[row], around.length[row]
                        front = bicycle.front_of_center(around.x[row], around.y[row], psi, long)
                        other = rectangle(front[0], front[1], psi, long, around.width[row])
                        along = separation(ego, other, ego[2], ego[3])
                        across = separation(ego, other, -ego[3], ego[2])
                        apart = max(
                            along, across, separation(ego, other, other[2], other[3]),
                            separation(ego, other, -other[3], other[2]),
                        )  # fmt: skip
                        if apart < clearance[i]:
                            clearance[i], beside[i], when[i], which[i] = apart, across > along, k, row
                    row += 1
