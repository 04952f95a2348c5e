"""The paper's KNN prediction and plain baselines.

IDM parameters of drivers that were observed for a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.impute import SimpleImputer
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted, validate_data

from idm_sumo.models.idm import LOWER, UPPER, IDMParameters
from idm_sumo.prediction.driving_code import FEATURES, driving_code
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.perception import leaders_along
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import DESIRED_SPEED

Floats = npt.NDArray[np.float64]

LEFT_OUT_PARTS = 10  # a library driver is predicted by the nine tenths it is not in


class KNNPredictor(RegressorMixin, MultiOutputMixin, BaseEstimator):  # type: ignore[misc]
    """Average the training drivers with the nearest driving codes.

    Codes are standardised by the training drivers' means and deviations; a missing value
    (no leader seen) takes the training mean, so that it neither attracts nor repels.

    Parameters
    ----------
    n_neighbors : int
        The paper's K, 8.
    features : sequence of str or None
        Columns of the driving code to use when codes come as a table; None takes all. An
        array, and a table whose columns have no names, is used whole.

    Attributes
    ----------
    pipeline_ : sklearn.pipeline.Pipeline
        Imputation, standardisation, neighbours.
    imputed_ : int64, shape (features,)
        Values of the training codes that were missing.
    n_features_in_ : int
    """

    def __init__(self, n_neighbors: int = 8, features: Sequence[str] | None = tuple(FEATURES.values())) -> None:
        self.n_neighbors = n_neighbors
        self.features = features

    def fit(self, X: pd.DataFrame | npt.ArrayLike, y: npt.ArrayLike) -> KNNPredictor:
        """Remember the training drivers.

        Parameters
        ----------
        X : pandas.DataFrame or array, shape (drivers, features)
            Driving codes.
        y : array, shape (drivers, 5)
            Their IDM parameters ``a, b, T, d0, d1``.

        Returns
        -------
        KNNPredictor

        Raises
        ------
        InputError
            If a feature is missing or there are fewer drivers than neighbours.
        """
        codes, theta = validate_data(
            self, self._chosen(X), y, ensure_all_finite="allow-nan", multi_output=True, y_numeric=True
        )
        if self.n_neighbors > len(codes):
            raise InputError(
                f"n_neighbors = {self.n_neighbors}: only n_samples = {len(codes)} training drivers; ask for fewer"
            )
        self.imputed_ = np.isnan(codes).sum(axis=0)
        imputer = SimpleImputer(strategy="mean", keep_empty_features=True)
        self.pipeline_: Pipeline = make_pipeline(imputer, StandardScaler(), KNeighborsRegressor(self.n_neighbors))
        self.pipeline_.fit(codes, theta)
        return self

    def predict(self, X: pd.DataFrame | npt.ArrayLike) -> Floats:
        """Return the predicted parameters of drivers.

        Parameters
        ----------
        X : pandas.DataFrame or array, shape (drivers, features)
            Driving codes.

        Returns
        -------
        float64, shape (drivers, 5)
            ``a, b, T, d0, d1`` in SI units.

        Raises
        ------
        InputError
            If a feature is missing.
        """
        codes = self._checked(X)
        return np.asarray(self.pipeline_.predict(codes))

    def missing(self, X: pd.DataFrame | npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Return how many values of each feature are filled in.

        Parameters
        ----------
        X : pandas.DataFrame or array, shape (drivers, features)
            Driving codes that :meth:`predict` would be given.

        Returns
        -------
        int64, shape (features,)
        """
        return np.asarray(np.isnan(self._checked(X)).sum(axis=0))

    def _checked(self, X: pd.DataFrame | npt.ArrayLike) -> Floats:
        check_is_fitted(self)
        return np.asarray(validate_data(self, self._chosen(X), reset=False, ensure_all_finite="allow-nan"))

    def _chosen(self, X: Any) -> Any:
        """Pick the features out of a table of codes."""
        if self.features is None or not isinstance(X, pd.DataFrame) or not _has_names(X):
            return X
        if absent := [name for name in self.features if name not in X.columns]:
            raise InputError(f"driving code has no column {absent[0]!r}; it has {', '.join(map(str, X.columns))}")
        return X[list(self.features)]

    def __sklearn_tags__(self) -> Any:
        """Tell scikit-learn that missing values are allowed."""
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


def _has_names(table: pd.DataFrame) -> bool:
    """Return whether scikit-learn takes labels for names of features."""
    return all(isinstance(name, str) for name in table.columns)


def average_parameters(theta: npt.ArrayLike) -> IDMParameters:
    """Return the average of drivers, the paper's "IDM Ave.".

    Parameters
    ----------
    theta : array_like, shape (drivers, 5)
        ``a, b, T, d0, d1`` in SI units.

    Returns
    -------
    IDMParameters
    """
    return IDMParameters(*np.asarray(theta, dtype=np.float64).mean(axis=0).tolist())


