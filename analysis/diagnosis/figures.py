"""Figures of a diagnosis: residuals, evidence and gains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from idm_sumo.diagnosis import LawMisfit, Scan
from idm_sumo.diagnosis.law_misfit import Cell

from ..page.style import method_colour, method_name, new_figure
from .curves import COVARIATES, clustered_mean

Floats = npt.NDArray[np.float64]

BASE, EXTENDED = "base", "extended"
COLOURS = {name: method_colour(name) for name in (BASE, EXTENDED)}
NAMES = {name: method_name(name) for name in (BASE, EXTENDED)}
SCANNED = {"position_m": "position along the road (m)", "time_s": "time since the period began (s)"}
UNSURE = 4.0  # bins with so many times the median standard error do not set the axis
KINDS = {"named": COLOURS[EXTENDED], "present without gain": "#56B4E9", "ruled out": "0.7"}
MARKED = "#F0E442"  # where a named or unexplained place or time lies
SIGN = "measured minus simulated (m)"


def residual_curves(curves: pd.DataFrame) -> Figure:
    """Draw the residuals against each covariate.

    Parameters
    ----------
    curves : pandas.DataFrame
        As :func:`analysis.diagnosis.curves.curves` returns it.

    Returns
    -------
    matplotlib.figure.Figure
        One panel a covariate, base and extended model, with 95 % bands over drivers.
    """
    shown = [covariate for covariate in COVARIATES if (curves["covariate"] == covariate.name).any()]
    rows = max(1, -(-len(shown) // 3))
    figure, axes = new_figure(11, 2.6 * rows + 0.4, columns=3, rows=rows)
    for ax, covariate in zip(axes, shown, strict=False):
        here = curves[curves["covariate"] == covariate.name]
        _curve_panel(ax, here, labels=covariate.scale == "labels")
        ax.set(xlabel=covariate.label)
    for ax in axes[len(shown) :]:
        ax.axis("off")
    figure.supylabel(f"{SIGN}; below 0 the simulated vehicle is too far ahead", fontsize=9)
    if shown:
        _legend(figure, axes[0])
    return figure


def _curve_panel(ax: Axes, curves: pd.DataFrame, *, labels: bool) -> None:
    ax.axhline(0.0, color="black", linewidth=0.8)
    for shift, (model, part) in zip((-0.08, 0.08), curves.groupby("model", sort=False), strict=False):
        colour, name = COLOURS[str(model)], NAMES[str(model)]
        if labels:
            half = part["mean"] - part["ci_low"]
            ax.errorbar(
                part["centre"] + shift, part["mean"], half, color=colour, fmt="o", markersize=4, capsize=3, label=name
            )
            ax.set_xticks(sorted(curves["centre"].unique()))
        else:
            ax.plot(part["centre"], part["mean"], color=colour, marker="o", markersize=2.5, linewidth=1.5, label=name)
            ax.fill_between(part["centre"], part["ci_low"], part["ci_high"], color=colour, alpha=0.2, linewidth=0)


def _legend(figure: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize=9, frameon=False)


def where_and_when(
    maps: dict[str, Floats],
    places: Floats,
    times: Floats,
    marks: list[tuple[tuple[float, float] | None, tuple[float, float] | None]],
) -> Figure:
    """Draw the mean residual by position and time.

    Parameters
    ----------
    maps : dict of str to float64, shape (places - 1, times - 1)
        By model.
    places, times : float64 array
        Edges of the cells (m, s).
    marks : list of pairs
        Intervals of position and time that are framed; None for everywhere or always.

    Returns
    -------
    matplotlib.figure.Figure
        One panel a model.
    """
    figure, axes = new_figure(11, 3.6, columns=len(maps))
    known = np.abs(np.concatenate([field[np.isfinite(field)] for field in maps.values()]))
    limit = max(float(np.quantile(known, 0.95)) if len(known) else 1.0, 1e-6)
    for ax, (model, field) in zip(axes, maps.items(), strict=True):
        ax.set_facecolor("0.88")
        ax.grid(visible=False)
        mesh = ax.pcolormesh(
            times, places, field, cmap="RdBu_r", norm=TwoSlopeNorm(0.0, -limit, limit), rasterized=True
        )
        for position, time in marks:
            _frame(ax, position or (places[0], places[-1]), time or (times[0], times[-1]))
        ax.set(title=NAMES[model], xlabel="time since the period began (s)", ylabel="position along the road (m)")
    figure.colorbar(mesh, ax=axes, label=SIGN, extend="both")
    return figure


def _frame(ax: Axes, position: tuple[float, float], time: tuple[float, float]) -> None:
    left, right = time
    low, high = position
    ax.plot([left, right, right, left, left], [low, low, high, high, low], color="black", linewidth=2.6)
    ax.plot([left, right, right, left, left], [low, low, high, high, low], color=MARKED, linewidth=1.4)


def gain_per_driver(gains: pd.DataFrame) -> Figure:
    """Draw the gain of every held-out driver.

    Parameters
    ----------
    gains : pandas.DataFrame
        ``base_ade, extended_ade`` (m), one row a held-out driver.

    Returns
    -------
    matplotlib.figure.Figure
        ADE of both models, and the sorted gains.
    """
    figure, axes = new_figure(10, 3.8, columns=2)
    base, extended = gains["base_ade"].to_numpy(), gains["extended_ade"].to_numpy()
    top = float(np.nanmax([base.max(initial=0.1), extended.max(initial=0.1)])) * 1.05
    axes[0].plot([0, top], [0, top], color="black", linewidth=0.8)
    axes[0].scatter(base, extended, s=9, alpha=0.6, color=COLOURS[EXTENDED], linewidths=0)
    axes[0].set(
        xlabel="ADE of the base model (m)",
        ylabel="ADE of the extended model (m)",
        xlim=(0, top),
        ylim=(0, top),
        title="below the line: better",
    )
    gain = np.sort(base - extended)[::-1]
    better = gain > 0
    share = np.arange(1, len(gain) + 1)
    for chosen, colour in ((better, COLOURS[EXTENDED]), (~better, COLOURS[BASE])):
        axes[1].bar(share[chosen], gain[chosen], width=1.0, color=colour)
    mean, half, _ = clustered_mean(base - extended, np.arange(len(base)), np.zeros(len(base), dtype=np.int64), 1)
    axes[1].axhline(0, color="black", linewidth=0.8)
    axes[1].axhspan(mean[0] - half[0], mean[0] + half[0], color="0.5", alpha=0.3)
    axes[1].set(
        xlabel="held-out drivers, best gain first",
        ylabel="gain in ADE (m)",
        title=f"{better.mean():.0%} of {len(gain)} drivers gain; grey: mean, 95 %",
    )
    return figure


def lag_figure(lags: Floats, responses: dict[str, tuple[Floats, Floats]]) -> Figure:
    """Draw the residual's correlation with the leader's acceleration.

    Parameters
    ----------
    lags : float64 array
        Lags (s).
    responses : dict of str to (mean, half)
        By model, as :func:`analysis.diagnosis.curves.lag_response` returns it.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure, (ax,) = new_figure(7, 3.4)
    ax.axhline(0, color="black", linewidth=0.8)
    ax.axvline(0, color="0.7", linewidth=0.8)
    for model, (mean, half) in responses.items():
        ax.plot(lags, mean, color=COLOURS[model], label=NAMES[model])
        ax.fill_between(lags, mean - half, mean + half, color=COLOURS[model], alpha=0.2, linewidth=0)
    ax.set(
        xlabel="lag behind the leader's acceleration (s); positive: the leader moved first",
        ylabel="correlation of the residual",
    )
    ax.legend(fontsize=8)
    return figure


