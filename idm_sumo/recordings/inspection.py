"""What is in a recording, and where each of its rows went."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.leaders import row_ahead
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import DEFAULT, Road

CLASSES = {0: "not recorded", 1: "motorcycle", 2: "car", 3: "truck"}


@dataclass(frozen=True)
class PeriodSummary:
    """One recording period as it was read, before cleaning.

    Attributes
    ----------
    period : str
    vehicles, rows : int
    start, end : float
        First and last time (s).
    mean_speed : float
        Over all rows (m/s).
    """

    period: str
    vehicles: int
    rows: int
    start: float
    end: float
    mean_speed: float


@dataclass(frozen=True)
class Inspection:
    """What ``idm-sumo inspect`` shows.

    Attributes
    ----------
    source : str
    rows : Accounting
        Over reading and cleaning together.
    vehicles_read : int
    periods : tuple of PeriodSummary
    lanes, classes : dict of str to int
        Rows by lane, vehicles by class, before cleaning.
    known_leaders : float
        Share of the rows left whose leader is known, by a label, a headway or the rows around.
    has_leader_rows : bool
        Whether the vehicles ahead are in the recording.
    notes : tuple of str
    """

    source: str
    rows: Accounting
    vehicles_read: int
    periods: tuple[PeriodSummary, ...]
    lanes: dict[str, int]
    classes: dict[str, int]
    known_leaders: float
    has_leader_rows: bool
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return plain values, with ``read``, ``used`` and ``dropped`` at the top."""
        plain = asdict(self)
        rows = plain.pop("rows")
        head = {"source": plain.pop("source"), "read": rows["total"], "used": rows["used"], "dropped": rows["dropped"]}
        head |= {"added": rows["added"]} if rows["added"] else {}
        counts = {
            "vehicles_read": plain.pop("vehicles_read"),
            "vehicles_used": rows["vehicles"],
            "vehicles_dropped": rows["vehicles_dropped"],
        }
        return head | counts | plain

    def lines(self) -> list[str]:
        """Return the same as lines of text."""
        out = [self.source, f"rows read        {self.rows.total:>10,}"]
        out += [f"  added          {rows:>10,}  {reason}" for reason, rows in self.rows.added.items()]
        out += [f"  dropped        {rows:>10,}  {reason}" for reason, rows in self.rows.dropped.items()]
        out += [f"rows used        {self.rows.used:>10,}", f"vehicles read    {self.vehicles_read:>10,}"]
        out += [f"  not modelled   {n:>10,}  {reason}" for reason, n in self.rows.vehicles_dropped.items()]
        out += [f"vehicles to model{self.rows.vehicles:>10,}"]
        out += ["period       vehicles        rows   start s (of file)     end s   mean speed m/s"]
        begin = min(p.start for p in self.periods)
        out += [
            f"{p.period:<12}{p.vehicles:>9,}{p.rows:>12,}{p.start - begin:>20.1f}{p.end - begin:>10.1f}"
            f"{p.mean_speed:>17.2f}"
            for p in self.periods
        ]
        out += ["rows by lane     " + ", ".join(f"{lane}: {rows:,}" for lane, rows in self.lanes.items())]
        out += ["vehicles by class " + ", ".join(f"{name}: {n:,}" for name, n in self.classes.items())]
        out += [f"leader known in {self.known_leaders:.1%} of the rows used"]
        return out + [f"note: {note}" for note in self.notes]


def inspect_recording(
    path: str | os.PathLike[str], *, location: str = DEFAULT.name, road: Road | None = None
) -> Inspection:
    """Read and clean a recording and say what became of every row.

    Parameters
    ----------
    path, location, road
        See :func:`idm_sumo.recordings.reading.read_recording`.

    Raises
    ------
    InputError
        As :func:`idm_sumo.recordings.reading.read_recording`.
    """
    read = read_recording(path, location=location, road=road)
    return summarise(read, clean(read), str(Path(path)))


def summarise(read: Recording, cleaned: Recording, source: str) -> Inspection:
    """Return the inspection of a recording read and cleaned already."""
    table = read.table
    first = table.drop_duplicates([c.PERIOD, c.VEHICLE])
    rows = cleaned.accounting
    return Inspection(
        source=source,
        rows=rows,
        vehicles_read=len(first),
        periods=_periods(read),
        lanes={str(lane): int(n) for lane, n in table[c.LANE].value_counts().sort_index().items()},
        classes={
            name: int((first[c.CLASS] == kind).sum())
            for kind, name in CLASSES.items()
            if (first[c.CLASS] == kind).any()
        },
        known_leaders=_known_leaders(cleaned),
        has_leader_rows=read.has_leader_rows,
        notes=tuple(dict.fromkeys((*cleaned.notes, *rows.notes))),
    )


def vehicle_table(read: Recording, cleaned: Recording, *, least_frames: int) -> pd.DataFrame:
    """List the vehicles of a recording and why some cannot be modelled.

    Parameters
    ----------
    read, cleaned : Recording
        The recording as it was read, and what cleaning made of it.
    least_frames : int
        Frames in a row that a vehicle needs.

    Returns
    -------
    pandas.DataFrame
        One row a vehicle: ``period, vehicle, first_frame, last_frame, frames, start_s, end_s, eligible,
        reason``. Frames and times are those of its longest unbroken run on the main lanes, times in
        seconds since the recording begins; missing for a vehicle without one.
    """
    if cleaned.vehicles is None:
        raise ValueError("not cleaned; see idm_sumo.recordings.cleaning.clean")
    table = read.table
    time = table.set_index(list(c.KEYS))[c.TIME] - table[c.TIME].min()
    out = cleaned.vehicles[[c.PERIOD, c.VEHICLE, "first_frame", "last_frame"]].copy()
    exists = out["first_frame"] >= 0
    out["frames"] = np.where(exists, out["last_frame"] - out["first_frame"] + 1, 0)
    for name, frame in (("start_s", "first_frame"), ("end_s", "last_frame")):
        wanted = pd.MultiIndex.from_frame(out[[c.PERIOD, c.VEHICLE, frame]])
        out[name] = time.reindex(wanted).to_numpy()
    short = (cleaned.vehicles["reason"] == "") & (out["frames"] < least_frames)
    reason = cleaned.vehicles["reason"].mask(short, f"fewer than {least_frames} frames in a row")
    out[["first_frame", "last_frame"]] = out[["first_frame", "last_frame"]].where(exists).astype("Int64")
    return out.assign(**{c.PERIOD: out[c.PERIOD].astype(str)}, eligible=reason == "", reason=reason)


def _periods(recording: Recording) -> tuple[PeriodSummary, ...]:
    out = []
    for period in recording.periods:
        table = recording.of_period(period).table
        time = table[c.TIME]
        speed = float(table[c.SPEED].mean())
        out.append(
            PeriodSummary(period, table[c.VEHICLE].nunique(), len(table), float(time.min()), float(time.max()), speed)
        )
    return tuple(out)


def _known_leaders(recording: Recording) -> float:
    table = recording.table
    known = (table[c.LEADER] > 0).to_numpy() | table[c.HEADWAY].notna().to_numpy()
    if recording.has_leader_rows:
        known |= row_ahead(table) >= 0
    return float(np.mean(known))
