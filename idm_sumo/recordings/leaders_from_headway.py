"""The leader of every recorded vehicle, rebuilt from its headway.

For recordings that hold a follower and its headway but not the car ahead. A jump of the
rebuilt leader is a change of leader, so its path is smoothed between jumps only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.leaders import frame_code
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import SHORTEST, filter_runs

JUMP = 2.5  # m a frame beyond the expected 0.1 s of travel: more than noise, less than a car


class Leaders(NamedTuple):
    """Front bumper (m) and speed (m/s) of each row's leader, shape (rows,), NaN for none."""

    x: npt.NDArray[np.float64]
    speed: npt.NDArray[np.float64]


def recorded_leaders(recording: Recording) -> Leaders:
    """Rebuild the leaders of all rows; the leader's front is own front plus headway."""
    table = recording.table
    raw = table[c.X].to_numpy() + table[c.HEADWAY].to_numpy()
    first = _first_rows(table[c.VEHICLE].to_numpy(), frame_code(table), raw, table[c.SPEED].to_numpy())
    lengths = np.diff(np.append(first, len(raw)))
    position, speed, _ = filter_runs(np.nan_to_num(raw), first, lengths)
    # A glimpse too short for a cubic says nothing of the leader's speed: it takes the follower's.
    glimpse = np.repeat(lengths < SHORTEST, lengths)
    speed = np.where(glimpse, table[c.SPEED].to_numpy(), np.maximum(speed, 0.0))
    seen = np.isfinite(raw)
    return Leaders(np.where(seen, position, np.nan), np.where(seen, speed, np.nan))


def leader_runs(recording: Recording) -> npt.NDArray[np.int64]:
    """Return for each row the number of its stretch with one leader, shape (rows,)."""
    table = recording.table
    raw = table[c.X].to_numpy() + table[c.HEADWAY].to_numpy()
    first = _first_rows(table[c.VEHICLE].to_numpy(), frame_code(table), raw, table[c.SPEED].to_numpy())
    return np.repeat(np.arange(len(first)), np.diff(np.append(first, len(raw))))


def leader_lengths(recording: Recording) -> npt.NDArray[np.float64]:
    """Return the length (m) of each row's leader, shape (rows,), assumed where the source does not tell it."""
    table, known = recording.table, recording.leader_lengths
    lengths = np.full(len(table), recording.road.car_length)
    for period in recording.periods if known else ():
        here = (table[c.PERIOD] == period).to_numpy()
        numbers, place = np.unique(table[c.LEADER].to_numpy()[here], return_inverse=True)
        lengths[here] = np.array([known.get((period, int(number)), recording.road.car_length) for number in numbers])[
            place
        ]
    return lengths


def _first_rows(
    vehicle: npt.NDArray[np.int64],
    frame: npt.NDArray[np.int64],
    leader_x: npt.NDArray[np.float64],
    speed: npt.NDArray[np.float64],
) -> npt.NDArray[np.int64]:
    """Return the first row of every stretch with one leader, or with none."""
    known = np.isfinite(leader_x)
    with np.errstate(invalid="ignore"):
        jump = np.abs(np.diff(leader_x) - speed[1:] * FRAME_STEP) > JUMP
    breaks = (np.diff(vehicle) != 0) | (np.diff(frame) != 1) | (np.diff(known.astype(np.int8)) != 0) | jump
    return np.concatenate([[0], np.flatnonzero(breaks) + 1])
