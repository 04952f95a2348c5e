"""From a recording to windows of car-following: what each follower did and saw for some seconds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.diagnosis.other_lanes import OtherLanes
from idm_sumo.diagnosis.smoother import Smoother, smooth_along
from idm_sumo.diagnosis.traffic_context import Ahead, leader_events, look_around, since
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import running_mean, same_run

LEAD = 25  # frames before the start: the past that a delay reaches into, and a replicate's run-up
HORIZON = 120  # frames, 12 s
LEAST_HORIZON = 50  # frames, 5 s: below, a driver has not answered yet
EVERY = 10  # frames between compared positions
MOST = 6000  # windows of a diagnosis, of about seven hundred drivers: more cost time and memory in proportion
STANDING = 0.5  # m/s
MOVING = 1.0  # m/s: a window in which nobody is faster says nothing
UNREST_FRAMES = 150
HARD, HARD_FRAMES = -1.2, 10  # m/s², for so long: braking that is no noise of the measurement
NEARLY_ALWAYS = 0.8  # of the frames
NEAREST = 0.3  # m: a smaller recorded gap is an overlap of the measurement

# Columns of `Windows.seen`.
REAR, SPEED, ACCELERATION, KIND, SECOND, SECOND_SPEED, ADJACENT, BEHIND = range(8)
JUMP, SINCE, UNTIL_CUT_IN, UNTIL_OWN, MEAN_SPEED, LANE, TIME, X, V, OWN_KIND = range(8, 18)
TRUCKS_BESIDE, BRAKING_BESIDE, UNREST, ACCEPTED, BEHIND_KIND, CROWD_LEFT, CROWD_RIGHT = range(18, 25)
ABREAST, SECOND_KIND, FASTER, BESIDE_GAP, MOTORCYCLES, LENGTH, SINCE_STANDING, NEXT_BESIDE = range(25, 33)
ACCELERATION_OF_LATE, NEAREST_BESIDE, SINCE_ENTRY, SINCE_BRAKING, WITHOUT = range(33, 38)
COLUMNS = 38
LEADERS = (REAR, SPEED, ACCELERATION, SECOND, SECOND_SPEED)  # of which a recording shows what smoothing leaves

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Windows:
    """Windows of followers with a leader, sorted by driver.

    Attributes
    ----------
    seen : float64, shape (windows, COLUMNS, LEAD + horizon + 1)
        Frames last: a rollout reads a few columns frame by frame. The columns: leader's rear (m), speed, acceleration and
        class; second leader's rear less the leader's length (m, infinite for none) and speed; slower adjacent lane's speed
        (NaN for none); follower's front plus own length (m, minus infinite for none); jump (m) and time since the last
        leader change; time until the next cut-in and own change; running mean speed; lane; time (s); own position, speed,
        class; trucks beside and vehicles that brake in other lanes; own mean absolute acceleration of late; time headway (s)
        right after the last leader change; follower's class; vehicles near in the left and in the right adjacent lane (NaN
        without one); adjacent lanes with a vehicle alongside; second leader's class; faster adjacent lane's speed (NaN for
        none); adjacent lanes with a vehicle beside the own gap; motorcycles beside; leader's length (m, 0 if not known);
        time since the own last standstill; speed of the slower of the next vehicles ahead in the adjacent lanes (NaN for
        none); leader's mean acceleration of the last seconds; time since the entry (NaN for who was there when the recording
        began) and since the own last hard braking; 1 where the driver is without a cause that only some have (0 until such a
        cause is found).
        The simulation starts at frame ``LEAD``.
    blurred : float64, shape (windows, 5, LEAD + horizon + 1)
        The columns ``LEADERS``, smoothed once more: what a replicate's measurement sees.
    driver : int64, shape (windows,)
        Index into ``vehicle`` and ``period``.
    vehicle, period : shape (drivers,)
    platoon : int64, shape (drivers,)
        Block of neighbours (same lane, entering one after the other).
    own, leaders : Smoother
        Of followers and of leaders.
    excluded : mapping of str to int
        Vehicles without a window, by reason.
    """

    seen: Floats
    blurred: Floats
    driver: Integers
    vehicle: Integers
    period: npt.NDArray[np.str_]
    platoon: Integers
    own: Smoother
    leaders: Smoother
    excluded: Mapping[str, int]

    @property
    def drivers(self) -> int:
        """Number of drivers."""
        return len(self.vehicle)

    @property
    def target(self) -> Floats:
        """Recorded positions (m) at the compared moments, shape ``(windows, moments)``."""
        return np.ascontiguousarray(self.seen[:, X, LEAD + EVERY :: EVERY])

    @property
    def usual_lane(self) -> Integers:
        """The lane in which each driver nearly always is, 0 for who changes; shape ``(drivers,)``."""
        lane = self.seen[:, LANE, LEAD:-1].astype(np.int64)
        frames = np.zeros((self.drivers, lane.max(initial=0) + 1))
        np.add.at(frames, (self.driver[:, None], lane), 1.0)
        most = frames.argmax(axis=1)
        return np.where(frames.max(axis=1) > NEARLY_ALWAYS * frames.sum(axis=1), most, 0)

    def of_rows(self, rows: Integers) -> Windows:
        """Return some of the windows; their drivers keep their numbers, and may have none."""
        return replace(self, seen=self.seen[rows], blurred=self.blurred[rows], driver=self.driver[rows])

    def without(self, which: npt.NDArray[np.bool_]) -> Windows:
        """Return the windows, of which some are driven without what only some drivers have."""
        seen = self.seen.copy()
        seen[:, WITHOUT] = which[:, None]
        return replace(self, seen=seen)

    def of_drivers(self, which: Integers) -> Windows:
        """Return the windows of some drivers, renumbered in their order."""
        place = np.full(self.drivers, -1, dtype=np.int64)
        place[which] = np.arange(len(which))
        rows = np.flatnonzero(place[self.driver] >= 0)
        rows = rows[np.argsort(place[self.driver[rows]], kind="stable")]
        return replace(
            self, seen=self.seen[rows], blurred=self.blurred[rows], driver=place[self.driver[rows]],
            vehicle=self.vehicle[which], period=self.period[which], platoon=self.platoon[which],
        )  # fmt: skip


def several_periods(windows: Windows) -> bool:
    """Return whether windows are of several periods, each with its own clock.

    Then nothing is looked for along the time: it would lay one period over another.
    """
    return len(np.unique(windows.period)) > 1


def cut_windows(
    recording: Recording, own: Smoother, leaders: Smoother, rng: np.random.Generator, most: int = MOST
) -> Windows:
    """Smooth a recording (unless it is smooth), followers and leaders each by their filter, and cut it into windows.

    Parameters
    ----------
    recording : Recording
    own, leaders : Smoother
        Of followers and of leaders.
    rng : numpy.random.Generator
        Of the neighbours that are drawn where there are more windows.
    most : int
        Windows, about: whole blocks of neighbours are drawn, so that neither time nor memory grows with what was recorded.

    Notes
    -----
    Windows of a driver do not overlap. The horizon is 12 s, or what the median driver has, not below 5 s; it is empty of windows
    if nobody follows a leader that long.
    """
    smoothed = recording if recording.is_smooth else smooth_along(recording, own)
    shown = smooth_along(recording, leaders) if recording.has_leader_rows and not recording.is_smooth else smoothed
    table = smoothed.table
    ahead = look_around(shown)
    gap = ahead.rear - table[c.X].to_numpy(np.float64)
    good = np.isfinite(gap) & (gap > NEAREST)
    starts, lengths = _stretches(good, same_run(table))
    horizon = _horizon(lengths)
    first = _placed(starts, lengths, horizon)
    code = table[c.PERIOD].cat.codes.to_numpy(np.int64)
    key = (code << 32) + table[c.VEHICLE].to_numpy(np.int64)
    seen = _columns(smoothed, ahead)
    rows = first[:, None] + np.arange(-LEAD, horizon + 1)
    moving = table[c.SPEED].to_numpy()[rows].max(axis=1, initial=0.0) > MOVING
    rows = rows[moving]
    blurred = _blurred(shown, ahead, leaders)
    blurred = np.where(np.isfinite(blurred), blurred, seen[LEADERS, :])
    keys, driver = np.unique(key[rows[:, LEAD]] if len(rows) else np.empty(0, np.int64), return_inverse=True)
    entry = np.array([np.searchsorted(key, one) for one in keys], dtype=np.int64)
    platoon = _platoons(code[entry], table[c.LANE].to_numpy()[entry], table[c.FRAME].to_numpy()[entry])
    drawn = _drawn(np.bincount(driver, minlength=len(keys)), platoon, most, rng)
    excluded = {
        f"no leader for {horizon * FRAME_STEP:g} s": len(np.unique(key)) - len(np.unique(key[first])),
        "standing": len(np.unique(key[first])) - len(keys),
        f"not drawn: about {most:,} windows of all drivers are enough": len(keys) - int(drawn.sum()),
    }
    rows, driver, entry = rows[drawn[driver]], np.cumsum(drawn)[driver[drawn[driver]]] - 1, entry[drawn]
    periods = np.asarray(table[c.PERIOD].astype(str))
    return Windows(
        seen=_cut(seen, rows), blurred=_cut(blurred, rows), driver=driver.astype(np.int64),
        vehicle=table[c.VEHICLE].to_numpy(np.int64)[entry], period=periods[entry],
        platoon=np.unique(platoon[drawn], return_inverse=True)[1].astype(np.int64), own=own, leaders=leaders,
        excluded={reason: number for reason, number in excluded.items() if number},
    )  # fmt: skip


def _cut(columns: Floats, rows: Integers) -> Floats:
    """Return the columns of each window's rows, one after the other in memory, shape ``(windows, columns, frames)``."""
    return np.ascontiguousarray(columns[:, rows].transpose(1, 0, 2))


