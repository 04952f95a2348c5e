"""Two or more recordings held against the first of them, measure by measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from idm_sumo.evaluation import macroscopic as m
from idm_sumo.evaluation.distances import RESAMPLES, Sample, distance
from idm_sumo.evaluation.waves import wave_speeds
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.leaders import row_ahead
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import road
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent

ALL_PERIODS = "all"
RECORDING = "recording"
ONCE_A_SECOND = 10  # frames; the next frame's gap says nothing new
MOVING = 1.0  # m/s, below which a time headway means nothing
# What the distances look at: column, unit, and the value beyond which all are far.
DISTRIBUTIONS = {
    "gap": ("gap_m", "m", 100.0), "time_headway": ("time_headway_s", "s", 10.0), "travel_time": ("travel_time_s", "s", 300.0),
    "speed": ("speed_m_s", "m_s", 30.0),
}  # fmt: skip


@dataclass(frozen=True)
class Portrait:
    """What is measured of one recording; every table has the column ``period``.

    Attributes
    ----------
    fields : pandas.DataFrame
        :func:`idm_sumo.evaluation.macroscopic.edie`.
    positions : pandas.DataFrame
        :func:`idm_sumo.evaluation.macroscopic.speed_by_position`.
    travel_times, lane_changes, waves : pandas.DataFrame
        Of the functions with these names.
    following : pandas.DataFrame
        :func:`following`.
    counts : pandas.Series
        Vehicles by period.
    thin : bool
        Whether it holds a few of the vehicles only.
    """

    fields: pd.DataFrame
    positions: pd.DataFrame
    travel_times: pd.DataFrame
    lane_changes: pd.DataFrame
    waves: pd.DataFrame
    following: pd.DataFrame
    counts: pd.Series
    thin: bool

    @property
    def periods(self) -> list[str]:
        """Labels of the periods, in order of time."""
        return [str(label) for label in self.counts.index]


@dataclass(frozen=True)
class Comparison:
    """Recordings held against the first of them.

    Attributes
    ----------
    portraits : dict of str to Portrait
        By name, the reference first.
    summary : pandas.DataFrame
        One row a recording and period, see :func:`compare`.
    notes : tuple of str
        What could not be had, and why.
    """

    portraits: dict[str, Portrait]
    summary: pd.DataFrame
    notes: tuple[str, ...]

    @property
    def reference(self) -> str:
        """Name of the recording the others are held against."""
        return next(iter(self.portraits))


def compare(
    recordings: Mapping[str, Recording], *, seed: int = 1, resamples: int = RESAMPLES, progress: Progress = silent
) -> Comparison:
    """Measure recordings and hold them against the first.

    Periods belong together by their label where all of a recording's labels are among the reference's,
    else by their order.

    Parameters
    ----------
    recordings : mapping of str to Recording
        By name, the reference first.
    seed : int
        Of the bootstrap.
    resamples : int
        Bootstrap draws.

    Returns
    -------
    Comparison
        Its summary has ``recording, period`` (the reference's label; ``all`` where there are several) and

        ``vehicles``, ``mean_speed_m_s``, ``flow_veh_h``, ``density_veh_km``
            number; Edie's speed, flow and density of the five main lanes together over section and period.
        ``travel_time_s``, ``gap_m``, ``time_headway_s``
            median travel time between stations; medians over vehicles and seconds.
        ``lane_changes_per_km``, ``merges``, ``exits``
            between main lanes, per vehicle-km; vehicles that came from and went to the auxiliary lane.
        ``wave_speed_m_s``, ``wave_lanes``
            median over the lanes (and periods) in which a wave was found, and their number.
        ``<measure>_wasserstein_<unit>``, ``<measure>_ks``, with ``_low`` and ``_high``
            distances from the reference and their 95 % bootstrap interval over vehicles, for gap, time headway,
            travel time and speed.
        ``speed_rmse_m_s``, ``flow_rmse_veh_h``, ``density_rmse_veh_km``
            root mean square differences from the reference by minute, lane and segment.

        Distances and differences of the reference from itself are NaN.

    Raises
    ------
    InputError
        If there are fewer than two recordings.
    """
    if len(recordings) < 2:
        raise InputError("a comparison needs two recordings; name another one")
    portraits = {}
    for number, (name, recording) in enumerate(recordings.items()):
        progress("measuring", number, len(recordings))
        portraits[name] = portray(recording)
    progress("measuring", len(recordings), len(recordings))
    return compare_portraits(portraits, seed=seed, resamples=resamples)


def compare_portraits(portraits: dict[str, Portrait], *, seed: int = 1, resamples: int = RESAMPLES) -> Comparison:
    """Do :func:`compare` with what was measured before."""
    reference = next(iter(portraits.values()))
    rng = np.random.default_rng(seed)
    rows = []
    for name, portrait in portraits.items():
        pairs = [(own, [own], [theirs]) for own, theirs in matched_periods(reference.periods, portrait.periods)]
        if len(pairs) > 1:
            pairs.append((ALL_PERIODS, [p[1][0] for p in pairs], [p[2][0] for p in pairs]))
        for label, own, theirs in pairs:
            figures = {RECORDING: name, c.PERIOD: label, **_figures(portrait, theirs)}
            if portrait is not reference:
                figures |= _distances(reference, own, portrait, theirs, rng, resamples)
                figures |= _field_differences(reference, own, portrait, theirs)
            rows.append(figures)
    return Comparison(portraits, pd.DataFrame(rows), _notes(portraits))


def portray(recording: Recording) -> Portrait:
    """Measure one recording."""
    return Portrait(
        m.edie(recording), m.speed_by_position(recording), m.travel_times(recording), m.lane_changes(recording),
        wave_speeds(recording), following(recording), m.vehicle_counts(recording), not recording.has_leader_rows,
    )  # fmt: skip


def following(recording: Recording) -> pd.DataFrame:
    """Return gaps and time headways once a second.

    The gap is bumper to bumper to the vehicle ahead in the same main lane; in a thin recording the
    recorded headway minus an assumed length of the leader. The time headway is front to front,
    over the follower's speed, above 1 m/s.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, gap_m, time_headway_s, speed_m_s``; NaN without a leader.
    """
    table = recording.table
    main = (table[c.LANE] <= road.MAIN_LANES) & table[c.X].between(0.0, road.SECTION_LENGTH)
    rows = np.flatnonzero(main & (table[c.FRAME] % ONCE_A_SECOND == 0))
    if recording.has_leader_rows:
        ahead = row_ahead(table)[rows]
        x, length = table[c.X].to_numpy(), table[c.LENGTH].fillna(road.CAR_LENGTH).to_numpy()
        headway = np.where(ahead >= 0, x[ahead] - x[rows], np.nan)
        gap = headway - length[ahead]
    else:
        headway = table[c.HEADWAY].to_numpy()[rows]
        gap = headway - road.CAR_LENGTH
    speed = table[c.SPEED].to_numpy()[rows]
    moving = np.where(speed > MOVING, speed, np.nan)
    return pd.DataFrame({
        c.PERIOD: table[c.PERIOD].iloc[rows].astype(str).to_numpy(), c.VEHICLE: table[c.VEHICLE].to_numpy()[rows],
        "gap_m": gap, "time_headway_s": headway / moving, "speed_m_s": speed,
    })  # fmt: skip


def matched_periods(reference: list[str], other: list[str]) -> list[tuple[str, str]]:
    """Return pairs of labels that belong together: the same ones, or in their order."""
    if set(other) <= set(reference):
        return [(label, label) for label in other]
    return list(zip(reference, other, strict=False))


def _of(table: pd.DataFrame, periods: list[str]) -> pd.DataFrame:
    return table[table[c.PERIOD].isin(periods)]


def _figures(portrait: Portrait, periods: list[str]) -> dict[str, float]:
    """Return what a recording is by itself."""
    fields, changes = _of(portrait.fields, periods), _of(portrait.lane_changes, periods)
    fields = fields[fields[c.LANE] <= road.MAIN_LANES]
    waves = _of(portrait.waves, periods)["wave_speed_m_s"].dropna()
    follow = _of(portrait.following, periods)
    flow, density = _flow_and_density(fields)
    return {
        "vehicles": int(portrait.counts[periods].sum()),
        "mean_speed_m_s": float(np.average(fields[m.MEAN_SPEED], weights=fields[m.SAMPLES])),
        "flow_veh_h": flow, "density_veh_km": density,
        "travel_time_s": float(_of(portrait.travel_times, periods)["travel_time_s"].median()),
        "gap_m": float(follow["gap_m"].median()), "time_headway_s": float(follow["time_headway_s"].median()),
        "lane_changes_per_km": float(changes["changes"].sum() / changes["km"].sum()),
        "merges": int(changes["merges"].sum()), "exits": int(changes["exits"].sum()),
        "wave_speed_m_s": float(waves.median()) if len(waves) else np.nan, "wave_lanes": len(waves),
    }  # fmt: skip


def _flow_and_density(fields: pd.DataFrame) -> tuple[float, float]:
    """Return flow (1/h) and density (1/km) of all main lanes together, the mean over segments and minutes."""
    across = fields.groupby([c.PERIOD, m.MINUTE, m.SEGMENT], observed=True)[[m.FLOW, m.DENSITY]].sum(min_count=1)
    return float(across[m.FLOW].mean()), float(across[m.DENSITY].mean())


def _distances(
    reference: Portrait, own: list[str], other: Portrait, theirs: list[str], rng: np.random.Generator, resamples: int
) -> dict[str, float]:
    """Return the distances of all distributions."""
    found: dict[str, float] = {}
    for name, (column, unit, upper) in DISTRIBUTIONS.items():
        samples = [_sample(portrait, periods, column) for portrait, periods in ((reference, own), (other, theirs))]
        values = distance(*samples, upper=upper, rng=rng, resamples=resamples)
        for key, value in values._asdict().items():
            kind, _, end = key.partition("_")
            middle = f"{kind}_{unit}" if kind == "wasserstein" else kind
            found[f"{name}_{middle}" + (f"_{end}" if end else "")] = value
    return found


def _sample(portrait: Portrait, periods: list[str], column: str) -> Sample:
    table = _of(portrait.travel_times if column == "travel_time_s" else portrait.following, periods)
    table = table[np.isfinite(table[column])]
    vehicle = table.groupby([c.PERIOD, c.VEHICLE], observed=True, sort=False).ngroup()
    return Sample(table[column].to_numpy(np.float64), vehicle.to_numpy(np.int64))


def _field_differences(reference: Portrait, own: list[str], other: Portrait, theirs: list[str]) -> dict[str, float]:
    """Return how far flow, density and speed are apart, minute by minute, lane by lane, segment by segment."""
    keys = [c.PERIOD, m.MINUTE, c.LANE, m.SEGMENT]
    renamed = other.fields[other.fields[c.PERIOD].isin(theirs)]
    renamed = renamed.assign(**{c.PERIOD: renamed[c.PERIOD].astype(str).map(dict(zip(theirs, own, strict=True)))})
    ours = _of(reference.fields, own)
    both = ours.assign(**{c.PERIOD: ours[c.PERIOD].astype(str)}).merge(
        renamed, on=keys, how="outer", suffixes=("", "_o")
    )
    both = both[both[c.LANE] <= road.MAIN_LANES]
    if not reference.thin and not other.thin:  # a region where nobody was seen has no flow and no density, but no speed
        both = both.fillna({name + end: 0.0 for name in (m.FLOW, m.DENSITY) for end in ("", "_o")})
    names = {m.MEAN_SPEED: "speed_rmse_m_s", m.FLOW: "flow_rmse_veh_h", m.DENSITY: "density_rmse_veh_km"}
    return {to: float(np.sqrt(((both[name + "_o"] - both[name]) ** 2).mean())) for name, to in names.items()}


def _notes(portraits: dict[str, Portrait]) -> tuple[str, ...]:
    """Say what could not be measured."""
    notes = []
    for name, portrait in portraits.items():
        if portrait.thin:
            notes.append(
                f"{name} holds a few of the vehicles only: flow, density and counts of the traffic cannot be had from it, "
                f"and gaps are its headways minus an assumed leader length of {road.CAR_LENGTH:.1f} m"
            )
            if len(portrait.periods) > 1:
                notes.append(
                    f"{name}: its periods differ in size; over all of them it is mostly {portrait.counts.idxmax()}, so compare by period"
                )
        missing = int(portrait.waves["wave_speed_m_s"].isna().sum())
        if missing:
            notes.append(f"{name}: no wave speed in {missing} of {len(portrait.waves)} lanes and periods")
    return tuple(notes)
