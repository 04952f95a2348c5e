"""Tables with NGSIM's names, in feet.

Beyond this module and :mod:`idm_sumo.recordings.readers.pairs` nobody knows feet.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings import leaders
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.clock import bounded, check_frames, check_one_period, frames_of_clock, sound_clock
from idm_sumo.recordings.coercion import FARTHEST_LEADER, FRAMES, LONGEST, WIDEST, drop_impossible, sizes, whole
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.on_road import check_lane_widths, check_on_road, road_of_lanes, why_foreign
from idm_sumo.recordings.periods import split_periods
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.errors import InputError

FINITE = ("Vehicle_ID", "Frame_ID", "Global_Time", "Local_X", "Local_Y", "v_Vel", "v_Acc", "Lane_ID")
SHORTEST_CAR = 2.5  # m; the median vehicle of any recording is longer
NARROWEST_CAR = 1.0  # m, as well
DENSE_SHARE = 0.5  # share of leaders found in the table from which it counts as complete


def to_recording(
    raw: pd.DataFrame, ledger: Ledger, *, road: Road, source: str, any_road: bool = False
) -> tuple[Recording, Accounting]:
    """Turn a table of official names into a recording, booking every row that is left out.

    Parameters
    ----------
    raw : pandas.DataFrame
        Columns by their official names, numbers in feet; incomplete columns are worked
        around where that is honest, and noted.
    ledger : Ledger
        The rows read so far.
    road : Road
        What was recorded: its lanes are the numbers that a row may have.
    source : str
        Name for messages.
    any_road : bool, keyword-only
        Whether lanes that do not fit the road make one of their own.

    Raises
    ------
    InputError
        If a column that cannot be done without is missing, or the numbers are not in feet.
    """
    if raw.empty:
        raise InputError(f"{source}: no rows; give a recording with at least one vehicle")
    before = set(raw["Vehicle_ID"].dropna().unique())
    notes: list[str] = []
    raw = _drop_unfinished(raw, ledger)
    _check_not_empty(raw, ledger, source)
    raw = _with_keys(raw, source)
    raw = sound_clock(raw, notes, source)
    check_feet(raw, road, source)
    raw = _with_period(raw, notes, source)
    raw = _drop_repeated(raw, ledger)
    table = _in_si(raw, road, notes)
    if any_road and "Lane_ID" in raw and (why := why_foreign(table, road)):
        road, table = road_of_lanes(table, Path(source).stem, why, source, notes)
    table = drop_impossible(table, ledger, road, source)
    _check_not_empty(table, ledger, source)
    check_on_road(table[c.X], table[c.Y], road, source)
    if "Lane_ID" in raw:
        check_lane_widths(table, road, source, range(1, road.main_lanes + 1))
    table = table.sort_values(list(c.KEYS), kind="stable", ignore_index=True)
    table, known = _with_leaders(table, "Preceding" in raw, road, notes)
    recording = Recording.from_table(table, road=road, source=source, notes=tuple(notes), has_leader_rows=known)
    lost = len(before - set(recording.table[c.VEHICLE].unique().astype(float)))
    gone = {"no row left": lost} if lost else {}
    return recording, ledger.close(len(recording.table), vehicles=recording.vehicle_count, vehicles_dropped=gone)


def _drop_unfinished(raw: pd.DataFrame, ledger: Ledger) -> pd.DataFrame:
    """Drop rows without a number where one is needed. No leader, size or class is not a defect of a row."""
    frame = raw["Frame_ID"] if "Frame_ID" in raw else pd.Series(np.nan, raw.index)
    if "step" in raw:
        frame = frame.fillna(raw["step"])
    if "Global_Time" in raw:
        raw = raw.assign(Global_Time=bounded(raw["Global_Time"]))
        if "Frame_ID" not in raw and "step" not in raw:
            frame = frames_of_clock(raw)
    raw = raw.assign(Frame_ID=frame)
    values = raw[[name for name in FINITE if name in raw]].to_numpy(dtype="float64")
    return ledger.drop(raw, ~np.isfinite(values).all(axis=1), "non-finite value")


def _with_keys(raw: pd.DataFrame, source: str) -> pd.DataFrame:
    """Make vehicles, frames and leaders whole numbers."""
    keys = {
        "Vehicle_ID": whole(raw["Vehicle_ID"], "Vehicle_ID", source, low=0),
        "Frame_ID": whole(raw["Frame_ID"], "Frame_ID", source, low=-FRAMES, high=FRAMES),
    }
    if "Preceding" in raw:
        keys["Preceding"] = whole(raw["Preceding"], "Preceding", source, missing=0)
    raw = raw.assign(**keys)
    check_frames(raw, source)
    return raw


def _check_not_empty(raw: pd.DataFrame, ledger: Ledger, source: str) -> None:
    if raw.empty:
        reasons = ", ".join(f"{rows} {reason}" for reason, rows in ledger.dropped.items())
        raise InputError(f"{source}: no rows left of {ledger.total} read ({reasons})")


def check_feet(raw: pd.DataFrame, road: Road, source: str) -> None:
    """Raise if the table looks like metres, or has positions and speeds in different units.

    Raises
    ------
    InputError
        Says which numbers give it away.
    """
    advice = "NGSIM layout is in feet; convert, or give a Parquet of our own columns"
    if "Lane_ID" in raw:
        main = raw[raw["Lane_ID"].between(1, road.main_lanes)]
        width = float((main["Local_X"] / (main["Lane_ID"] - 0.5)).median()) if len(main) else 12.0
        if width < 6.0:
            raise InputError(f"{source}: looks like metres: lanes are {width:.1f} wide by Local_X; {advice}")
    elif raw["Local_X"].max() < 25 and raw["Local_Y"].max() < 700 and _slow(raw):
        raise InputError(
            f"{source}: looks like metres: Local_X ends at {raw['Local_X'].max():.1f}, "
            f"Local_Y at {raw['Local_Y'].max():.0f}; {advice}"
        )
    _check_speed(raw, source)
    _check_sizes(raw, source, advice)


def _check_sizes(raw: pd.DataFrame, source: str, advice: str) -> None:
    """Raise for sizes in metres beside positions in feet: they would shift every gap."""
    cars = raw[raw["v_Class"] != c.MOTORCYCLE] if "v_Class" in raw else raw
    for name, least, word in (("v_Length", SHORTEST_CAR, "long"), ("v_Width", NARROWEST_CAR, "wide")):
        size = cars[name][cars[name] > 0] if name in cars else pd.Series(dtype="float64")
        if len(size) and (median := float(size.median())) * FOOT < least:
            raise InputError(
                f"{source}: {name} looks like metres: half of the vehicles are less than {median:.1f} ft "
                f"{word}; {advice}"
            )


def _slow(raw: pd.DataFrame) -> bool:
    """Whether no vehicle is faster than 35, which any free vehicle is in ft/s and none was in m/s."""
    return "v_Vel" not in raw or float(raw["v_Vel"].quantile(0.99)) < 35


def _check_speed(raw: pd.DataFrame, source: str) -> None:
    """Compare the recorded speed with the progress of the positions."""
    if "v_Vel" not in raw:
        return
    same = (raw["Vehicle_ID"].diff() == 0) & (raw["Frame_ID"].diff() == 1) & (raw["v_Vel"] > 10)
    if same.sum() < 20:
        return
    ratio = float((raw["Local_Y"].diff() / FRAME_STEP / raw["v_Vel"])[same].median())
    if not 0.5 < ratio < 2:
        raise InputError(
            f"{source}: Local_Y advances {ratio:.2f} times as fast as v_Vel says; both must be in feet, 0.1 s a frame"
        )


def _with_period(raw: pd.DataFrame, notes: list[str], source: str) -> pd.DataFrame:
    """Add the period of each row: the file's own scene or period, or else from the clock."""
    for name in ("scene", "period"):
        if name in raw:
            notes.append(f"period is the file's {name}")
            label = raw[name].where(raw[name].notna(), "(none)")
            return raw.assign(**{c.PERIOD: pd.Categorical(label.astype(str))})
    if "Global_Time" not in raw:
        check_one_period(raw, source)
        notes.append("one period is assumed, because there is no Global_Time")
        return raw.assign(**{c.PERIOD: pd.Categorical(np.full(len(raw), "recording"))})
    labels, note = split_periods(
        raw["Vehicle_ID"].to_numpy(), raw["Frame_ID"].to_numpy(), raw["Global_Time"].to_numpy().round().astype(np.int64)
    )
    if note:
        notes.append(note)
    return raw.assign(**{c.PERIOD: labels})