def _drawn(count: Integers, platoon: Integers, most: int, rng: np.random.Generator) -> npt.NDArray[np.bool_]:
    """Return which drivers take part, by how many windows each has: all, or blocks drawn at random until they have so many."""
    if count.sum() <= most:
        return np.ones(len(count), dtype=bool)
    of_block = np.bincount(platoon, count)
    order = rng.permutation(len(of_block))
    before = np.cumsum(of_block[order]) - of_block[order]
    taken = np.zeros(len(of_block), dtype=bool)
    taken[order[before < most]] = True
    return taken[platoon]


def _stretches(good: npt.NDArray[np.bool_], same: npt.NDArray[np.bool_]) -> tuple[Integers, Integers]:
    """Return first row and length of every unbroken stretch of good rows."""
    begins = good & ~(same & np.concatenate([[False], good[:-1]]))
    starts = np.flatnonzero(begins)
    number = np.cumsum(begins) - 1
    return starts, np.bincount(number[good], minlength=len(starts)).astype(np.int64)


def _horizon(lengths: Integers) -> int:
    """Return the frames to simulate: 12 s if half of the stretches have them, else what the median has."""
    if not len(lengths):
        return HORIZON
    usual = int(np.median(lengths[lengths > LEAST_HORIZON])) if (lengths > LEAST_HORIZON).any() else LEAST_HORIZON
    return max(min(HORIZON, usual - 1 - LEAD), LEAST_HORIZON) // EVERY * EVERY


