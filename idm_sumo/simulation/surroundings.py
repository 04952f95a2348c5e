"""What an extended driver sees in a replay.

The traffic around its simulated place, and what its recorded vehicle knew. Everything but own place
and speed is recorded: leader, second leader, neighbours and follower are those at the simulated
place, and the moments of cut-ins and of the own lane change those of the recorded vehicle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.models.effects.hysteresis import LATELY
from idm_sumo.models.effects.lane_change_relaxation import headway_after
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.leaders_from_headway import leader_lengths, leader_runs, recorded_leaders
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import running_mean, same_run
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import perceive

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class TrafficDetails(NamedTuple):
    """What is known of the traffic's rows beyond places.

    Of each row of the scenes' traffic, shape ``(rows,)``: what :class:`~idm_sumo.scenes.traffic.Traffic` does not hold.

    Attributes
    ----------
    acceleration, acceleration_of_late : float64
        m/s², the latter the mean of the last seconds.
    vehicle_class : float64
        NaN where not recorded.
    who : int64
        Number that stays the same as long as it is the same vehicle.
    """

    acceleration: Floats
    acceleration_of_late: Floats
    vehicle_class: Floats
    who: Integers


class RecordedDrivers(NamedTuple):
    """What the recorded vehicle of each window brings along.

    Attributes
    ----------
    time : float64, shape (windows,)
        Of the window's start since the first frame of the period (s).
    own_class : float64, shape (windows,)
    jump, since, accepted : float64, shape (windows,)
        By how much the last leader change up to the start shortened the gap (m), the time since and the
        time headway right after it (s); NaN for none.
    cut_in, own_change : float64, shape (windows,)
        Seconds from the start to the next vehicle inserted ahead, and to the own lane change; NaN for none.
    driven, moments : float64, shape (windows,)
        Sum of the speeds recorded up to the start (m/s) and their number.
    """

    time: Floats
    own_class: Floats
    jump: Floats
    since: Floats
    accepted: Floats
    cut_in: Floats
    own_change: Floats
    driven: Floats
    moments: Floats


def what_is_seen(recording: Recording, scenes: Scenes) -> tuple[TrafficDetails, RecordedDrivers]:
    """Return what extended drivers see beyond the scenes' traffic.

    Parameters
    ----------
    recording : Recording
        The period the scenes were cut from.
    scenes : Scenes
        Of one period.

    Returns
    -------
    others : TrafficDetails
    recorded : RecordedDrivers

    Raises
    ------
    InputError
        If the scenes are of several periods.
    """
    scenes.check_one_period()
    table = recording.table
    known = _leaders(recording, scenes)
    return _details(table, scenes, known), _recorded(table, scenes, known.who, known.gap)


class _Known(NamedTuple):
    """Of every recorded row its leader, and the traffic's motion.

    ``who`` (0 for none) and ``gap`` (m) are the leader's. The others, acceleration, whether it goes on
    from the row before, and class, are those of the vehicle that stands in the traffic: the row's own
    where the vehicles ahead are recorded, its leader's where the headway is all that is known.
    """

    who: Integers
    gap: Floats
    acceleration: Floats
    goes_on: npt.NDArray[np.bool_]
    kind: Floats


def _leaders(recording: Recording, scenes: Scenes) -> _Known:
    table = recording.table
    if scenes.leader_source == LEADER_FROM_LANE:
        t = scenes.traffic
        cell = t.cell(scenes.road.lane_at(table[c.Y]), table[c.FRAME].to_numpy())
        who, gap = _perceive_all(
            cell, table[c.X].to_numpy(), table[c.VEHICLE].to_numpy(), t.offsets, t.x, t.length, t.vehicle
        )
        kind = table[c.CLASS].to_numpy(np.float64)
        return _Known(who, gap, table[c.ACCELERATION].to_numpy(), same_run(table), np.where(kind > 0, kind, np.nan))
    leader, run = recorded_leaders(recording), leader_runs(recording)
    known = np.isfinite(leader.x)
    acceleration = np.gradient(leader.speed, FRAME_STEP)
    edge = np.concatenate([[True], np.diff(run) != 0])
    acceleration[edge | np.append(edge[1:], True)] = 0.0  # a difference there would be of two vehicles
    gap = np.where(known, table[c.HEADWAY].to_numpy() - leader_lengths(recording), np.inf)
    return _Known(np.where(known, run + 1, 0), gap, acceleration, ~edge, np.full(len(table), np.nan))


@njit(cache=True)
def _perceive_all(cell, front, own, offsets, x, length, vehicle):  # type: ignore[no-untyped-def]
    who, gap = np.zeros(len(cell), dtype=np.int64), np.full(len(cell), np.inf)
    for i in range(len(cell)):
        row, gap[i] = perceive(cell[i], front[i], own[i], offsets, x, length, vehicle)
        who[i] = vehicle[row] if row != NOBODY else 0
    return who, gap


def _rows(table: pd.DataFrame, vehicle: Integers, frame: Integers) -> Integers:
    """Return the rows of vehicles and frames, -1 for none."""
    stride = np.int64(1) << 32
    code = table[c.VEHICLE].to_numpy() * stride + table[c.FRAME].to_numpy()
    wanted = vehicle * stride + frame
    place = np.minimum(np.searchsorted(code, wanted), len(code) - 1)
    return np.where(code[place] == wanted, place, -1).astype(np.int64)


def _details(table: pd.DataFrame, scenes: Scenes, known: _Known) -> TrafficDetails:
    """Look up every row of the traffic in the table."""
    t, acceleration, kind = scenes.traffic, known.acceleration, known.kind
    of_late = running_mean(acceleration, known.goes_on, LATELY)
    group, frame = np.divmod(np.repeat(np.arange(len(t.offsets) - 1), np.diff(t.offsets)), t.frames)
    if scenes.leader_source == LEADER_FROM_LANE:
        row = _rows(table, t.vehicle, frame + t.first_frame)
        return TrafficDetails(acceleration[row], of_late[row], kind[row], t.vehicle)
    vehicle, first = np.full((2, int(group.max(initial=0)) + 1), -1, dtype=np.int64)
    window = scenes.cell // t.frames
    used = window < len(vehicle)  # a window without any leader has no row
    vehicle[window[used]], first[window[used]] = scenes.vehicle[used], scenes.first_frame[used]
    row = _rows(table, vehicle[group], first[group] + frame)
    return TrafficDetails(
        np.where(row >= 0, acceleration[row], 0.0), np.where(row >= 0, of_late[row], 0.0),
        np.where(row >= 0, kind[row], np.nan), np.where(row >= 0, known.who[row], 0),
    )  # fmt: skip


def _recorded(table: pd.DataFrame, scenes: Scenes, who: Integers, gap: Floats) -> RecordedDrivers:
    """Look up each window's past and coming events."""
    start = _rows(table, scenes.vehicle, scenes.first_frame + scenes.start)
    vehicle, frame = table[c.VEHICLE].to_numpy(), table[c.FRAME].to_numpy()
    follows = np.concatenate([[False], (np.diff(vehicle) == 0) & (np.diff(frame) == 1)])
    before = np.concatenate([[0], who[:-1]])
    changed = follows & (who != before) & (who > 0) & (before > 0)
    with np.errstate(invalid="ignore"):
        jump = np.concatenate([[0.0], gap[:-1]]) - gap
    lane_changed = follows & np.concatenate([[False], np.diff(table[c.LANE].to_numpy()) != 0])
    last = _latest(changed, vehicle)[start]
    none = last < 0
    speed = table[c.SPEED].to_numpy()
    sums = np.concatenate([[0.0], np.cumsum(speed)])
    first = np.searchsorted(vehicle, scenes.vehicle)
    return RecordedDrivers(
        time=(frame[start] - frame.min()) * FRAME_STEP,
        own_class=np.where(scenes.vehicle_class > 0, scenes.vehicle_class, np.nan).astype(np.float64),
        jump=np.where(none, np.nan, jump[last]),
        since=np.where(none, np.nan, (frame[start] - frame[last]) * FRAME_STEP),
        accepted=np.where(none, np.nan, headway_after(gap, speed)[last]),
        cut_in=_until(changed & (jump > 0) & ~lane_changed, vehicle, frame, start),
        own_change=_until(lane_changed, vehicle, frame, start),
        driven=sums[start] - sums[first],
        moments=(start - first).astype(np.float64),
    )


def _latest(event: npt.NDArray[np.bool_], vehicle: Integers) -> Integers:
    """Return each row's last row with an event.

    Of the same vehicle, up to that row, itself included; -1 for none.
    """
    row = np.maximum.accumulate(np.where(event, np.arange(len(event)), -1))
    return np.where((row >= 0) & (vehicle[row] == vehicle), row, -1).astype(np.int64)


def _until(event: npt.NDArray[np.bool_], vehicle: Integers, frame: Integers, start: Integers) -> Floats:
    """Return the seconds to the vehicle's next event.

    From each start; NaN for none.
    """
    rows = np.flatnonzero(event)
    if not len(rows):
        return np.full(len(start), np.nan)
    place = np.searchsorted(rows, start, side="right")
    found = rows[np.minimum(place, len(rows) - 1)]
    there = (place < len(rows)) & (vehicle[found] == vehicle[start])
    return np.where(there, (frame[found] - frame[start]) * FRAME_STEP, np.nan)
