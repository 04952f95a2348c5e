"""The leader of every recorded vehicle, rebuilt from its headway.

For recordings that hold a follower and its headway but not the car ahead. A jump of the
rebuilt leader is a change of leader, so its path is smoothed between jumps only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from idm_sumo import columns as c
from idm_sumo import road
from idm_sumo.recording import Recording

JUMP = 2.5  # m a frame beyond the expected 0.1 s of travel: more than noise, less than a car
SMOOTHING_FRAMES = 21
SMOOTHING_ORDER = 3


class Leaders(NamedTuple):
    """Front bumper (m) and speed (m/s) of each row's leader, shape (rows,), NaN for none."""

    x: npt.NDArray[np.float64]
    speed: npt.NDArray[np.float64]


def recorded_leaders(recording: Recording) -> Leaders:
    """Rebuild the leaders of all rows of one period; the leader's front is own front plus headway."""
    table = recording.table
    raw = table[c.X].to_numpy() + table[c.HEADWAY].to_numpy()
    first = _first_rows(table[c.VEHICLE].to_numpy(), table[c.FRAME].to_numpy(), raw, table[c.SPEED].to_numpy())
    position, speed = np.full(len(raw), np.nan), np.full(len(raw), np.nan)
    own_speed = table[c.SPEED].to_numpy()
    for begin, end in zip(first, np.append(first[1:], len(raw)), strict=True):
        if np.isnan(raw[begin]):
            continue
        position[begin:end], speed[begin:end] = _smooth_run(raw[begin:end], own_speed[begin:end])
    return Leaders(position, speed)


def _first_rows(
    vehicle: npt.NDArray[np.int64],
    frame: npt.NDArray[np.int64],
    leader_x: npt.NDArray[np.float64],
    speed: npt.NDArray[np.float64],
) -> npt.NDArray[np.int64]:
    """Return the first row of every stretch with one leader, or with none."""
    known = np.isfinite(leader_x)
    with np.errstate(invalid="ignore"):
        jump = np.abs(np.diff(leader_x) - speed[1:] * road.FRAME_STEP) > JUMP
    breaks = (np.diff(vehicle) != 0) | (np.diff(frame) != 1) | (np.diff(known.astype(np.int8)) != 0) | jump
    return np.concatenate([[0], np.flatnonzero(breaks) + 1])


def _smooth_run(
    path: npt.NDArray[np.float64], follower_speed: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Smooth one leader's path; a glimpse of under half a second takes the follower's speed."""
    frames = min(SMOOTHING_FRAMES, len(path) - 1 + len(path) % 2)
    if frames <= SMOOTHING_ORDER:
        return path, follower_speed
    settings = {"window_length": frames, "polyorder": SMOOTHING_ORDER, "delta": road.FRAME_STEP, "mode": "interp"}
    return savgol_filter(path, **settings), np.maximum(savgol_filter(path, deriv=1, **settings), 0.0)
