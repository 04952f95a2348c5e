r"""Flow, density, speed, travel times and lane changes of traffic.

Edie's generalised definitions hold for any region of space and time, here a stretch of one
lane of length :math:`L` over a time :math:`\Delta t`. With the vehicles' distances :math:`x_i` and
times :math:`t_i` spent in it

.. math:: q = \frac{\sum x_i}{L\,\Delta t},\qquad k = \frac{\sum t_i}{L\,\Delta t},\qquad
    v = \frac{\sum x_i}{\sum t_i} = \frac qk.

Source: Edie (1963), Discussion of traffic stream measurements and definitions; Treiber and
Kesting (2013), Traffic Flow Dynamics, section 3.3. A row of a recording is a presence of 0.1 s,
in which the vehicle travels its speed times 0.1 s.

A recording without its leaders' rows (``has_leader_rows`` is false) holds only some of the
vehicles. Its speeds are means over those; its flows, densities and counts are unknown (NaN).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import runs
from idm_sumo.roads import Road

Floats = npt.NDArray[np.float64]

Integers = npt.NDArray[np.int64]
SEGMENTS = 8  # parts of the section
INSIDE = (25.0, 40.08)  # m, of the stations from start and end of the section; US-101 is recorded from 12 to 631 m
HELD = 10  # frames that a vehicle must stay in a lane for its change to count
PER_HOUR, PER_KM = 3600.0, 1000.0

MINUTE, SEGMENT, FLOW, DENSITY = "minute", "segment", "flow_veh_h", "density_veh_km"
MEAN_SPEED, SAMPLES = "speed_m_s", "vehicle_seconds"


def edie(recording: Recording, *, segments: int = SEGMENTS, minutes: float = 1.0) -> pd.DataFrame:
    """Return flow, density and speed of regions.

    Regions are by period, minute, lane and segment.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.
    segments : int
        Number of equal parts of the section; 0 is upstream.
    minutes : float
        Length of the time intervals, counted from each period's first frame.

    Returns
    -------
    pandas.DataFrame
        ``period, minute`` (number of the interval), ``lane`` (main and auxiliary), ``segment``, ``x_m`` (its middle),
        ``flow_veh_h``, ``density_veh_km``, ``speed_m_s``, ``vehicle_seconds``. Regions without vehicles are
        missing. Flow and density are NaN if the recording holds only some of the vehicles.
    """
    road = recording.road
    table, edges = _in_section(recording), np.linspace(0.0, road.length, segments + 1)
    table = table.assign(**{
        SEGMENT: np.minimum(np.searchsorted(edges, table[c.X], side="right") - 1, segments - 1),
        MINUTE: (_seconds(recording.table)[table.index] // (60.0 * minutes)).astype(np.int64),
    })  # fmt: skip
    regions = table.groupby([c.PERIOD, MINUTE, c.LANE, SEGMENT], observed=True)[c.SPEED]
    sums = regions.agg(["sum", "size"]).reset_index()
    distance, time = sums["sum"].to_numpy() * FRAME_STEP, sums["size"].to_numpy() * FRAME_STEP
    area = _lengths(road, edges)[sums[c.LANE].to_numpy(), sums[SEGMENT].to_numpy()]
    area = area * _durations(recording, sums, minutes)
    if not recording.has_leader_rows:
        area = np.full(len(sums), np.nan)
    return sums[[c.PERIOD, MINUTE, c.LANE, SEGMENT]].assign(**{
        "x_m": (0.5 * (edges[1:] + edges[:-1]))[sums[SEGMENT].to_numpy()],
        FLOW: distance / area * PER_HOUR, DENSITY: time / area * PER_KM, MEAN_SPEED: distance / time, SAMPLES: time,
    })  # fmt: skip


def _in_section(recording: Recording) -> pd.DataFrame:
    """Return rows in the section on main and auxiliary lanes.

    Ramps lie mostly outside the section.
    """
    table, road = recording.table, recording.road
    on_lanes = table[c.LANE] <= road.main_lanes
    for side in road.auxiliary_lanes:
        on_lanes |= (table[c.LANE] == side.number) & table[c.X].between(side.start, side.end)
    return table[on_lanes & table[c.X].between(0.0, road.length)]


def _seconds(table: pd.DataFrame) -> Floats:
    """Return each row's time (s) since its period's start."""
    first = table.groupby(c.PERIOD, observed=True)[c.FRAME].transform("min")
    return np.asarray((table[c.FRAME] - first) * FRAME_STEP, dtype=np.float64)


def _lengths(road: Road, edges: Floats) -> Floats:
    """Return lane lengths (m) by lane number and segment.

    The shape is ``(last lane + 1, segments)``.
    """
    whole = np.tile(np.diff(edges), (road.last_lane + 1, 1))
    for side in road.auxiliary_lanes:
        whole[side.number] = np.diff(np.clip(edges, side.start, side.end))
    return whole


def _durations(recording: Recording, sums: pd.DataFrame, minutes: float) -> Floats:
    """Return how long (s) each region's interval was recorded.

    The last interval of a period may be shorter than the others.
    """
    frames = recording.table.groupby(c.PERIOD, observed=True)[c.FRAME].agg(["min", "max"])
    whole = ((frames["max"] - frames["min"] + 1) * FRAME_STEP).reindex(sums[c.PERIOD].astype(str)).to_numpy()
    begin = sums[MINUTE].to_numpy() * 60.0 * minutes
    return np.asarray(np.minimum(60.0 * minutes, whole - begin))


def speed_by_position(recording: Recording, *, bins: int = SEGMENTS) -> pd.DataFrame:
    """Return Edie's mean speed by period and position.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.
    bins : int
        Number of equal parts of the section.

    Returns
    -------
    pandas.DataFrame
        ``period, segment, x_m, speed_m_s, speed_se_m_s`` and ``vehicles``, of the main lanes. The standard
        error is over the vehicles' own mean speeds there, since frames are not independent.
    """
    table, road = _in_section(recording), recording.road
    table = table[table[c.LANE] <= road.main_lanes]
    segment = np.minimum((table[c.X] / road.length * bins).astype(np.int64), bins - 1)
    table = table.assign(**{SEGMENT: segment})
    own = table.groupby([c.PERIOD, SEGMENT, c.VEHICLE], observed=True)[c.SPEED].mean()
    by_vehicle = own.groupby([c.PERIOD, SEGMENT], observed=True).agg(["sem", "size"])
    speed = table.groupby([c.PERIOD, SEGMENT], observed=True)[c.SPEED].mean()
    out = pd.DataFrame({MEAN_SPEED: speed, "speed_se_m_s": by_vehicle["sem"], "vehicles": by_vehicle["size"]})
    out = out.reset_index()
    out.insert(2, "x_m", (out[SEGMENT] + 0.5) * road.length / bins)
    return out


def travel_times(recording: Recording, *, stations: tuple[float, float] | None = None) -> pd.DataFrame:
    """Return each vehicle's travel time between two stations.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.
    stations : (float, float), optional
        Positions of the stations (m); by default a little inside both ends of the section.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, entered_s`` (since the period's first frame), ``travel_time_s``. Vehicles that did not
        pass both stations are missing. The moments are interpolated between frames.
    """
    passed = [_passing(recording.table, station) for station in stations or stations_of(recording.road)]
    both = passed[0].merge(passed[1], on=[c.PERIOD, c.VEHICLE], suffixes=("", "_end"))
    both["travel_time_s"] = both["seconds_end"] - both["seconds"]
    kept = both.rename(columns={"seconds": "entered_s"})[[c.PERIOD, c.VEHICLE, "entered_s", "travel_time_s"]]
    return kept[kept["travel_time_s"] > 0].reset_index(drop=True)


def stations_of(road: Road) -> tuple[float, float]:
    """Return the positions (m) between which travel times are taken.

    Parameters
    ----------
    road : Road
        The road.

    Returns
    -------
    (float, float)
        A little inside both ends of the section, where vehicles are surely recorded.
    """
    return INSIDE[0], road.length - INSIDE[1]


def _passing(table: pd.DataFrame, station: float) -> pd.DataFrame:
    """Return when (s) each vehicle first passed a station (m)."""
    starts, _ = runs(table)
    x, seconds = table[c.X].to_numpy(), _seconds(table)
    crossing = np.zeros(len(table), dtype=bool)
    crossing[1:] = (x[:-1] < station) & (x[1:] >= station)
    crossing[starts] = False
    rows = np.flatnonzero(crossing)
    share = (station - x[rows - 1]) / (x[rows] - x[rows - 1])
    moment = seconds[rows - 1] + share * (seconds[rows] - seconds[rows - 1])
    period, vehicle = table[c.PERIOD].iloc[rows].astype(str).to_numpy(), table[c.VEHICLE].to_numpy()[rows]
    found = pd.DataFrame({c.PERIOD: period, c.VEHICLE: vehicle, "seconds": moment})
    return found.drop_duplicates([c.PERIOD, c.VEHICLE])


def lane_changes(recording: Recording, *, held: int = HELD) -> pd.DataFrame:
    """Return every vehicle's distance and lane changes.

    A change counts if the vehicle stayed long enough in the lanes before and after, since measured
    positions near a marking flicker.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.
    held : int
        Frames that a vehicle must stay in a lane.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, km``, ``changes`` between main lanes, ``merges`` from the auxiliary lane or the ramp,
        ``exits`` to them.
    """
    table, main = recording.table, recording.road.main_lanes
    rows, before, after = _changes(recording, held)
    kinds = {"changes": (before <= main) & (after <= main), "merges": before > main, "exits": after > main}
    driven = table[c.SPEED] * FRAME_STEP / PER_KM
    counts = pd.DataFrame({c.PERIOD: table[c.PERIOD], c.VEHICLE: table[c.VEHICLE], "km": driven})
    for name, kind in kinds.items():
        counts[name] = 0
        counts.loc[rows[kind], name] = 1
    return counts.groupby([c.PERIOD, c.VEHICLE], observed=True).sum().reset_index()


def lane_change_places(recording: Recording, *, held: int = HELD) -> pd.DataFrame:
    """Return where and when vehicles changed lanes.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.
    held : int
        Frames that a vehicle must stay in a lane.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, frame, x`` (m), ``before`` and ``after``: main lanes, or one more for the lanes beside them.
    """
    rows, before, after = _changes(recording, held)
    places = recording.table.iloc[rows][[c.PERIOD, c.VEHICLE, c.FRAME, c.X]].reset_index(drop=True)
    return places.assign(before=before, after=after)


def _changes(recording: Recording, held: int) -> tuple[Integers, Integers, Integers]:
    """Return where vehicles change lanes, as rows.

    Return the rows in which a vehicle is first in another lane, and the lanes before and after.
    """
    table, main = recording.table, recording.road.main_lanes
    lane = np.minimum(table[c.LANE].to_numpy(np.int64), main + 1)  # side lanes continue each other
    starts, lengths = runs(table)
    stretch = np.repeat(np.arange(len(starts)), lengths)
    breaks = np.flatnonzero((np.diff(lane) != 0) | (np.diff(stretch) != 0)) + 1
    first = np.concatenate([[0], breaks])
    long = np.diff(np.concatenate([first, [len(lane)]])) >= held
    first = first[long]
    before, after = lane[first[:-1]], lane[first[1:]]
    changed = (stretch[first[1:]] == stretch[first[:-1]]) & (before != after)
    return first[1:][changed], before[changed], after[changed]


def vehicle_counts(recording: Recording) -> pd.Series:
    """Return the number of vehicles by period.

    Parameters
    ----------
    recording : Recording
        Any recording; one of only some vehicles does not count the traffic.

    Returns
    -------
    pandas.Series
        Number of vehicles, indexed by period.
    """
    table = recording.table.drop_duplicates([c.PERIOD, c.VEHICLE])
    return table.groupby(c.PERIOD, observed=True).size().reindex(recording.periods)
