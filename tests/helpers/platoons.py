"""A small two-period recording in NGSIM's layout: platoons behind leaders that speed up and slow down.

Written with plain arithmetic (followers repeat their leader's path later and farther back,
after Newell), so it shares nothing with the models under test.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from tests.helpers.ngsim_files import OFFICIAL

STARTS = (1118846978900, 1118847842000)  # ms, what frame 0 would be of the first two periods
FEET = 0.3048


def platoon_recording(
    *, periods: int = 2, platoons: int = 4, cars: int = 6, frames: int = 220, seed: int = 3
) -> pd.DataFrame:
    """Return rows with the official columns, feet."""
    rng = np.random.default_rng(seed)
    rows = []
    for period in range(periods):
        for platoon in range(platoons):
            lane = platoon % 5 + 1
            first = 50 + 260 * (platoon // 5)
            rows += _platoon(rng, period, platoon, lane, first, cars, frames)
    return pd.concat(rows, ignore_index=True)[list(OFFICIAL)]


def _platoon(
    rng: np.random.Generator, period: int, platoon: int, lane: int, first: int, cars: int, frames: int
) -> list[pd.DataFrame]:
    t = np.arange(-400, frames) * 0.1
    speed = 11 + 3 * np.sin(2 * np.pi * t / 25 + rng.uniform(0, 6)) + np.cumsum(rng.normal(0, 0.02, len(t)))
    path = 250 + np.cumsum(speed) * 0.1 - np.cumsum(speed)[400] * 0.1
    wait, back, rows = 0.0, 0.0, []
    ahead = np.full(frames, np.nan)
    for car in range(cars):
        x = np.interp(t[400:] - wait, t, path) - back
        x = x + rng.normal(0, 0.05, frames)
        number = platoon * cars + car + 1
        frame = first + np.arange(frames)
        rows.append(pd.DataFrame({
            "Vehicle_ID": number, "Frame_ID": frame, "Total_Frames": frames,
            "Global_Time": STARTS[period] + 100 * frame,
            "Local_X": 12 * (lane - 0.5) + 0.3, "Local_Y": x / FEET, "Global_X": 0.0, "Global_Y": 0.0, "v_Length": 15.0,
            "v_Width": 6.0, "v_Class": 2, "v_Vel": 36.0, "v_Acc": 0.0, "Lane_ID": lane,
            "Preceding": number - 1 if car else 0, "Following": 0,
            "Space_Headway": (ahead - x) / FEET if car else 0.0, "Time_Headway": 0.0,
        }))  # fmt: skip
        ahead = x
        wait, back = wait + rng.uniform(0.7, 1.6), back + rng.uniform(6, 9)
    return rows
