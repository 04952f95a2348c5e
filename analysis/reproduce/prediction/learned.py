"""The predictors fitted through the rollout, and their windows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import calibrate
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import ResidualPredictor, RolloutPredictor
from idm_sumo.prediction.driver_prediction import LEARNING_STEP
from idm_sumo.scenes.windows import Scenes, Window
from idm_sumo.simulation.rollout import Trajectories

from ..drivers import Drivers
from ..settings import Settings
from ..source import Source

Floats = npt.NDArray[np.float64]
MOST_DRIVERS = 300  # largest number of drivers to learn from


@dataclass(frozen=True)
class Learned:
    """The predictors and the training windows they were fitted to.

    Attributes
    ----------
    windows : Drivers
        Training windows.
    predictor : RolloutPredictor
        Of IDM parameters; its pooled set is that of the whole report.
    residual : ResidualPredictor
        Of what a driver does beyond the pooled IDM.
    """

    windows: Drivers
    predictor: RolloutPredictor
    residual: ResidualPredictor

    def first_seconds(self, drivers: Drivers) -> pd.DataFrame:
        """Return what is observed in each window.

        Smoothed by the past alone.

        Parameters
        ----------
        drivers : Drivers
            Windows.

        Returns
        -------
        pandas.DataFrame
            One row a window.
        """
        return pd.concat([self.predictor.observe(s) for s in drivers.scenes], ignore_index=True)


def learn(source: Source, settings: Settings, window: Window) -> Learned:
    """Fit the predictors to windows along the training drivers' way.

    Parameters
    ----------
    source : Source
        Recordings, split into training and test.
    settings : Settings
        Settings of the run.
    window : Window
        Observed and simulated frames.

    Returns
    -------
    Learned
        The predictors and their windows.
    """
    drivers, _ = source.drivers(source.train, "train", replace(window, every=LEARNING_STEP))
    rng = np.random.default_rng(settings.seed)
    windows = replace(drivers, scenes=tuple(some_drivers(scenes, rng) for scenes in drivers.scenes))
    predictor = RolloutPredictor(desired_speed=settings.desired_speed, seed=settings.seed)
    predictor.fit(list(windows.scenes))
    return Learned(windows, predictor, residual_of(predictor).fit(list(windows.scenes)))


def residual_of(predictor: RolloutPredictor, **changes: Any) -> ResidualPredictor:
    """Return a residual on a fitted predictor's pooled set.

    Parameters
    ----------
    predictor : RolloutPredictor
        Fitted.
    **changes
        Further parameters of the residual.

    Returns
    -------
    ResidualPredictor
        Not fitted.
    """
    same = {"desired_speed": predictor.desired_speed, "seed": predictor.seed, "one_for_all": predictor.pooled_}
    return ResidualPredictor(**(same | changes))


def some_drivers(scenes: Scenes, rng: np.random.Generator, most: int = MOST_DRIVERS) -> Scenes:
    """Return the windows of some drivers, drawn at random.

    Parameters
    ----------
    scenes : Scenes
        Windows of one period.
    rng : numpy.random.Generator
        Source of the draws.
    most : int
        Largest number of drivers.

    Returns
    -------
    Scenes
        Windows of at most so many drivers.
    """
    vehicles = np.unique(scenes.vehicle)
    if len(vehicles) <= most:
        return scenes
    return scenes.subset(np.isin(scenes.vehicle, rng.choice(vehicles, most, replace=False)))


def fits_or(scenes: Scenes, pooled: IDMParameters, desired_speed: float | None) -> Floats:
    """Return fitted parameters, the pooled ones where a fit failed.

    Parameters
    ----------
    scenes : Scenes
        Windows of one period.
    pooled : IDMParameters
        The pooled set.
    desired_speed : float, optional
        Desired speed (m/s).

    Returns
    -------
    float64, shape (windows, 5)
        ``a, b, T, d0, d1``.
    """
    theta = calibrate(scenes, desired_speed=desired_speed)[list(IDMParameters._fields)].to_numpy(np.float64)
    return np.where(np.isfinite(theta), theta, np.asarray(pooled))


def window_ade(scenes: Scenes, driven: Trajectories) -> Floats:
    """Return the ADE of each window.

    Parameters
    ----------
    scenes : Scenes
        Windows of one period.
    driven : Trajectories
        One row a window.

    Returns
    -------
    float64, shape (windows,)
        Average displacement error (m).
    """
    return np.asarray(displacement(scenes, driven).mean(axis=1))


def stays_in_lane(scenes: Scenes) -> npt.NDArray[np.bool_]:
    """Return which recorded vehicles stay in their lane.

    Parameters
    ----------
    scenes : Scenes
        Windows of one period.

    Returns
    -------
    bool array, shape (windows,)
    """
    lane = scenes.road.lane_at(scenes.y)
    return np.asarray((lane == lane[:, :1]).all(axis=1))