def evidence(tests: pd.DataFrame) -> Figure:
    """Draw every hypothesis by its p-value and its outcome.

    Parameters
    ----------
    tests : pandas.DataFrame
        ``name, p_value, kind``, the latter of :data:`KINDS`.

    Returns
    -------
    matplotlib.figure.Figure
        One bar a hypothesis.
    """
    ordered = tests.sort_values("p_value", ascending=False)
    figure, (ax,) = new_figure(7.5, 0.28 * len(ordered) + 1.0)
    strength = -np.log10(np.maximum(ordered["p_value"].to_numpy(np.float64), 1e-16))
    y = np.arange(len(ordered))
    for kind, colour in KINDS.items():
        of_kind = (ordered["kind"] == kind).to_numpy()
        if of_kind.any():
            ax.barh(y[of_kind], strength[of_kind], color=colour, label=kind)
    ax.set_yticks(y, [str(name).replace("_", " ") for name in ordered["name"]], fontsize=8)
    ax.set(xlabel="−log10 of p, corrected for the number of hypotheses")
    ax.legend(loc="lower right", fontsize=8)
    return figure


def free_accelerations(scans: Sequence[Scan]) -> Figure:
    """Draw the acceleration that the base model lacks.

    Parameters
    ----------
    scans : sequence of Scan
        Estimates along position and time.

    Returns
    -------
    matplotlib.figure.Figure
        One panel a scan, with 95 % intervals.
    """
    figure, axes = new_figure(11, 3.2, columns=max(len(scans), 1))
    for ax, scan in zip(axes, scans, strict=False):
        centre = 0.5 * (scan.edges[1:] + scan.edges[:-1])
        ax.axhline(0, color="black", linewidth=0.8)
        half = 1.96 * scan.standard_error
        ax.step(centre, scan.estimate, where="mid", color=COLOURS[BASE])
        ax.fill_between(
            centre, scan.estimate - half, scan.estimate + half, step="mid", color=COLOURS[BASE], alpha=0.2, linewidth=0
        )
        ax.set(xlabel=SCANNED.get(scan.covariate, scan.covariate), ylabel="acceleration the base model lacks (m/s²)")
        sure = scan.standard_error <= UNSURE * np.nanmedian(scan.standard_error)
        if sure.any():  # bins of a few vehicles must not compress all others
            ax.set_ylim(
                float((scan.estimate - 1.2 * half)[sure].min()), float((scan.estimate + 1.2 * half)[sure].max())
            )
    return figure


