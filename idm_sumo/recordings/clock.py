"""Whether the clock of a recording follows its frames, and what stands for a clock that does not."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings.coercion import HIGHEST_SPEED
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.periods import FRAME_MS, SAME_PERIOD_MS
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.errors import InputError

UNITS = {"seconds": 1e3, "microseconds": 1e-3, "nanoseconds": 1e-6}  # ms in one
LATEST_MS = 1e19  # a clock that shows more shows nothing, in nanoseconds too
NEAR = 0.1  # relative: how far a clock's rate may be from one it is taken for
JITTER_MS = 2.0  # half of the steps of a clock that jitters are farther off; those of NGSIM are exact
STANDING = 0.5  # share of frames over which a clock stands from which it is constant or rounded
ENOUGH = 20  # steps of vehicles that tell how a clock runs
COLLIDE = 0.01  # share of rows of one vehicle and frame from which numbers are used again
REUSED = 0.05  # share of vehicles that jump, as well
NOISE = 3.0  # m, of a position, beyond what the highest speed explains
REMEDY = "give Global_Time (ms) or a column `period`, or a file for each period"


def bounded(clock: pd.Series) -> pd.Series:
    """Return clock readings, NaN where one is beyond any clock."""
    return clock.where(clock.abs() < LATEST_MS)


def frames_of_clock(raw: pd.DataFrame) -> pd.Series:
    """Return the frame of each row by its clock alone, whatever its unit."""
    order = raw.sort_values(["Vehicle_ID", "Global_Time"], kind="stable")
    steps = order["Global_Time"].diff()[order["Vehicle_ID"].diff() == 0]
    step = float(steps[steps > 0].median()) if (steps > 0).any() else FRAME_MS
    unit = next((ms for ms in UNITS.values() if abs(step * ms / FRAME_MS - 1.0) < NEAR), 1.0)
    return ((raw["Global_Time"] - raw["Global_Time"].min()) * unit / FRAME_MS).round()


def check_frames(raw: pd.DataFrame, source: str) -> None:
    """Raise if vehicles are recorded at another rate than every frame of 0.1 s.

    Raises
    ------
    InputError
        If half of the steps of vehicles skip frames; says how many.
    """
    step = _steps(raw, "Frame_ID", ["Vehicle_ID", "Frame_ID"])
    step = step[step > 0]
    if len(step) >= ENOUGH and (median := float(np.median(step))) > 1.0:
        raise InputError(
            f"{source}: the frames of a vehicle are {median:g} apart ({median * FRAME_STEP:g} s); resample it to every "
            f"frame of {FRAME_STEP} s"
        )


def sound_clock(raw: pd.DataFrame, notes: list[str], source: str) -> pd.DataFrame:
    """Return the table with a clock in ms that follows the frames, or without one, and say what was wrong.

    Parameters
    ----------
    raw : pandas.DataFrame
        ``Vehicle_ID, Frame_ID`` (whole numbers) and, if recorded, ``Global_Time``.
    notes : list of str
        Gets a line for every fault that was worked around.
    source : str
        What messages call the file.

    Raises
    ------
    InputError
        If a frame lasts something else than 0.1 s by the clock.
    """
    if "Global_Time" not in raw:
        return raw
    frames, clock = _advances(raw)
    if len(frames) < ENOUGH:
        return raw
    if (standing := float((clock == 0).mean())) > STANDING:
        notes.append(
            f"Global_Time stands still over {standing:.0%} of the frames (constant, or rounded by a "
            f"spreadsheet); Frame_ID "
            "is used in its place"
        )
        return raw.drop(columns="Global_Time")
    rate = float(np.median(clock / frames))
    for unit, ms in UNITS.items():
        if abs(rate * ms / FRAME_MS - 1.0) < NEAR:
            notes.append(f"Global_Time is in {unit}; it is converted to ms")
            return sound_clock(raw.assign(Global_Time=raw["Global_Time"] * ms), notes, source)
    if not abs(rate / FRAME_MS - 1.0) < NEAR:
        raise InputError(
            f"{source}: Global_Time advances by {rate:g} a frame where {FRAME_MS} ms are needed; "
            f"resample the recording to "
            f"{FRAME_STEP} s, or leave Global_Time out"
        )
    off = np.abs(clock - FRAME_MS * frames)
    if float(np.median(off)) <= JITTER_MS:
        return raw
    notes.append(f"Global_Time jitters by {np.median(off):.0f} ms; Frame_ID is used for the time within a period")
    return raw.assign(Global_Time=_steadied(raw))


def check_one_period(raw: pd.DataFrame, source: str) -> None:
    """Raise if rows without a clock are of several periods that use numbers again.

    Raises
    ------
    InputError
        If rows of a vehicle and frame are there twice, or vehicles jump between their frames.
    """
    rows = raw.drop_duplicates()
    collide = int(rows.duplicated(["Vehicle_ID", "Frame_ID"]).sum())
    rows = rows.sort_values(["Vehicle_ID", "Frame_ID"], kind="stable")
    frames = rows["Frame_ID"].diff().clip(lower=1)
    reach = HIGHEST_SPEED * FRAME_STEP * frames + NOISE
    moved = rows["Local_Y"].diff() * FOOT
    jump = (rows["Vehicle_ID"].diff() == 0) & ((moved > reach) | (moved < -reach.clip(upper=10.0)))
    jumping, vehicles = rows.loc[jump, "Vehicle_ID"].nunique(), rows["Vehicle_ID"].nunique()
    if collide > COLLIDE * len(rows) or (jumping > REUSED * vehicles and jumping > 2):
        raise InputError(
            f"{source}: without a clock, {collide} of {len(rows)} rows are second ones of a vehicle and "
            f"frame and {jumping} of "
            f"{vehicles} vehicles jump: several periods use the same numbers; {REMEDY}"
        )


def _steps(raw: pd.DataFrame, of: str, order: list[str]) -> npt.NDArray[np.float64]:
    rows = raw.sort_values(order, kind="stable")
    return np.asarray(rows[of].diff()[rows["Vehicle_ID"].diff() == 0], dtype=np.float64)


def _advances(raw: pd.DataFrame) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return by how much frames and clock advance between rows of a vehicle that follow each other."""
    order = ["Vehicle_ID", "Global_Time", "Frame_ID"]
    frames, clock = _steps(raw, "Frame_ID", order), _steps(raw, "Global_Time", order)
    follow = frames == 1
    return frames[follow], clock[follow]


def _steadied(raw: pd.DataFrame) -> npt.NDArray[np.float64]:
    """Return the clock by the frames: one offset a period, periods being offsets a minute apart."""
    offset = np.asarray(raw["Global_Time"] - FRAME_MS * raw["Frame_ID"], dtype=np.float64)
    order = np.argsort(offset, kind="stable")
    period = np.empty(len(offset), dtype=np.int64)
    period[order] = np.concatenate([[0], np.cumsum(np.diff(offset[order]) > SAME_PERIOD_MS)])
    middle = pd.Series(offset).groupby(period).median().round().to_numpy()
    return np.asarray(middle[period] + FRAME_MS * raw["Frame_ID"].to_numpy())
