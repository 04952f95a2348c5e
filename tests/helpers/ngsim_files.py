"""Small files in the layouts people bring, written from one table of a few cars."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.recordings.readers.layouts import OFFICIAL

START = 1118846978900  # ms; Global_Time - 100 * Frame_ID of the first official period
LATER = 1118847842000  # of the second


def table(vehicles: int = 3, frames: int = 30, *, start: int = START, first_frame: int = 13) -> pd.DataFrame:
    """Cars one behind the other on lane 2, 60 ft apart, at 40 ft/s; official columns, feet."""
    rows = []
    for number in range(1, vehicles + 1):
        frame = first_frame + np.arange(frames)
        rows.append(pd.DataFrame({
            "Vehicle_ID": number, "Frame_ID": frame, "Total_Frames": frames, "Global_Time": start + 100 * frame,
            "Local_X": 18.5, "Local_Y": 1000 - 60 * number + 4.0 * np.arange(frames), "Global_X": 6451137.641,
            "Global_Y": 1873344.962, "v_Length": 14.5, "v_Width": 4.9, "v_Class": 2, "v_Vel": 40.0, "v_Acc": 0.5,
            "Lane_ID": 2, "Preceding": number - 1, "Following": (number + 1) % (vehicles + 1),
            "Space_Headway": 60.0 if number > 1 else 0.0, "Time_Headway": 1.5 if number > 1 else 0.0,
        }))  # fmt: skip
    return pd.concat(rows, ignore_index=True)[list(OFFICIAL)]


def official(path: Path, rows: pd.DataFrame, blank: str = "   ") -> Path:
    lines = [blank.join(str(cell) for cell in row) for row in rows.astype(object).itertuples(index=False)]
    path.write_text("\n".join(lines) + "\n")
    return path


def portal(path: Path, rows: pd.DataFrame, *, location: str = "us-101", encoding: str = "utf-8") -> Path:
    """As the data portal writes: other cases, further columns, thousands separators."""
    out = rows.rename(columns={"v_Length": "v_length", "v_Class": "v_Class", "Lane_ID": "Lane_ID"})
    out.insert(14, "O_Zone", "")
    out["Global_Time"] = [f"{value:,}" for value in rows["Global_Time"]]
    out["Local_Y"] = [f"{value:,.3f}" for value in rows["Local_Y"]]
    if "Location" not in out:
        out["Location"] = location
    out.to_csv(path, index=False, encoding=encoding)
    return path
