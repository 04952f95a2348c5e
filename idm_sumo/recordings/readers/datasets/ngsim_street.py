"""NGSIM's streets, Lankershim Boulevard and Peachtree Street: official text of 24 columns, 10 frames a second, feet.

``Local_Y`` runs north along the street. Vehicles that drive along it, north or south, are read, each direction a
period; those of the crossing streets are not. Lanes are numbered from the median, turning bays from 11 on. Within a
junction a row has no lane: it keeps the one that the vehicle came from.

Source: FHWA (2007), Lankershim Boulevard Dataset, FHWA-HRT-07-029.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers.delimited import check_location, keep_location, numbers_of
from idm_sumo.recordings.readers.layout import Layout, Opened, plain
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.tracks import Tracks, to_recording, with_lanes
from idm_sumo.roads import BUILT_IN
from idm_sumo.roads.straight import lanes_of_labels
from idm_sumo.roads.units import FOOT, MILE_PER_HOUR

COLUMNS = (
    "Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y", "Global_X", "Global_Y", "v_Length",
    "v_Width", "v_Class", "v_Vel", "v_Acc", "Lane_ID", "Origin_Zone", "Destination_Zone", "Intersection", "Section",
    "Direction", "Movement", "Preceding", "Following", "Space_Headway", "Time_Headway",
)  # fmt: skip
NORTH, SOUTH = 2, 4  # Direction of vehicles along the street
PORTAL = {"vehicle_id", "local_x", "local_y", "direction", "movement"}  # columns of the data portal that a street needs
FIRST_BAY = 11  # numbers of lanes from here on are of turning bays
SPEED_LIMIT = 35 * MILE_PER_HOUR


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Read who drives along the street, each direction a period of the recording.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str
        Empty: the file has no header, or the data portal's.
    """
    if not opened.names:
        return street(numbers_of(opened.path, COLUMNS, opened.ledger), opened)
    wanted = {new: name for new in (*COLUMNS, "Location") for name in opened.names if name.lower() == new.lower()}
    raw = opened.columns(wanted, ("Location",))
    if "Location" in raw:
        raw, seen = keep_location(raw, opened.location, opened.ledger)
        check_location(opened.path, raw, seen, opened.location)
    return street(raw, opened)


def street(raw: pd.DataFrame, opened: Opened) -> tuple[Recording, Accounting]:
    """Turn rows of a street, in feet, into a recording."""
    raw = opened.ledger.drop(raw, ~raw["Direction"].isin([NORTH, SOUTH]), "of a crossing street")
    raw = raw.sort_values(["Vehicle_ID", "Frame_ID"], kind="stable").reset_index(drop=True)
    north = raw["Direction"] == NORTH
    label = raw["Lane_ID"].where(raw["Lane_ID"] > 0).groupby(raw["Vehicle_ID"]).ffill().fillna(0)
    label = label.where(label < FIRST_BAY, 0).astype(np.int64)
    along = np.where(north, raw["Local_Y"], -raw["Local_Y"]) * FOOT
    left = np.where(north, -raw["Local_X"], raw["Local_X"]) * FOOT
    table = pd.DataFrame({
        c.PERIOD: np.where(north, "northbound", "southbound"), c.VEHICLE: raw["Vehicle_ID"],
        c.TIME: raw["Frame_ID"] / 10.0, c.X: along, c.SPEED: raw["v_Vel"] * FOOT, c.ACCELERATION: raw["v_Acc"] * FOOT,
        c.LENGTH: raw["v_Length"] * FOOT, c.WIDTH: raw["v_Width"] * FOOT,
        c.CLASS: raw["v_Class"].where(raw["v_Class"].isin([c.MOTORCYCLE, c.CAR, c.TRUCK]), 0).astype("int8"),
        c.LEADER: raw["Preceding"],
    })  # fmt: skip
    lanes = lanes_of_labels(left, label, opened.source)
    notes = (
        "a street with traffic lights: calibrate who follows; a vehicle that stands without a leader near is not "
        "following, and there is no network for a closed loop",
        f"{int((raw['Lane_ID'] <= 0).sum())} rows within junctions keep the lane that their vehicle came from",
    )
    tracks = Tracks(
        with_lanes(table, lanes), lanes.widths, opened.path.stem, SPEED_LIMIT, notes, has_signals=True
    )  # fmt: skip
    return to_recording(tracks, opened.ledger, source=opened.source, road=opened.road)


def recognise(opened: Opened) -> bool:
    """Whether the first line is as many numbers as the layout has columns, or a street of the portal is wanted."""
    if opened.location.lower() not in BUILT_IN and {plain(name) for name in opened.names} >= PORTAL:
        return True
    return not opened.names and len(opened.first_numbers) == len(COLUMNS)


LAYOUT = Layout(name="NGSIM street", read=read, recognise=recognise)
