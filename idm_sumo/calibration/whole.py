"""Calibration of each driver over all of its windows together."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.calibration.pooled import pooled
from idm_sumo.calibration.status import OK
from idm_sumo.calibration.table import full_ade
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import PARAMETERS

WINDOWS = "windows"  # column: how many windows of the driver its parameters were fitted to


def fit_whole_drivers(fits: pd.DataFrame, scenes: Scenes, progress: Progress = silent) -> pd.DataFrame:
    """Fit every driver to all of its windows together.

    Parameters
    ----------
    fits : pandas.DataFrame
        As :func:`idm_sumo.calibration.table.calibrate` returns for the same scenes.
    scenes : Scenes
        Several windows a driver.
    progress : Progress
        Called with the drivers done and their total.

    Returns
    -------
    pandas.DataFrame
        The row of each driver's first window, with the parameters that have the smallest mean ADE over those of its
        windows that can be fitted; ``ade_m`` is that mean, ``windows`` their number. Standard deviations are those of
        independent windows together; a parameter is undetermined if every window leaves it so.
    """
    groups = fits.groupby([c.PERIOD, c.VEHICLE], sort=False, observed=True).indices
    rows = []
    for done, every in enumerate(groups.values(), 1):
        rows.append(_one(fits, scenes, np.asarray(every)))
        progress("calibration", done, len(groups))
    return pd.DataFrame(rows).reset_index(drop=True).astype({c.VEHICLE: "int64"})


def _one(fits: pd.DataFrame, scenes: Scenes, every: np.ndarray[tuple[int], np.dtype[np.int64]]) -> pd.Series:
    """Return the row of one driver."""
    usable = every[(fits["status"].to_numpy()[every] == OK)]
    first = usable[0] if len(usable) else every[0]
    row = fits.iloc[int(first)].copy()
    row[WINDOWS] = len(usable)
    if len(usable) < 2:
        return row
    part, told = scenes.subset(usable), fits.iloc[usable]
    limit = told["desired_speed_m_s"].max()
    theta = pooled(part, desired_speed=float(limit))
    row[list(PARAMETERS)] = list(theta)
    row["ade_m"] = full_ade(part, np.tile(theta, (len(part), 1)), limit).mean()
    row["status"] = OK
    for name in PARAMETERS:
        row[f"{name}_sd"] = float(1.0 / np.sqrt((1.0 / told[f"{name}_sd"].clip(lower=1e-9) ** 2).sum()))
    row["undetermined"] = ",".join(_common(told["undetermined"]))
    row["at_bound"] = ",".join(_common(told["at_bound"]))
    return row


def _common(names: pd.Series) -> list[str]:
    """Return the names that all lists have, in order."""
    lists = [set(str(one).split(",")) for one in names]
    return [name for name in PARAMETERS if all(name in one for one in lists)]
