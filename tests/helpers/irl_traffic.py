"""Small traffic for the learner's tests: modelled cars among others, on all lanes."""

from __future__ import annotations

import numpy as np

from idm_sumo.irl.policy import drive_policy
from idm_sumo.irl.simulation import actions_of
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Scenes, Window
from idm_sumo.simulation.rollout import Trajectories
from tests.helpers.builders import Car, scenes

FRAMES = 40


def busy(cars: int = 6, *, horizon: int = 30, seed: int = 1, has_leader_rows: bool = True) -> Scenes:
    """Return ``cars`` modelled drivers of about 12 m/s, somewhat off their lanes' middles, with traffic around."""
    rng = np.random.default_rng(seed)
    all_cars = []
    for i in range(cars):
        x0, speed = 40.0 + 90.0 * i, rng.uniform(10, 14)
        lane = 1 + i % US101.main_lanes
        left, right = (lane + 2 if lane == 1 else lane - 1), (lane - 2 if lane == US101.main_lanes else lane + 1)
        middle = float(US101.lane_center(lane))
        y = middle + rng.uniform(-0.3, 0.3) * np.ones(FRAMES)
        all_cars.append(Car(i + 1, x0, speed=speed, y=y, frames=FRAMES, headway=rng.uniform(15, 25) + 4.0))
        for number, (dx, where) in enumerate(((18, lane), (-16, lane), (6, left), (-8, right), (28, right))):
            x, aside = x0 + dx + rng.uniform(-3, 3), rng.uniform(-0.1, 0.1) * float(US101.lane_width(where))
            other = Car(
                10_000 + 10 * i + number,
                x,
                y=np.full(FRAMES, float(US101.lane_center(where)) - aside),
                speed=speed + rng.uniform(-1.5, 1.5),
                frames=FRAMES,
                length=rng.uniform(4, 8),
            )
            if has_leader_rows:
                all_cars.append(other)
    return scenes(
        *all_cars, window=Window(4, horizon), modelled=tuple(range(1, cars + 1)), has_leader_rows=has_leader_rows
    )


def drive_controls(some: Scenes, acceleration: np.ndarray, steering: np.ndarray) -> Trajectories:
    """Drive every vehicle by given controls, arrays of shape (vehicles, horizon) in m/s² and rad."""
    actions = iter(actions_of(np.stack([acceleration, steering], axis=2).swapaxes(0, 1)))
    return drive_policy(some, lambda _: next(actions))
