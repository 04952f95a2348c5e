"""Compilation of a calibration's kernels, before many recordings need them at once."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads import Road
from idm_sumo.scenes.windows import Window, build_scenes

from ..drivers.calibrated import Calibration, driver_table

CARS, FRAMES, HEADWAY = 12, 60, 25.0  # as many cars as a population has at least, and some more
ROAD = Road("warm-up", widths=(3.5, 3.5, 3.5), length=1500.0, speed_limit=30.0)


def compile_kernels() -> None:
    """Calibrate a few vehicles, which calls every kernel of it once; what is compiled is kept on the disk."""
    window = Window(observed=5, horizon=20)
    driver_table(build_scenes(smooth(clean(_platoon())), window), Calibration(window))


def _platoon() -> Recording:
    """Return vehicles that follow each other and slow down one after the other."""
    frame, car = np.tile(np.arange(FRAMES), CARS), np.repeat(np.arange(CARS), FRAMES)
    since = frame * FRAME_STEP
    speed = 12.0 + np.sin(0.8 * since - 0.5 * car)
    way = 12.0 * since - (np.cos(0.8 * since - 0.5 * car) - np.cos(0.5 * car)) / 0.8
    table = pd.DataFrame({
        c.PERIOD: "warm", c.VEHICLE: car + 1, c.FRAME: frame, c.TIME: since, c.X: 400.0 + way - HEADWAY * car,
        c.Y: float(ROAD.lane_center(3)), c.SPEED: speed, c.ACCELERATION: 0.0, c.HEADING: 0.0,
        c.LENGTH: ROAD.car_length, c.WIDTH: ROAD.car_width, c.CLASS: 2, c.LANE: 3, c.LEADER: car, c.HEADWAY: np.nan,
    })  # fmt: skip
    return Recording.from_table(table, road=ROAD, source="warm-up")
