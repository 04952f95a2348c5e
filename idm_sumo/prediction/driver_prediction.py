"""A table of drivers predicted through the rollout: parameters, their spread, and what they are based on."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.stats import norm

from idm_sumo.calibration.hierarchical import SHIFT
from idm_sumo.models.idm import LOWER, UPPER, IDMParameters
from idm_sumo.prediction.moving_horizon import MovingHorizon, recent
from idm_sumo.prediction.observation import first_second
from idm_sumo.prediction.rollout_predictor import RolloutPredictor
from idm_sumo.prediction.spread import logarithms
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

LEARNING_STEP = 30  # frames between the windows that are learned from
WATCHING_STEP = 60  # between those from which is learned how much a longer past counts
SECOND = 10  # frames that are read off; more are driven again
LIKELY = 0.9  # of the drivers lie between the columns `*_low` and `*_high`


def predict_through_rollout(scenes: Scenes, predictor: RolloutPredictor | MovingHorizon) -> pd.DataFrame:
    """Predict the drivers of ``scenes`` from their first frames.

    Parameters
    ----------
    scenes : Scenes
    predictor : RolloutPredictor or MovingHorizon
        Fitted. A driver it was fitted to is predicted by the fold that left it out.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, first_frame, a, b, T, d0, d1, status, based_on``, the ends of the
        90 % interval of every parameter (``a_low, a_high``, ...) and the first second.
    """
    prediction = predictor.predict_left_out(scenes)
    if isinstance(predictor, MovingHorizon):
        learned = predictor.predictor
        seen = recent(scenes, learned.observed_)
        counts = f", those before the last {learned.observed_} counting {predictor.strength_:g}"
    else:
        learned, seen, counts = predictor, scenes, ""
    table = scenes.keys()
    table[list(IDMParameters._fields)] = prediction.theta
    table["status"] = prediction.status
    table["based_on"] = (
        f"{scenes.window.observed} frames, fit through the rollout of {learned.windows_} windows of "
        f"{learned.drivers_} drivers{counts}"
    )
    half = norm.ppf(0.5 + 0.5 * LIKELY) * np.sqrt(np.einsum("njj->nj", prediction.covariance))
    middle = logarithms(prediction.theta)
    for end, sign in (("low", -1.0), ("high", 1.0)):
        limit = np.clip(np.exp(middle + sign * half) - SHIFT, np.array(LOWER), np.array(UPPER))
        table[[f"{name}_{end}" for name in IDMParameters._fields]] = limit
    return table.join(first_second(seen))


def drivers_of(scenes: Scenes, table: pd.DataFrame) -> Scenes:
    """Return the windows of the drivers that a driver table names.

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
