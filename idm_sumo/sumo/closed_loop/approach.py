"""Room upstream of the section for vehicles to line up.

A vehicle that is put on the road at the section's start needs the gap there that its model holds for safe; in dense
traffic it waits for one while the road ahead empties. Put on the road some way upstream, it drives up to its leader.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.sumo.network import RoadNetwork

DISTANCE = 200.0  # m upstream of where it was first recorded
MARGIN = 10.0  # m from the network's start
MOUTH = 40.0  # m; who is first recorded farther on is put there
SPEEDS = 9  # vehicles in a row whose median speed is that of the approach
SLOWEST = 3.0  # m/s


def moved_upstream(demand: pd.DataFrame, net: RoadNetwork) -> pd.DataFrame:
    """Return the demand with entering vehicles farther upstream.

    A vehicle departs earlier by the time that the way takes at the speed of those who enter in its lane; the order in
    a lane is kept.

    Parameters
    ----------
    demand : pandas.DataFrame
        ``depart_s, x_m, speed_m_s, lane``, by departure; ``depart_s`` begins with 0.
    net : RoadNetwork
        Its main road may begin nearer than ``DISTANCE``; then vehicles are put at its start.

    Returns
    -------
    pandas.DataFrame
    """
    start = net.mainline_start() + MARGIN
    entering = (demand[d.DEPART] > 0.0) & (demand[d.X] < MOUTH) & (demand[d.LANE] <= net.road.main_lanes)
    moved = demand.copy()
    for _, lane in demand[entering].groupby(d.LANE):
        x, depart, speed = _earlier(lane, start)
        moved.loc[lane.index, [d.X, d.DEPART, d.SPEED]] = np.column_stack([x, depart, speed])
    return moved.sort_values(d.DEPART, kind="stable", ignore_index=True)


def _earlier(lane: pd.DataFrame, start: float) -> tuple[npt.NDArray[np.float64], ...]:
    """Return places (m), times (s) and speeds (m/s) of departure."""
    usual = lane[d.SPEED].rolling(SPEEDS, center=True, min_periods=1).median().clip(lower=SLOWEST).to_numpy()
    x, then = lane[d.X].to_numpy(dtype=np.float64), lane[d.DEPART].to_numpy(dtype=np.float64)
    way = np.clip(x - start, 0.0, DISTANCE)
    wanted = then - way / usual
    wanted = np.minimum.accumulate(wanted[::-1])[::-1]
    depart = np.maximum(np.round(wanted, 1), FRAME_STEP)
    return x - np.minimum(way, usual * (then - depart)), depart, np.minimum(lane[d.SPEED].to_numpy(), usual)
