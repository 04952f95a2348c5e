"""Leader-follower pairs, one row a pair and moment, to a :class:`~idm_sumo.recordings.recording.Recording`.

Every pair is a world of its own: of its followers only the leader is known, and whoever drives
in another pair is nobody's traffic.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.coercion import LATEST, drop_impossible, numbers, whole
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.readers.layouts import PAIR_LENGTHS, PAIR_NUMBERS, PAIRS
from idm_sumo.recordings.readers.pair_names import completed, driven
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.resampling import resample
from idm_sumo.recordings.smoothing import filter_runs, runs, smoothness
from idm_sumo.roads import Road
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.errors import InputError

__all__ = ["driven", "to_recording"]

LENGTH, SPACING = PAIR_LENGTHS  # one of them tells the other
GRID_TOLERANCE = 0.02  # s, between a row's time and its frame
SPACING_TOLERANCE = 0.1  # m, between the stated gap and the one of positions and length
CAR_LENGTHS = (3.0, 7.5)  # m, between which the median of vehicles lies; in feet it is 10 to 25


def to_recording(raw: pd.DataFrame, ledger: Ledger, *, road: Road, source: str) -> tuple[Recording, Accounting]:
    """Turn a table of pairs into a recording of the followers, each with its leader's headway and length.

    Parameters
    ----------
    raw : pandas.DataFrame
        ``follower, leader`` (numbers), ``t`` (s, 0.1 s apart), ``x_follower, x_leader`` (fronts), ``leader_length`` or
        ``spacing`` (bumper to bumper) or both; ``period, v_follower, a_follower`` where there are any. Lengths in feet
        or metres, told by the leaders' lengths.
    ledger : Ledger
        Empty; every row is booked as used or dropped.
    road : Road
        Lateral positions are unknown: everybody is put in the middle of its main lanes.
    source : str
        Name for messages.

    Raises
    ------
    InputError
        If units or time steps are none we know, or the columns contradict each other.
    """
    ledger.total += len(raw)
    told: list[str] = []
    raw = completed(raw, told, source)
    period = raw["period"].where(raw["period"].notna(), "(none)").astype(str) if "period" in raw else "recording"
    raw = raw.assign(period=period)
    raw = raw.assign(**{name: numbers(raw[name], name, source) for name in PAIR_NUMBERS if name in raw})
    finite = [name for name in (*PAIRS, LENGTH, SPACING, "v_follower") if name in raw]
    raw = ledger.drop(raw, ~np.isfinite(raw[finite].to_numpy()).all(axis=1), "non-finite value")
    raw = ledger.drop(raw, ~raw["t"].between(-LATEST, LATEST), "impossible time, position or acceleration")
    _check_not_empty(raw, ledger, source)
    raw = raw.assign(**{name: whole(raw[name], name, source, low=0) for name in ("follower", "leader")})
    raw = _every_frame(raw, ledger, source)
    unit, unit_name = _unit(raw, source)
    table = drop_impossible(_table(raw, unit, road, source), ledger, road, source)
    table = ledger.drop(table, ~(table[c.HEADWAY] > 0), "leader not ahead")
    table = ledger.drop(table, table.duplicated(list(c.KEYS)), "duplicate frame of a vehicle")
    lengths = _lengths(table)
    own = [lengths.get(key, np.nan) for key in zip(table[c.PERIOD].astype(str), table[c.VEHICLE], strict=True)]
    if "follower_length" in raw:
        own = raw["follower_length"].loc[table.index] * unit
    _check_not_empty(table, ledger, source)
    recording = Recording.from_table(table.assign(**{c.LENGTH: own}), road=road, source=source, has_leader_rows=False)
    pairs = table.drop_duplicates([c.PERIOD, c.VEHICLE, c.LEADER])
    notes = (
        f"{len(pairs)} leader-follower pairs in {unit_name}: each follower sees its leader and nobody else; what needs "
        "a second leader, a neighbour or a rear vehicle cannot be tested",
        "lateral positions are unknown: everybody is put in the middle lane",
        "the length of leaders is recorded, that of followers only where they lead another pair"
        if "follower_length" not in raw else "the lengths of both are recorded",
        *told,
    )  # fmt: skip
    recording = smoothness(replace(recording, notes=notes, leader_lengths=lengths))
    return recording, ledger.close(len(recording.table), vehicles=recording.vehicle_count)


def _every_frame(raw: pd.DataFrame, ledger: Ledger, source: str) -> pd.DataFrame:
    """Return pairs with a row every 0.1 s, by the rule of :mod:`idm_sumo.recordings.resampling`."""
    steps = raw.sort_values(["period", "follower", "t"], kind="stable").groupby(["period", "follower"])["t"].diff()
    step = float(steps[steps > 0].median()) if (steps > 0).any() else FRAME_STEP
    if abs(step - FRAME_STEP) <= GRID_TOLERANCE:
        return raw
    names = {"period": c.PERIOD, "follower": c.VEHICLE, "t": c.TIME}
    table = raw.rename(columns=names).assign(**{c.PERIOD: pd.Categorical(raw["period"])})
    places = tuple(name for name in ("x_follower", "x_leader", SPACING) if name in raw)
    rates = tuple(name for name in ("v_follower", "a_follower") if name in raw)
    table = resample(table, ledger, source, positions=places, rates=rates, run_of="leader")
    back = {new: old for old, new in names.items()}
    # A period's frames are counted from its first row; so are the times, which may lie between frames of 0 s.
    table = table.rename(columns=back).assign(t=table[c.FRAME] * FRAME_STEP)
    return table.assign(period=table["period"].astype(str)).drop(columns=c.FRAME)


def _check_not_empty(raw: pd.DataFrame, ledger: Ledger, source: str) -> None:
    if raw.empty:
        raise InputError(f"{source}: no rows left of {ledger.total} read; give pairs with at least one row")


def _unit(raw: pd.DataFrame, source: str) -> tuple[float, str]:
    """Return metres per unit of length, by the median length of the leaders: a car is 4.5 m or 14.8 ft long."""
    length = raw[LENGTH] if LENGTH in raw else raw["x_leader"] - raw["x_follower"] - raw[SPACING]
    median = float(length.groupby([raw["period"], raw["leader"]]).first().median())
    for unit, name in ((1.0, "metres"), (FOOT, "feet")):
        if CAR_LENGTHS[0] <= median * unit <= CAR_LENGTHS[1]:
            return unit, name
    raise InputError(
        f"{source}: the median leader is {median:.1f} long, neither metres (about 4.5) nor feet (about "
        f"15); convert to metres"
    )


def _table(raw: pd.DataFrame, unit: float, road: Road, source: str) -> pd.DataFrame:
    """Return the followers' rows in SI units, with a column of the leaders' lengths beside those of a recording."""
    frame = np.round(raw["t"].to_numpy() / FRAME_STEP).astype(np.int64)
    if (off := np.abs(raw["t"] - frame * FRAME_STEP) > GRID_TOLERANCE).any():
        row = raw[off].iloc[0]
        raise InputError(
            f"{source}: follower {row['follower']:.0f}, t = {row['t']:g} s is no multiple of 0.1 s; resample it"
        )
    lane = (road.main_lanes + 1) // 2
    front, leader = raw["x_follower"] * unit, raw["x_leader"] * unit
    length = raw[LENGTH] * unit if LENGTH in raw else leader - front - raw[SPACING] * unit
    _check_spacing(raw, leader - front - length, unit, source)
    table = pd.DataFrame({
        c.PERIOD: pd.Categorical(raw["period"]), c.VEHICLE: raw["follower"], c.FRAME: frame,
        c.TIME: raw["t"] + raw["period"].map(_clock), c.X: front, c.Y: float(road.lane_center(lane)), c.HEADING: 0.0,
        c.LENGTH: np.nan, c.WIDTH: np.nan, c.CLASS: 0, c.LANE: lane, c.LEADER: raw["leader"],
        c.HEADWAY: leader - front, LENGTH: length,
    })  # fmt: skip
    table = table.assign(order=np.arange(len(table))).sort_values(list(c.KEYS), kind="stable")
    _, speed, acceleration = filter_runs(table[c.X].to_numpy(), *runs(table))
    table = table.assign(**{c.SPEED: np.maximum(speed, 0.0), c.ACCELERATION: acceleration}).sort_values("order")
    for name, recorded in ((c.SPEED, "v_follower"), (c.ACCELERATION, "a_follower")):
        if recorded in raw:
            values = raw[recorded].to_numpy(np.float64) * unit
            table[name] = np.where(np.isfinite(values), values, table[name])
    _check_speed(table, speed_of=np.sort(speed), source=source)
    return table.drop(columns="order")


def _check_spacing(raw: pd.DataFrame, gap: pd.Series, unit: float, source: str) -> None:
    if LENGTH in raw and SPACING in raw:
        apart = float((raw[SPACING] * unit - gap).abs().median())
        if apart > SPACING_TOLERANCE:
            raise InputError(
                f"{source}: spacing differs from x_leader - x_follower - leader_length by {apart:.2f} m; "
                f"x must be fronts, "
                "spacing bumper to bumper"
            )


def _check_speed(table: pd.DataFrame, *, speed_of: npt.NDArray[np.float64], source: str) -> None:
    """Compare the median recorded speed with that of the positions."""
    recorded, driven = float(table[c.SPEED].median()), float(np.median(speed_of))
    if driven > 1.0 and not 0.5 < recorded / driven < 2.0:
        raise InputError(
            f"{source}: v_follower is {recorded / driven:.2f} times what x_follower advances; both must have one unit"
        )


def _clock(period: str) -> float:
    """Return when a period such as ``0400-0415`` begins (s), so that periods keep their order; 0 without a clock."""
    start = period[:4]
    return 3600.0 * int(start[:2]) + 60.0 * int(start[2:]) if len(start) == 4 and start.isdigit() else 0.0


def _lengths(table: pd.DataFrame) -> dict[tuple[str, int], float]:
    """Return the length (m) of every leader by period and number; the median where rows disagree."""
    length = table.groupby([c.PERIOD, c.LEADER], observed=True)[LENGTH].median()
    return {(str(period), int(leader)): float(value) for (period, leader), value in length.items() if value > 0}
