"""What blind trials add up to: power, confusion, false alarms, magnitude and coverage, with their counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy import stats

from .style import save

LEVELS = ["small", "mid", "large"]


def summarise(trials: pd.DataFrame, folder: Path) -> None:
    """Write every table and the picture of a campaign into ``folder``; one row of ``trials`` a recording."""
    graded = trials.assign(outcome=[outcome(row) for _, row in trials.iterrows()])
    graded["named"] = [", ".join(cause["name"] for cause in row["found"]["causes"]) for _, row in trials.iterrows()]
    graded["verdict"] = [row["found"]["verdict"] for _, row in trials.iterrows()]
    for column in ("underlying", "noise", "sigma", "form", "density", "lanes"):
        graded[column] = [plan[column] for plan in trials["plan"]]
    listing = ["group", "name", "size", "outcome", "verdict", "named", "underlying", "noise", "sigma", "form", "density", "lanes", "seed", "seconds"]  # fmt: skip
    graded[listing].round(3).to_csv(folder / "trials.csv", index=False)
    tables = {
        "By group": counts(graded, ["group"]), "Power": counts(graded[graded["group"] == "single"], ["name", "size"]),
        "By conditions": pd.concat([counts(graded, [key]).rename(columns={key: "condition"}) for key in ("underlying", "noise", "form", "density")]),
        "Magnitudes": magnitudes(graded),
    }  # fmt: skip
    lines = [
        "# Blind trials of `diagnose`",
        "",
        f"{len(graded)} recordings; median {graded['seconds'].median():.0f} s each.",
    ]
    for title, table in tables.items():
        table.to_csv(folder / f"{title.lower().replace(' ', '_')}.csv", index=False)
        lines += ["", f"## {title}", "", _markdown(table)]
    (folder / "README.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    save(power_curves(graded), folder / "power.png")


def outcome(trial: Any) -> str:
    """Return right, silent, wrong, or for nulls ``silent`` and ``false alarm``; pairs are right if both are named."""
    found = trial["found"]
    names = [cause["name"] for cause in found["causes"]]
    hidden = list(trial["effects"])
    if trial["group"] == "outside":
        return "right" if found["verdict"] == "unknown" else "wrong" if names else "silent"
    if not hidden:
        return "false alarm" if names or found["verdict"] == "unknown" else "silent"
    if any(name not in hidden for name in names):
        return "wrong" if not names or names[0] not in hidden else "right and more"
    if set(names) == set(hidden):
        return "right"
    return "one of two" if names else "unknown" if found["verdict"] == "unknown" else "silent"


def counts(graded: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """Return how often each outcome came, with the exact 95 % interval of the share that was right (or silent, for nulls)."""
    table = graded.groupby([*keys, "outcome"], sort=False).size().unstack(fill_value=0)
    total = table.sum(axis=1)
    good = table.get("right", 0) + table.get("right and more", 0)
    if keys == ["group"] and "none" in table.index:
        good.loc["none"] = table.loc["none"].get("silent", 0)
    interval = [stats.binomtest(int(g), int(n)).proportion_ci(method="exact") for g, n in zip(good, total, strict=True)]
    table["recordings"] = total
    table["good"] = (good / total).round(3)
    table["ci95"] = [f"{one.low:.2f}-{one.high:.2f}" for one in interval]
    return table.reset_index()


def magnitudes(graded: pd.DataFrame) -> pd.DataFrame:
    """Return relative errors of the estimated sizes and how often the 95 % interval holds the planted one (usual forms)."""
    rows = []
    for _, trial in graded[(graded["form"] == "usual") & graded["group"].isin(["single"])].iterrows():
        name = trial["name"]
        for cause in trial["found"]["causes"]:
            if cause["name"] != name:
                continue
            one, truth = next(iter(cause["parameters"].values())), abs(trial["effects"][name])  # the size comes first
            value, (low, high) = abs(one["value"]), sorted(abs(x) for x in one["ci95"])
            rows.append({"name": name, "error": abs(value / truth - 1.0), "covered": low <= truth <= high})
    table = pd.DataFrame(rows, columns=["name", "error", "covered"])
    grouped = table.groupby("name", sort=False)
    out = pd.DataFrame({"median error": grouped["error"].median(), "90 % of errors below": grouped["error"].quantile(0.9),
                        "interval holds it": grouped["covered"].mean(), "found": grouped.size()})  # fmt: skip
    return out.round(3).reset_index()


def power_curves(graded: pd.DataFrame) -> Figure:
    """Draw the share of recordings in which the cause was named, against its size, cause by cause."""
    single = graded[graded["group"] == "single"]
    names = list(dict.fromkeys(single["name"]))
    fig, axes = plt.subplots(3, 4, figsize=(11, 7), sharex=True, sharey=True, layout="constrained")
    for name, ax in zip(names, axes.flat, strict=False):
        own = single[single["name"] == name]
        share = [np.mean(own.loc[own["size"] == level, "outcome"].str.startswith("right")) for level in LEVELS]
        ax.plot(LEVELS, share, marker="o", color="black")
        ax.set(title=name.replace("_", " "), ylim=(-0.05, 1.05))
        ax.title.set_size(9)
    for ax in list(axes.flat)[len(names) :]:
        ax.axis("off")
    fig.supylabel("share of recordings in which it was named")
    return fig


def _markdown(table: pd.DataFrame) -> str:
    head = "| " + " | ".join(map(str, table.columns)) + " |"
    rule = "|" + "---|" * len(table.columns)
    rows = ["| " + " | ".join(str(value) for value in row) + " |" for row in table.itertuples(index=False)]
    return "\n".join([head, rule, *rows])
