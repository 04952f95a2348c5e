"""Floating car data of a user's own SUMO network, told along its corridor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smoothness
from idm_sumo.recordings.tracks import OFFSET, Tracks, to_recording
from idm_sumo.roads import Road
from idm_sumo.roads.pieces import locate, nearest
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import BROKEN, open_plain

PERIOD = "fcd"
OTHER_PLANE = 100.0  # m between where lane and position, and where x and y put a vehicle
MOST_OFF = 0.95  # share of rows off the corridor from which the network or the corridor is another
TRUCKS = ("truck", "trailer", "bus", "coach", "delivery")
CYCLES = ("motorcycle", "moped", "bicycle")
LENGTH, WIDTH = 5.0, 1.8  # m, of SUMO's default vehicle type


@dataclass(frozen=True)
class VehicleTypes:
    """Sizes and classes of SUMO's vehicle types, by their names.

    Attributes
    ----------
    lengths, widths : mapping of str to float
        m.
    classes : mapping of str to int
        Of :mod:`idm_sumo.recordings.columns`.
    """

    lengths: Mapping[str, float] = field(default_factory=dict)
    widths: Mapping[str, float] = field(default_factory=dict)
    classes: Mapping[str, int] = field(default_factory=dict)


def read_types(paths: list[Path]) -> VehicleTypes:
    """Return the vehicle types of route files or additional files.

    Raises
    ------
    InputError
        If a file is no XML, or a size is no number.
    """
    lengths: dict[str, float] = {}
    widths: dict[str, float] = {}
    classes: dict[str, int] = {}
    for path in paths:
        for kind in _types_of(path):
            name, vehicle_class = kind.get("id", ""), kind.get("vClass", "passenger")
            try:
                lengths[name] = float(kind.get("length", LENGTH))
                widths[name] = float(kind.get("width", WIDTH))
            except ValueError as error:
                raise InputError(f"{path}: vType {name!r}: {error}") from None
            classes[name] = c.TRUCK if vehicle_class in TRUCKS else c.MOTORCYCLE if vehicle_class in CYCLES else c.CAR
    return VehicleTypes(lengths, widths, classes)


def _types_of(path: Path) -> list[ElementTree.Element]:
    if not path.is_file():
        raise InputError(f"{path}: no such route file")
    found = []
    try:
        with open_plain(path) as stream:
            for _, element in ElementTree.iterparse(stream):
                if element.tag == "vType":
                    found.append(element)
                elif element.tag != "param":
                    element.clear()
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: not a route file ({error})") from None
    except BROKEN as error:
        raise InputError(f"{path}: cannot be unpacked ({error})") from None
    return found


def to_corridor(
    raw: pd.DataFrame, ledger: Ledger, road: Road, types: VehicleTypes, source: str
) -> tuple[Recording, Accounting]:
    """Turn rows of floating car data into a recording of a road with pieces.

    Parameters
    ----------
    raw : pandas.DataFrame
        SUMO's attributes: ``time, id, speed`` and ``lane, pos`` or ``x, y``, better both; ``angle, acceleration, type,
        length, width`` where they are there.
    ledger : Ledger
    road : Road
        Whoever is elsewhere is not read.
    types : VehicleTypes
        For vehicles whose size is not in the file.
    source : str
        Name for messages.

    Raises
    ------
    InputError
        If nearly nobody is on the road, or the file tells neither lanes nor positions.
    """
    notes = [f"on {Path(road.network).name}: edges {', '.join(road.edges)[:120]}"]
    raw = ledger.drop(raw, raw["id"].isna() | (raw["id"].astype(str) == ""), "a person, not a vehicle")
    needed = [name for name in ("time", "speed", "pos") if name in raw]
    raw = ledger.drop(raw, ~np.isfinite(raw[needed].to_numpy(np.float64)).all(axis=1), "non-finite value")
    where = _located(raw, road, notes, source)
    off = where.number == 0
    if off.mean() > MOST_OFF:
        edges = raw["lane"].astype(str).str.rsplit("_", n=1).str[0].value_counts().index[:8] if "lane" in raw else []
        here = f"{', '.join(road.edges)[:120]} of {Path(road.network).name}"
        raise InputError(
            f"{source}: {off.mean():.0%} of the rows are not on {here}"
            + (f"; most driven are {', '.join(edges)}: name them with --corridor EDGE..." if len(edges) else "")
        )
    table = _table(raw, where, types, notes)
    table = ledger.drop(table, off, "off the corridor")
    tracks = Tracks(table, road.widths, road.name, road.speed_limit, tuple(notes), road.has_signals)
    recording, account = to_recording(tracks, ledger, source=source, road=road)
    return smoothness(recording), account


def _located(raw: pd.DataFrame, road: Road, notes: list[str], source: str) -> Any:
    plane = [raw[name].to_numpy(np.float64) if name in raw else None for name in ("x", "y")]
    x, y = plane if plane[0] is not None and plane[1] is not None else (None, None)
    position = raw["pos"].to_numpy(np.float64) if "pos" in raw else None
    if "lane" not in raw:
        if x is None or y is None:
            raise InputError(f"{source}: has neither lane and pos nor x and y; run SUMO with its usual --fcd-output")
        notes.append("lanes are not in the file: everybody is on the lane whose centre line is nearest")
        return nearest(road, x, y)
    lanes = raw["lane"].fillna("").astype(str).to_numpy(object)
    where = locate(road, lanes, position, x, y)
    on = where.number > 0
    if position is None or not on.any() or float(np.median(np.abs(where.offset[on]))) <= OTHER_PLANE:
        return where
    notes.append(
        "x and y are not in the network's plane (geographic?): lane and pos are used, all drive on lane centres"
    )
    return locate(road, lanes, position, None, None)


def _table(raw: pd.DataFrame, where: Any, types: VehicleTypes, notes: list[str]) -> pd.DataFrame:
    table = pd.DataFrame({
        c.PERIOD: PERIOD, c.VEHICLE: raw["id"].astype(str).to_numpy(), c.TIME: raw["time"].to_numpy(), c.X: where.x,
        c.LANE: where.number, OFFSET: where.offset, c.SPEED: raw["speed"].to_numpy(),
    })  # fmt: skip
    if "acceleration" in raw:
        values = raw["acceleration"].to_numpy(np.float64)
        table[c.ACCELERATION] = np.where(np.isfinite(values), values, 0.0)
    if "angle" in raw:
        turned = np.deg2rad(90.0 - raw["angle"].to_numpy(np.float64)) - where.heading  # SUMO's is clockwise from north
        turned = np.arctan2(np.sin(turned), np.cos(turned))
        table[c.HEADING] = np.where(np.abs(turned) < 1e-3, 0.0, turned)  # its digits end at 0.01 degrees
    kind = raw["type"].astype(str).str.partition("@")[0] if "type" in raw else pd.Series("", raw.index)
    for name, known, assumed in ((c.LENGTH, types.lengths, LENGTH), (c.WIDTH, types.widths, WIDTH)):
        recorded = raw[name].to_numpy(np.float64) if name in raw else np.full(len(raw), np.nan)
        told = kind.map(dict(known)).to_numpy(np.float64)
        table[name] = np.where(np.isfinite(recorded), recorded, told)
        if (unknown := np.isnan(table[name])).any():
            notes.append(
                f"{name} of {unknown.mean():.0%} of the rows is not known (name the types with --route-files): SUMO's "
                f"default of {assumed:g} m is taken"
            )
            table[name] = table[name].fillna(assumed)
    table[c.CLASS] = kind.map(dict(types.classes)).fillna(0).to_numpy().astype("int8")
    return table
