"""One small sound input of every kind, as the table or the values that mutations change."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.models.idm import IDMParameters
from idm_sumo.recordings import columns as c
from idm_sumo.roads.us101 import US101
from tests.helpers import ngsim_files

FRAMES = 30


def ngsim() -> pd.DataFrame:
    """Return three cars in NGSIM's columns (feet)."""
    return ngsim_files.table(frames=FRAMES)


def fcd() -> pd.DataFrame:
    """Return the same as SUMO writes floating car data."""
    raw = ngsim()
    return pd.DataFrame({
        "timestep_time": raw["Frame_ID"] * 0.1, "vehicle_id": [f"car.{n}" for n in raw["Vehicle_ID"]],
        "vehicle_x": raw["Local_Y"] * 0.3048, "vehicle_y": -raw["Local_X"] * 0.3048, "vehicle_angle": 90.0,
        "vehicle_speed": raw["v_Vel"] * 0.3048, "vehicle_lane": "entry_3", "vehicle_length": 4.5,
    })  # fmt: skip


def pairs() -> pd.DataFrame:
    """Return a follower and its leader."""
    t = 0.1 * np.arange(FRAMES)
    return pd.DataFrame({
        "period": "p1", "follower": 2, "leader": 1, "t": t, "x_follower": 12.0 * t, "x_leader": 30.0 + 12.0 * t,
        "leader_length": 4.5, "v_follower": 12.0,
    })  # fmt: skip


def own() -> pd.DataFrame:
    """Return a recording in its own columns."""
    steps = np.arange(FRAMES)
    return pd.DataFrame({
        c.PERIOD: "p1", c.VEHICLE: 1, c.FRAME: steps, c.TIME: 0.1 * steps, c.X: 10.0 + 1.2 * steps,
        c.Y: float(US101.lane_center(3)), c.SPEED: 12.0, c.ACCELERATION: 0.0, c.HEADING: 0.0, c.LENGTH: 4.5,
        c.WIDTH: 1.8, c.CLASS: 2, c.LANE: 3, c.LEADER: 0, c.HEADWAY: np.nan,
    })  # fmt: skip


def drivers() -> pd.DataFrame:
    """Return a table of two drivers."""
    return pd.DataFrame({
        "period": "p1", "vehicle": [1, 2], "a": 1.5, "b": 2.0, "T": 1.2, "d0": 2.5, "d1": 0.5, "ade_m": 0.4,
        "status": "ok", "desired_speed_m_s": 24.6,
    })  # fmt: skip


def model() -> dict[str, object]:
    """Return an extended model with one cause."""
    base = {**IDMParameters(1.5, 2.0, 1.2, 2.5, 0.5)._asdict(), "desired_speed": 24.6}
    return {
        "format": "idm-sumo extended model 1", "source": "", "law": "idm", "reaction": 1.0, "base": base, "causes": [],
        "drivers": "",
    }  # fmt: skip


def run_file() -> str:
    """Return a run file."""
    return (
        'recordings = ["surrogate"]\nobserved = 10\nhorizon = 100\nneighbours = 8\nframe_counts = [2, 10]\nseed = 1\n'
    )


def policy() -> dict[str, np.ndarray]:
    """Return the arrays of a policy of one layer."""
    return {"w0": np.zeros((16, 2)), "b0": np.zeros(2), "facts": np.array('{"kind": "clone", "seed": 1}')}
