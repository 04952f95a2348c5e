"""The arrays that pictures of a diagnosis need, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration.driver_table import DESIRED_SPEED, HAS
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.models import idm
from idm_sumo.recordings.columns import FRAME_STEP

Floats = npt.NDArray[np.float64]

FITTED = ("a", "b", "T", "d0", DESIRED_SPEED)
COVARIATES = (
    "vehicle", "window", "lag", "position", "time", "speed", "gap", "approach_rate", "leader_acceleration",
    "since_change", "lane", "leader_class", "adjacent_difference", "rear_gap", "base", "extended",
)  # fmt: skip


def residuals(windows: w.Windows, base: Floats | None, extended: Floats | None) -> pd.DataFrame:
    """Return one row a compared moment; see :class:`~idm_sumo.diagnosis.result.Diagnosis`. Empty without rollouts."""
    if base is None or extended is None or not len(windows.seen):
        return pd.DataFrame({name: np.empty(0) for name in COVARIATES})
    at = windows.seen[:, :, w.LEAD + w.EVERY :: w.EVERY]
    moments = at.shape[2]
    columns: dict[str, npt.NDArray[Any]] = {
        "vehicle": np.repeat(windows.vehicle[windows.driver], moments),
        "window": np.repeat(np.arange(len(at)), moments),
        "lag": np.tile((1.0 + np.arange(moments)) * w.EVERY * FRAME_STEP, len(at)),
        "position": at[:, w.X].ravel(), "time": at[:, w.TIME].ravel(), "speed": at[:, w.V].ravel(),
        "gap": (at[:, w.REAR] - at[:, w.X]).ravel(), "approach_rate": (at[:, w.V] - at[:, w.SPEED]).ravel(),
        "leader_acceleration": at[:, w.ACCELERATION].ravel(), "since_change": at[:, w.SINCE].ravel(),
        "lane": at[:, w.LANE].astype(np.int64).ravel(), "leader_class": at[:, w.KIND].astype(np.int64).ravel(),
        "adjacent_difference": (at[:, w.V] - at[:, w.ADJACENT]).ravel(),
        "rear_gap": (at[:, w.X] - at[:, w.BEHIND]).ravel(), "base": base.ravel(), "extended": extended.ravel(),
    }  # fmt: skip
    table = pd.DataFrame(columns)
    table.loc[table["since_change"] > 1e5, "since_change"] = np.nan
    table.loc[~np.isfinite(table["rear_gap"]), "rear_gap"] = np.nan
    return table


def drivers(windows: w.Windows, own: Fit, held: Mapping[str, Any]) -> pd.DataFrame:
    """Return one row a driver: its parameters at a fit, for rollouts; ADE (m) of those held out."""
    # `b` may be larger than a driver table's, where it no longer matters.
    theta = np.clip(own.theta, (*idm.LOWER[:4], 0.0), (*idm.UPPER[:4], np.inf))
    table = pd.DataFrame({
        "period": windows.period, "vehicle": windows.vehicle,
        "windows": np.bincount(windows.driver, minlength=windows.drivers),
        **dict(zip(FITTED, theta.T, strict=True)), "d1": 0.0,
    })  # fmt: skip
    without = windows.seen[:, w.WITHOUT, 0] > 0.0
    if without.any():
        table[HAS] = (np.bincount(windows.driver, ~without, windows.drivers) > 0.0).astype(np.int64)
    if not held:
        return table.assign(held_out=False, base_ade=np.nan, extended_ade=np.nan)
    known = pd.DataFrame({
        "period": held["period"], "vehicle": held["vehicle"], "base_ade": held["base"], "extended_ade": held["extended"]
    })  # fmt: skip
    merged = table.merge(known, how="left", on=["period", "vehicle"])
    return merged.assign(held_out=merged["base_ade"].notna())
