"""A table of drivers predicted through the rollout.

Parameters, their spread, and what they are based on.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.prediction.rollout_predictor import RolloutPredictor
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import DESIRED_SPEED

LEARNING_STEP = 30  # frames between the windows that are learned from
SECOND = 10  # frames that parameters are predicted from
LIKELY = 0.9  # of the drivers lie between the columns `*_low` and `*_high`


def predict_through_rollout(scenes: Scenes, predictor: RolloutPredictor) -> pd.DataFrame:
    """Predict the drivers of ``scenes`` from their first frames.

    Parameters
    ----------
    scenes : Scenes
    predictor : RolloutPredictor
        Fitted. A driver it was fitted to is predicted by the fold that left it out.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, first_frame, a, b, T, d0, d1, desired_speed_m_s, status, based_on``, the ends of the
        90 % interval of every parameter (``a_low, a_high``, ...) and the first second.
    """
    prediction = predictor.predict_left_out(scenes)
    table = prediction._replace(keys=scenes.keys()).to_pandas()
    based_on = (
        f"{scenes.window.observed} frames, fit through the rollout of {predictor.windows_} windows of "
        f"{predictor.drivers_} drivers"
    )
    table.insert(table.columns.get_loc("status") + 1, "based_on", based_on)
    return table.join(predictor.observe(scenes))


def typical_desired_speed(drivers: pd.DataFrame) -> float | None:
    """Return the median desired speed (m/s) of drivers.

    A driver that is yet to be predicted is taken to want what drivers want; one second of it does not tell.

    Parameters
    ----------
    drivers : pandas.DataFrame
        A driver table.

    Returns
    -------
    float or None
        None where the table has no desired speeds.
    """
    return float(drivers[DESIRED_SPEED].median()) if DESIRED_SPEED in drivers else None


def drivers_of(scenes: Scenes, table: pd.DataFrame) -> Scenes:
    """Return the windows of a driver table's drivers.

    Parameters
    ----------
    scenes : Scenes
    table : pandas.DataFrame
        ``period, vehicle`` of the drivers.

    Returns
    -------
    Scenes

    Raises
    ------
    InputError
        If none of them is in the scenes.
    """
    keys = pd.MultiIndex.from_frame(table[[c.PERIOD, c.VEHICLE]].astype({c.PERIOD: str}))
    named = np.asarray(pd.MultiIndex.from_arrays([scenes.period, scenes.vehicle]).isin(keys))
    if not named.any():
        raise InputError("--drivers: none of its drivers is in the recording; use `--method knn`, or leave it out")
    return scenes.subset(named)
