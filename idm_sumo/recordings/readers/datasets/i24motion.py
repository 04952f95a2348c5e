"""I-24 MOTION: a motorway in Tennessee, 25 frames a second, feet, one JSON object a vehicle.

``x_position`` runs along the motorway, ``y_position`` across it; both are of the middle of a vehicle's rear. Lanes are
12 ft wide and the first begins 12 ft beside the line that divides the carriageways, which is ``y = 0``. ``timestamp``
is in seconds. Which way a carriageway drives is told by the vehicles, since releases turn ``x`` either way.

Source: D. Gloudemans et al., I-24 MOTION: An instrument for freeway traffic science, Transportation Research C 2023.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers.layout import Layout, Opened
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.tracks import Tracks, to_recording, with_lanes
from idm_sumo.roads.straight import FEW, Lanes
from idm_sumo.roads.units import FOOT, MILE_PER_HOUR
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import BROKEN, open_plain

LANE_WIDTH = 12 * FOOT
INNER_EDGE = 12 * FOOT  # m between the dividing line and lane 1
MOST_LANES = 8
SPEED_LIMIT = 70 * MILE_PER_HOUR
BLOCK = 1 << 20  # characters
LONGEST = 1 << 28  # characters of one vehicle
CLASSES = {0: c.CAR, 1: c.CAR, 2: c.CAR, 3: c.CAR, 4: c.TRUCK, 5: c.TRUCK, 6: c.MOTORCYCLE}
SERIES = ("timestamp", "x_position", "y_position")


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Read both carriageways, each a period of the recording.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str
        Empty: the file has no columns.
    """
    parts = [_vehicle(one, number, opened.source) for number, one in enumerate(_objects(opened), 1)]
    if not parts:
        raise InputError(f"{opened.source}: holds no vehicle")
    table = pd.concat(parts, ignore_index=True)
    opened.ledger.total += len(table)
    lanes = _lanes(table.pop("across").to_numpy(np.float64))
    notes = ("each carriageway is a period; a vehicle's front is its length ahead of the recorded rear",
             "lanes are 12 ft wide and begin 12 ft beside the dividing line")  # fmt: skip
    tracks = Tracks(with_lanes(table, lanes), lanes.widths, f"I-24 {opened.path.stem}", SPEED_LIMIT, notes)
    return to_recording(tracks, opened.ledger, source=opened.source, road=opened.road)


def _objects(opened: Opened) -> Iterator[dict[str, Any]]:
    """Yield the vehicles of an array, or of lines, one at a time: a day is larger than memory."""
    decoder, rest, done = json.JSONDecoder(), "", 0
    try:
        with open_plain(opened.path) as stream:
            while block := stream.read(BLOCK):
                rest = (rest + block.decode("utf-8", errors="replace")).lstrip(" \r\n\t,[\ufeff")
                while rest.startswith("{"):
                    try:
                        found, end = decoder.raw_decode(rest)
                    except json.JSONDecodeError:
                        break  # it goes on in the next block
                    done += 1
                    yield found
                    rest = rest[end:].lstrip(" \r\n\t,[")
                if len(rest) > LONGEST:
                    raise InputError(f"{opened.source}: vehicle {done + 1} has more than {LONGEST >> 20} MB")
    except RecursionError:
        raise InputError(f"{opened.source}: vehicle {done + 1} is nested too deep") from None
    except BROKEN as error:
        raise InputError(f"{opened.source}: cannot be unpacked ({error})") from None
    if rest.strip(" \r\n\t,]"):
        raise InputError(f"{opened.source}: vehicle {done + 1} is no whole JSON object; was the file cut short?")


def _vehicle(told: dict[str, Any], number: int, source: str) -> pd.DataFrame:
    """Return the rows of a vehicle, along and across its carriageway."""
    try:
        time, x, y = (np.asarray(told[name], dtype=np.float64) for name in SERIES)
        length, width = (float(np.median(np.asarray(told.get(name, np.nan), dtype=np.float64)))
                         for name in ("length", "width"))  # fmt: skip
        kind = int(np.median(np.asarray(told.get("coarse_vehicle_class", -1), dtype=np.float64)))
        if not len(time) == len(x) == len(y) > 0 or time.ndim != 1:
            raise ValueError(f"{len(time)} times, {len(x)} x, {len(y)} y")
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{source}: vehicle {number}: {', '.join(SERIES)} must be lists of one length ({error})"
        ) from None
    name = told.get("_id", number)
    name = str(name.get("$oid", number)) if isinstance(name, dict) else str(name)
    forward = 1.0 if len(x) < 2 or x[-1] >= x[0] else -1.0
    length = length * FOOT
    return pd.DataFrame({
        c.PERIOD: "one carriageway" if float(np.median(y)) < 0 else "other carriageway", c.VEHICLE: name, c.TIME: time,
        c.X: forward * x * FOOT + (length if np.isfinite(length) else 0.0), "across": np.abs(y) * FOOT,
        c.LENGTH: length, c.WIDTH: width * FOOT, c.CLASS: CLASSES.get(kind, 0),
    })  # fmt: skip


def _lanes(across: np.ndarray[Any, np.dtype[np.float64]]) -> Lanes:
    """Return lanes by the distance from the dividing line."""
    number = np.floor((across - INNER_EDGE) / LANE_WIDTH).astype(np.int64) + 1
    number = np.where((number >= 1) & (number <= MOST_LANES), number, 0)
    counts = np.bincount(number, minlength=MOST_LANES + 1)[1:]
    used = np.flatnonzero(counts >= FEW * max(counts.sum(), 1)) + 1
    last = int(used.max()) if len(used) and counts.sum() else 1
    number = np.where(number <= last, number, 0)
    offset = np.where(number > 0, INNER_EDGE + (number - 0.5) * LANE_WIDTH - across, 0.0)
    return Lanes(number, offset, (LANE_WIDTH,) * last)


def recognise(opened: Opened) -> bool:
    """Whether a file is JSON whose first object has the lists of a vehicle."""
    text = opened.start.lstrip()
    return text[:1] in "[{" and all(f'"{name}"' in text for name in ("timestamp", "x_position"))


LAYOUT = Layout(name="I-24 MOTION", read=read, recognise=recognise)