def first_gap_parameters(scenes: Scenes, pooled: IDMParameters, *, desired_speed: float | None = None) -> Floats:
    r"""Return pooled parameters that keep each driver's first gap.

    The baseline without any learning about drivers. Only ``T`` differs: it makes the gap at
    the start of the simulation the equilibrium gap at the speed of the start,

    .. math:: T = \frac{d\sqrt{1 - (v/v_0)^4} - d_0 - d_1\sqrt{v/v_0}}{v},

    :func:`idm_sumo.models.idm.equilibrium_gap` solved for ``T``, within the bounds of calibration.
    Where no ``T`` does it (no leader, at standstill, at or above the desired speed) the
    pooled one stays.

    Parameters
    ----------
    scenes : Scenes
    pooled : IDMParameters
    desired_speed : float, optional
        m/s; by default the road's speed limit.

    Returns
    -------
    float64, shape (vehicles, 5)
    """
    start = slice(scenes.start, scenes.start + 1)
    gap = leaders_along(scenes, scenes.x[:, start], scenes.y[:, start], scenes.start).gap[:, 0]
    speed, limit = scenes.speed[:, scenes.start], scenes.road.desired_speed(desired_speed)
    solvable = np.isfinite(gap) & (speed > 0.0) & (speed < limit)
    v, d = speed[solvable], gap[solvable]
    share = v / limit
    headway = (d * np.sqrt(1.0 - share**4) - pooled.d0 - pooled.d1 * np.sqrt(share)) / v
    theta = np.tile(np.asarray(pooled, dtype=np.float64), (len(scenes), 1))
    theta[solvable, IDMParameters._fields.index("T")] = np.clip(headway, LOWER.T, UPPER.T)
    return theta


def predict_drivers(scenes: Scenes, library: pd.DataFrame, *, observed: int, neighbours: int) -> pd.DataFrame:
    """Predict drivers from their first frames and calibrated drivers.

    A driver that is in the library itself (same period and vehicle) is predicted without its
    own row: the library is left out in ten parts, as in cross-validation.

    Parameters
    ----------
    scenes : Scenes
    library : pandas.DataFrame
        Calibrated drivers with their driving codes, as ``idm-sumo calibrate`` writes them.
    observed, neighbours : int, keyword-only
        Frames that are seen of each driver, and how many similar drivers are averaged.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, first_frame, a, b, T, d0, d1, desired_speed_m_s, status, based_on`` and the code.

    Raises
    ------
    InputError
        If the library holds no usable driver or no driving codes.
    """
    known = _usable(library)
    codes = driving_code(scenes, observed)
    own = pd.MultiIndex.from_arrays([scenes.period, scenes.vehicle])
    part_of_known = pd.factorize(known.set_index([c.PERIOD, c.VEHICLE]).index)[0] % LEFT_OUT_PARTS
    part_of = pd.Series(
        part_of_known, index=pd.MultiIndex.from_frame(known[[c.PERIOD, c.VEHICLE]].astype({c.PERIOD: str}))
    )
    part = part_of[~part_of.index.duplicated()].reindex(own).fillna(-1).to_numpy(dtype=np.int64)
    theta, speed = np.empty((len(scenes), len(IDMParameters._fields))), np.empty(len(scenes))
    wanted = known.get(DESIRED_SPEED, pd.Series(scenes.road.speed_limit, index=known.index))
    for number in np.unique(part):
        rest = known[part_of_known != number]
        if rest.empty:
            raise InputError("the driver table holds no drivers but the ones to be predicted; calibrate more drivers")
        predictor = KNNPredictor(min(neighbours, len(rest))).fit(
            rest[list(FEATURES.values())], rest[list(IDMParameters._fields)]
        )
        theta[part == number] = predictor.predict(codes[part == number])
        speed[part == number] = predictor.fit(rest[list(FEATURES.values())], wanted[rest.index]).predict(
            codes[part == number]
        )
    blind = codes["leader_frames"] == 0
    table = scenes.keys()
    table[list(IDMParameters._fields)] = theta
    table[DESIRED_SPEED] = speed.clip(wanted.min(), wanted.max())  # a mean of equal numbers differs by rounding
    table["status"] = np.where(blind, "no leader seen: time headway filled in by the library's mean", "ok")
    table["based_on"] = f"{observed} frames, {neighbours} neighbours of {len(known)} drivers"
    return table.join(codes)


def _usable(library: pd.DataFrame) -> pd.DataFrame:
    """Return the drivers with finite parameters and driving code."""
    if absent := [name for name in FEATURES.values() if name not in library.columns]:
        raise InputError(f"driver table has no column {absent[0]!r}; write it with `idm-sumo calibrate`")
    finite = np.isfinite(library[list(IDMParameters._fields)].to_numpy(np.float64)).all(axis=1)
    if not finite.any():
        raise InputError("the driver table holds no driver with finite parameters; see its column `status`")
    return library[finite].reset_index(drop=True)
