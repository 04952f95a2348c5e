"""The paper's figures, and figures that explain the tables."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from idm_sumo.evaluation.figures import plot_time_space
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.models.idm import LOWER, UPPER
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

from ..page.style import METHOD_COLOURS, METHOD_NAMES, label_ends, method_colour, method_line, method_name, new_figure
from .paper import METHODS, MISSING, NEIGHBOURS
from .study import Study

LEVELS = ("idm_average", "idm_pooled", "idm_oracle")


def accuracy_against_neighbours(table: pd.DataFrame, methods: pd.DataFrame) -> Figure:
    """Draw ADE against the number of neighbours.

    This is the paper's figure, left, with levels for comparison.

    Parameters
    ----------
    table : pandas.DataFrame
        The table of neighbours.
    methods : pandas.DataFrame
        The table of methods.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure, (ax,) = new_figure()
    ax.errorbar(table["k"], table["ade_m"], table["ade_se_m"], color=METHOD_COLOURS["idm_prediction"],
                marker="o", markersize=3, capsize=2, label=METHOD_NAMES["idm_prediction"])  # fmt: skip
    for name in LEVELS:
        ade = float(methods.set_index("method").loc[name, "ade_m"])
        ax.axhline(ade, color=METHOD_COLOURS[name], linestyle="--", linewidth=1, label=METHOD_NAMES[name])
    ax.axvline(NEIGHBOURS, color="0.7", linewidth=1)
    ax.annotate(f"the paper's k = {NEIGHBOURS}", (NEIGHBOURS, 1), xycoords=("data", "axes fraction"),
                xytext=(4, -10), textcoords="offset points", fontsize=8, color="0.4")  # fmt: skip
    ax.set(xlabel="number of neighbours k", ylabel="ADE (m)", ylim=(0, None))
    ax.legend(fontsize=8)
    return figure


def oracle_parameters(fits: pd.DataFrame) -> Figure:
    """Draw histograms of the oracle's parameters.

    This is the paper's figure, middle, with d0 against d1 and the shares at a bound.

    Parameters
    ----------
    fits : pandas.DataFrame
        Oracle calibrations, one row a window.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure, axes = new_figure(10, 5.4, columns=3, rows=2)
    hits = fits["at_bound"].fillna("").str.split(",")
    for ax, name in zip(axes, LOWER._fields, strict=False):
        at_bound = hits.map(lambda names, name=name: name in names).mean()
        bins = np.linspace(getattr(LOWER, name), getattr(UPPER, name), 41).tolist()
        ax.hist(fits[name].dropna(), bins=bins, color=METHOD_COLOURS["idm_oracle"])
        ax.set(title=f"{name}: {at_bound:.0%} at a bound", xlabel=_axis(name), ylabel="drivers")
    hit = hits.map(lambda names: bool({"d0", "d1"} & set(names)))
    for chosen, colour, label in (
        (~hit, METHOD_COLOURS["idm_oracle"], "inside"),
        (hit, METHOD_COLOURS["idm_prediction"], "d0 or d1 at a bound"),
    ):
        axes[5].scatter(fits["d0"][chosen], fits["d1"][chosen], s=5, alpha=0.5, color=colour, label=label, linewidths=0)
    axes[5].set(title="d0 against d1", xlabel=_axis("d0"), ylabel=_axis("d1"))
    axes[5].legend(fontsize=7, loc="upper right")
    return figure


def flat_directions(moves: pd.DataFrame) -> Figure:
    """Draw the cost of moves along each oracle's flattest direction.

    Parameters
    ----------
    moves : pandas.DataFrame
        As :func:`analysis.reproduce.tables.flat_directions` returns it.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure, (ax,) = new_figure(7, 3.6)
    by_share = moves.groupby("share")["increase"]
    shares = by_share.median().index.to_numpy()
    for low, high, alpha in ((0.1, 0.9, 0.15), (0.25, 0.75, 0.3)):
        ax.fill_between(shares, by_share.quantile(low), by_share.quantile(high), alpha=alpha, linewidth=0,
                        color=METHOD_COLOURS["idm_oracle"], label=f"{high - low:.0%} of the drivers")  # fmt: skip
    ax.plot(
        shares, by_share.median(), color=METHOD_COLOURS["idm_oracle"], marker="o", markersize=3, label="median driver"
    )
    ax.set(xlabel="distance from the oracle along its flattest direction (share of the range between the bounds)",
           ylabel="ADE above the oracle's (m)", ylim=(0, None), xlim=(0, None))  # fmt: skip
    ax.legend(fontsize=8)
    return figure


