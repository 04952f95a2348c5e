"""The study's spine: scenes of training and test drivers, their oracles, and every prediction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import calibrate, pooled
from idm_sumo.driving_code import FEATURES, features_of
from idm_sumo.idm import IDMParameters
from idm_sumo.prediction import KNNPredictor, average_parameters, first_gap_parameters
from idm_sumo.progress import Progress, silent
from idm_sumo.scenes import Window

from .drivers import Drivers
from .settings import Settings
from .source import Source

Floats = npt.NDArray[np.float64]
PARAMETERS = list(IDMParameters._fields)


@dataclass(frozen=True)
class Study:
    """Training and test drivers with everything learned from the training side.

    Attributes
    ----------
    settings : Settings
    train, test : Drivers
    train_fits, test_fits : pandas.DataFrame
        Oracle calibrations, one row a window, in the windows' order.
    pooled : IDMParameters
        The one set that minimises the training drivers' mean ADE.
    excluded : pandas.DataFrame
        Vehicles without a window: ``period, vehicle, reason``.
    """

    settings: Settings
    train: Drivers
    test: Drivers
    train_fits: pd.DataFrame
    test_fits: pd.DataFrame
    pooled: IDMParameters
    excluded: pd.DataFrame

    @cached_property
    def library(self) -> tuple[pd.DataFrame, Floats]:
        """Codes over the whole window and oracle parameters of the training drivers that could be fitted."""
        theta = self.train_fits[PARAMETERS].to_numpy()
        fitted = np.isfinite(theta).all(axis=1)
        codes = self.train.code()
        return codes[fitted].reset_index(drop=True), theta[fitted]

    def neighbours(self, codes: pd.DataFrame, k: int, features: tuple[str, ...] = tuple(FEATURES)) -> Floats:
        """Predict parameters for test drivers with these codes by the paper's averaging of ``k`` neighbours.

        ``features`` are the paper's symbols; a library smaller than ``k`` is averaged whole.
        """
        train_codes, theta = self.library
        columns = features_of(features, speed=self.settings.code_speed)
        return KNNPredictor(min(k, len(theta)), columns).fit(train_codes, theta).predict(codes)


def prepare(source: Source, settings: Settings, window: Window, progress: Progress = silent) -> Study:
    """Cut the windows of both sides and calibrate every driver.

    Raises
    ------
    InputError
        If one side has no driver with a whole window.
    """
    rng = np.random.default_rng(settings.seed)
    train, excluded_train = source.drivers(source.train, "train", window)
    test, excluded_test = source.drivers(source.test, "test", window)
    train, test = train.sample(settings.max_drivers, rng), test.sample(settings.max_drivers, rng)
    progress("pooled calibration", 0, 3)
    one_for_all = pooled(train.scenes, desired_speed=settings.desired_speed)
    progress("calibration of training drivers", 1, 3)
    train_fits = _fits(train, settings)
    progress("calibration of test drivers", 2, 3)
    test_fits = _fits(test, settings)
    progress("calibration", 3, 3)
    excluded = pd.concat([excluded_train, excluded_test], ignore_index=True)
    return Study(settings, train, test, train_fits, test_fits, one_for_all, excluded)


def _fits(drivers: Drivers, settings: Settings) -> pd.DataFrame:
    """Calibrate all drivers of one side, in the order of their windows."""
    fits = [calibrate(s, desired_speed=settings.desired_speed, seed=settings.seed) for s in drivers.scenes]
    return pd.concat(fits, ignore_index=True)


def predictions(study: Study) -> dict[str, Floats]:
    """Return every IDM method's parameters of the test drivers, shape (windows, 5), by method name."""
    s = study.settings
    seen = study.test.code(s.observed)
    _, theta = study.library
    n = len(study.test)
    first_gap = [first_gap_parameters(scenes, study.pooled) for scenes in study.test.scenes]
    oracle = study.test_fits[PARAMETERS].to_numpy()
    one_for_all = np.tile(study.pooled, (n, 1))
    return {
        "idm_average": np.tile(average_parameters(theta), (n, 1)),
        "idm_prediction": study.neighbours(seen, s.neighbours),
        "idm_first_gap": np.concatenate(first_gap),
        "idm_pooled": one_for_all,
        # A driver whose fit failed keeps the pooled parameters; the fit's status says so.
        "idm_oracle": np.where(np.isfinite(oracle), oracle, one_for_all),
    }
