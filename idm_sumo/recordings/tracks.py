"""Tracks of a data set, along and across its road in SI units, to a :class:`Recording`.

What a reader of a data set brings is a table with a row a vehicle and moment: how far along the road, in which lane,
how far from the lane's middle. From there on all data sets are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.coercion import EARTH, IMPOSSIBLE, LATEST, LONGEST, WIDEST, drop_impossible, sizes
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.identities import vehicle_numbers
from idm_sumo.recordings.leaders import row_ahead, row_of
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.resampling import resample
from idm_sumo.roads import Road
from idm_sumo.roads.straight import FREE, Lanes, straight_road
from idm_sumo.runtime.errors import InputError

OFFSET = "offset"  # column of a table of tracks: m, left of the lane's middle
NEEDED = (c.PERIOD, c.VEHICLE, c.TIME, c.X, c.LANE, OFFSET)
NOT_FINITE = "non-finite value"


@dataclass(frozen=True)
class Tracks:
    """What a data set tells.

    Attributes
    ----------
    table : pandas.DataFrame
        ``period`` (label), ``vehicle`` (number or label), ``time`` (s), ``x`` (front, m, downstream), ``lane``
        (1 leftmost, 0 beside the main lanes), ``offset`` (m, left of the lane's middle); ``speed, acceleration,
        length, width, vehicle_class`` and ``leader`` (as vehicles are named) where they are recorded.
    widths : sequence of float
        Widths of the main lanes (m), leftmost first.
    name : str
        Of the road.
    speed_limit : float
        m/s; NaN where it is not known.
    notes : tuple of str
        What was assumed.
    has_signals : bool
        Whether traffic lights stop the vehicles.
    """

    table: pd.DataFrame
    widths: Sequence[float]
    name: str
    speed_limit: float = float("nan")
    notes: tuple[str, ...] = field(default=())
    has_signals: bool = False


def with_lanes(table: pd.DataFrame, lanes: Lanes) -> pd.DataFrame:
    """Return a table with the lane and the offset of each row."""
    return table.assign(**{c.LANE: lanes.number, OFFSET: lanes.offset})


def to_recording(
    tracks: Tracks, ledger: Ledger, *, source: str, road: Road | None = None
) -> tuple[Recording, Accounting]:
    """Turn tracks into a recording with a row every 0.1 s.

    Parameters
    ----------
    tracks : Tracks
    ledger : Ledger
        The rows read so far; every row is booked as used, dropped or added.
    source : str
        Name for messages.
    road : Road, optional
        What was recorded; by default a straight road of the tracks' lanes, as long as the tracks.

    Raises
    ------
    InputError
        If nothing can be used, units are impossible, or the road has fewer lanes than the tracks.
    """
    notes = list(tracks.notes)
    table = _finite(tracks.table, ledger, source)
    before = table[[c.PERIOD, c.VEHICLE]].drop_duplicates()
    table = _numbered(table, notes, source)
    first = float(table[c.X].min())
    if road is None:
        table = table.assign(**{c.X: table[c.X] - first})
        road = _road(tracks, table, notes)
        if abs(first) > FRAME_STEP:
            notes.append(f"x is counted from the first position of the file, {first:.1f} m")
    table = _placed(table, road, source)
    table = resample(table, ledger, source)
    table = drop_impossible(_complete(table, road, notes), ledger, road, source)
    table = table.assign(**{c.LEADER: _consistent_leaders(table, notes)})
    recording = Recording.from_table(table, road=road, source=source, notes=tuple(dict.fromkeys(notes)))
    lost = len(before) - recording.vehicle_count
    gone = {"no row left": lost} if lost > 0 else {}
    return recording, ledger.close(len(recording.table), vehicles=recording.vehicle_count, vehicles_dropped=gone)


def _finite(table: pd.DataFrame, ledger: Ledger, source: str) -> pd.DataFrame:
    numbers = table[[c.TIME, c.X, OFFSET]].to_numpy(np.float64)
    table = ledger.drop(table, ~np.isfinite(numbers).all(axis=1) | table[c.VEHICLE].isna().to_numpy(), NOT_FINITE)
    sound = table[c.TIME].between(-LATEST, LATEST) & table[c.X].between(-EARTH, EARTH)
    table = ledger.drop(table, ~sound, IMPOSSIBLE)
    if table.empty:
        raise InputError(f"{source}: no rows left of {ledger.total} read ({ledger.dropped})")
    return table


def _numbered(table: pd.DataFrame, notes: list[str], source: str) -> pd.DataFrame:
    """Return the table with numbers for vehicles and leaders."""
    number = vehicle_numbers(table[c.VEHICLE], notes, source)
    out = table.assign(**{c.VEHICLE: table[c.VEHICLE].map(number).astype(np.int64)})
    if c.LEADER in table:
        out[c.LEADER] = table[c.LEADER].map(number).fillna(0).astype(np.int64)
    if isinstance(table[c.PERIOD].dtype, pd.CategoricalDtype):
        return out
    return out.assign(**{c.PERIOD: pd.Categorical(table[c.PERIOD].astype(str))})


def _road(tracks: Tracks, table: pd.DataFrame, notes: list[str]) -> Road:
    limit = tracks.speed_limit
    if not np.isfinite(limit):
        speed = table[c.SPEED] if c.SPEED in table else _speeds(table)
        limit = float(speed.quantile(FREE))
        notes.append(
            f"no speed limit is recorded; {limit:.1f} m/s, which {1 - FREE:.0%} of the rows exceed, is taken for the "
            "desired speed (--desired-speed gives another)"
        )
    road = straight_road(
        tracks.name, tracks.widths, length=float(table[c.X].max()), speed_limit=max(limit, 1.0),
        beside=bool((table[c.LANE] == 0).any()),
    )  # fmt: skip
    return replace(road, has_signals=tracks.has_signals)


def _speeds(table: pd.DataFrame) -> pd.Series:
    ordered = table.sort_values([c.PERIOD, c.VEHICLE, c.TIME], kind="stable")
    steps = ordered.groupby([c.PERIOD, c.VEHICLE], observed=True)[[c.X, c.TIME]].diff()
    return (steps[c.X] / steps[c.TIME].where(steps[c.TIME] > 0)).dropna()


def _placed(table: pd.DataFrame, road: Road, source: str) -> pd.DataFrame:
    """Return the table with ``y`` (m) on the road; who is beside its main lanes gets the lane after them."""
    lane = table[c.LANE].to_numpy(np.int64)
    if (most := int(lane.max())) > road.last_lane:
        raise InputError(
            f"{source}: has lane {most}, {road.name} has {road.main_lanes}: it was recorded on another road"
        )
    beside = road.main_lanes + 1
    if (lane == 0).any() and road.last_lane < beside:
        raise InputError(f"{source}: has rows beside the main lanes, where {road.name} has no lane")
    lane = np.where(lane > 0, lane, beside)
    return table.assign(**{c.LANE: lane, c.Y: road.lane_center(lane) + table[OFFSET].to_numpy()})


def _complete(table: pd.DataFrame, road: Road, notes: list[str]) -> pd.DataFrame:
    """Return the table with every column of a recording; what was not recorded is derived or unknown."""
    same = _follows(table)
    for name, origin in ((c.SPEED, c.X), (c.ACCELERATION, c.SPEED)):
        if name not in table:
            values = table[origin].to_numpy(np.float64)
            rate = pd.Series(np.gradient(values, FRAME_STEP) if len(values) > 1 else 0.0, table.index)
            edge = ~same | ~np.append(same[1:], False)
            back = (table[origin].diff() / FRAME_STEP).where(same).bfill(limit=1).fillna(0.0)
            table = table.assign(**{name: rate.where(~edge, back)})
            notes.append(f"{name} is a difference of {origin}, because it is not recorded")
    if (backwards := table[c.SPEED] < 0).any():
        table = table.assign(**{c.SPEED: table[c.SPEED].where(table[c.SPEED] < -1.0, table[c.SPEED].clip(lower=0.0))})
        notes.append(f"{int(backwards.sum())} rows have a speed below 0; 0 is taken where it is above -1 m/s")
    for name, bounds in ((c.LENGTH, LONGEST), (c.WIDTH, WIDEST)):
        size = table[name].to_numpy(np.float64) if name in table else np.full(len(table), np.nan)
        table[name] = sizes(size, name, bounds, notes)
    missing = [name for name in (c.LENGTH, c.WIDTH) if table[name].isna().all()]
    if missing:
        assumed = {c.LENGTH: road.car_length, c.WIDTH: road.car_width}
        notes.append("not recorded, assumed: " + ", ".join(f"{name} {assumed[name]:g} m" for name in missing))
    defaults = {c.CLASS: 0, c.LEADER: 0, c.HEADWAY: np.nan, c.HEADING: 0.0}
    table = table.assign(**{name: value for name, value in defaults.items() if name not in table})
    return table[list(c.ALL)]


def _follows(table: pd.DataFrame) -> npt.NDArray[np.bool_]:
    codes = table[c.PERIOD].cat.codes.to_numpy()
    same = (np.diff(table[c.VEHICLE].to_numpy()) == 0) & (np.diff(codes) == 0) & (np.diff(table[c.FRAME]) == 1)
    return np.concatenate([[False], same])


def _consistent_leaders(table: pd.DataFrame, notes: list[str]) -> npt.NDArray[np.int64]:
    """Return the recorded leaders and say in how many rows they are those next ahead by lane and position."""
    leader = np.asarray(table[c.LEADER], dtype=np.int64)
    if not (leader > 0).any():
        notes.append("leaders are not recorded: they are rebuilt from lanes and positions")
        return leader
    ahead, told = row_ahead(table), row_of(table, leader)
    both = (ahead >= 0) & (told >= 0)
    if both.any():
        share = float((ahead == told)[both].mean())
        notes.append(f"recorded leaders are those next ahead by lane and position in {share:.1%} of {both.sum()} rows")
    return leader
