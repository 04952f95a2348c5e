"""The one picture of what was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from idm_sumo.models.effects import Cause, ExtendedModel, Stimuli
from idm_sumo.roads import Road

from ..page.style import new_figure
from . import contract as c
from .effect_driving import kept_gaps, stimuli, through_a_wave, with_only
from .figures import BASE, COLOURS, EXTENDED, MARKED, NAMES
from .outcome import Outcome, told

Floats = npt.NDArray[np.float64]

POINTS = 40  # speeds of a curve
CLEAR = 0.03  # share by which gaps at steady speed must differ for a picture of them
SLOWEST = 2.0  # m/s
LATE = 0.9  # of a stretch or a time: where the picture is of, since what drifts is small before
LANE = 1.0  # height of a lane in the picture of a road


@dataclass(frozen=True)
class Section:
    """The recorded part of a road.

    Attributes
    ----------
    road : Road
        Its lanes and ramps.
    low, high : float
        Where the recording begins and ends (m).
    """

    road: Road
    low: float
    high: float


@dataclass(frozen=True)
class Picture:
    """A picture with what is seen on it.

    Attributes
    ----------
    figure : matplotlib.figure.Figure
        The picture.
    alt, caption : str
        For readers who cannot see it; how to read it.
    """

    figure: Figure
    alt: str
    caption: str


def picture_of(outcome: Outcome, curves: pd.DataFrame, section: Section) -> Picture | None:
    """Return the picture of the strongest finding.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.
    curves : pandas.DataFrame
        Residuals by covariate, as in ``tables/residual_curves.csv``.
    section : Section
        Of the recording.

    Returns
    -------
    Picture or None
        None where nothing was found that can be drawn.
    """
    content = outcome.content
    for cause in content.causes:
        place = outcome.bounded("position", cause.where.position_m) if cause.where else None
        if place is not None:
            return on_the_road(outcome, curves, section, place, (cause.where.lanes or ()) if cause.where else ())
        modelled = outcome.modelled(cause)
        if modelled is not None:
            return in_the_plane(outcome, cause, modelled)
    for one in content.unexplained:
        place = outcome.bounded("position", one.position_m)
        if place is not None:
            return on_the_road(outcome, curves, section, place, ())
    return None


def on_the_road(
    outcome: Outcome, curves: pd.DataFrame, section: Section, place: tuple[float, float], lanes: Sequence[int]
) -> Picture:
    """Draw the models' errors above the road itself.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.
    curves : pandas.DataFrame
        Residuals by covariate.
    section : Section
        The road below.
    place : (float, float)
        Where it was found (m).
    lanes : sequence of int
        Lanes in which it acts; empty for all.

    Returns
    -------
    Picture
        With the place framed in both parts.
    """
    figure, (ax, below) = new_figure(6.6, 4.2, rows=2)
    here = curves[curves["covariate"] == "position"]
    ax.axhline(0.0, color="black", linewidth=0.8)
    shown = (BASE, EXTENDED) if outcome.content.verdict == "named" else (BASE,)
    for model, style in zip(shown, ("-", (0, (5, 2))), strict=False):
        part = here[here["model"] == model]
        ax.plot(part["centre"], part["mean"], color=COLOURS[model], linestyle=style, linewidth=2, label=NAMES[model])
        ax.fill_between(part["centre"], part["ci_low"], part["ci_high"], color=COLOURS[model], alpha=0.15, linewidth=0)
    ax.axvspan(*place, color=MARKED, alpha=0.35, linewidth=0)
    ax.set(ylabel="recorded ahead of\nsimulated (m)")
    if len(here):
        ax.legend(fontsize=9, frameon=False, loc="best")
    _road(below, section, place, lanes)
    ax.set_xlim(below.get_xlim())
    said = f"from {place[0]:.0f} to {place[1]:.0f} m"
    which = "the base and the extended model" if len(shown) > 1 else "the base model"
    return Picture(
        figure,
        f"Mean error of {which} along the road, above the road with its lanes; the stretch {said} is marked",
        "Above: by how much held-out drivers were recorded ahead of their simulation (below zero: the simulation is "
        f"too far ahead); bands are 95 % intervals. Below: the road, driven to the right. Marked: {said}"
        + (f", lane {', '.join(map(str, lanes))}." if lanes else "."),
    )


def _road(ax: Axes, section: Section, place: tuple[float, float], lanes: Sequence[int]) -> None:
    """Draw lanes and ramps with the place marked."""
    road, low, high = section.road, section.low, section.high
    number = road.main_lanes
    ax.axhspan(-number * LANE, 0.0, color="0.9", linewidth=0)
    for lane in range(number + 1):
        edge = lane in (0, number)
        ax.axhline(-lane * LANE, color="0.45", linewidth=1.2 if edge else 0.7, linestyle="-" if edge else (0, (8, 8)))
    for side in road.side_lanes:
        start, end = max(side.start, low), min(side.end, high)
        ax.fill_between([start, end], -(number + 1) * LANE, -number * LANE, color="0.9", linewidth=0)
        ax.text(
            (start + end) / 2, -(number + 0.5) * LANE, side.kind, ha="center", va="center", fontsize=8, clip_on=True
        )
    for lane in lanes or range(1, number + 1):
        ax.fill_between(place, -lane * LANE, -(lane - 1) * LANE, color=MARKED, alpha=0.6, linewidth=0)
    bottom = -(number + bool(road.side_lanes)) * LANE
    ax.set(xlim=(low, high), ylim=(bottom, 0.2), xlabel="position along the road (m)", ylabel="lane")
    ax.set_yticks([-(lane - 0.5) * LANE for lane in range(1, number + 1)], [str(n) for n in range(1, number + 1)])
    ax.grid(visible=False)


def in_the_plane(outcome: Outcome, cause: c.Cause, modelled: Cause) -> Picture:
    """Draw the median driver by gap and speed.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.
    cause : contract.Cause
        The cause.
    modelled : Cause
        The same, as the extended model has it.

    Returns
    -------
    Picture
        Of gaps kept at steady speed where these differ, else of the way through a wave.
    """
    telling = told(cause)
    known = dict(telling.situation) if telling is not None else {}
    region = cause.where or c.Where()
    if region.lanes:
        known["lane"] = float(region.lanes[0])
    for field, interval in (("x", region.position_m), ("t", region.time_s)):
        if interval is not None:
            known[field] = interval[0] + LATE * (interval[1] - interval[0])
    around = stimuli(known)
    models = {BASE: with_only(outcome.model, None), EXTENDED: with_only(outcome.model, modelled)}
    slow, fast = _speeds(outcome)
    speeds = np.linspace(slow, fast, POINTS)
    gaps = {name: kept_gaps(model, speeds, around) for name, model in models.items()}
    apart = np.abs(gaps[EXTENDED] / gaps[BASE] - 1.0)
    steady = bool(np.isfinite(apart).any() and np.nanmax(apart) > CLEAR)
    when = telling.when if telling is not None and telling.when else "with the cause"
    return _steady(speeds, gaps, when) if steady else _wave(models, slow, fast, around)


def _speeds(outcome: Outcome) -> tuple[float, float]:
    """Return lowest and highest speed of the picture (m/s)."""
    slow, fast = outcome.speeds
    limit = outcome.model.desired_speed
    fast = min(max(fast, 0.3 * limit), 0.8 * limit)
    return min(max(slow, SLOWEST), 0.6 * fast), fast


def _steady(speeds: Floats, gaps: dict[str, Floats], when: str) -> Picture:
    figure, (ax,) = new_figure(6.6, 3.4)
    for name, label, style in ((BASE, "otherwise", "-"), (EXTENDED, when, (0, (5, 2)))):
        ax.plot(speeds, gaps[name], color=COLOURS[name], linestyle=style, linewidth=2.2, label=label)
    ax.fill_between(speeds, gaps[BASE], gaps[EXTENDED], color="0.5", alpha=0.15, linewidth=0)
    ax.set(xlabel="speed (m/s)", ylabel="gap kept at a steady speed (m)", ylim=(0, None))
    ax.legend(fontsize=9, frameon=False)
    middle = len(speeds) // 2
    return Picture(
        figure,
        f"Gap against speed, two lines: at {speeds[middle]:.0f} m/s the median driver keeps "
        f"{gaps[BASE][middle]:.0f} m, and {gaps[EXTENDED][middle]:.0f} m {when}",
        f"The gap that the median driver keeps at a steady speed: {when}, and otherwise.",
    )


def _wave(models: dict[str, ExtendedModel], slow: float, fast: float, around: Stimuli) -> Picture:
    figure, (ax,) = new_figure(6.6, 3.8)
    for name, label, style in ((BASE, "without the cause", "-"), (EXTENDED, "with the cause", (0, (5, 2)))):
        gap, speed = through_a_wave(models[name], slow, fast, around)
        ax.plot(speed, gap, color=COLOURS[name], linestyle=style, linewidth=2.2, label=label)
        for at in (int(np.argmin(np.abs(speed[: len(speed) // 2] - 0.5 * (slow + fast)))), int(np.argmax(gap))):
            arrow = {"arrowstyle": "-|>", "color": COLOURS[name], "lw": 2, "mutation_scale": 22}
            ax.annotate("", (speed[at + 4], gap[at + 4]), (speed[at], gap[at]), arrowprops=arrow)
    ax.set(xlabel="speed (m/s)", ylabel="gap (m)", ylim=(0, None))
    ax.legend(fontsize=9, frameon=False)
    return Picture(
        figure,
        f"Gap against speed of a driver behind a leader that slows from {fast:.0f} to {slow:.0f} m/s and speeds up "
        "again: two loops, with the cause and without it",
        f"The median driver behind a leader that brakes from {fast:.0f} to {slow:.0f} m/s and accelerates again, with "
        "the cause and without it. Arrows show the direction.",
    )
