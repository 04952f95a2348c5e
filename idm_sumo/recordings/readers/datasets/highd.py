"""highD: German motorways from a drone, 25 frames a second, metres.

``NN_tracks.csv`` with ``NN_tracksMeta.csv`` and ``NN_recordingMeta.csv`` beside it. A vehicle is a box, ``x, y`` its
upper left corner in the picture, ``width`` its length and ``height`` its width; ``y`` points down. The upper
carriageway drives to the left. Lanes lie between the markings of the recording.

Source: R. Krajewski, J. Bock, L. Kloeker, L. Eckstein, The highD Dataset, ITSC 2018.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers.beside import Companion, companion, markings_in, number_in
from idm_sumo.recordings.readers.layout import Layout, Opened
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.tracks import Tracks, to_recording, with_lanes
from idm_sumo.roads.straight import Lanes, lanes_between, lanes_of_labels

FRAME_RATE = 25.0  # Hz, of every recording of the set
LEFTWARDS = 1  # drivingDirection of the upper carriageway
CLASSES = {"car": c.CAR, "truck": c.TRUCK, "bus": c.TRUCK, "van": c.CAR, "motorcycle": c.MOTORCYCLE}


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Read both carriageways, each a period of the recording.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str
    """
    raw = opened.columns(columns)
    about, cars = companion(opened, "_tracks", "_recordingMeta"), companion(opened, "_tracks", "_tracksMeta")
    notes = [note for beside in (about, cars) for note in beside.notes]
    leftwards = _leftwards(raw, cars)
    table = pd.DataFrame({
        c.PERIOD: np.where(leftwards, "upper carriageway", "lower carriageway"), c.VEHICLE: raw["id"],
        c.TIME: raw["frame"] / number_in(about, "frameRate", FRAME_RATE),
        c.X: np.where(leftwards, -raw["x"], raw["x"] + raw["width"]), c.LENGTH: raw["width"], c.WIDTH: raw["height"],
    })  # fmt: skip
    sign = np.where(leftwards, -1.0, 1.0)
    for name, recorded in ((c.SPEED, "xVelocity"), (c.ACCELERATION, "xAcceleration")):
        if recorded in raw:
            table[name] = raw[recorded] * sign
    if "precedingId" in raw:
        table[c.LEADER] = raw["precedingId"]
    table[c.CLASS] = _classes(raw["id"], cars)
    middle = raw["y"] + 0.5 * raw["height"]
    lanes = _lanes(raw, middle * -sign, leftwards, about, opened.source)
    notes.append("each carriageway is a period; a vehicle is where the front of its box is")
    limit = number_in(about, "speedLimit", float("nan"))
    tracks = Tracks(
        with_lanes(table, lanes), lanes.widths, f"highD {opened.path.stem.removesuffix('_tracks')}",
        limit if limit > 0 else float("nan"), tuple(notes),
    )  # fmt: skip
    return to_recording(tracks, opened.ledger, source=opened.source, road=opened.road)


def _leftwards(raw: pd.DataFrame, cars: Companion) -> pd.Series:
    """Return which rows are of vehicles that drive to the left of the picture."""
    if (told := cars.by_key("id", "drivingDirection")) is not None:
        direction = raw["id"].map(told)
        if direction.notna().all():
            return direction == LEFTWARDS
    if "xVelocity" in raw:
        return raw["xVelocity"].groupby(raw["id"]).transform("median") < 0
    ends = raw.sort_values("frame").groupby("id")["x"].agg(["first", "last"])
    return raw["id"].map(ends["last"] < ends["first"])


def _classes(vehicle: pd.Series, cars: Companion) -> pd.Series:
    if (told := cars.by_key("id", "class")) is None:
        return pd.Series(0, vehicle.index)
    kind = told.astype(str).str.strip().str.lower().map(CLASSES)
    return vehicle.map(kind).fillna(0).astype("int8")


def _lanes(raw: pd.DataFrame, left: pd.Series, leftwards: pd.Series, about: Companion, source: str) -> Lanes:
    """Return lanes by the markings, or where they are not beside the file by the lane numbers."""
    parts = {}
    for upper, name in ((True, "upperLaneMarkings"), (False, "lowerLaneMarkings")):
        here = leftwards == upper
        if not here.any():
            continue
        if (markings := markings_in(about, name)) is not None:
            edges = sorted((edge if upper else -edge for edge in markings), reverse=True)
            parts[upper] = here, lanes_between(left[here], edges)
        else:
            parts[upper] = here, lanes_of_labels(left[here], raw["laneId"][here].to_numpy(), source)
    number, offset = np.zeros(len(raw), dtype=np.int64), np.zeros(len(raw))
    for here, lanes in parts.values():
        number[here], offset[here] = lanes.number, lanes.offset
    widest = max((lanes.widths for _, lanes in parts.values()), key=len)
    return Lanes(number, offset, widest)


LAYOUT = Layout(
    name="highD",
    marks=("frame", "xvelocity", "laneid", "precedingid"),
    columns={name: (name.lower(),) for name in ("frame", "id", "x", "y", "width", "height", "laneId")},
    optional={name: (name.lower(),) for name in ("xVelocity", "xAcceleration", "precedingId")},
    read=read,
)
