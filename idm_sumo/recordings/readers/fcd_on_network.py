"""Floating car data of a user's own SUMO network, told along its corridor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.coercion import EARTH, IMPOSSIBLE
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smoothness
from idm_sumo.recordings.tracks import OFFSET, Tracks, to_recording
from idm_sumo.roads import Road
from idm_sumo.roads.pieces import locate, nearest
from idm_sumo.runtime.errors import InputError, shown
from idm_sumo.runtime.inputs import existing_file
from idm_sumo.runtime.memory import Handed
from idm_sumo.runtime.xml import scan

PERIOD = "fcd"
OTHER_PLANE = 100.0  # m between where lane and position, and where x and y put a vehicle
MOST_OFF = 0.95  # share of rows off the corridor from which the network or the corridor is another
TRUCKS = ("truck", "trailer", "bus", "coach", "delivery")
CYCLES = ("motorcycle", "moped", "bicycle")
LENGTH, WIDTH = 5.0, 1.8  # m, of SUMO's default vehicle type and of most classes
SIZES = {  # m, length and width that SUMO gives to a type of a class without its own
    "emergency": (6.5, 2.16), "bus": (12.0, 2.5), "coach": (14.0, 2.6), "delivery": (6.5, 2.16), "truck": (7.1, 2.4),
    "trailer": (16.5, 2.55), "motorcycle": (2.2, 0.9), "moped": (2.1, 0.78), "bicycle": (1.6, 0.65),
}  # fmt: skip
ROOTS = {"routes": "a route file", "additional": "an additional file", "add": "an older one"}


@dataclass(frozen=True)
class VehicleTypes:
    """Sizes and classes of SUMO's vehicle types, by their names.

    Attributes
    ----------
    lengths, widths : dict of str to float
        m.
    classes : dict of str to int
        Of :mod:`idm_sumo.recordings.columns`.
    """

    lengths: dict[str, float] = field(default_factory=dict)
    widths: dict[str, float] = field(default_factory=dict)
    classes: dict[str, int] = field(default_factory=dict)


def read_types(paths: list[Path]) -> VehicleTypes:
    """Return the vehicle types of route files or additional files.

    Raises
    ------
    InputError
        If a file is no XML, a size is no number, or a type is there twice with different sizes.
    """
    types = VehicleTypes()
    for path in paths:
        scan(existing_file(path, "name a route file"), path, partial(_note_type, types), roots=ROOTS,
             advice="is it whole?")  # fmt: skip
    return types


def _note_type(types: VehicleTypes, tag: str, attributes: Mapping[str, str]) -> None:
    """Note size and class of a vehicle type; ValueError if it is no size, or another one than before."""
    if tag != "vType":
        return
    name, vehicle_class = attributes.get("id", ""), attributes.get("vClass", "passenger")
    length, width = (
        _size(name, attributes, key, default)
        for key, default in zip(("length", "width"), SIZES.get(vehicle_class, (LENGTH, WIDTH)), strict=True)
    )
    if (types.lengths.get(name, length), types.widths.get(name, width)) != (length, width):
        raise ValueError(f"vType {shown(name)} is there twice, with different sizes; leave one of the files out")
    types.lengths[name], types.widths[name] = length, width
    types.classes[name] = c.TRUCK if vehicle_class in TRUCKS else c.MOTORCYCLE if vehicle_class in CYCLES else c.CAR


def _size(name: str, attributes: Mapping[str, str], key: str, default: float) -> float:
    text = attributes.get(key, "")
    try:
        size = float(text or default)
    except ValueError:
        size = float("nan")
    if not 0.0 < size < float("inf"):
        raise ValueError(f"vType {shown(name)}: {key} = {shown(text)} is no size")
    return size


def to_corridor(
    held: Handed[pd.DataFrame], ledger: Ledger, road: Road, types: VehicleTypes, source: str
) -> tuple[Recording, Accounting]:
    """Turn rows of floating car data into a recording of a road with pieces.

    Parameters
    ----------
    held : Handed of pandas.DataFrame
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
    raw = held.take()
    raw = raw.assign(id=_texts(raw["id"]))
    raw = ledger.drop(raw, raw["id"] == "", "a person, not a vehicle")
    plane = {"x", "y"} <= set(raw)
    needed = [name for name in ("time", "speed", "pos", "angle", *(("x", "y") if plane else ())) if name in raw]
    raw = ledger.drop(raw, ~np.isfinite(raw[needed].to_numpy(np.float64)).all(axis=1), "non-finite value")
    far = [name for name in ("x", "y", "pos") if name in needed]
    raw = ledger.drop(raw, (raw[far].abs() > EARTH).any(axis=1), IMPOSSIBLE)
    if raw.empty:
        raise InputError(f"{source}: no rows left of {ledger.total} read ({ledger.dropped})")
    where = _located(raw, road, notes, source)
    off = where.number == 0
    if off.mean() > MOST_OFF:
        edges = _texts(raw["lane"]).str.rsplit("_", n=1).str[0].value_counts().index[:8] if "lane" in raw else []
        here = f"{', '.join(road.edges)[:120]} of {Path(road.network).name}"
        raise InputError(
            f"{source}: {off.mean():.0%} of the rows are not on {here}"
            + (f"; most driven are {', '.join(edges)}: name them with --corridor EDGE..." if len(edges) else "")
        )
    table = ledger.drop(_table(raw, where, types, notes), off, "off the corridor")
    del raw, where
    tracks = Tracks(table, road.widths, road.name, road.speed_limit, tuple(notes), road.has_signals)
    recording, account = to_recording(tracks, ledger, source=source, road=road)
    return smoothness(recording), account