def _placed(starts: Integers, lengths: Integers, horizon: int) -> Integers:
    """Return the first rows of the windows, as many to a stretch as fit, evenly placed."""
    count = np.maximum(lengths - 1 - LEAD, 0) // horizon
    stretch = np.repeat(np.arange(len(starts)), count)
    within = np.arange(len(stretch)) - np.repeat(np.cumsum(count) - count, count)
    spare = (lengths - 1 - LEAD - count * horizon)[stretch]
    return np.asarray(starts[stretch] + LEAD + within * horizon + spare * (within + 1) // (count[stretch] + 1))


def _columns(recording: Recording, ahead: Ahead) -> Floats:
    """Return the columns of ``Windows.seen`` for each row, shape ``(COLUMNS, rows)``."""
    table = recording.table
    same = same_run(table)
    x, v = table[c.X].to_numpy(np.float64), table[c.SPEED].to_numpy(np.float64)
    length = table[c.LENGTH].fillna(recording.road.car_length).to_numpy(np.float64)
    events = leader_events(table, ahead)
    seen = np.empty((COLUMNS, len(table)))
    seen[[REAR, SPEED, ACCELERATION, KIND]] = ahead.rear, ahead.speed, ahead.acceleration, ahead.kind
    seen[ACCELERATION_OF_LATE] = ahead.acceleration_of_late
    seen[SECOND], seen[SECOND_SPEED] = ahead.second_place, ahead.second_speed
    seen[BEHIND] = ahead.follower_front + length
    seen[[JUMP, SINCE, ACCEPTED, UNTIL_CUT_IN, UNTIL_OWN]] = events
    seen[MEAN_SPEED] = running_mean(v, same)
    seen[[ADJACENT, NEXT_BESIDE, FASTER, CROWD_LEFT, CROWD_RIGHT, NEAREST_BESIDE]] = np.nan
    seen[[TRUCKS_BESIDE, BRAKING_BESIDE, ABREAST, BESIDE_GAP, MOTORCYCLES, WITHOUT]] = 0.0
    if recording.has_leader_rows:
        beside = OtherLanes(table)
        seen[ADJACENT], seen[TRUCKS_BESIDE], seen[BRAKING_BESIDE] = (
            beside.slower_speed(), beside.trucks(), beside.braking()
        )  # fmt: skip
        seen[CROWD_LEFT], seen[CROWD_RIGHT] = beside.crowd(-1), beside.crowd(1)
        seen[FASTER], seen[ABREAST] = beside.faster_speed(), beside.abreast()
        seen[NEXT_BESIDE], seen[NEAREST_BESIDE] = beside.slower_next_speed(), beside.nearest()
        seen[BESIDE_GAP], seen[MOTORCYCLES] = beside.beside_gap(ahead.rear - x), beside.motorcycles()
    seen[BEHIND_KIND], seen[SECOND_KIND], seen[LENGTH] = ahead.follower_kind, ahead.second_kind, ahead.length
    seen[SINCE_STANDING] = since(v < STANDING, same)[0]
    own = table[c.ACCELERATION].to_numpy(np.float64)
    seen[UNREST] = running_mean(np.abs(own), same, UNREST_FRAMES)
    seen[SINCE_BRAKING] = since(running_mean(own, same, HARD_FRAMES) < HARD, same)[0]
    seen[LANE] = table[c.LANE].to_numpy(np.float64)
    seen[TIME] = _clock(recording)
    seen[SINCE_ENTRY] = _since_entry(table, seen[TIME])
    seen[X], seen[V], seen[OWN_KIND] = x, v, table[c.CLASS].to_numpy(np.float64)
    return seen


def _clock(recording: Recording) -> Floats:
    """Return the time (s) since the first frame of each row's period."""
    table = recording.table
    first = table.groupby(c.PERIOD, observed=True)[c.FRAME].transform("min")
    return np.asarray((table[c.FRAME] - first).to_numpy() * FRAME_STEP, dtype=np.float64)


def _since_entry(table: pd.DataFrame, clock: Floats) -> Floats:
    """Return the time (s) since each vehicle came into sight, NaN for those that were there when their period began."""
    entry = (
        pd.Series(clock).groupby([table[c.PERIOD].cat.codes.to_numpy(), table[c.VEHICLE].to_numpy()]).transform("min")
    )
    return np.where(entry > 0.0, clock - entry, np.nan)


def _blurred(shown: Recording, ahead: Ahead, leaders: Smoother) -> Floats:
    """Return what a second smoothing sees of the leaders."""
    once = _of_leaders(ahead)
    if not shown.has_leader_rows or shown.is_smooth:
        return once
    again = look_around(smooth_along(shown, leaders))
    return np.where(again.identity == ahead.identity, _of_leaders(again), once)


def _of_leaders(ahead: Ahead) -> Floats:
    return np.stack([ahead.rear, ahead.speed, ahead.acceleration, ahead.second_place, ahead.second_speed])


def _platoons(period: Integers, lane: npt.NDArray[np.int64], frame: npt.NDArray[np.int64], size: int = 5) -> Integers:
    """Return blocks of about five drivers of one lane that enter one after the other."""
    order = np.lexsort((frame, lane, period))
    group = (
        np.concatenate([[0], np.cumsum((np.diff(period[order]) != 0) | (np.diff(lane[order]) != 0))])
        if len(order)
        else order
    )
    first = np.searchsorted(group, group)
    block = np.empty(len(order), dtype=np.int64)
    block[order] = group * 100_000 + (np.arange(len(order)) - first) // size
    return np.unique(block, return_inverse=True)[1].astype(np.int64)
