"""What each recorded driver sees, row by row: leaders, follower, leader changes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.models.effects.hysteresis import LATELY
from idm_sumo.models.effects.lane_change_relaxation import LARGEST_JUMP, headway_after
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.leaders import row_ahead, row_of
from idm_sumo.recordings.leaders_from_headway import JUMP, leader_lengths, recorded_leaders
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import running_mean, same_run

LEAST_JUMP = 0.5  # m; a smaller step of the gap is noise
NEVER = 1e6  # s, since or until an event that there is not

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class Ahead(NamedTuple):
    """The leader of each row, and the leader's leader: positions in m, NaN or infinite where there is none."""

    identity: Integers  # who it is; -1 for nobody
    rear: Floats
    speed: Floats
    acceleration: Floats
    acceleration_of_late: Floats  # mean of the last seconds
    kind: Floats  # vehicle class
    length: Floats  # 0 where there is none, or it is not known
    second_place: Floats  # second leader's rear minus the first leader's length, infinite for none
    second_speed: Floats
    second_kind: Floats  # its class, 0 for none
    follower_front: Floats  # of the vehicle behind, minus infinity for none
    follower_kind: Floats  # its class, 0 for none


def look_around(recording: Recording) -> Ahead:
    """Return who is ahead and behind in each row of a smoothed recording; arrays of shape ``(rows,)``."""
    return _with_rows(recording) if recording.has_leader_rows else _without_rows(recording)


def _with_rows(recording: Recording) -> Ahead:
    table = recording.table
    x, speed, acceleration = (table[name].to_numpy(np.float64) for name in (c.X, c.SPEED, c.ACCELERATION))
    of_late = running_mean(acceleration, same_run(table), LATELY)
    length = table[c.LENGTH].fillna(recording.road.car_length).to_numpy(np.float64)
    named = row_of(table, table[c.LEADER].to_numpy(np.int64))
    leader = np.where(named >= 0, named, row_ahead(table))
    second = np.where(leader >= 0, leader[leader], -1)
    behind = np.full(len(table), -1, dtype=np.int64)
    behind[leader[leader >= 0]] = np.flatnonzero(leader >= 0)

    def of(values: Floats, row: Integers, otherwise: float) -> Floats:
        return np.where(row >= 0, values[row], otherwise)

    return Ahead(
        identity=np.where(leader >= 0, table[c.VEHICLE].to_numpy(np.int64)[leader], -1),
        rear=of(x - length, leader, np.nan), speed=of(speed, leader, np.nan),
        acceleration=of(acceleration, leader, np.nan), acceleration_of_late=of(of_late, leader, np.nan),
        kind=of(table[c.CLASS].to_numpy(np.float64), leader, 0.0),
        length=of(length, leader, 0.0), second_place=of(x - length, second, np.inf) - of(length, leader, 0.0), second_speed=of(speed, second, 0.0),
        second_kind=of(table[c.CLASS].to_numpy(np.float64), second, 0.0),
        follower_front=of(x, behind, -np.inf), follower_kind=of(table[c.CLASS].to_numpy(np.float64), behind, 0.0),
    )  # fmt: skip


def _without_rows(recording: Recording) -> Ahead:
    """Only the headway tells of the leader: a jump of the rebuilt leader is another leader."""
    table = recording.table
    parts = []
    for period in recording.periods:
        part = recording.of_period(period)
        found = recorded_leaders(part)
        parts.append((np.flatnonzero((table[c.PERIOD] == period).to_numpy()), found.x, found.speed))
    front, speed = np.full(len(table), np.nan), np.full(len(table), np.nan)
    for rows, x, v in parts:
        front[rows], speed[rows] = x, v
    jump = np.abs(np.diff(front) - speed[1:] * FRAME_STEP)
    same = same_run(table) & np.concatenate([[False], jump < JUMP])
    acceleration = np.concatenate([[0.0], np.diff(speed) / FRAME_STEP])
    acceleration[~same] = 0.0
    count = len(table)
    seen = np.isfinite(front)
    return Ahead(
        identity=np.where(seen, np.cumsum(~same), -1), rear=front - leader_lengths(recording), speed=speed,
        acceleration=acceleration, acceleration_of_late=running_mean(acceleration, same, LATELY), kind=np.zeros(count), length=np.zeros(count), second_place=np.full(count, np.inf),
        second_speed=np.zeros(count), second_kind=np.zeros(count), follower_front=np.full(count, -np.inf), follower_kind=np.zeros(count),
    )  # fmt: skip


class Events(NamedTuple):
    """Leader changes as seen from each row: m, s; ``NEVER`` where there is none."""

    jump: Floats
    since: Floats
    accepted: Floats  # time headway right after it, s
    until_cut_in: Floats
    until_own_change: Floats


def leader_events(table: pd.DataFrame, ahead: Ahead) -> Events:
    """Return the last and the next changes of leader and lane of each row."""
    same = same_run(table)
    gap = ahead.rear - table[c.X].to_numpy(np.float64)
    changed = np.zeros(len(table), dtype=bool)
    changed[1:] = (np.diff(ahead.identity) != 0) & same[1:]
    step = np.zeros(len(table))
    step[1:] = gap[:-1] - gap[1:]
    new_leader = changed & np.isfinite(step)
    own = np.zeros(len(table), dtype=bool)
    own[1:] = (np.diff(table[c.LANE].to_numpy()) != 0) & same[1:]
    near_own = np.convolve(own, np.ones(5), mode="same") > 0
    ago, last = since(changed, same)
    jump = np.where(last >= 0, np.clip(np.nan_to_num(step[last]), 0.0, LARGEST_JUMP), 0.0)
    jump = np.where(jump > LEAST_JUMP, jump, 0.0)
    cut_in = new_leader & ~near_own & (step > LEAST_JUMP)
    accepted = headway_after(np.nan_to_num(gap), table[c.SPEED].to_numpy(np.float64))
    accepted = np.where(last >= 0, accepted[last], 0.0)
    return Events(jump, ago, accepted, _until(cut_in, same), _until(own, same))


def since(event: Flags, same: Flags) -> tuple[Floats, Integers]:
    """Return time (s) since the last event of the run and its row, -1 for none."""
    row = np.arange(len(event))
    begin = np.maximum.accumulate(np.where(~same, row, 0))
    last = np.maximum.accumulate(np.where(event, row, -1))
    last = np.where(last >= begin, last, -1)
    return np.where(last >= 0, (row - last) * FRAME_STEP, NEVER), last


def _until(event: Flags, same: Flags) -> Floats:
    """Return the time (s) until the next event of the run."""
    row, count = np.arange(len(event)), len(event)
    end = np.minimum.accumulate(np.where(np.append(~same[1:], True), row, count)[::-1])[::-1]
    following = np.minimum.accumulate(np.where(event, row, count)[::-1])[::-1]
    return np.where(following <= end, (following - row) * FRAME_STEP, NEVER)
