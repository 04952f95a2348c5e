"""SUMO's floating car data (``--fcd-output``), as XML, CSV or Parquet, to a recording."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.coercion import LATEST, LONGEST, WIDEST, drop_impossible, numbers, sizes
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.identities import vehicle_numbers
from idm_sumo.recordings.on_road import check_foreign_lanes, check_on_road, foreign_edges, outside
from idm_sumo.recordings.readers.fcd_on_network import VehicleTypes, to_corridor
from idm_sumo.recordings.readers.header import check_names
from idm_sumo.recordings.readers.layouts import FCD_NUMBERS, bare
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.resampling import resample
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError, shown
from idm_sumo.runtime.memory import Handed
from idm_sumo.runtime.xml import scan

NUMBERS = FCD_NUMBERS[1:]
NO_TYPES = VehicleTypes()
STEP_TOLERANCE = 1e-3  # s
ROOTS = {"fcd-export": "a SUMO FCD file"}
REQUIRED = ("x", "y", "angle", "speed")  # beside id and time
PERIOD = FCD = "fcd"


def from_table(
    held: Handed[pd.DataFrame], ledger: Ledger, *, road: Road, source: str, types: VehicleTypes = NO_TYPES
) -> tuple[Recording, Accounting]:
    """Turn a table that SUMO wrote, as CSV or Parquet, into a recording."""
    raw = held.take()
    raw = raw.set_axis(check_names([bare(name) for name in raw.columns], source), axis=1)
    ledger.total += len(raw)
    held = Handed(raw.assign(**{name: numbers(raw[name], name, source) for name in FCD_NUMBERS if name in raw}))
    del raw
    return _to_recording(held, ledger, road, types, source)


def read_xml(
    path: Path, ledger: Ledger, *, road: Road, source: str, types: VehicleTypes = NO_TYPES
) -> tuple[Recording, Accounting]:
    """Read an FCD file in XML (or XML packed with gzip) as a stream.

    Raises
    ------
    InputError
        If the XML is malformed (names the line), has no vehicles, or holds a text where a number belongs.
    """
    collector = _Collector()
    scan(path, source, collector.start, roots=ROOTS, advice="was the run cut short?")
    ledger.total += len(collector.time)
    ledger.notes += [f"{collector.persons} rows of persons are skipped"] if collector.persons else []
    held = Handed(collector.table())
    del collector
    return _to_recording(held, ledger, road, types, source)


class _Collector:
    """Gathers the attributes of the vehicles while the XML streams by."""

    def __init__(self) -> None:
        self.now = 0.0
        self.time = array("d")
        self.persons = 0
        self.vehicle = array("q")
        self.texts = {"lane": array("q"), "type": array("q")}
        self.names: dict[str, int] = {}
        self.words: dict[str, dict[str, int]] = {name: {} for name in self.texts}
        self.numbers = {name: array("d") for name in NUMBERS}
        self.pairs = tuple(self.numbers.items())

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag == "vehicle":
            self._vehicle(attributes)
        elif tag == "timestep":
            try:
                self.now = float(attributes.get("time", "nan"))
            except ValueError:
                raise ValueError(f"time = {shown(attributes['time'])} is not a number") from None
        elif tag == "person":
            self.persons += 1

    def _vehicle(self, attributes: dict[str, str]) -> None:
        name = attributes.get("id", "")
        if not name:
            raise ValueError("a vehicle has no id; run SUMO with --fcd-output.attributes id,x,y,angle,speed,lane")
        self.time.append(self.now)
        self.vehicle.append(self.names.setdefault(name, len(self.names)))
        for key, codes in self.texts.items():
            words = self.words[key]
            codes.append(words.setdefault(attributes.get(key, ""), len(words)))
        try:
            for key, values in self.pairs:
                values.append(float(attributes.get(key, "nan")))
        except ValueError:
            raise ValueError(f"{name}: {key} = {shown(attributes[key])} is not a number") from None

    def table(self) -> pd.DataFrame:
        names = np.array(list(self.names), dtype=object)
        columns: dict[str, Any] = {"time": np.array(self.time), "id": names[np.array(self.vehicle, dtype=np.int64)]}
        for key, codes in self.texts.items():
            if set(self.words[key]) - {""}:
                columns[key] = np.array(list(self.words[key]), dtype=object)[np.array(codes, dtype=np.int64)]
        columns |= {key: np.array(values) for key, values in self.numbers.items()}
        table = pd.DataFrame(columns)
        return table.drop(columns=[key for key in NUMBERS if table[key].isna().all()])


def _to_recording(
    held: Handed[pd.DataFrame], ledger: Ledger, road: Road, types: VehicleTypes, source: str
) -> tuple[Recording, Accounting]:
    ledger.layout, raw = FCD, held.take()
    if raw.empty:
        raise InputError(f"{source}: no vehicles in this FCD file; run the simulation longer")
    if road.pieces:
        held = Handed(raw)
        del raw
        return to_corridor(held, ledger, road, types, source)
    missing = [name for name in REQUIRED if name not in raw]
    if missing:
        raise InputError(f"{source}: FCD attribute {missing[0]!r} is missing; needed are id, {', '.join(REQUIRED)}")
    notes: list[str] = []
    raw = ledger.drop(raw, ~np.isfinite(raw[["time", *REQUIRED]].to_numpy()).all(axis=1), "non-finite value")
    raw = ledger.drop(raw, ~raw["time"].between(-LATEST, LATEST), "impossible time, position or acceleration")
    if "lane" in raw and (edges := foreign_edges(raw["lane"], road)):
        check_foreign_lanes(raw["lane"], raw["y"], edges, road, source)
        notes.append(
            f"edges ({', '.join(edges[:5])}) are not those of {road.name}, but the lanes fit: it is taken for it"
        )
    raw = _drop_outside(raw, ledger, road, source)
    table = _every_frame(_table(raw, road, notes, source), ledger, source)
    table = drop_impossible(table, ledger, road, source)
    table = ledger.drop(table, table.duplicated(list(c.KEYS)), "duplicate frame of a vehicle")
    recording = Recording.from_table(table, road=road, source=source, notes=tuple(notes))
    return recording, ledger.close(len(recording.table), vehicles=recording.vehicle_count)


def _every_frame(table: pd.DataFrame, ledger: Ledger, source: str) -> pd.DataFrame:
    """Return rows every 0.1 s, by the rule of :mod:`idm_sumo.recordings.resampling`."""
    steps = np.diff(np.unique(table[c.TIME].to_numpy()))
    if not len(steps) or abs(float(np.median(steps)) - FRAME_STEP) <= STEP_TOLERANCE:
        return table
    return resample(table, ledger, source)


def _drop_outside(raw: pd.DataFrame, ledger: Ledger, road: Road, source: str) -> pd.DataFrame:
    """Drop what is before, beyond or beside the section; a file of another network is a mistake."""
    if raw.empty:
        raise InputError(f"{source}: no rows left of {ledger.total} read ({ledger.dropped})")
    off = outside(raw["x"], raw["y"], road) | (raw["x"] < 0.0).to_numpy()
    if off.all():
        raise InputError(
            f"{source}: no position lies in the study section (x from {raw['x'].min():.1f} to {raw['x'].max():.1f} m, "
            f"y from {raw['y'].min():.1f} to {raw['y'].max():.1f} m); FCD must come from {road.network or road.name}"
        )
    check_on_road(raw["x"], raw["y"], road, source, network=True)
    return ledger.drop(raw, off, "outside the section")


def _table(raw: pd.DataFrame, road: Road, notes: list[str], source: str) -> pd.DataFrame:
    x, y = raw["x"].to_numpy(), raw["y"].to_numpy()
    angle = np.deg2rad(90.0 - raw["angle"].to_numpy())  # SUMO's is clockwise from north
    table = pd.DataFrame({
        c.PERIOD: pd.Categorical(np.full(len(raw), PERIOD)), c.VEHICLE: _numbers(raw["id"], notes, source),
        c.FRAME: np.round(raw["time"].to_numpy() / FRAME_STEP).astype(np.int64), c.TIME: raw["time"].to_numpy(),
        c.X: x, c.Y: y, c.SPEED: raw["speed"].to_numpy(),
        c.HEADING: np.arctan2(np.sin(angle), np.cos(angle)), c.LANE: road.lane_of(x, y),
        c.CLASS: 0, c.LEADER: 0, c.HEADWAY: np.nan,
    })  # fmt: skip
    for name, bounds in ((c.LENGTH, LONGEST), (c.WIDTH, WIDEST)):
        size = raw[name].to_numpy() if name in raw else np.full(len(raw), np.nan)
        table[name] = sizes(size, name, bounds, notes)
    notes.append("lane is taken from the lateral position, vehicle class and leader are not in FCD")
    if "length" not in raw:
        notes.append("vehicle lengths are not in this FCD file")
    return _with_acceleration(table, raw, notes)


def _with_acceleration(table: pd.DataFrame, raw: pd.DataFrame, notes: list[str]) -> pd.DataFrame:
    if "acceleration" in raw:
        values = raw["acceleration"].to_numpy()
        return table.assign(**{c.ACCELERATION: np.where(np.isfinite(values), values, 0.0)})
    notes.append("acceleration is a difference of speed: run SUMO with --fcd-output.acceleration to have its own")
    ordered = table.sort_values([c.VEHICLE, c.FRAME], kind="stable")
    rate = ordered.groupby(c.VEHICLE)[c.SPEED].diff() / (ordered.groupby(c.VEHICLE)[c.FRAME].diff() * FRAME_STEP)
    return table.assign(**{c.ACCELERATION: rate.reindex(table.index).replace([np.inf, -np.inf], 0.0).fillna(0.0)})


def _numbers(names: pd.Series, notes: list[str], source: str) -> npt.NDArray[np.int64]:
    """Return vehicle numbers: the id itself where it is one, else the next free number."""
    if (absent := (names.isna() | (names == "")).to_numpy()).any():
        raise InputError(
            f"{source}: row {int(absent.argmax()) + 1} of those in the section has no vehicle id; run SUMO with "
            "--fcd-output.attributes id,x,y,angle,speed,lane"
        )
    number = vehicle_numbers(names, notes, source)
    return np.asarray(names.map(number), dtype=np.int64)
