"""Compilation of the kernels beside other work.

A first run so does not wait for it.
"""

from __future__ import annotations

from concurrent.futures import Future

import numpy as np
import pandas as pd

from idm_sumo.calibration import calibrate, pooled
from idm_sumo.evaluation.metrics import score
from idm_sumo.prediction.driving_code import driving_code
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.runtime.workers import beside
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm

CARS, FRAMES, HEADWAY = 4, 40, 25.0
ROAD = Road("warm-up", widths=(3.5, 3.5, 3.5), length=1000.0, speed_limit=30.0)


def compile_beside() -> Future[None]:
    """Compile the kernels in another process.

    They go into the cache on disk that all processes share.

    Returns
    -------
    concurrent.futures.Future
        Wait for the end with ``.result()``.
    """
    return beside(compile_kernels)


def compile_kernels() -> None:
    """Call every kernel of the study once."""
    scenes = build_scenes(_platoon(), Window(observed=5, horizon=20))
    pooled(scenes)
    fits = calibrate(scenes)
    driving_code(scenes, 5)
    score(scenes, drive_idm(scenes, fits[["a", "b", "T", "d0", "d1"]].fillna(1.0).to_numpy()))


def _platoon() -> Recording:
    """Return a few vehicles that follow each other."""
    frame = np.tile(np.arange(FRAMES), CARS)
    car = np.repeat(np.arange(CARS), FRAMES)
    speed = 12.0 - car
    table = pd.DataFrame({
        c.PERIOD: "warm", c.VEHICLE: car + 1, c.FRAME: frame, c.TIME: frame * FRAME_STEP,
        c.X: speed * frame * FRAME_STEP - HEADWAY * car, c.Y: float(ROAD.lane_center(3)), c.SPEED: speed,
        c.ACCELERATION: 0.0, c.HEADING: 0.0, c.LENGTH: ROAD.car_length, c.WIDTH: ROAD.car_width, c.CLASS: 2,
        c.LANE: 3, c.LEADER: car, c.HEADWAY: np.nan,
    })  # fmt: skip
    return Recording.from_table(table, road=ROAD, source="warm-up")
