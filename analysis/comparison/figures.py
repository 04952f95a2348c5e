"""Pictures of whole recordings side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from idm_sumo.evaluation import macroscopic as m
from idm_sumo.evaluation.comparison import Comparison, matched_periods
from idm_sumo.evaluation.traffic_measures import TrafficMeasures
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording

from ..page.style import new_figure, tidy

PALETTE = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SPEED_MAP = "cividis"  # safe for colour-blind readers
HIGHEST = 22.0  # m/s, the colours' end
CELL_LENGTH, CELL_TIME = 5.0, 2.0  # m, s: fine enough to see single vehicles


def colours(names: Sequence[str]) -> dict[str, str]:
    """Return one colour a recording, the reference black.

    Parameters
    ----------
    names : sequence of str
    """
    return {name: PALETTE[number % len(PALETTE)] for number, name in enumerate(names)}


def overview(comparison: Comparison) -> Figure:
    """Draw speeds by position, and distributions.

    Speeds by position are of up to three periods. The distributions of gap, time headway and travel time
    are of the period in which the reference holds most vehicles: recordings that mix periods in unequal
    shares would differ by that alone.

    Parameters
    ----------
    comparison : Comparison
    """
    measures = comparison.measures
    reference = measures[comparison.reference]
    periods = reference.periods[:3]
    figure = Figure(figsize=(11, 6.2), layout="constrained", dpi=130)
    grid = figure.add_gridspec(2, 6)  # one, two or three periods above, three distributions below
    wide = 6 // len(periods)
    paint = colours(list(measures))
    for place, period in enumerate(periods):
        ax = tidy(figure.add_subplot(grid[0, place * wide : (place + 1) * wide]))
        _speed_by_position(ax, measures, period, paint)
    fullest = str(reference.counts.idxmax())
    span = f"travel time over {np.ptp(m.stations_of(reference.road)):.0f} m (s)"
    for place, (table, column, edges, label) in enumerate(
        (
            ("following", "gap_m", np.linspace(0, 60, 61), "gap (m)"),
            ("following", "time_headway_s", np.linspace(0, 6, 61), "time headway (s)"),
            ("travel_times", "travel_time_s", np.linspace(20, 140, 41), span),
        )
    ):
        ax = tidy(figure.add_subplot(grid[1, 2 * place : 2 * place + 2]))
        _distribution(ax, measures, paint, table, column, edges, fullest)
        ax.set(xlabel=label)
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 4), fontsize=9, frameon=False)
    return figure


def _speed_by_position(ax: Axes, measures: Mapping[str, TrafficMeasures], period: str, paint: dict[str, str]) -> None:
    reference = next(iter(measures.values()))
    for name, measured in measures.items():
        theirs = dict(matched_periods(reference.periods, measured.periods)).get(period)
        table = measured.positions[measured.positions[c.PERIOD] == theirs]
        if table.empty:
            continue
        mean, se = table[m.MEAN_SPEED], table["speed_se_m_s"].fillna(0.0)
        ax.plot(table["x_m"], mean, color=paint[name], marker="o", markersize=3)
        ax.fill_between(table["x_m"], mean - se, mean + se, color=paint[name], alpha=0.2, linewidth=0)
    road = reference.road
    for place in road.ramp_places:
        ax.axvline(place, color="0.8", linewidth=1, zorder=0)
    ax.set(title=period, xlabel="position (m)", ylabel="mean speed (m/s)", ylim=(0, HIGHEST), xlim=(0, road.length))


def _distribution(
    ax: Axes,
    measures: Mapping[str, TrafficMeasures],
    paint: dict[str, str],
    table: str,
    column: str,
    edges: npt.NDArray[np.float64],
    period: str,
) -> None:
    reference = next(iter(measures.values()))
    for name, measured in measures.items():
        theirs = dict(matched_periods(reference.periods, measured.periods)).get(period)
        rows = getattr(measured, table)
        values = rows.loc[rows[c.PERIOD] == theirs, column].dropna().to_numpy()
        if len(values):
            density = np.histogram(values, edges)[0] / len(values) / np.diff(edges)
            ax.stairs(density, edges, color=paint[name], label=name, linewidth=1.6)
    ax.set(title=period, ylabel="density", xlim=(edges[0], edges[-1]))


def time_space(recordings: Mapping[str, Recording], *, lanes: Sequence[int] | None = None) -> Figure:
    """Draw time-space diagrams, coloured by speed.

    One row a recording (of one period), one column a lane.

    Parameters
    ----------
    recordings : mapping of str to Recording
    lanes : sequence of int, keyword-only, optional
        By default all main lanes.
    """
    if lanes is None:
        lanes = range(1, max(recording.road.main_lanes for recording in recordings.values()) + 1)
    figure, axes = new_figure(2.6 * len(lanes), 0.6 + 1.9 * len(recordings), columns=len(lanes), rows=len(recordings))
    longest = max(_minutes(recording.table).max() for recording in recordings.values())
    image: Any = None
    for row, (name, recording) in enumerate(recordings.items()):
        table = recording.table.assign(minutes=_minutes(recording.table))
        for column, lane in enumerate(lanes):
            ax = axes[row * len(lanes) + column]
            image = _lane_image(ax, table[table[c.LANE] == lane], longest, recording.road.length)
            ax.set(
                title=f"lane {lane}" if row == 0 else "",
                xlabel="minute" if row == len(recordings) - 1 else "",
                ylabel=f"{name}\nposition (m)" if column == 0 else "",
            )
            ax.tick_params(labelleft=column == 0, labelbottom=row == len(recordings) - 1)
    figure.colorbar(image, ax=axes, label="speed (m/s)", shrink=0.8, pad=0.01)
    return figure


def lane_change_map(comparison: Comparison) -> Figure:
    """Draw where vehicles change lanes, one road a recording.

    Parameters
    ----------
    comparison : Comparison
    """
    measures = comparison.measures
    figure, axes = new_figure(9.0, 0.5 + 1.5 * len(measures), rows=len(measures))
    for ax, (name, measured) in zip(axes, measures.items(), strict=True):
        _changes_on_the_road(ax, measured)
        ax.set(ylabel=name)
    axes[0].legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
    axes[-1].set(xlabel="position along the road (m)")
    return figure


def _changes_on_the_road(ax: Axes, measured: TrafficMeasures) -> None:
    road, places = measured.road, measured.lane_change_places
    middle = (places["before"] + places["after"]) / 2.0
    for label, left, marker, colour in (
        ("to the left", True, "^", PALETTE[2]),
        ("to the right", False, "v", PALETTE[1]),
    ):
        chosen = (places["after"] < places["before"]) == left
        ax.scatter(places[c.X][chosen], middle[chosen], s=14, marker=marker, color=colour, label=label, linewidths=0)
    lanes = range(1, road.main_lanes + 1)
    ax.set(xlim=(0.0, road.length), ylim=(road.main_lanes + 1.4, 0.5), yticks=[*lanes, road.main_lanes + 1],
           yticklabels=[*map(str, lanes), "side"])  # fmt: skip
    ax.tick_params(labelsize=7)


def _minutes(table: pd.DataFrame) -> pd.Series:
    """Return minutes since the first frame."""
    return (table[c.FRAME] - table[c.FRAME].min()) * FRAME_STEP / 60.0


def _lane_image(ax: Axes, table: pd.DataFrame, longest: float, length: float) -> Any:
    """Draw mean speeds of fine cells of one lane.

    Cells without a vehicle are white.
    """
    times = np.arange(0.0, longest + CELL_TIME / 60.0, CELL_TIME / 60.0)
    places = np.arange(0.0, length + CELL_LENGTH, CELL_LENGTH)
    where = (table["minutes"], table[c.X])
    count = np.histogram2d(*where, bins=(times, places))[0]
    total = np.histogram2d(*where, bins=(times, places), weights=table[c.SPEED])[0]
    speed = np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)
    ax.grid(False)
    return ax.imshow(
        speed.T,
        origin="lower",
        aspect="auto",
        cmap=SPEED_MAP,
        vmin=0.0,
        vmax=HIGHEST,
        interpolation="nearest",
        extent=(0.0, times[-1], 0.0, places[-1]),
    )
