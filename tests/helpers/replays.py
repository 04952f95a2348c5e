"""Recorded traffic to be replayed, orderly and not, and the comparison of two replays."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.us101 import US101
from idm_sumo.simulation.rollout import Trajectories

DRIVER = (1.4, 1.8, 1.1, 2.0, 1.0)


def vehicle(number, x, y, speed, *, frames=40, length=4.7, heading=0.0, headway=np.nan, lane=None, first=100):
    """Return the rows of one vehicle: at constant speed from ``x``, unless arrays are given."""
    time = np.arange(frames) * FRAME_STEP
    front = x if np.ndim(x) else x + speed * time
    lateral = np.broadcast_to(y, frames)
    return pd.DataFrame(
        {
            c.PERIOD: "p", c.VEHICLE: number, c.FRAME: np.arange(frames) + first, c.TIME: time, c.X: front,
            c.Y: lateral, c.SPEED: speed, c.ACCELERATION: 0.0, c.HEADING: heading, c.LENGTH: length, c.WIDTH: 1.9,
            c.CLASS: 2, c.LANE: US101.lane_at(lateral) if lane is None else lane, c.LEADER: 0, c.HEADWAY: headway,
        }
    )  # fmt: skip


def crowd(seed=0, vehicles=50, frames=112) -> pd.DataFrame:
    """Return traffic that changes lanes, overlaps, crosses edges' ends and stops: worse than any recording."""
    rng = np.random.default_rng(seed)
    time, parts = np.arange(frames) * FRAME_STEP, []
    for number in range(1, vehicles + 1):
        lane = rng.integers(1, 6)
        speed = np.clip(rng.uniform(0, 14) + 4 * np.sin(time * rng.uniform(0.2, 1) + number), 0, None)
        front = rng.uniform(100, 450) + np.concatenate([[0], np.cumsum(speed[:-1])]) * FRAME_STEP
        change = rng.choice([-1, 0, 0, 1]) / (1 + np.exp(-2 * (time - rng.uniform(0, 11))))
        lateral = US101.lane_center(lane) + rng.normal(0, 0.5) + change * US101.widths[0]
        heading = np.arctan2(np.gradient(lateral, FRAME_STEP), np.maximum(speed, 1))
        length = rng.choice([2.1, 3.9, 4.7, 14.0])
        parts.append(vehicle(number, front, lateral, speed, frames=frames, length=length, heading=heading))
    return pd.concat(parts)


def assert_same(one: Trajectories, other: Trajectories) -> None:
    """Every figure agrees; a micrometre would already be a fault."""
    np.testing.assert_array_equal(one.leader, other.leader)
    for name in ("x", "y", "heading", "speed", "acceleration", "steering", "gap"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-9, err_msg=name)
