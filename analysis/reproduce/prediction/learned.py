"""The predictor fitted through the rollout, and its windows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import calibrate
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import RolloutPredictor, first_second
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
    """The predictor and the training windows it was fitted to.

    Attributes
    ----------
    windows : Drivers
        Training windows.
    predictor : RolloutPredictor
        Fitted predictor.
    """

    windows: Drivers
    predictor: RolloutPredictor


def learn(source: Source, settings: Settings, window: Window) -> Learned:
    """Fit the predictor to windows along the training drivers' way.

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
        The predictor and its windows.
    """
    drivers, _ = source.drivers(source.train, "train", replace(window, every=LEARNING_STEP))
    rng = np.random.default_rng(settings.seed)
    windows = replace(drivers, scenes=tuple(some_drivers(scenes, rng) for scenes in drivers.scenes))
    predictor = RolloutPredictor(desired_speed=settings.desired_speed, seed=settings.seed)
    return Learned(windows, predictor.fit(list(windows.scenes)))


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


def first_seconds(drivers: Drivers) -> pd.DataFrame:
    """Return what is observed in each window's first second.

    Parameters
    ----------
    drivers : Drivers
        Windows.

    Returns
    -------
    pandas.DataFrame
        :func:`idm_sumo.prediction.first_second`, one row a window.
    """
    return pd.concat([first_second(s) for s in drivers.scenes], ignore_index=True)


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
