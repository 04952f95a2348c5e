"""Pictures of a replay: positions over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import Trajectories

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BEHIND, AHEAD = 25.0, 60.0  # m, shown before the recorded vehicle's start and beyond its end
RECORDED, TRAFFIC = "#000000", "#BBBBBB"


def plot_time_space(
    scenes: Scenes,
    driven: Trajectories | Mapping[str, Trajectories],
    which: int = 0,
    *,
    ax: Axes | None = None,
    colours: Mapping[str, str] | None = None,
) -> Axes:
    """Draw the positions of one driver over time.

    Parameters
    ----------
    scenes : Scenes
    driven : Trajectories, or dict of str to Trajectories
        Of all drivers of ``scenes``, by what the legend calls them.
    which : int
        Row of the driver to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.
    colours : dict of str to str, optional
        By the names of ``driven``; matplotlib's own by default.

    Returns
    -------
    matplotlib.axes.Axes
    """
    if ax is None:
        from matplotlib import pyplot

        _, ax = pyplot.subplots(layout="constrained")
    named = {"modelled": driven} if isinstance(driven, Trajectories) else driven
    steps = scenes.window.horizon + 1
    seconds = np.arange(steps) * FRAME_STEP
    recorded = scenes.x[which, scenes.start : scenes.start + steps]
    limits = float(recorded[0] - BEHIND), float(recorded[-1] + AHEAD)
    where = _others(scenes, which, seconds, limits)
    label = "other vehicles in its lane" if scenes.leader_source == LEADER_FROM_LANE else "its recorded leader"
    ax.scatter(where[:, 0], where[:, 1], s=2, color=TRAFFIC, label=label)
    ax.plot(seconds, recorded, color=RECORDED, linewidth=2.2, label="recorded")
    for name, trajectories in named.items():
        ax.plot(seconds, trajectories.x[which], color=(colours or {}).get(name), linewidth=1.4, label=name)
    ax.set(xlabel="time since the start of the simulation (s)", ylabel="position along the road (m)", ylim=limits,
           title=f"vehicle {scenes.vehicle[which]}, {scenes.period[which]}, lane {scenes.lane[which]}")  # fmt: skip
    ax.legend(fontsize=8)
    return ax


def _others(
    scenes: Scenes, which: int, seconds: npt.NDArray[np.floating[Any]], limits: tuple[float, float]
) -> npt.NDArray[np.float64]:
    """Return times and positions of other vehicles in the lane.

    In s and m, shape ``(points, 2)``.
    """
    t, points = scenes.traffic, []
    for k, second in enumerate(seconds):
        cell = scenes.cell[which] + scenes.start + k
        rows = slice(t.offsets[cell], t.offsets[cell + 1])
        others = t.x[rows][t.vehicle[rows] != scenes.vehicle[which]]
        points += [(second, x) for x in others if limits[0] < x < limits[1]]
    return np.array(points).reshape(-1, 2)
