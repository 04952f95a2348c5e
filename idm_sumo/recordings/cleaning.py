"""The paper's cleaning: main lanes only, no vehicle with irregular frames or a wrong leader."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Ledger
from idm_sumo.recordings.coercion import HIGHEST_SPEED
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.leaders import row_ahead, row_of
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError

LEADER_FRAMES = 10  # frames with a wrong leader from which a vehicle is not modelled
LANE_CHANGE_MARGIN = 20  # frames before and after a lane change in which labels are not judged
REACH = HIGHEST_SPEED * FRAME_STEP + 3.0  # m; a position that moves farther within a frame is another vehicle's
CLOCK_TOLERANCE = 0.05  # s, between two rows' times and their frames

AUXILIARY = "auxiliary lane or ramp"
IRREGULAR = "frame irregularity"
WRONG_LEADER = "wrong leader"
JUMP = "position jumps"
LEADER_JUMP = "leader's position jumps"
NEVER_MAIN = "never on a main lane"

Flags = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]


def clean(
    recording: Recording, *, leader_frames: int = LEADER_FRAMES, lane_change_margin: int = LANE_CHANGE_MARGIN
) -> Recording:
    """Apply the paper's rules and count what they cost.

    1. Rows on the auxiliary lane and the ramps are removed. The hole this leaves in the
       frames of a vehicle is no irregularity; its longest run on the main lanes counts.
    2. Vehicles whose recorded frames have a hole, or whose clock does not follow their
       frames, are removed ("frame ID irregularities, that cause the cars to disappear").
    3. Vehicles whose recorded leader is not the vehicle next ahead in their lane in at least
       ``leader_frames`` frames are not modelled ("the wrong car in front at some frames,
       causing IDM to be blind to the true vehicle in front"). Their rows stay, as traffic.
       Needs recorded leaders, and the leaders' rows.
    4. Vehicles whose position moves farther within a frame than :data:`REACH` are removed: that is another
       vehicle under their number. Those who drive behind one for ``leader_frames``, or whose leader, known by its
       headway only, does so are not modelled.

    ``Total_Frames`` is not used: it disagrees with the rows of every vehicle in the files
    known to us, whose frames are unbroken.

    Parameters
    ----------
    recording : Recording
        As read.
    leader_frames, lane_change_margin : int, keyword-only
        Frames of disagreement that disqualify; frames around a lane change of either vehicle
        that are not judged, because labels and positions change lane at different moments.

    Returns
    -------
    Recording
        The rows that remain as traffic, modelled or not. Its ``accounting`` goes from reading on, with vehicles not
        modelled by reason; its ``vehicles`` has one row a vehicle that came in: ``period``, ``vehicle``, ``reason``
        (empty if it may be modelled), ``first_frame`` and ``last_frame`` of its longest unbroken run on the main
        lanes (-1 if none), ``wrong_leader_frames``.

    Raises
    ------
    InputError
        If nothing is left.
    """
    table = recording.table
    ledger = Ledger(len(table))
    number, vehicles = _vehicles(table)
    irregular = np.bincount(number, weights=_irregular_rows(table, number)) > 0
    jumps = (np.bincount(number, weights=_jumps(table[[c.X, c.Y]].to_numpy(), table, number)) > 0) & ~irregular
    led_astray = np.bincount(number, weights=_leader_jumps(recording, number)) > 0
    wrong = _wrong_leader_frames(recording, number, lane_change_margin, len(vehicles), ledger)
    wrong = np.maximum(wrong, _frames_behind(recording, number, jumps))
    kept = ledger.drop(table, table[c.LANE] > recording.road.main_lanes, AUXILIARY)
    kept = ledger.drop(kept, irregular[number[kept.index]], IRREGULAR)
    kept = ledger.drop(kept, jumps[number[kept.index]], JUMP)
    if kept.empty:
        why = ", ".join(f"{rows} {reason}" for reason, rows in ledger.dropped.items())
        source = recording.source or "recording"
        raise InputError(f"{source}: no rows left after cleaning ({why}){_pace(table, number)}")
    vehicles = _with_longest_run(vehicles, kept, number[kept.index])
    vehicles["wrong_leader_frames"] = wrong
    reasons = [irregular, jumps, (vehicles["first_frame"] < 0).to_numpy(), led_astray, wrong >= leader_frames]
    vehicles["reason"] = np.select(reasons, [IRREGULAR, JUMP, NEVER_MAIN, LEADER_JUMP, WRONG_LEADER], default="")
    against = {str(k): int(n) for k, n in vehicles["reason"].value_counts(sort=False).items() if k}
    eligible = int((vehicles["reason"] == "").sum())
    account = ledger.close(len(kept), vehicles=eligible, vehicles_dropped=against)
    if recording.accounting.used == len(table):
        account = recording.accounting.then(account)
    return replace(recording, table=kept.reset_index(drop=True), accounting=account, vehicles=vehicles)


def _vehicles(table: pd.DataFrame) -> tuple[Integers, pd.DataFrame]:
    """Return for each row the running number of its vehicle, and the vehicles in that order."""
    first = _first_rows(table)
    vehicles = table.loc[first, [c.PERIOD, c.VEHICLE]].reset_index(drop=True)
    return np.cumsum(first) - 1, vehicles


def _first_rows(table: pd.DataFrame) -> Flags:
    """Whether each row is the first of its vehicle, in a table sorted by period, vehicle and frame."""
    period, vehicle = table[c.PERIOD].cat.codes.to_numpy(), table[c.VEHICLE].to_numpy()
    first = np.ones(len(table), dtype=bool)
    first[1:] = (period[1:] != period[:-1]) | (vehicle[1:] != vehicle[:-1])
    return first


def _irregular_rows(table: pd.DataFrame, number: Integers) -> Flags:
    """Whether a row does not follow its predecessor by one frame and 0.1 s; shape ``(rows,)``."""
    frames = np.diff(table[c.FRAME].to_numpy())
    clock = np.diff(table[c.TIME].to_numpy())
    broken = (frames != 1) | (np.abs(clock - FRAME_STEP * frames) > CLOCK_TOLERANCE)
    return np.concatenate([[False], broken & (np.diff(number) == 0)])


def _pace(table: pd.DataFrame, number: Integers) -> str:
    """Say how far apart the rows of a vehicle are, if not a frame."""
    same = np.diff(number) == 0
    if not same.any():
        return ""
    frames, seconds = (float(np.median(np.diff(table[name].to_numpy())[same])) for name in (c.FRAME, c.TIME))
    if frames == 1 and abs(seconds - FRAME_STEP) <= CLOCK_TOLERANCE:
        return ""
    return (
        f"; rows of a vehicle are {frames:g} frames and {seconds:g} s apart where 1 and {FRAME_STEP} s are needed: "
        "resample them, or mend the columns frame and time"
    )


def _jumps(place: npt.NDArray[np.float64], table: pd.DataFrame, number: Integers) -> Flags:
    """Whether places (m), shape ``(rows, axes)``, move farther than a vehicle can since the frame before."""
    far = np.linalg.norm(np.diff(place, axis=0), axis=1) > REACH
    return np.concatenate([[False], far & (np.diff(number) == 0) & (np.diff(table[c.FRAME].to_numpy()) == 1)])


def _leader_jumps(recording: Recording, number: Integers) -> Flags:
    """Whether a leader that is known by its headway only has jumped since the frame before; shape ``(rows,)``."""
    table, leader = recording.table, recording.table[c.LEADER].to_numpy()
    if recording.has_leader_rows:
        return np.zeros(len(table), dtype=bool)
    front = np.asarray(table[c.X] + table[c.HEADWAY], dtype=np.float64)[:, None]
    same = np.concatenate([[False], (np.diff(leader) == 0) & (leader[1:] > 0)])
    return np.asarray(_jumps(front, table, number) & same)


def _frames_behind(recording: Recording, number: Integers, removed: Flags) -> Integers:
    """Return for each vehicle in how many frames a removed one is next ahead of it; shape ``(vehicles,)``."""
    if not recording.has_leader_rows or not removed.any():
        return np.zeros(len(removed), dtype=np.int64)
    ahead = row_ahead(recording.table)
    behind = (ahead >= 0) & removed[number[ahead]]
    return np.bincount(number, weights=behind, minlength=len(removed)).astype(np.int64)


def _wrong_leader_frames(
    recording: Recording, number: Integers, margin: int, vehicles: int, ledger: Ledger
) -> Integers:
    """Return for each vehicle in how many frames its recorded leader is wrong; shape ``(vehicles,)``."""
    table = recording.table
    leader = table[c.LEADER].to_numpy()
    if not recording.has_leader_rows or not (leader > 0).any():
        ledger.notes.append("recorded leaders cannot be checked: they, or their rows, are not in the recording")
        return np.zeros(vehicles, dtype=np.int64)
    ahead, recorded = row_ahead(table), row_of(table, leader)
    settled = ~_near_lane_change(table, number, margin)
    judged = settled & (table[c.LANE].to_numpy() <= recording.road.main_lanes)
    judged &= np.where(ahead >= 0, settled[ahead], True) & np.where(recorded >= 0, settled[recorded], True)
    wrong = judged & ((ahead != recorded) | ((leader > 0) & (recorded < 0)))
    wrong &= ~((ahead < 0) & _has_left(table, leader))
    return np.bincount(number, weights=wrong, minlength=vehicles).astype(np.int64)


def _near_lane_change(table: pd.DataFrame, number: Integers, margin: int) -> Flags:
    """Whether a vehicle changes lane within ``margin`` frames of each row; shape ``(rows,)``."""
    changes = np.zeros(len(table), dtype=np.int64)
    changes[1:] = (np.diff(table[c.LANE].to_numpy()) != 0) & (np.diff(number) == 0)
    sofar = np.concatenate([[0], np.cumsum(changes)])
    first = np.searchsorted(number, number, side="left")
    last = np.searchsorted(number, number, side="right")
    row = np.arange(len(table))
    # A change is booked on the first row in the new lane, hence one more row ahead than behind.
    return sofar[np.minimum(row + margin + 1, last)] > sofar[np.maximum(row - margin + 1, first)]


def _has_left(table: pd.DataFrame, leader: Integers) -> Flags:
    """Whether the recorded leader was last seen before each row's frame, so that it has left the section."""
    last = table.groupby([c.PERIOD, c.VEHICLE], observed=True)[c.FRAME].max()
    known = pd.MultiIndex.from_arrays([table[c.PERIOD].astype(str), leader])
    by_name = pd.MultiIndex.from_arrays([last.index.get_level_values(0).astype(str), last.index.get_level_values(1)])
    place = by_name.get_indexer(known)
    gone: Flags = (place >= 0) & (last.to_numpy()[place] < table[c.FRAME].to_numpy())
    return gone


def _with_longest_run(vehicles: pd.DataFrame, kept: pd.DataFrame, number: Integers) -> pd.DataFrame:
    """Add first and last frame of each vehicle's longest unbroken run; -1 where it has no rows."""
    frame = kept[c.FRAME].to_numpy()
    start = np.ones(len(kept), dtype=bool)
    start[1:] = (np.diff(number) != 0) | (np.diff(frame) != 1)
    begin = np.flatnonzero(start)
    end = np.append(begin[1:], len(kept)) - 1
    runs = pd.DataFrame({"number": number[begin], "first_frame": frame[begin], "last_frame": frame[end]})
    runs["length"] = end - begin
    longest = runs.sort_values(["number", "length"], ascending=[True, False], kind="stable").drop_duplicates("number")
    longest = longest.set_index("number")[["first_frame", "last_frame"]]
    return vehicles.join(longest.reindex(vehicles.index, fill_value=-1))
