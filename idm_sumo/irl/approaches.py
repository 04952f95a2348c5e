"""Smallest distance between a modelled vehicle and any other.

The gap to the leader says nothing about vehicles beside and behind; this distance covers them, too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.evaluation.collisions import first_row_from
from idm_sumo.evaluation.rectangles import rectangle, separation
from idm_sumo.irl.episodes import episodes_of
from idm_sumo.models import bicycle
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

Floats = npt.NDArray[np.float64]

FAR = 30.0  # m, largest distance of a vehicle that counts


def closest_approaches(scenes: Scenes, trajectories: Trajectories) -> pd.DataFrame:
    """Return each modelled vehicle's closest approach to another vehicle.

    Parameters
    ----------
    scenes : Scenes
        Windows of the drivers.
    trajectories : Trajectories
        One row a driver of ``scenes``, from the start of the simulation.

    Returns
    -------
    pandas.DataFrame
        One row a driver:

        - ``clearance_m``: smallest distance over all steps after the start between its rectangle and another
          vehicle's, the recorded vehicle that it replaces excepted. It is the largest separation along the edges
          of either rectangle: exact unless corner faces corner, then a little too small; negative where the
          rectangles overlap; infinite where no vehicle is within 30 m.
        - ``lateral``: whether the other vehicle was beside it at that moment, overlapping along the road.
        - ``step``: that moment.
        - ``other``: number of the other vehicle; 0 for none, or for a leader known by its headway only.
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
                            along,
                            across,
                            separation(ego, other, other[2], other[3]),
                            separation(ego, other, -other[3], other[2]),
                        )
                        if apart < clearance[i]:
                            clearance[i], beside[i], when[i], which[i] = apart, across > along, k, row
                    row += 1