def law_misfit(misfit: LawMisfit) -> Figure:
    """Draw the acceleration that the law lacks.

    Over gap and speed, and over gap and approach rate.

    Parameters
    ----------
    misfit : LawMisfit
        Of a diagnosis.

    Returns
    -------
    matplotlib.figure.Figure
        Two panels; cells within two standard errors of zero are hatched, and without five drivers left grey.
    """
    figure, axes = new_figure(10, 4.0, columns=2)
    limit = max(abs(cell.acceleration) for cell in misfit.cells)
    for ax, (name, label) in zip(axes, MISFIT_AXES.items(), strict=True):
        here = [cell for cell in misfit.cells if cell.x_name == name]
        shown = _patches(here, limit)
        ax.set_facecolor("0.88")
        ax.grid(visible=False)
        ax.add_collection(shown)
        unsure = [cell for cell in here if abs(cell.acceleration) < 2.0 * cell.standard_error]
        ax.add_collection(
            PatchCollection(
                [_patch(cell) for cell in unsure], facecolor="none", edgecolor="0.4", hatch="////", linewidth=0
            )
        )
        ax.set(xlabel=label, ylabel="gap (m)")
        ax.autoscale_view()
    figure.colorbar(shown, ax=axes, label="acceleration that the law lacks (m/s²)")
    return figure


MISFIT_AXES = {"speed": "speed (m/s)", "approach_rate": "approach rate (m/s); above 0: closing in"}


def _patch(cell: Cell) -> Rectangle:
    (left, right), (low, high) = cell.x_m_s, cell.gap_m
    return Rectangle((left, low), right - left, high - low)


def _patches(cells: Sequence[Cell], limit: float) -> PatchCollection:
    shown = PatchCollection([_patch(cell) for cell in cells], cmap="RdBu_r", norm=TwoSlopeNorm(0.0, -limit, limit))
    shown.set_array(np.array([cell.acceleration for cell in cells]))
    return shown
