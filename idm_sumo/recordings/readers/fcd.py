"""SUMO's floating car data (``--fcd-output``), as XML or Parquet, to a recording."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.readers.delimited import BROKEN, open_plain
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError

NUMBERS = ("x", "y", "angle", "speed", "acceleration", "length", "width")
REQUIRED = ("x", "y", "angle", "speed")
PERIOD = "fcd"
LEFT, RIGHT = 0.5, 3.0  # lane widths beside the main lanes within which a position may be: side lanes lie on the right
BEYOND = 30.0  # m; vehicles are recorded a little beyond the section


def is_fcd(names: list[str]) -> bool:
    """Whether the columns of a Parquet file are those SUMO writes."""
    bare = {_bare(name) for name in names}
    return {"time", "id", "x", "y", "speed"} <= bare


def _bare(name: str) -> str:
    return name.removeprefix("timestep_").removeprefix("vehicle_")


def from_parquet(raw: pd.DataFrame, ledger: Ledger, *, road: Road, source: str) -> tuple[Recording, Accounting]:
    """Turn the table of a Parquet file written by SUMO into a recording."""
    raw = raw.rename(columns={name: _bare(name) for name in raw.columns})
    ledger.total += len(raw)
    return _to_recording(raw, ledger, road, source)


def read_xml(path: Path, ledger: Ledger, *, road: Road, source: str) -> tuple[Recording, Accounting]:
    """Read an FCD file in XML (or XML packed with gzip) as a stream.

    Raises
    ------
    InputError
        If the XML is malformed (names the line), has no vehicles, or holds a text where a number belongs.
    """
    collector = _Collector()
    parser = expat.ParserCreate()
    parser.StartElementHandler = collector.start
    try:
        with open_plain(path) as stream:
            parser.ParseFile(stream)
    except expat.ExpatError as error:
        raise InputError(f"{source}: line {error.lineno}: malformed XML ({error}); was the run cut short?") from None
    except ValueError as error:
        raise InputError(f"{source}: line {parser.CurrentLineNumber}: {error}") from None
    except BROKEN as error:
        raise InputError(f"{source}: cannot be unpacked ({error})") from None
    if collector.root != "fcd-export":
        raise InputError(f"{source}: root element is <{collector.root}>; a SUMO FCD file has <fcd-export>")
    ledger.total += len(collector.time)
    return _to_recording(collector.table(), ledger, road, source)


class _Collector:
    """Gathers the attributes of the vehicles while the XML streams by."""

    def __init__(self) -> None:
        self.root = ""
        self.now = 0.0
        self.time = array("d")
        self.vehicle = array("q")
        self.names: dict[str, int] = {}
        self.numbers = {name: array("d") for name in NUMBERS}
        self.pairs = tuple(self.numbers.items())

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag == "vehicle":
            self._vehicle(attributes)
        elif tag == "timestep":
            self.now = float(attributes.get("time", "nan"))
        elif not self.root:
            self.root = tag

    def _vehicle(self, attributes: dict[str, str]) -> None:
        name = attributes.get("id", "")
        self.time.append(self.now)
        self.vehicle.append(self.names.setdefault(name, len(self.names)))
        try:
            for key, values in self.pairs:
                values.append(float(attributes.get(key, "nan")))
        except ValueError:
            raise ValueError(f"{name}: {key} = {attributes[key]!r} is not a number") from None

    def table(self) -> pd.DataFrame:
        names = np.array(list(self.names), dtype=object)
        columns: dict[str, Any] = {"time": np.array(self.time), "id": names[np.array(self.vehicle, dtype=np.int64)]}
        columns |= {key: np.array(values) for key, values in self.numbers.items()}
        table = pd.DataFrame(columns)
        return table.drop(columns=[key for key in NUMBERS if table[key].isna().all()])


def _to_recording(raw: pd.DataFrame, ledger: Ledger, road: Road, source: str) -> tuple[Recording, Accounting]:
    if raw.empty:
        raise InputError(f"{source}: no vehicles in this FCD file; run the simulation longer")
    missing = [name for name in REQUIRED if name not in raw]
    if missing:
        raise InputError(f"{source}: FCD attribute {missing[0]!r} is missing; needed are id, {', '.join(REQUIRED)}")
    notes: list[str] = []
    present = [name for name in ("time", *REQUIRED) if name in raw]
    raw = ledger.drop(raw, ~np.isfinite(raw[present].to_numpy(dtype="float64")).all(axis=1), "non-finite value")
    _check_step(raw, source)
    raw = _drop_outside(raw, ledger, road, source)
    table = _table(raw, road, notes)
    table = ledger.drop(table, table.duplicated(list(c.KEYS)), "duplicate frame of a vehicle")
    recording = Recording.from_table(table, road=road, source=source, notes=tuple(notes))
    return recording, ledger.close(len(recording.table), vehicles=recording.vehicle_count)


def _check_step(raw: pd.DataFrame, source: str) -> None:
    steps = np.diff(np.unique(raw["time"].to_numpy()))
    if len(steps) and abs(float(np.median(steps)) - FRAME_STEP) > 1e-3:
        raise InputError(f"{source}: time step is {np.median(steps):g} s; run SUMO with --step-length 0.1")


def _drop_outside(raw: pd.DataFrame, ledger: Ledger, road: Road, source: str) -> pd.DataFrame:
    """Drop what is before, beyond or beside the study section; a file of another network is a mistake."""
    left, right = LEFT * road.widths[0], -road.width - RIGHT * road.widths[-1]
    outside = ~raw["x"].between(0.0, road.length + BEYOND) | ~raw["y"].between(right, left)
    if outside.all():
        raise InputError(
            f"{source}: no position lies in the study section (x from {raw['x'].min():.1f} to {raw['x'].max():.1f} m, "
            f"y from {raw['y'].min():.1f} to {raw['y'].max():.1f} m); FCD must come from {road.network or road.name}"
        )
    return ledger.drop(raw, outside, "outside the section")


def _table(raw: pd.DataFrame, road: Road, notes: list[str]) -> pd.DataFrame:
    x, y = raw["x"].to_numpy(dtype="float64"), raw["y"].to_numpy(dtype="float64")
    angle = np.deg2rad(90.0 - raw["angle"].to_numpy(dtype="float64"))  # SUMO's is clockwise from north
    table = pd.DataFrame({
        c.PERIOD: pd.Categorical(np.full(len(raw), PERIOD)), c.VEHICLE: _numbers(raw["id"], notes),
        c.FRAME: np.round(raw["time"].to_numpy() / FRAME_STEP).astype(np.int64), c.TIME: raw["time"].to_numpy(),
        c.X: x, c.Y: y, c.SPEED: raw["speed"].to_numpy(dtype="float64"),
        c.HEADING: np.arctan2(np.sin(angle), np.cos(angle)), c.LANE: road.lane_of(x, y),
        c.CLASS: 0, c.LEADER: 0, c.HEADWAY: np.nan,
    })  # fmt: skip
    for name in (c.LENGTH, c.WIDTH):
        size = raw[name].to_numpy(dtype="float64") if name in raw else np.full(len(raw), np.nan)
        table[name] = np.where(size > 0, size, np.nan)
    notes.append("lane is taken from the lateral position, vehicle class and leader are not in FCD")
    if "length" not in raw:
        notes.append("vehicle lengths are not in this FCD file")
    return _with_acceleration(table, raw, notes)


def _with_acceleration(table: pd.DataFrame, raw: pd.DataFrame, notes: list[str]) -> pd.DataFrame:
    if "acceleration" in raw:
        values = raw["acceleration"].to_numpy(dtype="float64")
        return table.assign(**{c.ACCELERATION: np.where(np.isfinite(values), values, 0.0)})
    notes.append("acceleration is a difference of speed: run SUMO with --fcd-output.acceleration to have its own")
    ordered = table.sort_values([c.VEHICLE, c.FRAME], kind="stable")
    rate = ordered.groupby(c.VEHICLE)[c.SPEED].diff() / (ordered.groupby(c.VEHICLE)[c.FRAME].diff() * FRAME_STEP)
    return table.assign(**{c.ACCELERATION: rate.reindex(table.index).replace([np.inf, -np.inf], 0.0).fillna(0.0)})


def _numbers(names: pd.Series, notes: list[str]) -> npt.NDArray[np.int64]:
    """Return vehicle numbers: the id itself where it is one, else the next free number."""
    text = names.astype(str)
    given = [name for name in text.unique() if name.isdecimal() and name == str(int(name)) and name != "0"]
    number = {name: int(name) for name in given}
    free = max(number.values(), default=0)
    others = [name for name in text.unique() if name not in number]
    number |= {name: free + place for place, name in enumerate(others, 1)}
    if others:
        some = ", ".join(f"{name} = {number[name]}" for name in others[:3])
        notes.append(f"{len(others)} vehicles have a name, not a number; they got the next free ones ({some})")
    return np.asarray(text.map(number), dtype=np.int64)
