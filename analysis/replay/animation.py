"""An animated picture of one replay, seen from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.transforms import Affine2D

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import LEADER_OF_RECORDED, Scenes
from idm_sumo.simulation.rollout import Trajectories

from ..page.style import METHOD_COLOURS, RECORDED, TRAFFIC, new_figure

AHEAD, BEHIND = 90.0, 50.0  # m of road in the picture, from the recorded car
EVERY = 2  # frames a picture: five a second


def animate(
    recording: Recording, scenes: Scenes, trajectories: Trajectories, path: Path, progress: Progress = silent
) -> None:
    """Write a GIF of the first driver.

    The recorded car is a black outline, the modelled car filled with colour, traffic grey.

    Parameters
    ----------
    recording : Recording
    scenes : Scenes
    trajectories : Trajectories
    path : Path
    progress : Progress
        Called with a stage's name, what is done of it and its total.
    """
    figure, (ax,) = new_figure(9, 2.6)
    table = recording.of_period(scenes.one_period).table
    first = int(scenes.first_frame[0]) + scenes.start
    steps = trajectories.x.shape[1]
    around = table[table[c.FRAME].between(first, first + steps - 1) & (table[c.VEHICLE] != scenes.vehicle[0])]
    by_frame = {int(frame): rows for frame, rows in around.groupby(c.FRAME)}
    _road(ax, scenes.road)
    writer = PillowWriter(fps=round(1 / (EVERY * FRAME_STEP)))
    with writer.saving(figure, str(path), dpi=90):
        for k in range(0, steps, EVERY):
            progress("drawing", k, steps)
            _draw(ax, scenes, trajectories, k, by_frame.get(first + k))
            writer.grab_frame()
            figure.set_layout_engine(None)  # the first picture's margins hold for all: anew, each is drawn twice
    progress("drawing", steps, steps)


def _draw(ax: Axes, scenes: Scenes, trajectories: Trajectories, k: int, around: pd.DataFrame | None) -> None:
    """Draw one frame: other cars at another place of the same road."""
    for car in list(ax.patches):
        car.remove()
    frame = scenes.start + k
    middle = scenes.x[0, frame]
    ax.set_xlim(middle - BEHIND, middle + AHEAD)
    if around is not None:
        near = around[around[c.X].between(middle - BEHIND - 20, middle + AHEAD + 20)]
        sizes = near[[c.LENGTH, c.WIDTH]].fillna({c.LENGTH: scenes.road.car_length, c.WIDTH: scenes.road.car_width})
        for row in near[[c.X, c.Y, c.HEADING]].join(sizes).to_numpy():
            x, y, heading, length, width = row
            _car(ax, x, y, heading, length, width, TRAFFIC)
    if scenes.leader_source == LEADER_OF_RECORDED:
        _leader(ax, scenes, frame)
    length, width = float(scenes.length[0]), float(scenes.width[0])
    _car(ax, trajectories.x[0, k], trajectories.y[0, k], trajectories.heading[0, k], length, width,
         METHOD_COLOURS["idm_prediction"], label="modelled")  # fmt: skip
    _car(ax, scenes.x[0, frame], scenes.y[0, frame], scenes.heading[0, frame], length, width,
         RECORDED, label="recorded", outlined=True)  # fmt: skip
    error = np.hypot(trajectories.x[0, k] - middle, trajectories.y[0, k] - scenes.y[0, frame])
    ax.set_title(
        f"vehicle {scenes.vehicle[0]}, {scenes.period[0]}: {k * FRAME_STEP:.1f} s, {error:.1f} m apart", fontsize=9
    )
    if ax.get_legend() is None:
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.02), fontsize=7, ncols=2, borderaxespad=0.0)


def _road(ax: Axes, road: Road) -> None:
    """Draw what is the same in every frame."""
    for lane, y in enumerate(road.markings):
        edge = lane in (0, road.main_lanes)
        ax.axhline(y, color="0.5", linewidth=1.2 if edge else 0.6, linestyle="-" if edge else (0, (8, 8)))
    ax.set(ylim=(-road.width - 1, 1), xlabel="position along the road (m)", yticks=[])
    ax.set_aspect("equal")
    ax.grid(visible=False)


def _leader(ax: Axes, scenes: Scenes, frame: int) -> None:
    """Draw the leader, the only other vehicle known."""
    t = scenes.traffic
    cell = scenes.cell[0] + frame
    for row in range(t.offsets[cell], t.offsets[cell + 1]):
        _car(ax, t.x[row], t.y[row], t.heading[row], t.length[row], t.width[row], TRAFFIC)


def _car(
    ax: Axes, x: float, y: float, heading: float, length: float, width: float, colour: str, *,
    label: str | None = None, outlined: bool = False,
) -> None:  # fmt: skip
    """Draw a car, filled or as an outline that lets a car below it be seen; ``x, y`` is its front bumper's centre."""
    look = {"fill": False, "edgecolor": colour, "linewidth": 1.6} if outlined else {"facecolor": colour}
    body = Rectangle((-length, -width / 2), length, width, label=label, **look)
    body.set_transform(Affine2D().rotate(heading).translate(x, y) + ax.transData)
    ax.add_artist(body)  # unlike add_patch, it does not work out limits, which are given here
