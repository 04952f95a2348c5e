"""Reconstructed NGSIM of I-80: numbers in ten columns without a header, 10 frames a second, metres.

In order: vehicle, frame, lane, position of the front along the road (m), speed (m/s), acceleration (m/s²), length (m),
class, follower, leader. Positions across the road are not told.

Source: M. Montanino, V. Punzo, Trajectory data reconstruction and simulation-based validation against macroscopic
traffic patterns, Transportation Research B 80, 2015.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers.delimited import numbers_of
from idm_sumo.recordings.readers.layout import Layout, Opened
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.tracks import OFFSET, Tracks, to_recording
from idm_sumo.roads import BUILT_IN

COLUMNS = ("vehicle", "frame", "lane", "x", "speed", "acceleration", "length", "class", "follower", "leader")
ROAD = BUILT_IN["i-80"]


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Read the vehicles in the middles of their lanes.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str
        Empty: the file has no header.
    """
    raw = numbers_of(opened.path, COLUMNS, opened.ledger)
    main = raw["lane"].between(1, ROAD.main_lanes)
    table = pd.DataFrame({
        c.PERIOD: "recording", c.VEHICLE: raw["vehicle"], c.TIME: raw["frame"] / 10.0, c.X: raw["x"],
        c.SPEED: raw["speed"], c.ACCELERATION: raw["acceleration"], c.LENGTH: raw["length"],
        c.CLASS: raw["class"].where(raw["class"].isin([c.MOTORCYCLE, c.CAR, c.TRUCK]), 0).astype("int8"),
        c.LANE: raw["lane"].where(main, 0).fillna(0).astype(np.int64), OFFSET: 0.0, c.LEADER: raw["leader"],
    })  # fmt: skip
    notes = (
        "positions are reconstructed already and not smoothed again; whoever reconstructed them may have leaked a "
        "leader's future into its past",
        "positions across the road are not told: everybody is in the middle of its lane",
    )
    tracks = Tracks(table, ROAD.widths, "i-80", ROAD.speed_limit, notes)
    recording, account = to_recording(tracks, opened.ledger, source=opened.source, road=opened.road)
    return replace(recording, is_smooth=True), account


def recognise(opened: Opened) -> bool:
    """Whether the first line is as many numbers as the layout has columns, a class among them."""
    numbers = opened.first_numbers
    return not opened.names and len(numbers) == len(COLUMNS) and numbers[7] in (c.MOTORCYCLE, c.CAR, c.TRUCK)


LAYOUT = Layout(name="reconstructed NGSIM", read=read, recognise=recognise)
