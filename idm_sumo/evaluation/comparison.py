"""Comparison of recordings with a reference, measure by measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation import macroscopic as m
from idm_sumo.evaluation.distances import RESAMPLES, Sample, distance
from idm_sumo.evaluation.traffic_measures import TrafficMeasures, measure_traffic
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent

ALL_PERIODS = "all"
RECORDING = "recording"
ACCEPTABLE_GEH = 5.0
# Distributions that are compared: column, unit, and the value beyond which values count as equal.
DISTRIBUTIONS = {
    "gap": ("gap_m", "m", 100.0), "time_headway": ("time_headway_s", "s", 10.0),
    "travel_time": ("travel_time_s", "s", 300.0),
    "speed": ("speed_m_s", "m_s", 30.0),
}  # fmt: skip


@dataclass(frozen=True)
class Comparison:
    """Recordings compared with the first of them.

    Attributes
    ----------
    measures : dict of str to TrafficMeasures
        By name, the reference first.
    summary : pandas.DataFrame
        One row a recording and period, see :func:`compare`.
    notes : tuple of str
        What could not be measured, and why.
    """

    measures: dict[str, TrafficMeasures]
    summary: pd.DataFrame
    notes: tuple[str, ...]

    @property
    def reference(self) -> str:
        """Name of the recording with which the others are compared."""
        return next(iter(self.measures))


def compare(
    recordings: Mapping[str, Recording], *, seed: int = 1, resamples: int = RESAMPLES, progress: Progress = silent
) -> Comparison:
    """Measure recordings and compare them with the first.

    Periods are matched by label where all labels of a recording occur in the reference, else by order.

    Parameters
    ----------
    recordings : mapping of str to Recording
        By name, the reference first.
    seed : int
        For the bootstrap.
    resamples : int
        Bootstrap draws.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    Comparison
        Its summary has ``recording, period`` (the reference's label; ``all`` where there are several) and

        ``vehicles``, ``mean_speed_m_s``, ``flow_veh_h``, ``density_veh_km``
            number of vehicles; Edie's speed, flow and density of all main lanes over section and period.
        ``travel_time_s``, ``gap_m``, ``time_headway_s``
            median travel time between stations; medians over vehicles and seconds.
        ``lane_changes_per_km``, ``merges``, ``exits``
            changes between main lanes per vehicle-km; vehicles from and to the auxiliary lane.
        ``wave_speed_m_s``, ``wave_lanes``
            median over the lanes (and periods) with a wave, and their number.
        ``<measure>_wasserstein_<unit>``, ``<measure>_ks``, with ``_low`` and ``_high``
            distances from the reference with their 95 % bootstrap interval over vehicles, for gap, time
            headway, travel time and speed.
        ``speed_rmse_m_s``, ``flow_rmse_veh_h``, ``density_rmse_veh_km``
            root mean square differences from the reference by minute, lane and segment.
        ``geh_below_5_share``
            share of lanes and minutes whose flows differ by a :func:`geh` below 5.
        ``speed_profile_rmse_m_s``
            root mean square difference of the mean speed by position.

        Distances and differences of the reference from itself are NaN.

    Raises
    ------
    InputError
        If there are fewer than two recordings.
    """
    if len(recordings) < 2:
        raise InputError("a comparison needs two recordings; name another one")
    measures = {}
    for number, (name, recording) in enumerate(recordings.items()):
        progress("measuring", number, len(recordings))
        measures[name] = measure_traffic(recording)
    progress("measuring", len(recordings), len(recordings))
    return compare_measures(measures, seed=seed, resamples=resamples)


def compare_measures(measures: dict[str, TrafficMeasures], *, seed: int = 1, resamples: int = RESAMPLES) -> Comparison:
    """Compare recordings that have been measured.

    Parameters
    ----------
    measures : dict of str to TrafficMeasures
        By name, the reference first.
    seed : int
        For the bootstrap.
    resamples : int
        Bootstrap draws.

    Returns
    -------
    Comparison
        As :func:`compare` returns it.
    """
    reference = next(iter(measures.values()))
    rng = np.random.default_rng(seed)
    rows = []
    for name, measured in measures.items():
        pairs = [(own, [own], [theirs]) for own, theirs in matched_periods(reference.periods, measured.periods)]
        if len(pairs) > 1:
            pairs.append((ALL_PERIODS, [p[1][0] for p in pairs], [p[2][0] for p in pairs]))
        for label, own, theirs in pairs:
            figures = {RECORDING: name, c.PERIOD: label, **_figures(measured, theirs)}
            if measured is not reference:
                figures |= _distances(reference, own, measured, theirs, rng, resamples)
                figures |= _field_differences(reference, own, measured, theirs)
                figures["speed_profile_rmse_m_s"] = _profile_difference(reference, own, measured, theirs)
            rows.append(figures)
    return Comparison(measures, pd.DataFrame(rows), _notes(measures))


def matched_periods(reference: list[str], other: list[str]) -> list[tuple[str, str]]:
    """Return pairs of matching labels of periods.

    Parameters
    ----------
    reference, other : list of str
        Labels in order of time.

    Returns
    -------
    list of (str, str)
        Equal labels where all of ``other`` occur in the reference, else pairs in their order.
    """
    if set(other) <= set(reference):
        return [(label, label) for label in other]
    return list(zip(reference, other, strict=False))


def _of(table: pd.DataFrame, periods: list[str]) -> pd.DataFrame:
    return table[table[c.PERIOD].isin(periods)]


def _figures(measured: TrafficMeasures, periods: list[str]) -> dict[str, float]:
    """Return the measures of a recording by itself."""
    fields, changes = _of(measured.fields, periods), _of(measured.lane_changes, periods)
    fields = fields[fields[c.LANE] <= measured.road.main_lanes]
    waves = _of(measured.waves, periods)["wave_speed_m_s"].dropna()
    follow = _of(measured.following, periods)
    flow, density = _flow_and_density(fields)
    return {
        "vehicles": int(measured.counts[periods].sum()),
        "mean_speed_m_s": float(np.average(fields[m.MEAN_SPEED], weights=fields[m.SAMPLES])),
        "flow_veh_h": flow, "density_veh_km": density,
        "travel_time_s": float(_of(measured.travel_times, periods)["travel_time_s"].median()),
        "gap_m": float(follow["gap_m"].median()), "time_headway_s": float(follow["time_headway_s"].median()),
        "lane_changes_per_km": float(changes["changes"].sum() / changes["km"].sum()),
        "merges": int(changes["merges"].sum()), "exits": int(changes["exits"].sum()),
        "wave_speed_m_s": float(waves.median()) if len(waves) else np.nan, "wave_lanes": len(waves),
    }  # fmt: skip


def _flow_and_density(fields: pd.DataFrame) -> tuple[float, float]:
    """Return flow (1/h) and density (1/km) of all main lanes.

    The mean is over segments and minutes.
    """
    across = fields.groupby([c.PERIOD, m.MINUTE, m.SEGMENT], observed=True)[[m.FLOW, m.DENSITY]].sum(min_count=1)
    return float(across[m.FLOW].mean()), float(across[m.DENSITY].mean())


def _distances(
    reference: TrafficMeasures,
    own: list[str],
    other: TrafficMeasures,
    theirs: list[str],
    rng: np.random.Generator,
    resamples: int,
) -> dict[str, float]:
    """Return the distances of all distributions."""
    found: dict[str, float] = {}
    for name, (column, unit, upper) in DISTRIBUTIONS.items():
        samples = [_sample(measured, periods, column) for measured, periods in ((reference, own), (other, theirs))]
        values = distance(*samples, upper=upper, rng=rng, resamples=resamples)
        for key, value in values._asdict().items():
            kind, _, end = key.partition("_")
            middle = f"{kind}_{unit}" if kind == "wasserstein" else kind
            found[f"{name}_{middle}" + (f"_{end}" if end else "")] = value
    return found


def _sample(measured: TrafficMeasures, periods: list[str], column: str) -> Sample:
    table = _of(measured.travel_times if column == "travel_time_s" else measured.following, periods)
    table = table[np.isfinite(table[column])]
    vehicle = table.groupby([c.PERIOD, c.VEHICLE], observed=True, sort=False).ngroup()
    return Sample(table[column].to_numpy(np.float64), vehicle.to_numpy(np.int64))


def _field_differences(
    reference: TrafficMeasures, own: list[str], other: TrafficMeasures, theirs: list[str]
) -> dict[str, float]:
    """Return root mean square differences of flow, density and speed.

    They are taken by minute, lane and segment; with them the share of lanes and minutes with an acceptable GEH.
    """
    keys = [c.PERIOD, m.MINUTE, c.LANE, m.SEGMENT]
    renamed = other.fields[other.fields[c.PERIOD].isin(theirs)]
    renamed = renamed.assign(**{c.PERIOD: renamed[c.PERIOD].astype(str).map(dict(zip(theirs, own, strict=True)))})
    ours = _of(reference.fields, own)
    both = ours.assign(**{c.PERIOD: ours[c.PERIOD].astype(str)}).merge(
        renamed, on=keys, how="outer", suffixes=("", "_o")
    )
    both = both[both[c.LANE] <= reference.road.main_lanes]
    if not reference.partial and not other.partial:  # a region without vehicles has zero flow and density, and no speed
        both = both.fillna({name + end: 0.0 for name in (m.FLOW, m.DENSITY) for end in ("", "_o")})
    names = {m.MEAN_SPEED: "speed_rmse_m_s", m.FLOW: "flow_rmse_veh_h", m.DENSITY: "density_rmse_veh_km"}
    found = {to: float(np.sqrt(((both[name + "_o"] - both[name]) ** 2).mean())) for name, to in names.items()}
    flows = both.groupby([c.PERIOD, m.MINUTE, c.LANE])[[m.FLOW, f"{m.FLOW}_o"]].mean().dropna()
    below = geh(flows[m.FLOW].to_numpy(), flows[f"{m.FLOW}_o"].to_numpy()) < ACCEPTABLE_GEH
    return found | {"geh_below_5_share": float(below.mean()) if len(below) else np.nan}


def geh(one: npt.ArrayLike, other: npt.ArrayLike) -> npt.NDArray[np.float64]:
    r"""Return the GEH statistic of flows.

    .. math:: \mathrm{GEH} = \sqrt{\frac{2\,(q_1-q_2)^2}{q_1+q_2}}

    Parameters
    ----------
    one, other : array_like
        Hourly flows :math:`q_1, q_2` (1/h).

    Returns
    -------
    float64
        0 where both are zero.

    Notes
    -----
    Below 5 for 85 % of the counts is what FHWA's Traffic Analysis Toolbox III (2004) asks of a calibrated simulation.
    There a count is of an hour; of a minute, chance alone makes larger values.
    """
    first, second = np.asarray(one, dtype=np.float64), np.asarray(other, dtype=np.float64)
    both = first + second
    return np.asarray(np.sqrt(2.0 * (first - second) ** 2 / np.where(both > 0.0, both, 1.0)))


def _profile_difference(reference: TrafficMeasures, own: list[str], other: TrafficMeasures, theirs: list[str]) -> float:
    """Return the RMS difference (m/s) of mean speed profiles."""
    both = [_of(one.positions, periods) for one, periods in ((reference, own), (other, theirs))]
    profiles = [one.groupby(m.SEGMENT)[m.MEAN_SPEED].mean() for one in both]
    return float(np.sqrt(((profiles[1] - profiles[0]) ** 2).mean()))


def _notes(measures: dict[str, TrafficMeasures]) -> tuple[str, ...]:
    """Return notes on what could not be measured."""
    notes = []
    for name, measured in measures.items():
        if measured.partial:
            notes.append(
                f"{name} holds only some of the vehicles: flow, density and counts of the traffic cannot be measured, "
                f"and gaps are its headways minus an assumed leader length of {measured.road.car_length:.1f} m"
            )
            if len(measured.periods) > 1:
                notes.append(
                    f"{name}: its periods differ in size, and {measured.counts.idxmax()} dominates all of them "
                    "together; compare by period"
                )
        missing = int(measured.waves["wave_speed_m_s"].isna().sum())
        if missing:
            notes.append(f"{name}: no wave speed in {missing} of {len(measured.waves)} lanes and periods")
    return tuple(notes)
