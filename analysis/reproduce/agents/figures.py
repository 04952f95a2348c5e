"""Figures of the learned agents.

They show the reward, the learning curve, and the distances to other vehicles.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from idm_sumo.irl import features
from idm_sumo.irl.episodes import episodes_of
from idm_sumo.models import bicycle
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import Trajectories

from ...page.style import METHOD_COLOURS, METHOD_NAMES, RECORDED, TRAFFIC, new_figure
from ..drivers import Drivers
from .rows import Agents, clearances, recorded_paths
from .training import AGENT

Floats = npt.NDArray[np.float64]

BEHIND, AHEAD, GRID = 30.0, 45.0, 0.5  # m
MAPS = ("lane", "boundary", "collision")  # the paper's three
NEAR = 25.0  # m, half length of the drawn road


def reward_maps(scenes: Scenes, which: int, weights: Floats) -> Figure:
    """Draw the position's features and their weighted sum.

    This is the paper's figure, around one modelled vehicle.

    Parameters
    ----------
    scenes : Scenes
        Windows of one period.
    which : int
        Row of the driver.
    weights : float64, shape (features,)
        Learned weights.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    x, y, found = _on_grid(scenes, which)
    figure, axes = new_figure(11, 6.4, columns=2, rows=2)
    panels = [(name, found[:, :, features.NAMES.index(name)]) for name in MAPS]
    panels.append(
        ("all, weighted as learned", found[:, :, : features.STATE_FEATURES] @ weights[: features.STATE_FEATURES])
    )
    origin = float(scenes.x[which, scenes.start])
    for ax, (name, values) in zip(axes, panels, strict=True):
        low = max(float(values.min()), -1.0) if name != panels[-1][0] else float(np.quantile(values, 0.01))
        mesh = ax.pcolormesh(x - origin, y, values, cmap="viridis", vmin=low, shading="nearest", rasterized=True)
        figure.colorbar(mesh, ax=ax, shrink=0.85)
        ego = (0.0, scenes.y[which, scenes.start], scenes.heading[which, scenes.start])
        ax.add_patch(_outline(*ego, scenes.length[which], scenes.width[which], edgecolor="white", facecolor="none"))
        ax.set(title=name, xlabel="ahead of the modelled vehicle's front (m)", ylabel="y (m)", aspect="equal")
        ax.grid(visible=False)
    return figure


def _on_grid(scenes: Scenes, which: int) -> tuple[Floats, Floats, Floats]:
    """Return all features with the vehicle's middle on a grid.

    Heading and speed are those of the start.
    """
    episodes, around = episodes_of([scenes.subset(np.array([which]))])
    psi, v = float(scenes.heading[which, scenes.start]), float(scenes.speed[which, scenes.start])
    front = float(scenes.x[which, scenes.start])
    x = np.arange(front - BEHIND, front + AHEAD, GRID)
    y = np.arange(-scenes.road.width - 1.0, 1.0, GRID)
    out = np.empty((len(y), len(x), features.COUNT))
    for row, lateral in enumerate(y):
        for column, along in enumerate(x):
            features.values(
                along, lateral, psi, v, 0.0, 0.0, episodes.length[0], episodes.width[0], episodes.cell[0],
                episodes.stride[0], episodes.lanes[0], episodes.own[0], around, out[row, column],
            )  # fmt: skip
    return x, y, out


def _outline(x: float, y: float, heading: float, length: float, width: float, **style: object) -> Polygon:
    """Return a vehicle's rectangle from its front bumper."""
    cx, cy = bicycle.center_of_front(x, y, heading, length)
    along = 0.5 * length * np.array([np.cos(heading), np.sin(heading)])
    across = 0.5 * width * np.array([-np.sin(heading), np.cos(heading)])
    middle = np.array([cx, cy])
    corners = [middle + along + across, middle + along - across, middle - along - across, middle - along + across]
    return Polygon(np.array(corners), closed=True, **style)


def learning_curve(curve: pd.DataFrame) -> Figure:
    """Draw returns and outcomes of episodes over the training.

    Parameters
    ----------
    curve : pandas.DataFrame
        Learning curves, with a column ``seed``.

    Returns
    -------
    matplotlib.figure.Figure
        One line a seed.
    """
    figure, axes = new_figure(9, 3.4, columns=2)
    for number, (seed, rows) in enumerate(curve.groupby("seed")):
        smooth = rows.rolling(8, min_periods=1, on="steps").mean()
        colour = f"C{number}"
        axes[0].plot(smooth["steps"] / 1e6, smooth["mean_return"], color=colour, label=f"seed {seed}")
        axes[1].plot(smooth["steps"] / 1e6, smooth["collision_share"], color=colour, label=f"seed {seed}: collision")
        axes[1].plot(
            smooth["steps"] / 1e6,
            smooth["off_road_share"],
            color=colour,
            linestyle=":",
            label=f"seed {seed}: off the road",
        )
    axes[0].set(xlabel="environment steps (million)", ylabel="return of an episode", xlim=(0, None))
    axes[1].set(xlabel="environment steps (million)", ylabel="share of episodes", ylim=(0, 1), xlim=(0, None))
    for ax in axes:
        ax.legend(fontsize=7)
    return figure


