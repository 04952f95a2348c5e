"""exiD: entries and exits of German motorways from a drone, 25 frames a second, metres.

``NN_tracks.csv`` with ``NN_tracksMeta.csv`` and ``NN_recordingMeta.csv`` beside it. ``xCenter, yCenter`` are the middle
of a vehicle on a plan, ``heading`` is in degrees. A vehicle's lane is known by its lanelet of the map and by how far it
is from that lanelet's middle; lanelets that lie in line are one lane. Where a vehicle is on two, the first counts.

Source: T. Moers, L. Vater, R. Krajewski, J. Bock, A. Zlocki, L. Eckstein, The exiD Dataset, IV 2022.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers.beside import companion, number_in
from idm_sumo.recordings.readers.layout import Layout, Opened
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.straightening import along_longest
from idm_sumo.recordings.tracks import Tracks, to_recording, with_lanes
from idm_sumo.roads.straight import FEW, Lanes, widths_of

FRAME_RATE = 25.0  # Hz, of every recording of the set
CLASSES = {"car": c.CAR, "van": c.CAR, "truck": c.TRUCK, "bus": c.TRUCK, "trailer": c.TRUCK, "motorcycle": c.MOTORCYCLE}
SAME_LANE = 1.5  # m; lanelets whose middles are nearer across the road are of one lane
TEXTS = ("lanelet", "lanelet_offset")
Floats = npt.NDArray[np.float64]


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Read both carriageways, each a period of the recording.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str
    """
    raw = opened.columns(columns, TEXTS)
    about, cars = companion(opened, "_tracks", "_recordingMeta"), companion(opened, "_tracks", "_tracksMeta")
    notes = [note for beside in (about, cars) for note in beside.notes]
    heading = np.deg2rad(raw["heading"].to_numpy(np.float64))
    main = heading[0]
    forward = pd.Series(np.cos(heading - main)).groupby(raw["id"].to_numpy()).transform("median").to_numpy() > 0
    period = np.where(forward, "one carriageway", "other carriageway")
    along, lanes = _straightened(raw, period)
    table = pd.DataFrame({
        c.PERIOD: period, c.VEHICLE: raw["id"], c.TIME: raw["frame"] / number_in(about, "frameRate", FRAME_RATE),
        c.X: along + 0.5 * raw["length"], c.LENGTH: raw["length"], c.WIDTH: raw["width"],
    })  # fmt: skip
    for name, recorded in ((c.SPEED, "speed"), (c.ACCELERATION, "acceleration"), (c.LEADER, "leader")):
        if recorded in raw:
            table[name] = raw[recorded]
    if (told := cars.by_key("trackId", "class")) is not None:
        kind = told.astype(str).str.strip().str.lower().map(CLASSES)
        table[c.CLASS] = raw["id"].map(kind).fillna(0).astype("int8")
    notes.append("each carriageway is a period; x runs along the way of its longest recorded vehicle")
    limit = number_in(about, "speedLimit", float("nan"))
    tracks = Tracks(
        with_lanes(table, lanes), lanes.widths, f"exiD {opened.path.stem.removesuffix('_tracks')}",
        limit if limit > 0 else float("nan"), tuple(notes),
    )  # fmt: skip
    return to_recording(tracks, opened.ledger, source=opened.source, road=opened.road)


def _straightened(raw: pd.DataFrame, period: npt.NDArray[np.str_]) -> tuple[Floats, Lanes]:
    """Return how far along its carriageway each row is, and its lane there."""
    s, number, offset, widths = np.zeros(len(raw)), np.zeros(len(raw), dtype=np.int64), np.zeros(len(raw)), []
    lanelet = raw["lanelet"].map(str).str.split(";").str[0].to_numpy()
    from_middle = pd.to_numeric(raw["lanelet_offset"].map(str).str.split(";").str[0], errors="coerce").to_numpy()
    for label in np.unique(period):
        here = np.flatnonzero(period == label)
        vehicle = raw["id"].to_numpy(np.float64)[here].astype(np.int64)
        x, y = raw["x"].to_numpy(np.float64)[here], raw["y"].to_numpy(np.float64)[here]
        along = along_longest(x, y, vehicle, raw["frame"].to_numpy(np.float64)[here])
        lanes = _lanes(along.offset, lanelet[here], from_middle[here])
        s[here], number[here], offset[here] = along.s, lanes.number, lanes.offset
        widths.append(lanes.widths)
    return s, Lanes(number, offset, max(widths, key=len))


def _lanes(across: Floats, lanelet: npt.NDArray[np.str_], from_middle: Floats) -> Lanes:
    """Return lanes made of the lanelets whose middles lie in line."""
    middle = pd.Series(across - np.nan_to_num(from_middle)).groupby(lanelet).median().sort_values(ascending=False)
    strip = np.concatenate([[0], np.cumsum(-np.diff(middle.to_numpy()) > SAME_LANE)])
    label = pd.Series(lanelet).map(dict(zip(middle.index, strip, strict=True))).to_numpy()
    where = across - np.nan_to_num(from_middle)
    middles = np.array([float(np.median(where[label == one])) for one in range(strip[-1] + 1)])
    counts = np.bincount(label, minlength=len(middles))
    kept = np.flatnonzero(counts >= FEW * counts.sum())
    number = np.searchsorted(kept, label) + 1
    number = np.where(np.isin(label, kept), number, 0)
    offset = np.where(number > 0, np.where(np.isnan(from_middle), across - middles[label], from_middle), 0.0)
    return Lanes(number.astype(np.int64), offset, widths_of(middles[kept]))


LAYOUT = Layout(
    name="exiD",
    marks=("trackid", "xcenter", "laneletid", "latlanecenteroffset"),
    columns={
        "id": ("trackid",), "frame": ("frame",), "x": ("xcenter",), "y": ("ycenter",), "heading": ("heading",),
        "length": ("length",), "width": ("width",), "lanelet": ("laneletid",),
        "lanelet_offset": ("latlanecenteroffset",),
    },
    optional={"speed": ("lonvelocity",), "acceleration": ("lonacceleration",), "leader": ("leadid",)},
    read=read,
)  # fmt: skip
