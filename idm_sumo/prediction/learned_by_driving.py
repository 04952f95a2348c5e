"""What predictors that learn by driving windows have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.base import BaseEstimator

from idm_sumo.calibration import pooled
from idm_sumo.calibration.pooled import usable_windows
from idm_sumo.calibration.problem import prepare
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction.past_only import PastOnly
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

Integers = npt.NDArray[np.int64]


class LearnedByDriving(BaseEstimator):  # type: ignore[misc]
    """A predictor fitted to windows of training drivers.

    Of scikit-learn's protocol it follows what needs no arrays: parameters are set at construction and by
    ``set_params``, ``clone`` copies them, ``fit`` returns the predictor and what is learned ends in an
    underscore. It is fitted to scenes, not to ``X, y``, because drivers are learned by driving them;
    ``check_estimator``, pipelines and grid searches over arrays therefore do not apply.

    Attributes
    ----------
    pooled_ : IDMParameters
    past_ : PastOnly
        How the observed frames are smoothed.
    keys_ : pandas.MultiIndex
        Period and vehicle of the training drivers.
    drivers_, windows_ : int
        Learned from.
    fold_of_driver_ : int64, shape (drivers,)
        In which each of them is left out.
    observed_ : int
        Frames that were seen of them.
    desired_speed_ : float
        m/s, as given or the limit of the road that was learned from.
    """

    folds: int
    desired_speed: float | None
    seed: int
    one_for_all: IDMParameters | None
    past_only: bool

    def _begin(self, scenes: Scenes | Sequence[Scenes]) -> tuple[list[Scenes], list[Integers]]:
        """Return the windows that can be driven, and their drivers.

        Drivers are numbered from 0 over all periods.
        """
        every = driveable([scenes] if isinstance(scenes, Scenes) else list(scenes), self.desired_speed)
        self.desired_speed_ = float(every[0].road.desired_speed(self.desired_speed))
        self.observed_ = every[0].window.observed
        driver, self.keys_ = numbered(every)
        self.drivers_, self.windows_ = len(self.keys_), len(driver)
        self.past_ = PastOnly.fit(every if self.past_only else [])
        self.pooled_: IDMParameters = self.one_for_all or pooled(every, desired_speed=self.desired_speed)
        self.fold_of_driver_ = np.random.default_rng(self.seed).permutation(self.drivers_) % self.folds
        return every, np.split(driver, np.cumsum([len(one) for one in every])[:-1])

    def _fold(self, scenes: Scenes) -> Integers:
        """Return in which fold each window's driver was left out.

        The number of folds for a driver that was not learned from.
        """
        number = self.keys_.get_indexer(pd.MultiIndex.from_arrays([scenes.period, scenes.vehicle]))
        return np.where(number >= 0, self.fold_of_driver_[number], self.folds)


def driveable(every: list[Scenes], desired_speed: float | None) -> list[Scenes]:
    """Return the windows that can be driven.

    Parameters
    ----------
    every : list of Scenes
    desired_speed : float or None
        m/s.

    Returns
    -------
    list of Scenes

    Raises
    ------
    InputError
        If there is none.
    """
    found = [one.subset(usable_windows(prepare(one, desired_speed=desired_speed), one)) for one in every]
    if not sum(map(len, found)):
        raise InputError("prediction: no training window can be driven; see `idm-sumo inspect` for why")
    return [one for one in found if len(one)]


def numbered(every: list[Scenes]) -> tuple[Integers, pd.MultiIndex]:
    """Return every window's driver, and all drivers' keys.

    Drivers are numbered from 0 over all periods; the keys are their periods and vehicles.

    Parameters
    ----------
    every : list of Scenes

    Returns
    -------
    number : int64, shape (windows,)
    keys : pandas.MultiIndex
    """
    keys = pd.concat([one.keys() for one in every])[[c.PERIOD, c.VEHICLE]]
    number, found = pd.factorize(pd.MultiIndex.from_frame(keys))
    return np.asarray(number, dtype=np.int64), pd.MultiIndex.from_tuples(list(found))