def _drop_repeated(raw: pd.DataFrame, ledger: Ledger) -> pd.DataFrame:
    """Drop rows that are there twice, and second rows of a vehicle in one frame."""
    key = [c.PERIOD, "Vehicle_ID", "Frame_ID"]
    twice = raw.duplicated(key, keep=False)
    if not twice.any():
        return raw
    exact = pd.Series(False, raw.index)
    exact[twice] = raw[twice].duplicated()
    raw = ledger.drop(raw, exact, "exact duplicate row")
    return ledger.drop(raw, raw.duplicated(key), "duplicate frame of a vehicle")


def _in_si(raw: pd.DataFrame, road: Road, notes: list[str]) -> pd.DataFrame:
    """Return the table in metres and seconds, with every column but leaders found from headways."""
    frame = raw["Frame_ID"].to_numpy()
    table = pd.DataFrame({
        c.PERIOD: raw[c.PERIOD], c.VEHICLE: raw["Vehicle_ID"], c.FRAME: frame,
        c.X: raw["Local_Y"] * FOOT, c.Y: -raw["Local_X"] * FOOT, c.HEADING: 0.0,
    })  # fmt: skip
    if "Global_Time" in raw:
        table[c.TIME] = raw["Global_Time"] / 1000
    else:
        table[c.TIME] = frame * FRAME_STEP
        notes.append("time is counted from frame 0, because there is no Global_Time")
    _add_motion(table, raw, notes)
    _add_sizes(table, raw, notes)
    if "Lane_ID" in raw:
        lane = raw["Lane_ID"].clip(-1, 99)
        table[c.LANE] = lane.where(lane == lane.round(), 0).astype("int64")
    else:
        table[c.LANE] = road.lane_of(table[c.X], table[c.Y])
        notes.append("lane is taken from the lateral position, because there is no Lane_ID")
    headway = raw["Space_Headway"] * FOOT if "Space_Headway" in raw else pd.Series(np.nan, raw.index)
    headway = headway.where(headway != 0)  # NGSIM's 0 is no leader
    table[c.HEADWAY] = sizes(headway.to_numpy(), "Space_Headway", (0.0, FARTHEST_LEADER), notes)
    preceding = raw["Preceding"] if "Preceding" in raw else pd.Series(0, raw.index)
    table[c.LEADER] = preceding.where(preceding > 0, 0).astype("int64")
    return table