def approaches(test: Drivers, agents: Agents, others: dict[str, tuple[list[Trajectories], pd.DataFrame]]) -> Figure:
    """Draw the distributions of errors and closest approaches.

    A panel shows the closest approach without contact, another one the smallest gaps.

    Parameters
    ----------
    test : Drivers
        Test drivers.
    agents : Agents
        Their runs by agents.
    others : dict of str to (list of Trajectories, pandas.DataFrame)
        Trajectories and scores of methods for comparison.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure, axes = new_figure(11, 7, columns=2, rows=2)
    shown = {name: (agents.driven[name][0], agents.scores[name][0]) for name in agents.driven} | others
    for name, (driven, score) in shown.items():
        _cumulative(axes[0], score["ade_m"].to_numpy(), name)
        _cumulative(axes[1], clearances(test, driven)["clearance_m"].to_numpy(), name)
    _cumulative(axes[1], clearances(test, recorded_paths(test))["clearance_m"].to_numpy(), None)
    axes[0].set(xlabel="ADE of a run (m)", ylabel="share of runs below", xscale="log", ylim=(0, 1))
    axes[1].set(
        xlabel="closest approach to any other vehicle (m)", ylabel="share of runs below", xlim=(-1, 6), ylim=(0, 1)
    )
    axes[1].axvline(0, color="0.6", linewidth=0.8)
    for ax in axes[:2]:
        ax.legend(fontsize=7)
    chosen = AGENT if AGENT in agents.driven else next(iter(agents.driven))
    _draw_brush(axes[2], test, agents.driven[chosen][0], agents.scores[chosen][0])
    _draw_gap(axes[3], test, agents.driven[chosen][0], agents.scores[chosen][0], chosen)
    return figure


def _cumulative(ax: Axes, values: Floats, name: str | None) -> None:
    ordered = np.sort(values)
    colour, label = (RECORDED, "recorded drivers") if name is None else (METHOD_COLOURS[name], METHOD_NAMES[name])
    ax.plot(ordered, (np.arange(len(ordered)) + 1) / len(ordered), color=colour, label=label, linewidth=1.3)


def nearest_brush(test: Drivers, driven: list[Trajectories], score: pd.DataFrame) -> tuple[int, int, pd.Series]:
    """Return the run with the closest approach without contact.

    Parameters
    ----------
    test : Drivers
        Test drivers.
    driven : list of Trajectories
        One a period.
    score : pandas.DataFrame
        Scores of the runs.

    Returns
    -------
    period, row : int
        Position of the run; the first run if all have contacts.
    approach : pandas.Series
        Its closest approach.
    """
    close = clearances(test, driven)
    apart = close["clearance_m"].where(~score["collision"].to_numpy() & (close["clearance_m"] > 0), np.inf)
    row = int(np.argmin(apart))
    within = row
    for part, scenes in enumerate(test.scenes):
        if within < len(scenes):
            return part, within, close.iloc[row]
        within -= len(scenes)
    raise AssertionError("more closest approaches than drivers")


def _draw_brush(ax: Axes, test: Drivers, driven: list[Trajectories], score: pd.DataFrame) -> None:
    """Draw the road around the closest approach, from above."""
    part, i, close = nearest_brush(test, driven, score)
    scenes, path, k = test.scenes[part], driven[part], int(close["step"])
    x, y, heading = path.x[i, k], path.y[i, k], path.heading[i, k]
    t = scenes.traffic
    cells = scenes.cell[i : i + 1] + scenes.start + k
    if scenes.leader_source == LEADER_FROM_LANE:
        cells = t.cell(np.arange(1, scenes.road.main_lanes + 1), scenes.first_frame[i] + scenes.start + k)
    for cell in cells:
        for row in range(t.offsets[cell], t.offsets[cell + 1]):
            if t.vehicle[row] != scenes.vehicle[i] and abs(t.x[row] - x) < NEAR:
                ax.add_patch(
                    _outline(
                        t.x[row] - x,
                        t.y[row],
                        t.heading[row],
                        t.length[row],
                        t.width[row],
                        facecolor=TRAFFIC,
                        edgecolor="0.3",
                    )
                )
    ax.add_patch(
        _outline(0.0, y, heading, scenes.length[i], scenes.width[i], facecolor=METHOD_COLOURS[AGENT], edgecolor="k")
    )
    ax.plot(path.x[i, : k + 1] - x, path.y[i, : k + 1], color=METHOD_COLOURS[AGENT], linewidth=1)
    for y_marking in scenes.road.markings:
        ax.axhline(y_marking, color="0.7", linewidth=0.8)
    ax.grid(visible=False)
    ax.set(xlim=(-NEAR, NEAR), ylim=(y - 7, y + 7), aspect="equal", xlabel="along the road (m)", ylabel="y (m)",
           title=f"closest without contact: {close['clearance_m']:.2f} m, vehicle {scenes.vehicle[i]}, "
                 f"{k * FRAME_STEP:.1f} s")  # fmt: skip


def _draw_gap(ax: Axes, test: Drivers, driven: list[Trajectories], score: pd.DataFrame, name: str) -> None:
    """Draw the smallest gap against the final error."""
    late = [path.x[:, -1] - s.x[:, s.start + s.window.horizon] for s, path in zip(test.scenes, driven, strict=True)]
    ax.scatter(np.concatenate(late), score["min_gap_m"], s=5, alpha=0.5, linewidths=0, color=METHOD_COLOURS[name])
    ax.axhline(0, color="0.6", linewidth=0.8)
    ax.axvline(0, color="0.6", linewidth=0.8)
    ax.set(
        xlabel="ahead of the recorded car at the end (m)",
        ylabel="smallest gap to the leader (m)",
        title=METHOD_NAMES[name],
    )
