"""The surrogate recording in NGSIM's layout and units."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings.readers.layouts import OFFICIAL
from idm_sumo.roads.units import FOOT
from idm_sumo.roads.us101 import US101
from idm_sumo.sumo.surrogate.demand import PERIODS
from idm_sumo.sumo.surrogate.noise import speed_and_acceleration, starts_of
from idm_sumo.sumo.surrogate.traffic import Trajectories

# ms since 1970: `Global_Time - 100 Frame_ID` of the official files, and when our periods begin
# (07:49:40 and every 15 minutes, about where the official files have their first rows).
CLOCK_OFFSET = (1118846978900, 1118847842000, 1118848757000)
PERIOD_START = (1118846980000, 1118847880000, 1118848780000)
FRAME_MS = 100

# Where the recording sees the ramps: from 500 ft and to 1,424 ft.
OFF_RAMP_LANE = US101.off_ramps[0].number
ON_RAMP_SEEN, OFF_RAMP_SEEN = 500 * FOOT, 1424 * FOOT
NO_SPEED_HEADWAY = 9999.99  # NGSIM's time headway of a standing vehicle
# Global coordinates (ft) are Local ones turned to the southeast, with an invented origin.
GLOBAL_ORIGIN = (6451137.6, 1873344.9)


def in_section(frames: Trajectories, drivers: pd.DataFrame) -> npt.NDArray[np.bool_]:
    """Return which rows the recording sees, before noise.

    Parameters
    ----------
    frames : dict of ndarray, shape (rows,)
        ``vehicle`` (number), ``x`` and ``y`` (m).
    drivers : pandas.DataFrame
        As of :func:`~idm_sumo.sumo.surrogate.demand.draw_drivers`; row number is vehicle number.

    Returns
    -------
    ndarray of bool, shape (rows,)
        True inside the section, and on a ramp where the recording sees it.
    """
    vehicle, x = frames["vehicle"], frames["x"]
    seen = (x >= np.where(drivers["on_ramp"].to_numpy()[vehicle], ON_RAMP_SEEN, 0)) & (x <= US101.length)
    on_off_ramp = US101.lane_of(x, frames["y"]) == OFF_RAMP_LANE
    return np.asarray(seen & ~(on_off_ramp & (x > OFF_RAMP_SEEN)))


def lay_out(
    frames: Trajectories, noisy: Trajectories, drivers: pd.DataFrame, frames_a_period: int
) -> Iterator[pd.DataFrame]:
    """Yield the recording in NGSIM's columns, one table a period.

    Parameters
    ----------
    frames, noisy : dict of ndarray, shape (rows,)
        Simulated positions, and the same with measurement noise; sorted by vehicle and frame.
    drivers : pandas.DataFrame
        As of :func:`~idm_sumo.sumo.surrogate.demand.draw_drivers`; row number is vehicle number.
    frames_a_period : int
        Frames of a period. A vehicle belongs to the period in which it is first seen.

    Yields
    ------
    pandas.DataFrame
        The 18 official columns, sorted by vehicle and frame.
    """
    starts = starts_of(frames["vehicle"])
    sizes = np.diff(starts)
    period, number = _renumber(frames["frame"][starts[:-1]], frames_a_period)
    period_of_row, number_of_row = np.repeat(period, sizes), np.repeat(number, sizes)
    lane = US101.lane_of(frames["x"], frames["y"]).astype(np.int8)
    place = (noisy["x"] / FOOT).round(3)
    ahead, behind = _neighbours(frames["frame"], lane, place, period_of_row)
    for chosen in range(PERIODS):
        rows = np.flatnonzero(period_of_row == chosen)
        table = pd.DataFrame({"Vehicle_ID": number_of_row[rows], "Lane_ID": lane[rows], "Local_Y": place[rows]})
        _add_clock(table, frames["frame"][rows], chosen, frames_a_period)
        _add_vehicles(table, drivers.iloc[frames["vehicle"][starts[:-1]][period == chosen]], sizes[period == chosen])
        _add_motion(table, noisy["x"][rows], noisy["y"][rows])
        _add_headways(table, place, number_of_row, ahead[rows], behind[rows])
        order = np.lexsort((table["Frame_ID"], table["Vehicle_ID"]))
        yield table[list(OFFICIAL)].iloc[order].reset_index(drop=True)


def _renumber(first: npt.NDArray[Any], frames_a_period: int) -> tuple[npt.NDArray[np.int8], npt.NDArray[np.int32]]:
    """Return period and number of each vehicle.

    Numbers begin at 1 in each period, in the order of appearance.
    """
    period = first // frames_a_period
    order = np.argsort(first, kind="stable")
    number = np.empty(len(first), dtype=np.int32)
    number[order] = pd.Series(period[order]).groupby(period[order]).cumcount().to_numpy() + 1
    return period.astype(np.int8), number


def _add_clock(table: pd.DataFrame, frame: npt.NDArray[Any], period: int, frames_a_period: int) -> None:
    """Add time of day and frame number."""
    clock = PERIOD_START[period] + FRAME_MS * (frame.astype(np.int64) - period * frames_a_period)
    table["Global_Time"] = clock
    table["Frame_ID"] = ((clock - CLOCK_OFFSET[period]) // FRAME_MS).astype(np.int32)


def _add_vehicles(table: pd.DataFrame, vehicles: pd.DataFrame, sizes: npt.NDArray[np.int64]) -> None:
    """Add the columns that are constant over a vehicle's frames."""
    table["Total_Frames"] = np.repeat(sizes, sizes).astype(np.int32)
    table["v_Length"] = np.repeat((vehicles["length"] / FOOT).round(1).to_numpy(), sizes)
    table["v_Width"] = np.repeat((vehicles["width"] / FOOT).round(1).to_numpy(), sizes)
    table["v_Class"] = np.repeat(vehicles["vehicle_class"].to_numpy(dtype=np.int8), sizes)


