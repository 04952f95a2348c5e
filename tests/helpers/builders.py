"""Tiny recordings, written inline: a few cars on straight lanes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.simulation.rollout import Trajectories


class Car(NamedTuple):
    """A vehicle at constant speed, or along given positions (m, one per frame)."""

    vehicle: int
    x: float | npt.NDArray[np.float64] = 0.0
    lane: float = 3
    speed: float | npt.NDArray[np.float64] = 10.0
    y: npt.NDArray[np.float64] | None = None
    heading: float | npt.NDArray[np.float64] = 0.0
    length: float = 4.0
    width: float = 2.0
    headway: float | npt.NDArray[np.float64] = np.nan
    first_frame: int = 1
    frames: int = 40
    vehicle_class: int = 2


def rows_of(car: Car, period: str = "p1") -> pd.DataFrame:
    steps = np.arange(car.frames)
    moves = np.ndim(car.x) == 0
    y = float(US101.lane_center(car.lane)) if car.y is None else car.y
    return pd.DataFrame({
        c.PERIOD: period, c.VEHICLE: car.vehicle, c.FRAME: car.first_frame + steps,
        c.TIME: (car.first_frame + steps) * FRAME_STEP,
        c.X: car.x + car.speed * FRAME_STEP * steps if moves else car.x, c.Y: y, c.SPEED: car.speed,
        c.ACCELERATION: 0.0, c.HEADING: car.heading, c.LENGTH: car.length, c.WIDTH: car.width,
        c.CLASS: car.vehicle_class, c.LANE: US101.lane_at(np.broadcast_to(y, car.frames)), c.LEADER: 0,
        c.HEADWAY: car.headway,
    })  # fmt: skip


def recording(*cars: Car, period: str = "p1", has_leader_rows: bool = True) -> Recording:
    table = pd.concat([rows_of(car, period) for car in cars], ignore_index=True)
    return Recording.from_table(table, road=US101, source="inline", has_leader_rows=has_leader_rows)


def scenes(
    *cars: Car,
    window: Window = Window(observed=4, horizon=20),  # noqa: B008 - frozen
    modelled: tuple[int, ...] = (1,),
    has_leader_rows: bool = True,
) -> Scenes:
    return build_scenes(recording(*cars, has_leader_rows=has_leader_rows), window, modelled=modelled)


def trajectories(
    some: Scenes,
    *,
    x: npt.ArrayLike | None = None,
    y: npt.ArrayLike | None = None,
    heading: npt.ArrayLike | None = None,
    speed: npt.ArrayLike | None = None,
) -> Trajectories:
    """Take the recorded vehicle's path where no other is given; arrays of one row a driver."""
    steps = some.window.horizon
    out = Trajectories.of(some)
    for name, given in (("x", x), ("y", y), ("heading", heading), ("speed", speed)):
        recorded = getattr(some, name)[:, some.start : some.start + steps + 1]
        getattr(out, name)[:] = recorded if given is None else given
    out.acceleration[:] = np.diff(out.speed, axis=1) / FRAME_STEP
    out.steering[:], out.gap[:], out.leader[:] = 0.0, np.inf, -1
    return out
