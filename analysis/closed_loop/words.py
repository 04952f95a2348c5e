"""Rank populations by closeness to the recording, in words."""

from __future__ import annotations

import numpy as np
import pandas as pd

POPULATION, RECORDED = "population", "recorded"
DEVIATION = "deviation of "
# Smaller is closer. The GEH and the last three are made here, from the figures themselves.
CLOSENESS = {
    "gap_wasserstein_m": "gaps",
    "time_headway_wasserstein_s": "time headways",
    "travel_time_wasserstein_s": "travel times",
    "speed_wasserstein_m_s": "speeds",
    "speed_rmse_m_s": "speed by minute, lane and segment",
    "flow_rmse_veh_h": "flow by minute, lane and segment",
    "density_rmse_veh_km": "density by minute, lane and segment",
    "speed_profile_rmse_m_s": "mean speed by position",
    "geh_above_5_share": "lanes and minutes with a GEH above 5",
    "late": "vehicles inserted late",
    "emergency_brakings": "emergency brakings",
    f"{DEVIATION}flow_veh_h": "flow",
    f"{DEVIATION}lane_changes_per_km": "lane changes",
    f"{DEVIATION}wave_speed_m_s": "wave speed",
}
# What is said of a figure that is above, and below, the recorded one.
FIGURES = {
    "mean_speed_m_s": ("mean speed", "too high", "too low"),
    "flow_veh_h": ("flow", "too high", "too low"),
    "density_veh_km": ("density", "too high", "too low"),
    "travel_time_s": ("median travel time", "too long", "too short"),
    "gap_m": ("median gap", "too wide", "too narrow"),
    "time_headway_s": ("median time headway", "too long", "too short"),
    "lane_changes_per_km": ("lane changes", "too many", "too few"),
    "wave_speed_m_s": ("wave speed", "too fast", "too slow"),
}
# None of these has happened on the recorded road: a population with one cannot be the closest.
DISQUALIFYING = {
    "never_inserted": "never inserted",
    "collisions": "collisions",
    "teleports": "teleports",
}
MOST_WRONG = 2  # figures named of each population


def ranking(table: pd.DataFrame) -> pd.DataFrame:
    """Rank the populations over all measures, the closest first; those with incidents come after all others.

    Parameters
    ----------
    table : pandas.DataFrame
        ``tables/closed_loop.csv``: one row a population and seed, the recording's first.

    Returns
    -------
    pandas.DataFrame
        ``rank, population, mean_rank, best_in`` (number of measures), ``measures`` (number that could be had),
        ``disqualified`` (why it cannot be the closest, '' where it can).
    """
    means, recorded = _means(table)
    for name in FIGURES:
        means[DEVIATION + name] = (means[name] / recorded[name]).map(
            lambda ratio: abs(np.log(ratio)) if ratio > 0 else np.nan
        )
    means["geh_above_5_share"] = 1.0 - means.get("geh_below_5_share", np.nan)
    # A population without waves or lane changes, where the recording has them, is the farthest.
    known = [
        name
        for name in CLOSENESS
        if means[name].notna().any() or np.isfinite(recorded.get(name.removeprefix(DEVIATION), np.nan))
    ]
    ranks = means[known].rank(na_option="bottom")
    out = pd.DataFrame({"mean_rank": ranks.mean(axis=1), "best_in": (ranks == 1).sum(axis=1), "measures": len(known)})
    out["disqualified"] = [_incidents(means.loc[name]) for name in out.index]
    out = out.assign(last=out["disqualified"] != "").sort_values(["last", "mean_rank"], kind="stable")
    out = out.drop(columns="last").reset_index(names=POPULATION)
    out.insert(0, "rank", np.arange(len(out)) + 1)
    return out


def _incidents(means: pd.Series) -> str:
    """Say what disqualifies a population, as means over its seeds."""
    found = [f"{means[name]:g} {words}" for name, words in DISQUALIFYING.items() if means.get(name, 0.0) > 0.0]
    return ", ".join(found)


def in_words(table: pd.DataFrame) -> str:
    """Say which population is closest, and where each is wrong.

    Parameters
    ----------
    table : pandas.DataFrame
        ``tables/closed_loop.csv``.
    """
    ranks = ranking(table)
    means, recorded = _means(table)
    order = ", ".join(f"{row[POPULATION]} ({row['mean_rank']:.1f})" for _, row in ranks.iterrows())
    first = ranks.iloc[0]
    closest = (
        f"Closest to the recording is {first[POPULATION]}: mean rank {first['mean_rank']:.1f} over "
        f"{first['measures']} measures, first in "
        f"{first['best_in']} of them. In order: {order}. "
        if len(ranks) > 1 and not first["disqualified"]
        else ""
    )
    out = "; ".join(f"{row[POPULATION]}: {row['disqualified']}" for _, row in ranks.iterrows() if row["disqualified"])
    closest += f"Not to be trusted, whatever their other figures: {out}. " if out else ""
    wrong = [f"{name}: {_wrong(means.loc[name], recorded)}" for name in ranks[POPULATION]]
    return closest + "Where each is wrong most: " + "; ".join(wrong) + "."


def _means(table: pd.DataFrame) -> tuple[pd.DataFrame, pd.Series]:
    """Return the populations' means over seeds, and the recording's row."""
    numbers = table.select_dtypes("number").columns
    recorded = table[table[POPULATION] == RECORDED].iloc[0]
    others = table[table[POPULATION] != RECORDED]
    return others.groupby(POPULATION, sort=False)[list(numbers)].mean(), recorded


def _wrong(own: pd.Series, recorded: pd.Series) -> str:
    """Name the figures with the largest relative errors."""
    off = {
        name: own[name] / recorded[name] - 1.0
        for name in FIGURES
        if recorded[name] and np.isfinite(own[name] / recorded[name])
    }
    worst = sorted(off, key=lambda name: -abs(off[name]))[:MOST_WRONG]
    parts = [f"{FIGURES[name][0]} {abs(off[name]):.0%} {FIGURES[name][1 if off[name] > 0 else 2]}" for name in worst]
    if np.isfinite(recorded["wave_speed_m_s"]) and not np.isfinite(own["wave_speed_m_s"]):
        parts.append("no backward-moving waves")
    return " and ".join(parts)