def _add_motion(table: pd.DataFrame, raw: pd.DataFrame, notes: list[str]) -> None:
    """Add speed and acceleration, from differences where they were not recorded; smoothing redoes both anyway."""
    rows = table.assign(row=np.arange(len(table))).sort_values(list(c.KEYS), kind="stable")
    for name, recorded, origin in ((c.SPEED, "v_Vel", c.X), (c.ACCELERATION, "v_Acc", c.SPEED)):
        if recorded in raw:
            table[name] = raw[recorded] * FOOT
            continue
        order = rows["row"].to_numpy()
        ordered = table.iloc[order]
        same = ordered[[c.PERIOD, c.VEHICLE]].astype({c.PERIOD: "str"}).eq(
            ordered[[c.PERIOD, c.VEHICLE]].astype({c.PERIOD: "str"}).shift()
        ).all(axis=1)  # fmt: skip
        rate = (ordered[origin].diff() / (ordered[c.FRAME].diff() * FRAME_STEP)).where(same)
        rate = rate.bfill(limit=1).fillna(0.0)
        table[name] = pd.Series(rate.to_numpy(), index=ordered.index).clip(lower=0 if name == c.SPEED else None)
        notes.append(f"{name} is a difference of {origin} until smoothed, because there is no {recorded}")


def _add_sizes(table: pd.DataFrame, raw: pd.DataFrame, notes: list[str]) -> None:
    for name, recorded, bounds in ((c.LENGTH, "v_Length", LONGEST), (c.WIDTH, "v_Width", WIDEST)):
        size = raw[recorded] * FOOT if recorded in raw else pd.Series(np.nan, raw.index)
        table[name] = sizes(size.to_numpy(), recorded, bounds, notes)
    kind = raw["v_Class"] if "v_Class" in raw else pd.Series(0.0, raw.index)
    known = kind.isin([c.MOTORCYCLE, c.CAR, c.TRUCK])
    if other := int((~known & kind.notna() & (kind != 0)).sum()):
        notes.append(f"{other} of {len(raw)} rows have a v_Class that is none of 1, 2 and 3; it counts as not recorded")
    table[c.CLASS] = kind.where(known, 0).astype("int8")
    missing = [name for name in ("v_Length", "v_Width", "v_Class") if name not in raw]
    if missing:
        notes.append(f"{', '.join(missing)} not recorded")


def _with_leaders(table: pd.DataFrame, recorded: bool, road: Road, notes: list[str]) -> tuple[pd.DataFrame, bool]:
    """Fill in leaders and say whether the vehicles ahead are in the table.

    With ``Preceding`` or without any headway the table is taken as complete. With headways
    alone it counts as complete if at least half of them point at a vehicle that is there;
    otherwise it is a thin subset, of whose leaders only the headway is known.
    """
    if recorded or table[c.HEADWAY].isna().all():
        return table, True
    leader = leaders.leader_from_headway(table, across=max(road.widths))
    share = float((leader > 0).sum() / table[c.HEADWAY].notna().sum())
    if share >= DENSE_SHARE:
        notes.append(f"leader is found from Space_Headway ({share:.0%} of headways), because there is no Preceding")
        return table.assign(**{c.LEADER: leader}), True
    notes.append(
        f"leader is known by its headway only: no Preceding, and only {share:.0%} of the vehicles ahead are in the file"
    )
    return table, False