def _texts(names: pd.Series) -> pd.Series:
    """Return names as texts, the empty one where there is none; equal ones are one object, which keeps them small."""
    codes, words = pd.factorize(names.to_numpy(dtype=object))
    return pd.Series(np.array([*map(str, words), ""], dtype=object)[codes], names.index)


def _located(raw: pd.DataFrame, road: Road, notes: list[str], source: str) -> Any:
    plane = [raw[name].to_numpy(np.float64) if name in raw else None for name in ("x", "y")]
    x, y = plane if plane[0] is not None and plane[1] is not None else (None, None)
    position = raw["pos"].to_numpy(np.float64) if "pos" in raw else None
    if "lane" not in raw:
        if x is None or y is None:
            raise InputError(f"{source}: has neither lane and pos nor x and y; run SUMO with its usual --fcd-output")
        notes.append("lanes are not in the file: everybody is on the lane whose centre line is nearest")
        return nearest(road, x, y)
    lanes = _texts(raw["lane"]).to_numpy(object)
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
        c.PERIOD: pd.Categorical.from_codes(np.zeros(len(raw), dtype=np.int8), [PERIOD]),
        c.VEHICLE: raw["id"].to_numpy(), c.TIME: raw["time"].to_numpy(), c.X: where.x,
        c.LANE: where.number, OFFSET: where.offset, c.SPEED: raw["speed"].to_numpy(),
    })  # fmt: skip
    if "acceleration" in raw:
        values = raw["acceleration"].to_numpy(np.float64)
        table[c.ACCELERATION] = np.where(np.isfinite(values), values, 0.0)
    if "angle" in raw:
        turned = np.deg2rad(90.0 - raw["angle"].to_numpy(np.float64)) - where.heading  # SUMO's is clockwise from north
        turned = np.arctan2(np.sin(turned), np.cos(turned))
        table[c.HEADING] = np.where(np.abs(turned) < 1e-3, 0.0, turned)  # its digits end at 0.01 degrees
    codes, kinds = _kinds(raw)
    for name, known, assumed in ((c.LENGTH, types.lengths, LENGTH), (c.WIDTH, types.widths, WIDTH)):
        recorded = raw[name].to_numpy(np.float64) if name in raw else np.full(len(raw), np.nan)
        told = np.array([known.get(kind, np.nan) for kind in kinds], dtype=np.float64)[codes]
        table[name] = np.where(np.isfinite(recorded), recorded, told)
        if (unknown := np.isnan(table[name])).any():
            notes.append(
                f"{name} of {unknown.mean():.0%} of the rows is not known (name the types with --route-files): SUMO's "
                f"default of {assumed:g} m is taken"
            )
            table[name] = table[name].fillna(assumed)
    table[c.CLASS] = np.array([types.classes.get(kind, 0) for kind in kinds], dtype=np.int8)[codes]
    return table


def _kinds(raw: pd.DataFrame) -> tuple[npt.NDArray[np.int64], list[str]]:
    """Return each row's place in a list of types, and that list, without what SUMO adds to names of its own copies."""
    if "type" not in raw:
        return np.zeros(len(raw), dtype=np.int64), [""]
    codes, names = pd.factorize(_texts(raw["type"]))
    return np.asarray(codes, dtype=np.int64), [name.partition("@")[0] for name in names.tolist()]
