"""When, where and as what drivers enter.

An exported vehicle needs it beside its parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.scenes.windows import Scenes

DESTINATION = "destination"  # edge: "downstream" or "off_ramp"
THROUGH, LEAVING = "downstream", "off_ramp"
NEAR = 20.0  # m before an off-ramp, from where whoever is beside the main lanes takes it


def departures(source: Scenes | Recording | Sequence[Scenes]) -> pd.DataFrame:
    """Return when, where and as what drivers enter.

    Parameters
    ----------
    source : Scenes, sequence of Scenes, or Recording
        From scenes a driver departs where its simulation starts; from a recording, every
        vehicle where it is first seen, and its way out is known.

    Returns
    -------
    pandas.DataFrame
        The keys ``period, vehicle, first_frame``; ``depart_s`` (frame number × 0.1 s, so on the
        period's own clock), ``lane, x_m, y_m, speed_m_s, length_m, width_m, vehicle_class, destination``.
    """
    if isinstance(source, Recording):
        return _of_recording(source)
    parts = [source] if isinstance(source, Scenes) else list(source)
    return pd.concat([_of_scenes(part) for part in parts], ignore_index=True)


def _of_scenes(scenes: Scenes) -> pd.DataFrame:
    first = scenes.start
    table = pd.DataFrame({
        **scenes.keys(),
        d.DEPART: (scenes.first_frame + first) * FRAME_STEP, d.LANE: scenes.lane,
        d.X: scenes.x[:, first], d.Y: scenes.y[:, first], d.SPEED: scenes.speed[:, first],
        d.LENGTH: scenes.length, d.WIDTH: scenes.width, d.CLASS: scenes.vehicle_class,
    })  # fmt: skip
    # A modelled driver keeps its lane, a main lane, so it stays on the freeway.
    return table.assign(**{DESTINATION: THROUGH})


def _of_recording(recording: Recording) -> pd.DataFrame:
    rows = recording.table.groupby([c.PERIOD, c.VEHICLE], observed=True, sort=True)
    first, last = rows.head(1).reset_index(drop=True), rows.tail(1).reset_index(drop=True)
    road, left = recording.road, _takes_off_ramp(recording.road, last)
    return pd.DataFrame({
        c.PERIOD: first[c.PERIOD].astype(str), c.VEHICLE: first[c.VEHICLE], d.FIRST_FRAME: first[c.FRAME],
        d.DEPART: first[c.FRAME] * FRAME_STEP, d.LANE: first[c.LANE].astype("int64"),
        d.X: first[c.X], d.Y: first[c.Y], d.SPEED: first[c.SPEED],
        d.LENGTH: first[c.LENGTH].fillna(road.car_length), d.WIDTH: first[c.WIDTH].fillna(road.car_width),
        d.CLASS: first[c.CLASS].astype("int64"), DESTINATION: left.map({True: LEAVING, False: THROUGH}),
    })  # fmt: skip


def _takes_off_ramp(road: Road, last: pd.DataFrame) -> pd.Series:
    """Return which vehicles leave the road, by their last rows."""
    left = last[c.LANE].isin([ramp.number for ramp in road.off_ramps])
    before = last[c.LANE].isin([lane.number for lane in road.auxiliary_lanes])
    for ramp in road.off_ramps:
        left |= before & (last[c.X] > ramp.start - NEAR)
    return left
