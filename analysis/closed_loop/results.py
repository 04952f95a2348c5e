"""Tables, pictures and page of a closed loop."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.evaluation.comparison import RECORDING, Comparison
from idm_sumo.recordings.recording import Recording
from idm_sumo.sumo.closed_loop.measurement import Measured, glimpse_of

from ..comparison.figures import lane_change_map, overview, time_space
from ..comparison.run import shown
from ..page.page import not_measured, render
from ..page.style import save
from ..page.time_space import diagrams_of
from ..reproduce.replay_bias import in_words
from . import words
from .settings import Case, Settings
from .words import POPULATION, RECORDED

FIRST = [
    "population",
    "seed",
    "vehicles",
    "mean_speed_m_s",
    "flow_veh_h",
    "density_veh_km",
    "travel_time_s",
    "gap_m",
    "time_headway_s",
    "lane_changes_per_km",
    "lane_changes_sumo_per_km",
    "wave_speed_m_s",
    "late",
    "largest_delay_s",
    "mean_delay_s",
    "never_inserted",
    "collisions",
    "emergency_brakings",
    "teleports",
    "flow_error_share",
    "speed_profile_rmse_m_s",
    "rank",
]
INSERTION = {
    "late": "inserted late",
    "largest_delay_s": "largest delay (s)",
    "mean_delay_s": "mean delay (s)",
    "never_inserted": "never inserted",
    "collisions": "collisions, at fault or not",
    "emergency_brakings": "emergency brakings",
    "teleports": "teleports",
}


def closed_loop_table(comparison: Comparison, measured: list[tuple[Case, Measured]]) -> pd.DataFrame:
    """Return ``tables/closed_loop.csv``.

    The recording's row comes first, then one row a population and seed.

    Parameters
    ----------
    comparison : Comparison
    measured : list of (Case, Measured)

    Returns
    -------
    pandas.DataFrame
        Columns of :func:`idm_sumo.evaluation.comparison.compare`'s summary, and ``population, seed, late``
        (vehicles inserted later than recorded, or never), ``largest_delay_s, mean_delay_s`` (over all
        vehicles), ``never_inserted, collisions, emergency_brakings, teleports``, ``lane_changes_sumo_per_km`` (by
        SUMO's own count, changes that are taken back at once included), ``flow_error_share`` (of the
        recorded flow), ``speed_profile_rmse_m_s`` (of mean speeds by position), and the population's ``rank``.
    """
    rows: list[dict[str, Any]] = [{POPULATION: RECORDED, RECORDING: RECORDED}]
    for case, m in measured:
        delays = m.outcome.departures["delay_s"]
        rows.append(
            {
                POPULATION: case.population,
                RECORDING: case.name,
                "seed": case.seed or 1,
                "late": len(m.outcome.late),
                "largest_delay_s": float(delays.max()),
                "mean_delay_s": float(delays.mean()),
                "never_inserted": int(m.outcome.departures["departed_s"].isna().sum()),
                **asdict(m.outcome.incidents),
                "lane_changes_sumo_per_km": m.outcome.lane_changes / float(m.measured.lane_changes["km"].sum()),
            }
        )
    table = pd.DataFrame(rows).merge(comparison.summary, on=RECORDING, validate="1:1")
    table["flow_error_share"] = table["flow_veh_h"] / table["flow_veh_h"].iloc[0] - 1.0
    table.loc[0, "flow_error_share"] = np.nan
    table["rank"] = table[POPULATION].map(words.ranking(table).set_index(POPULATION)["rank"])
    return table[[*FIRST, *(name for name in table if name not in (*FIRST, RECORDING))]]


def write_results(
    part: Path,
    table: pd.DataFrame,
    comparison: Comparison,
    measured: list[tuple[Case, Measured]],
    bias: pd.DataFrame,
    recorded: Recording,
    demand: pd.DataFrame,
    settings: Settings,
) -> None:
    """Write tables, pictures and page below ``part``.

    Parameters
    ----------
    part : Path
    table : pandas.DataFrame
        Of :func:`closed_loop_table`.
    comparison : Comparison
    measured : list of (Case, Measured)
    bias : pandas.DataFrame
        Replay bias; empty if it was not asked for.
    recorded : Recording
    demand : pandas.DataFrame
    settings : Settings
    """
    tables, figures = part / "tables", part / "figures"
    tables.mkdir()
    figures.mkdir()
    ranks = words.ranking(table)
    fields = pd.concat({key: p.fields for key, p in comparison.measures.items()}, names=[RECORDING]).reset_index(
        level=0
    )
    late = pd.concat({case.name: m.outcome.late for case, m in measured}, names=[POPULATION]).reset_index(level=0)
    for name, content in (
        ("closed_loop", table),
        ("ranking", ranks),
        ("replay_bias", bias),
        ("fields", fields),
        ("late_departures", late),
    ):
        if len(content.columns):
            content.to_csv(tables / f"{name}.csv", index=False, float_format="%.6g")
    ego = measured[0][1].outcome.ego
    if ego is not None:
        ego.to_csv(tables / "ego.csv", index=False, float_format="%.6g")
    glimpses = {RECORDED: glimpse_of(recorded)} | {
        case.population: m.glimpse for case, m in measured if m.glimpse is not None
    }
    save(overview(comparison), figures / "comparison.png")
    save(time_space(glimpses), figures / "time_space.png")
    save(lane_change_map(comparison), figures / "lane_changes.png")
    measures, distances = shown(comparison)
    render(
        part / "report.html",
        "closed_loop/report.html.j2",
        title=f"Closed loop: {Path(settings.recording).name}, {recorded.periods[0]}",
        figures=figures,
        not_measured=not_measured({Path(settings.recording).name: recorded}),
        findings=words.in_words(table),
        setup=_setup(settings, demand, measured),
        measures=measures,
        distances=distances,
        ranks=ranks.replace({"disqualified": {"": "–"}}),
        diagrams=diagrams_of(glimpses),
        insertion=table[table[POPULATION] != RECORDED][["population", "seed", *INSERTION]].rename(columns=INSERTION),
        bias=bias if len(bias) else None,
        bias_words=in_words(bias),
        notes=[*recorded.notes, *comparison.notes],
    )


def _setup(settings: Settings, demand: pd.DataFrame, measured: list[tuple[Case, Measured]]) -> str:
    """Say what the run was; every number computed."""
    duration = measured[0][0].files.duration
    boundary = (
        "The recorded speeds at the end of the section, lane by lane and smoothed over 7 s, are imposed as "
        "speed limits on the 300 m behind it: "
        "what holds recorded traffic up lies downstream of the section, and without that a closed loop runs free. "
        if settings.downstream_speed
        else "Nothing is imposed downstream of the section, so the bottleneck that held the recorded traffic "
        "up is missing. "
    )
    places = (
        "On every edge the desired speed is at most that of drivers whom no leader held up there. "
        if settings.place_speeds
        else ""
    )
    pooled = "; ".join(
        f"{case.name}: {case.pooled} of {len(demand)}"
        for case, _ in measured
        if case.population in ("drivers", "predicted")
    )
    ego = f"Vehicle {settings.ego} is driven by our own IDM, steering and bicycle. " if settings.ego is not None else ""
    return (
        f"{len(demand)} recorded vehicles over {duration / 60:.1f} minutes depart in their lane, at their speed, so "
        "early on up to 200 m before the section that they could arrive when they were recorded, with their route, "
        f"length and class, and then react. {boundary}{places}Lane changes by SUMO's {settings.lane_change_model}, "
        f"equal for all populations. {ego}"
        + (
            f"Vehicles without a calibration of their own, which have the pooled parameters: {pooled}."
            if pooled
            else ""
        )
    )
