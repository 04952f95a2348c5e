"""A campaign at a glance: what each recording's hidden effect was worth, whether it was found, and with which size."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.page.style import new_figure
from tests.simulators.campaign.scores import GAIN_BOUNDS, RIGHT, RIGHT_AND_MORE, SILENT, UNKNOWN, WRONG

# How an outcome of a single effect looks: face, edge.
LOOKS = {
    RIGHT: ("#009E73", "#009E73"),
    RIGHT_AND_MORE: ("#009E73", "#000000"),
    UNKNOWN: ("#E69F00", "#E69F00"),
    SILENT: ("none", "#777777"),
    WRONG: ("#D55E00", "#D55E00"),
}
# The car-following underneath: marker and name; any other is SUMO's.
LAWS = {"idm": ("o", "IDM"), "fvd": ("s", "full velocity difference"), "gipps": ("^", "Gipps")}
OF_SUMO = ("D", "SUMO's")
SHARES, RATIOS = (-3.0, 70.0), (0.25, 4.0)  # that are drawn: % of ADE; beyond, at the edge
NEAR = (0.8, 1.25)
APART = 0.11  # of a row, between what would lie upon each other


def at_a_glance(graded: pd.DataFrame, sizes: pd.DataFrame) -> Figure:
    """Draw single effects, a row an effect: outcome against what it is worth, and found over hidden size.

    Parameters
    ----------
    graded : DataFrame
        Of :func:`~tests.simulators.campaign.scores.scored`.
    sizes : DataFrame
        Of :func:`~tests.simulators.campaign.scores.sized`.
    """
    single = graded[graded["group"] == "single"]
    names = sorted(set(single["name"]))
    figure, (left, right) = new_figure(11.0, 1.6 + 0.5 * len(names), columns=2)
    _draw_outcomes(left, single, names)
    _draw_sizes(right, sizes[sizes["name"].isin(names)], names)
    for ax in (left, right):
        ax.set(yticks=range(len(names)), ylim=(len(names) - 0.5, -0.5))
    left.set_yticklabels([name.replace("_", " ") for name in names])
    right.set_yticklabels([])
    figure.legend(handles=_legend(single), loc="outside lower center", ncol=9, fontsize=8, frameon=False)
    return figure


def _draw_outcomes(ax: Axes, single: pd.DataFrame, names: list[str]) -> None:
    for row, name in enumerate(names):
        own = single[single["name"] == name].sort_values("best_gain")
        for number, one in enumerate(own.itertuples()):
            face, edge = LOOKS[one.outcome]
            share = np.clip(100.0 * one.best_gain, *SHARES)
            ax.plot(share, _beside(row, number, 5), LAWS.get(one.underlying, OF_SUMO)[0], ms=6, mfc=face, mec=edge)
    for bound in GAIN_BOUNDS:
        ax.axvline(100.0 * bound, color="black", linewidth=0.8, linestyle=":")
    ax.set_xscale("symlog", linthresh=5.0)
    ticks = (0, *(round(100.0 * bound) for bound in sorted(GAIN_BOUNDS)), 10, 20, 50)
    ax.set(xlim=[1.2 * share for share in SHARES], xticks=ticks, xticklabels=[f"{tick}" for tick in ticks])
    ax.set_xlabel("what the true model gains by it (% of ADE)")
    ax.set_title("Was it named?", loc="left", fontsize=10)


def _draw_sizes(ax: Axes, sizes: pd.DataFrame, names: list[str]) -> None:
    ax.axvspan(*NEAR, color="#DDDDDD", alpha=0.6, linewidth=0)
    ax.axvline(1.0, color="black", linewidth=0.8)
    for row, name in enumerate(names):
        own = sizes[sizes["name"] == name].sort_values(["underlying", "form"])
        for number, one in enumerate(own.itertuples()):
            at, (colour, _) = _beside(row, number, 7), LOOKS[RIGHT if one.covered else WRONG]
            low, middle, high = np.clip(np.array([one.low, one.estimate, one.high]) / one.planted, *RATIOS)
            ax.plot([low, high], [at, at], color=colour, linewidth=0.9, alpha=0.7)
            face = colour if one.form == "usual" else "white"
            ax.plot(middle, at, LAWS.get(one.underlying, OF_SUMO)[0], ms=5, mfc=face, mec=colour)
    ticks = (0.25, 0.5, 0.8, 1.0, 1.25, 2.0, 4.0)
    ax.set_xscale("log")
    ax.minorticks_off()
    ax.set(xlim=RATIOS, xticks=ticks, xticklabels=[f"{tick:g}" for tick in ticks])
    ax.set_xlabel("found over hidden size, 95 % interval")
    ax.set_title("How large? (red: interval misses; white: another form)", loc="left", fontsize=10)


def _beside(row: int, number: int, most: int) -> float:
    """Return where in a row one of several is drawn, so that none hides another."""
    return row + APART * (number % most - most // 2)


def _legend(single: pd.DataFrame) -> list[Line2D]:
    there = set(single["outcome"])
    outcomes = [
        Line2D([], [], marker="o", linestyle="", mfc=face, mec=edge, label=outcome)
        for outcome, (face, edge) in LOOKS.items()
        if outcome in there
    ]
    laws = [
        Line2D([], [], marker=marker, linestyle="", color="#333333", label=law)
        for marker, law in (*LAWS.values(), OF_SUMO)
    ]
    return [*outcomes, *laws]
