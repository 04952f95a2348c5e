"""Leader-follower pairs as other people record them: one row a frame, both vehicles in it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.recordings.columns import FRAME_STEP


def pair(
    follower, leader, *, gap=20.0, length=4.5, start=50.0, period="0400-0415", frames=40, first=100
) -> pd.DataFrame:
    """Return one pair in metres: both cars at 8 m/s, swaying a little."""
    t = (first + np.arange(frames)) * FRAME_STEP
    x = start + 8 * (t - t[0]) + 0.3 * np.sin(0.5 * (t - t[0]))
    speed = 8 + 0.15 * np.cos(0.5 * (t - t[0]))
    return pd.DataFrame({
        "period": period, "follower": follower, "leader": leader, "t": t, "x_follower": x, "v_follower": speed,
        "a_follower": -0.075 * np.sin(0.5 * (t - t[0])), "x_leader": x + gap + length, "v_leader": speed,
        "leader_length": length, "spacing": gap,
    })  # fmt: skip
