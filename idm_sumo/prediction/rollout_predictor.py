"""Parameters predicted from one second, fitted through the rollout."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from idm_sumo.calibration.kernel import from_search, sensitivities, slopes_at, to_search
from idm_sumo.calibration.population import SHIFT
from idm_sumo.calibration.problem import Problem, only, prepare
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import basis
from idm_sumo.prediction.learned_by_driving import LearnedByDriving
from idm_sumo.prediction.noise import ObservedScale, ResidualNoise
from idm_sumo.prediction.observation import COLUMNS, first_second
from idm_sumo.prediction.result import Prediction
from idm_sumo.prediction.spread import remaining_covariance
from idm_sumo.prediction.statuses import FEWEST_DRIVERS, OK, Familiar
from idm_sumo.prediction.through_rollout import at, fit_weights
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FURTHEST = 3.0  # standard deviations: a standardised value counts as this at most
SPREAD_WINDOWS = 600  # that the remaining covariance is learnt from
NOISE = 0.2  # m, times the root of the seconds: what positions are uncertain by even if the parameters were known


class RolloutPredictor(LearnedByDriving):
    """Predict IDM parameters linearly from the first second.

    The weights are fitted so that the predicted drivers drive right, not so that their parameters look
    like fitted ones.

    ``predict`` takes rows of features. For what it shares with scikit-learn's estimators, see
    :class:`~idm_sumo.prediction.learned_by_driving.LearnedByDriving`.

    Parameters
    ----------
    ridge : float
        How strongly drivers are drawn to the pooled one.
    folds : int
        In which drivers are left out in turn, to learn how far the prediction is off.
    desired_speed : float, optional
        m/s; by default the road's speed limit.
    seed : int
        Of the folds.
    one_for_all : IDMParameters, optional
        The pooled driver if it is known; fitted to the training windows otherwise.
    past_only : bool
        Whether the observed frames are smoothed by the past alone. Otherwise as the recording is, so that up to a
        second of the future is in them.

    Attributes
    ----------
    weights_ : float64, shape (29, 5)
        From the constant and standardised features to search coordinates.
    covariance_, population_covariance_ : float64, shape (5, 5)
        What remains unknown of a driver after its first second, and without it.
    noise_ : ResidualNoise
        Of positions of drivers that were left out.
    observed_scale_ : ObservedScale
        How uncertain they are by the speed and the gap that were observed.
    familiar_ : Familiar
        What first seconds the training drivers had.
    """

    def __init__(
        self,
        ridge: float = 0.03,
        folds: int = 5,
        desired_speed: float | None = None,
        seed: int = 1,
        one_for_all: IDMParameters | None = None,
        past_only: bool = True,
    ) -> None:
        self.ridge = ridge
        self.folds = folds
        self.desired_speed = desired_speed
        self.seed = seed
        self.one_for_all = one_for_all
        self.past_only = past_only

    def fit(self, scenes: Scenes | Sequence[Scenes], y: None = None) -> RolloutPredictor:
        """Learn from the windows of training drivers.

        Parameters
        ----------
        scenes : Scenes or sequence of Scenes
            Best several windows a driver (``Window(every=20)``).
        y : None
            For scikit-learn's protocol; not used.

        Returns
        -------
        RolloutPredictor

        Raises
        ------
        InputError
            If no window can be driven.
        """
        every, drivers = self._begin(scenes)
        problems = [prepare(one, desired_speed=self.desired_speed) for one in every]
        codes = [self.observe(one).to_numpy(np.float64) for one in every]
        self.center_ = to_search(np.asarray(self.pooled_))
        self._standardise(np.concatenate(codes))
        features = [self._features(code) for code in codes]
        self.weights_ = self._fit_weights(problems, features)
        left_out = self._left_out(problems, features, drivers)
        self._learn_spread(problems, left_out, np.concatenate(codes))
        return self

    def observe(self, scenes: Scenes) -> pd.DataFrame:
        """Return the first seconds of drivers, as :meth:`predict` takes them.

        Parameters
        ----------
        scenes : Scenes

        Returns
        -------
        pandas.DataFrame
            :func:`~idm_sumo.prediction.observation.first_second`, smoothed as at the fit.
        """
        return (self.past_.first_second(scenes) if self.past_only else first_second(scenes))[list(COLUMNS)]

    def predict(self, X: pd.DataFrame | npt.ArrayLike) -> Floats:
        """Return the predicted parameters of drivers.

        Parameters
        ----------
        X : pandas.DataFrame or array, shape (drivers, 10)
            First seconds, see :meth:`observe`.

        Returns
        -------
        float64, shape (drivers, 5)
            ``a, b, T, d0, d1`` in SI units.

        Raises
        ------
        InputError
            If a column is missing.
        """
        code = self._codes(X)
        theta = from_search(at(self.center_, self._features(code), self.weights_))
        return np.asarray(np.where(self.familiar_.known(code)[:, None], theta, np.asarray(self.pooled_)))

    def predict_with_spread(self, X: pd.DataFrame | npt.ArrayLike) -> Prediction:
        """Return predicted parameters and how uncertain they are.

        Parameters
        ----------
        X : pandas.DataFrame or array, shape (drivers, 10)
            First seconds, see :meth:`observe`.

        Returns
        -------
        Prediction
            Its status says which drivers get the population's parameters, and why.

        Raises
        ------
        InputError
            If a column is missing.
        """
        code = self._codes(X)
        status = self.status(code)
        known = (status == OK)[:, None, None]
        covariance = np.where(known, self.covariance_, self.population_covariance_)
        return Prediction(self.predict(code), covariance, status, self.desired_speed_)

    def predict_left_out(self, scenes: Scenes) -> Prediction:
        """Predict drivers of whom some may be training drivers.

        Each by weights that have not seen it.

        Parameters
        ----------
        scenes : Scenes

        Returns
        -------
        Prediction
        """
        code = self.observe(scenes)
        prediction = self.predict_with_spread(code)
        fold = self._fold(scenes)
        features, theta = self._features(self._codes(code)), prediction.theta.copy()
        for k, weights in enumerate(self.fold_weights_):
            mine = (fold == k) & (prediction.status == OK)
            theta[mine] = from_search(at(self.center_, features[mine], weights))
        return prediction._replace(theta=theta, keys=scenes.keys())

    def status(self, X: pd.DataFrame | npt.ArrayLike) -> npt.NDArray[np.str_]:
        """Return "ok", or why the population stands in.

        Parameters
        ----------
        X : pandas.DataFrame or array, shape (drivers, 10)
            First seconds, see :meth:`observe`.

        Returns
        -------
        str, shape (drivers,)

        Raises
        ------
        InputError
            If a column is missing.
        """
        return self.familiar_.status(self._codes(X))

    def scale(self, scenes: Scenes, prediction: Prediction) -> Floats:
        """Return how uncertain (m) the predicted positions are.

        The spread of the parameters through the rollout's derivatives, and noise that grows with the root of
        time; both more or less by what is observed.

        Parameters
        ----------
        scenes : Scenes
        prediction : Prediction
            Of their drivers.

        Returns
        -------
        float64, shape (windows, horizon)
            What :attr:`noise_` multiplies.
        """
        problem = prepare(scenes, desired_speed=self.desired_speed)
        factor = self.observed_scale_.factor(self._scaling(self._codes(self.observe(scenes))))
        return _scale(problem, prediction.theta, prediction.covariance) * factor

    def _codes(self, X: pd.DataFrame | npt.ArrayLike) -> Floats:
        check_is_fitted(self)
        if isinstance(X, pd.DataFrame):
            if absent := [name for name in COLUMNS if name not in X.columns]:
                raise InputError(f"first second has no column {absent[0]!r}; make it with `first_second`")
            X = X[list(COLUMNS)]
        code = np.asarray(X, dtype=np.float64)
        if code.ndim != 2 or code.shape[1] != len(COLUMNS):
            raise InputError(f"first second: shape {code.shape}, needed is (drivers, {len(COLUMNS)})")
        return code

    def _standardise(self, code: Floats) -> None:
        """Remember means, deviations and ranges of the training drivers."""
        usual = np.isfinite(code[:, 1]) & np.isfinite(code[:, 3])
        values = basis.plain(code[usual], self.pooled_, self.desired_speed_)
        self.mean_, self.deviation_ = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-6)
        more = basis.expand(self._standard(values))
        self.more_mean_, self.more_deviation_ = more.mean(axis=0), np.maximum(more.std(axis=0), 1e-6)
        self.familiar_ = Familiar.fit(code[usual], self.drivers_)

    def _standard(self, values: Floats) -> Floats:
        return np.asarray(np.clip((values - self.mean_) / self.deviation_, -FURTHEST, FURTHEST))

    def _scaling(self, code: Floats) -> Floats:
        """Return what the scale depends on, standardised.

        0, the training mean, for drivers that get the population's parameters.
        """
        values = self._standard(basis.plain(code, self.pooled_, self.desired_speed_))[:, [basis.V, basis.LOG_GAP]]
        return np.asarray(np.where(self.familiar_.known(code)[:, None], values, 0.0))

    def _features(self, code: Floats) -> Floats:
        """Return the constant and the standardised features.

        A driver without a leader has none.
        """
        more = basis.expand(self._standard(basis.plain(code, self.pooled_, self.desired_speed_)))
        more = np.clip((more - self.more_mean_) / self.more_deviation_, -FURTHEST, FURTHEST)
        return np.column_stack([np.ones(len(code)), more])

    def _fit_weights(self, problems: list[Problem], features: list[Floats]) -> Floats:
        if self.drivers_ < FEWEST_DRIVERS:
            return np.zeros((features[0].shape[1], len(self.center_)))
        return fit_weights(problems, features, self.center_, self.ridge)

    def _left_out(self, problems: list[Problem], features: list[Floats], driver: list[Integers]) -> list[Floats]:
        """Return search coordinates predicted for every training window.

        By models that have not seen its driver.
        """
        fold = self.fold_of_driver_
        self.fold_weights_: list[Floats] = []
        found = [np.empty((len(phi), len(self.center_))) for phi in features]
        for k in range(self.folds):
            seen = [np.flatnonzero(fold[who] != k) for who in driver]
            weights = self._fit_weights(
                [only(p, w) for p, w in zip(problems, seen, strict=True)],
                [f[w] for f, w in zip(features, seen, strict=True)],
            )
            self.fold_weights_.append(weights)
            for z, phi, who in zip(found, features, driver, strict=True):
                z[fold[who] == k] = at(self.center_, phi[fold[who] == k], weights)
        return found

    def _learn_spread(self, problems: list[Problem], left_out: list[Floats], codes: Floats) -> None:
        """Learn what remains unknown of parameters and positions."""
        step = max(1, self.windows_ // SPREAD_WINDOWS)
        few = [only(problem, np.arange(0, len(z), step)) for problem, z in zip(problems, left_out, strict=True)]
        theta = [from_search(z[::step]) for z in left_out]
        self.covariance_ = remaining_covariance(few, theta)
        self.population_covariance_ = remaining_covariance(few, [np.tile(self.pooled_, (len(t), 1)) for t in theta])
        residuals, scales = [], []
        for problem, z in zip(problems, left_out, strict=True):
            errors, _ = sensitivities(problem, z)
            residuals.append(np.where(problem.counted, -errors, np.nan))
            scales.append(_scale(problem, from_search(z), self.covariance_))
        off, scale, seen = np.concatenate(residuals), np.concatenate(scales), self._scaling(codes)
        self.observed_scale_ = ObservedScale.fit(seen, off, scale)
        self.noise_ = ResidualNoise.fit(off, scale * self.observed_scale_.factor(seen))


def _scale(problem: Problem, theta: Floats, covariance: Floats) -> Floats:
    """Return each position's standard deviation (m).

    By the parameters' covariance and time.
    """
    z = to_search(theta)
    _, slopes = sensitivities(problem, z)
    by_log = slopes * ((theta + SHIFT) / slopes_at(z))[:, :, None]
    spread = np.einsum("njh,njk,nkh->nh", by_log, np.broadcast_to(covariance, (len(z), *covariance.shape[-2:])), by_log)
    time = FRAME_STEP * np.arange(1, problem.target.shape[1] + 1)
    return np.asarray(np.sqrt(np.maximum(spread, 0.0) + NOISE**2 * time))