def _add_motion(table: pd.DataFrame, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> None:
    """Add lateral position, speed, acceleration and global coordinates (feet)."""
    speed, acceleration = speed_and_acceleration(x, starts_of(table["Vehicle_ID"].to_numpy()))
    table["Local_X"] = (-y / FOOT).round(3)
    table["v_Vel"], table["v_Acc"] = (speed / FOOT).round(2), (acceleration / FOOT).round(2)
    forward, right = table["Local_Y"] * np.sqrt(0.5), table["Local_X"] * np.sqrt(0.5)
    table["Global_X"] = (GLOBAL_ORIGIN[0] + forward - right).round(3)
    table["Global_Y"] = (GLOBAL_ORIGIN[1] - forward - right).round(3)


def _neighbours(
    frame: npt.NDArray[Any], lane: npt.NDArray[Any], place: npt.NDArray[Any], period: npt.NDArray[Any]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the next rows ahead and behind in the lane.

    They are -1 where there is none. Lanes 6, 7 and 8 are one strip. A neighbour that belongs to
    another period has no number in this one and stays unnamed, as in the official files.
    """
    strip = np.minimum(lane, US101.main_lanes + 1)
    order = np.lexsort((place, strip, frame))
    back, front = order[:-1], order[1:]
    named = (frame[back] == frame[front]) & (strip[back] == strip[front]) & (period[back] == period[front])
    ahead, behind = np.full(len(frame), -1), np.full(len(frame), -1)
    ahead[back[named]], behind[front[named]] = front[named], back[named]
    return ahead, behind


def _add_headways(
    table: pd.DataFrame,
    place: npt.NDArray[np.float64],
    number: npt.NDArray[np.int32],
    ahead: npt.NDArray[np.int64],
    behind: npt.NDArray[np.int64],
) -> None:
    """Add ``Preceding``, ``Following`` and headways; 0 without a neighbour."""
    has = ahead >= 0
    table["Preceding"] = np.where(has, number[ahead], 0)
    table["Following"] = np.where(behind >= 0, number[behind], 0)
    table["Space_Headway"] = np.where(has, place[ahead] - table["Local_Y"], 0).round(2)
    with np.errstate(divide="ignore", invalid="ignore"):
        headway = (table["Space_Headway"].to_numpy() / table["v_Vel"].to_numpy()).round(2)
    table["Time_Headway"] = np.where(has, np.minimum(headway, NO_SPEED_HEADWAY), 0)
