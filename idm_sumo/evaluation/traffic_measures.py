"""All measures of the traffic in one recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from idm_sumo.evaluation import macroscopic as m
from idm_sumo.evaluation.waves import wave_speeds
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.leaders import row_ahead
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road

ONCE_A_SECOND = 10  # frames; gaps of successive frames are nearly equal
MOVING = 1.0  # m/s, least speed of a time headway


@dataclass(frozen=True)
class TrafficMeasures:
    """All measures of one recording, as tables by period.

    Attributes
    ----------
    fields : pandas.DataFrame
        :func:`idm_sumo.evaluation.macroscopic.edie`.
    positions : pandas.DataFrame
        :func:`idm_sumo.evaluation.macroscopic.speed_by_position`.
    travel_times, lane_changes, lane_change_places, waves : pandas.DataFrame
        Of the functions with these names.
    following : pandas.DataFrame
        :func:`following`.
    counts : pandas.Series
        Vehicles by period.
    partial : bool
        Whether the recording holds only some of the vehicles.
    """

    fields: pd.DataFrame
    positions: pd.DataFrame
    travel_times: pd.DataFrame
    lane_changes: pd.DataFrame
    lane_change_places: pd.DataFrame
    waves: pd.DataFrame
    following: pd.DataFrame
    counts: pd.Series
    partial: bool
    road: Road

    @property
    def periods(self) -> list[str]:
        """Labels of the periods, in order of time."""
        return [str(label) for label in self.counts.index]


def measure_traffic(recording: Recording) -> TrafficMeasures:
    """Measure one recording.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.

    Returns
    -------
    TrafficMeasures
        All measures.
    """
    return TrafficMeasures(
        m.edie(recording), m.speed_by_position(recording), m.travel_times(recording), m.lane_changes(recording),
        m.lane_change_places(recording),
        wave_speeds(recording), following(recording), m.vehicle_counts(recording),
        not recording.has_leader_rows, recording.road,
    )  # fmt: skip


def following(recording: Recording) -> pd.DataFrame:
    """Return gaps and time headways once a second.

    The gap is bumper to bumper to the vehicle ahead in the same main lane. In a recording of only some
    vehicles it is the recorded headway minus an assumed length of the leader. The time headway is the
    distance front to front over the follower's speed, above 1 m/s.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, gap_m, time_headway_s, speed_m_s``; NaN without a leader.
    """
    table, road = recording.table, recording.road
    main = (table[c.LANE] <= road.main_lanes) & table[c.X].between(0.0, road.length)
    rows = np.flatnonzero(main & (table[c.FRAME] % ONCE_A_SECOND == 0))
    if recording.has_leader_rows:
        ahead = row_ahead(table)[rows]
        x, length = table[c.X].to_numpy(), table[c.LENGTH].fillna(road.car_length).to_numpy()
        headway = np.where(ahead >= 0, x[ahead] - x[rows], np.nan)
        gap = headway - length[ahead]
    else:
        headway = table[c.HEADWAY].to_numpy()[rows]
        gap = headway - road.car_length
    speed = table[c.SPEED].to_numpy()[rows]
    moving = np.where(speed > MOVING, speed, np.nan)
    return pd.DataFrame({
        c.PERIOD: table[c.PERIOD].iloc[rows].astype(str).to_numpy(), c.VEHICLE: table[c.VEHICLE].to_numpy()[rows],
        "gap_m": gap, "time_headway_s": headway / moving, "speed_m_s": speed,
    })  # fmt: skip
