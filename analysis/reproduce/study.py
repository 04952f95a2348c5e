"""Scenes of training and test drivers, their oracles, and predictions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import Population, calibrate, hierarchical
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import KNNPredictor, average_parameters, first_gap_parameters
from idm_sumo.prediction.driving_code import FEATURES, features_of
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import Window

from .drivers import Drivers
from .prediction.learned import Learned, learn
from .settings import Settings
from .source import Source

Floats = npt.NDArray[np.float64]
PARAMETERS = list(IDMParameters._fields)


@dataclass(frozen=True)
class Study:
    """Training and test drivers with all that was learned.

    Attributes
    ----------
    settings : Settings
        Settings of the run.
    train, test : Drivers
        Windows of both sides.
    train_fits, test_fits : pandas.DataFrame
        Oracle calibrations, one row a window, in the windows' order.
    pooled : IDMParameters
        The one set that minimises the training drivers' mean ADE, over windows along their whole way.
    population : Population
        Distribution of the training drivers' parameters.
    learned : Learned
        The predictors that were fitted through the rollout, and their windows.
    drawn_fits : pandas.DataFrame
        Test drivers fitted to their whole window and drawn to that population.
    excluded : pandas.DataFrame
        Vehicles without a window: ``period, vehicle, reason``.
    """

    settings: Settings
    train: Drivers
    test: Drivers
    train_fits: pd.DataFrame
    test_fits: pd.DataFrame
    pooled: IDMParameters
    population: Population
    learned: Learned
    drawn_fits: pd.DataFrame
    excluded: pd.DataFrame

    @cached_property
    def library(self) -> tuple[pd.DataFrame, Floats]:
        """Codes and oracle parameters of the fitted training drivers."""
        theta = self.train_fits[PARAMETERS].to_numpy()
        fitted = np.isfinite(theta).all(axis=1)
        codes = self.train.code()
        return codes[fitted].reset_index(drop=True), theta[fitted]

    def neighbours(
        self, codes: pd.DataFrame, k: int, features: tuple[str, ...] = tuple(FEATURES), speed: str | None = None
    ) -> Floats:
        """Predict parameters by the paper's averaging of neighbours.

        Parameters
        ----------
        codes : pandas.DataFrame
            Driving codes of the test drivers, one row a window.
        k : int
            Number of neighbours; a library smaller than that is averaged whole.
        features : tuple of str
            The paper's symbols of the features in use.
        speed : {"own", "relative"}, optional
            What ``nu`` stands for; by default what the settings say.

        Returns
        -------
        float64, shape (windows, 5)
            ``a, b, T, d0, d1``.
        """
        train_codes, theta = self.library
        columns = features_of(features, speed=speed or self.settings.code_speed)
        return KNNPredictor(min(k, len(theta)), columns).fit(train_codes, theta).predict(codes)

    def or_pooled(self, fits: pd.DataFrame) -> Floats:
        """Return fitted parameters, pooled ones where a fit failed.

        Parameters
        ----------
        fits : pandas.DataFrame
            One row a window.

        Returns
        -------
        float64, shape (windows, 5)
            ``a, b, T, d0, d1``.
        """
        theta = fits[PARAMETERS].to_numpy()
        return np.where(np.isfinite(theta), theta, np.array(self.pooled))


def prepare(source: Source, settings: Settings, window: Window, progress: Progress = silent) -> Study:
    """Cut the windows of both sides and calibrate every driver.

    Parameters
    ----------
    source : Source
        Recordings, split into training and test.
    settings : Settings
        Settings of the run.
    window : Window
        Observed and simulated frames.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    Study
        Ready for the tables.

    Raises
    ------
    InputError
        If a side has no driver with a whole window.
    """
    rng = np.random.default_rng(settings.seed)
    train, excluded_train = source.drivers(source.train, "train", window)
    test, excluded_test = source.drivers(source.test, "test", window)
    train, test = train.sample(settings.max_drivers, rng), test.sample(settings.max_drivers, rng)
    progress("calibration", 0, 5)
    learned = learn(source, settings, window)
    progress("calibration", 1, 5)
    train_fits = fits_of(train, settings)
    progress("calibration", 2, 5)
    test_fits = fits_of(test, settings)
    progress("calibration", 3, 5)
    _, population = hierarchical(train.scenes, desired_speed=settings.desired_speed)
    progress("calibration", 4, 5)
    drawn_fits, _ = hierarchical(test.scenes, population=population, desired_speed=settings.desired_speed)
    progress("calibration", 5, 5)
    excluded = pd.concat([excluded_train, excluded_test], ignore_index=True)
    return Study(
        settings,
        train,
        test,
        train_fits,
        test_fits,
        learned.predictor.pooled_,
        population,
        learned,
        drawn_fits,
        excluded,
    )


def fits_of(drivers: Drivers, settings: Settings) -> pd.DataFrame:
    """Calibrate all drivers of one side, in their windows' order.

    Parameters
    ----------
    drivers : Drivers
        Windows of one side of the study.
    settings : Settings
        Settings of the run.

    Returns
    -------
    pandas.DataFrame
        One row a window.
    """
    fits = [calibrate(s, desired_speed=settings.desired_speed) for s in drivers.scenes]
    return pd.concat(fits, ignore_index=True)


def predictions(study: Study) -> dict[str, Floats]:
    """Return every IDM method's parameters of the test drivers.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    dict of str to float64, shape (windows, 5)
        ``a, b, T, d0, d1`` by name of the method.
    """
    s = study.settings
    seen = study.test.code(s.observed)
    _, theta = study.library
    n = len(study.test)
    first_gap = [first_gap_parameters(one, study.pooled, desired_speed=s.desired_speed) for one in study.test.scenes]
    one_for_all = np.tile(study.pooled, (n, 1))

    return {
        "idm_average": np.tile(average_parameters(theta), (n, 1)),
        "idm_prediction": study.neighbours(seen, s.neighbours),
        "idm_rollout": study.learned.predictor.predict(study.learned.first_seconds(study.test)),
        "idm_first_gap": np.concatenate(first_gap),
        "idm_pooled": one_for_all,
        "idm_typical": np.tile(study.population.typical(), (n, 1)),
        "idm_hierarchical": study.or_pooled(study.drawn_fits),
        "idm_oracle": study.or_pooled(study.test_fits),
    }
