"""Windows with a shorter or another past."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idm_sumo.calibration.problem import Problem, prepare
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes, Window


def recent(scenes: Scenes, frames: int) -> Scenes:
    """Return the windows with only the last frames observed.

    Parameters
    ----------
    scenes : Scenes
    frames : int
        Observed before the simulation.

    Returns
    -------
    Scenes

    Raises
    ------
    InputError
        If the windows have fewer.
    """
    window = Window(frames, scenes.window.horizon)
    return _cut(scenes, _first(scenes, frames), scenes.start + scenes.window.horizon + 1, window)


def past(scenes: Scenes, frames: int, desired_speed: float | None = None) -> tuple[Scenes, Problem]:
    """Return the last observed frames as windows to be driven.

    From the first of them to the simulation's start. Where leaders come from the lane, what counts ends
    where the driver leaves the lane it is in at first.

    Parameters
    ----------
    scenes : Scenes
    frames : int
        Observed before the simulation.
    desired_speed : float, optional
        m/s; by default the road's speed limit.

    Returns
    -------
    before : Scenes
    problem : Problem

    Raises
    ------
    InputError
        If the windows have fewer frames before the simulation.
    """
    before = _cut(scenes, _first(scenes, frames), scenes.start + 1, Window(1, frames - 1))
    if scenes.leader_source != LEADER_FROM_LANE:
        return before, prepare(before, desired_speed=desired_speed)
    lanes = before.road.lane_at(before.y)
    before = replace(before, lane=lanes[:, 0], cell=before.cells(lanes[:, 0], 0))
    stayed = np.cumprod(lanes == lanes[:, :1], axis=1).astype(np.bool_)
    return before, prepare(before, desired_speed=desired_speed, mask=stayed)


def _first(scenes: Scenes, frames: int) -> int:
    if not 1 <= frames <= scenes.start + 1:
        raise InputError(
            f"frames = {frames}: must be between 1 and the {scenes.start + 1} that are observed before the simulation"
        )
    return scenes.start + 1 - frames


def _cut(scenes: Scenes, first: int, last: int, window: Window) -> Scenes:
    names = (c.X, c.Y, c.HEADING, c.SPEED, c.HEADWAY, *(() if scenes.raw_x is None else (c.RAW_X, c.RAW_Y)))
    paths = {name: getattr(scenes, name)[:, first:last] for name in names}
    return replace(scenes, window=window, cell=scenes.cell + first, first_frame=scenes.first_frame + first, **paths)
