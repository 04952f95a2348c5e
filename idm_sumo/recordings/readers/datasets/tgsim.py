"""TGSIM (Third Generation Simulation Data): American motorways from the air, 10 frames a second, metres.

``xloc-kf, yloc-kf`` are the middle of a vehicle on a plan whose origin is the upper left corner of a picture. Lane 1
is the leftmost in driving direction. The portal spells names with hyphens or underscores. Every run is a period.

Source: U.S. Department of Transportation, Third Generation Simulation Data, 2024.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers.layout import Layout, Opened
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.straightening import along_longest
from idm_sumo.recordings.tracks import Tracks, to_recording, with_lanes
from idm_sumo.roads.straight import Lanes, lanes_of_labels

LARGE = ("large", "truck", "bus", "trailer")  # what a type that is a truck is called
SMALL = ("motorcycle", "bicycle")


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Read every run, each a period of the recording.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str
    """
    raw = opened.columns(columns, ("type", "automated"))
    run = raw["run"].fillna(0).astype(int).astype(str) if "run" in raw else pd.Series("1", raw.index)
    along, lanes = _straightened(raw, run.to_numpy(), opened.source)
    length = raw["length"] if "length" in raw else pd.Series(np.nan, raw.index)
    table = pd.DataFrame({
        c.PERIOD: "run " + run, c.VEHICLE: raw["id"], c.TIME: raw["time"], c.X: along + 0.5 * length.fillna(0.0),
    })  # fmt: skip
    for name in (c.SPEED, c.ACCELERATION, c.LENGTH, c.WIDTH):
        if name in raw:
            table[name] = raw[name]
    if "type" in raw:
        kind = raw["type"].astype(str).str.lower()
        table[c.CLASS] = np.select([_any_of(kind, LARGE), _any_of(kind, SMALL)], [c.TRUCK, c.MOTORCYCLE], c.CAR)
    notes = ["a position is the middle of a vehicle; its front is half a length ahead", *_automated(raw)]
    tracks = Tracks(
        with_lanes(table, lanes), lanes.widths, f"TGSIM {opened.path.stem}", notes=tuple(notes)
    )  # fmt: skip
    return to_recording(tracks, opened.ledger, source=opened.source, road=opened.road)


def _any_of(kind: pd.Series, words: tuple[str, ...]) -> npt.NDArray[np.bool_]:
    return np.asarray(kind.str.contains("|".join(words), regex=True), dtype=bool)


def _automated(raw: pd.DataFrame) -> list[str]:
    """Say how many vehicles are automated: their parameters are a machine's."""
    if "automated" not in raw:
        return []
    yes = raw["automated"].astype(str).str.strip().str.lower().isin(["yes", "1", "1.0", "true"])
    vehicles = raw.loc[yes, "id"].drop_duplicates()
    return [f"{len(vehicles)} vehicles are automated, first {vehicles.iloc[0]:g}"] if len(vehicles) else []


def _straightened(raw: pd.DataFrame, run: npt.NDArray[np.str_], source: str) -> tuple[npt.NDArray[np.float64], Lanes]:
    s, number, offset, widths = np.zeros(len(raw)), np.zeros(len(raw), dtype=np.int64), np.zeros(len(raw)), []
    label = raw["lane"].fillna(0).to_numpy(np.int64)
    for one in np.unique(run):
        here = np.flatnonzero(run == one)
        vehicle = raw["id"].to_numpy(np.float64)[here].astype(np.int64)
        along = along_longest(
            raw["x"].to_numpy(np.float64)[here], raw["y"].to_numpy(np.float64)[here], vehicle,
            raw["time"].to_numpy(np.float64)[here],
        )  # fmt: skip
        right = np.polyfit(label[here], along.offset, 1)[0] if len(np.unique(label[here])) > 1 else -1.0
        lanes = lanes_of_labels(along.offset * -np.sign(right), label[here], source)  # lane 1 lies left
        s[here], number[here], offset[here] = along.s, lanes.number, lanes.offset
        widths.append(lanes.widths)
    return s, Lanes(number, offset, max(widths, key=len))


LAYOUT = Layout(
    name="TGSIM",
    marks=("id", "time", "xloc_kf", "yloc_kf"),
    columns={"id": ("id",), "time": ("time",), "x": ("xloc_kf",), "y": ("yloc_kf",), "lane": ("lane_kf",)},
    optional={
        "speed": ("speed_kf",), "acceleration": ("acceleration_kf",), "length": ("length_smoothed", "length"),
        "width": ("width_smoothed", "width"), "type": ("type_most_common", "type"), "run": ("run_index",),
        "automated": ("av", "acc"),
    },
    read=read,
)  # fmt: skip