def _axis(name: str) -> str:
    return {"a": "a (m/s²)", "b": "b (m/s²)", "T": "T (s)", "d0": "d0 (m)", "d1": "d1 (m)"}[name]


def error_growth(study: Study, driven: dict[str, list[Trajectories]]) -> Figure:
    """Draw the mean displacement error over the horizon.

    Bands are standard errors over vehicles.

    Parameters
    ----------
    study : Study
        Training and test drivers.
    driven : dict of str to list of Trajectories
        By method, one a period.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure, (ax,) = new_figure(8.0)
    ends = {}
    for name, trajectories in driven.items():
        parts = [displacement(s, t) for s, t in zip(study.test.scenes, trajectories, strict=True)]
        error = np.pad(np.concatenate(parts), ((0, 0), (1, 0)))  # no error at the start
        seconds = np.arange(error.shape[1]) * FRAME_STEP
        mean, se = error.mean(axis=0), error.std(axis=0, ddof=1) / np.sqrt(len(error))
        ax.plot(seconds, mean, color=METHOD_COLOURS[name], linestyle=method_line(name))
        ends[METHOD_NAMES[name]] = float(mean[-1])
        ax.fill_between(seconds, mean - se, mean + se, color=METHOD_COLOURS[name], alpha=0.2, linewidth=0)
    ax.set(
        xlabel="time since the start of the simulation (s)",
        ylabel="mean displacement error (m)",
        ylim=(0, None),
        xlim=(0, seconds[-1]),
    )
    label_ends(ax, ends, {METHOD_NAMES[name]: METHOD_COLOURS[name] for name in driven})
    return figure


def missing_vehicles(table: pd.DataFrame) -> Figure:
    """Draw ADE against the share of missing vehicles.

    The diamonds are the paper's figures, at its own share.

    Parameters
    ----------
    table : pandas.DataFrame
        As :func:`analysis.reproduce.missing.by_share` returns it.

    Returns
    -------
    matplotlib.figure.Figure
        Left with parameters found while nobody was missing, right with those found in the thinned scene.
    """
    figure, axes = new_figure(9.5, 4.0, columns=2)
    for ax, (way, part) in zip(axes, table.groupby("parameters", sort=False), strict=False):
        for name, one in part.groupby("method", sort=False):
            ax.plot(100 * one["missing_share"], one["ade_m"], color=method_colour(str(name)), marker="o", markersize=3,
                    linestyle=method_line(str(name)), label=method_name(str(name)))  # fmt: skip
        for name, printed in METHODS.items():
            if name in set(part["method"]):
                ax.plot(100 * MISSING, printed.ade_m, marker="D", color=method_colour(name), markeredgecolor="black")
        ax.set(title=str(way), xlabel="missing vehicles (%)", ylabel="ADE (m)", ylim=(0, None))
        ax.legend(fontsize=7)
    return figure


def time_space(scenes: Scenes, which: int, driven: dict[str, Trajectories]) -> Figure:
    """Draw one replay as positions over time.

    Parameters
    ----------
    scenes : Scenes
        Windows of one period.
    which : int
        Row of the driver.
    driven : dict of str to Trajectories
        Trajectories of the period by method.

    Returns
    -------
    matplotlib.figure.Figure
        The recorded vehicle, the modelled ones, and the traffic of its lane.
    """
    figure, (ax,) = new_figure(9.0, 4.6)
    named = {method_name(name): trajectories for name, trajectories in driven.items()}
    colours = {method_name(name): method_colour(name) for name in driven}
    plot_time_space(scenes, named, which, ax=ax, colours=colours)
    for name, line in zip(driven, ax.lines[1:], strict=True):
        line.set_linestyle(method_line(name))
    ax.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure
