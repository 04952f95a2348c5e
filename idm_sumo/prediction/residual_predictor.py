"""The pooled IDM and a residual predicted from observation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from idm_sumo.calibration.problem import prepare
from idm_sumo.models.idm import IDMParameters
from idm_sumo.models.residual import LEAST_GAP, LONGEST, OWN, REGRESSORS, SLOWEST
from idm_sumo.prediction import observation as o
from idm_sumo.prediction.learned_by_driving import LearnedByDriving
from idm_sumo.prediction.noise import ObservedScale, ResidualNoise
from idm_sumo.prediction.observation import COLUMNS, first_second
from idm_sumo.prediction.past_only import LEADER_MEAN_ACCELERATION, MEAN_ACCELERATION
from idm_sumo.prediction.residual_drive import ResidualDrivers, ResidualModel
from idm_sumo.prediction.residual_facts import expanded, facts
from idm_sumo.prediction.residual_fit import Part, by_fold, fit_folds, fit_residual, own_numbers
from idm_sumo.prediction.residual_rollout import Shared, errors_of
from idm_sumo.prediction.statuses import FEWEST_DRIVERS, OK, Familiar
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

RIDGES = (0.001, 0.005, 0.03, 0.2)
FURTHEST = 3.0  # standard deviations: a fact counts as this at most
LEAST_SCALE = 1e-6
HARDEST = 6.0  # m/s^2, of a leader's acceleration at the start


class ResidualPredictor(LearnedByDriving):
    r"""Predict what a driver does beyond the pooled IDM.

    Its acceleration is :math:`\dot v_\mathrm{IDM}(s) + w^\top\psi(s, t)` in closed loop: :math:`\psi` holds the present
    state, its squares and products, and what was observed of the driver, lasting and fading within 1 s and 3 s
    (:mod:`idm_sumo.models.residual`). Nothing in it looks ahead. The weights are fitted so that the driven vehicles
    stay near the recorded ones. A driver's present manoeuvre goes on for seconds, which no constant parameter says.

    Such a driver is no IDM: it drives in replay (:func:`~idm_sumo.prediction.residual_drive.drive_residual`), and a
    vehicle type of SUMO cannot hold it. :class:`~idm_sumo.prediction.rollout_predictor.RolloutPredictor` predicts what
    can be exported.

    Parameters
    ----------
    ridges : sequence of float
        How strongly drivers are drawn to the pooled one; the one with which drivers that were left out are driven
        best is taken.
    folds : int
        In which drivers are left out in turn.
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
    model_ : ResidualModel
        What all drivers share.
    weights_ : float64, shape (20 + 3 facts,)
        Shared ones, then those from the facts to a driver's three numbers.
    ridge_ : float
    noise_ : ResidualNoise
        Of positions of drivers that were left out.
    observed_scale_ : ObservedScale
        How uncertain they are by the speed and the gap that were observed.
    """

    def __init__(
        self,
        ridges: Sequence[float] = RIDGES,
        folds: int = 5,
        desired_speed: float | None = None,
        seed: int = 1,
        one_for_all: IDMParameters | None = None,
        past_only: bool = True,
    ) -> None:
        self.ridges = ridges
        self.folds = folds
        self.desired_speed = desired_speed
        self.seed = seed
        self.one_for_all = one_for_all
        self.past_only = past_only

    def fit(self, scenes: Scenes | Sequence[Scenes], y: None = None) -> ResidualPredictor:
        """Learn from the windows of training drivers.

        Parameters
        ----------
        scenes : Scenes or sequence of Scenes
            Best several windows a driver (``Window(every=30)``).
        y : None
            For scikit-learn's protocol; not used.

        Returns
        -------
        ResidualPredictor

        Raises
        ------
        InputError
            If no window can be driven.
        """
        every, drivers = self._begin(scenes)
        codes = [self.observe(one) for one in every]
        self._standardise(every, codes)
        folds = [self.fold_of_driver_[who] for who in drivers]
        parts = [self._part(one, code, k) for one, code, k in zip(every, codes, folds, strict=True)]
        self._learn(parts)
        self._learn_noise(parts, np.concatenate([self._scaling(code) for code in codes]))
        return self

    def observe(self, scenes: Scenes) -> pd.DataFrame:
        """Return what is seen of drivers before the simulation.

        Parameters
        ----------
        scenes : Scenes

        Returns
        -------
        pandas.DataFrame
            :func:`~idm_sumo.prediction.observation.first_second`, smoothed as at the fit, and the accelerations over
            the last second.
        """
        if self.past_only:
            return self.past_.first_second(scenes)
        code = first_second(scenes)
        means = {MEAN_ACCELERATION: code[o.ACCELERATION], LEADER_MEAN_ACCELERATION: code[o.LEADER_ACCELERATION]}
        return code.assign(**means)

    def predict(self, scenes: Scenes) -> ResidualDrivers:
        """Return the predicted drivers.

        Parameters
        ----------
        scenes : Scenes
            With as many observed frames as at the fit, see :func:`~idm_sumo.prediction.recent.recent`.

        Returns
        -------
        ResidualDrivers
            Their status says which are the pooled driver, and why.

        Raises
        ------
        InputError
            If another number of frames is observed.
        """
        code, phi, start = self._seen(scenes)
        return self._drivers(scenes, code, own_numbers(self.weights_, phi), start, None)

    def predict_left_out(self, scenes: Scenes) -> ResidualDrivers:
        """Predict drivers of whom some may be training drivers.

        Each by weights that have not seen it.

        Parameters
        ----------
        scenes : Scenes

        Returns
        -------
        ResidualDrivers

        Raises
        ------
        InputError
            If another number of frames is observed.
        """
        code, phi, start = self._seen(scenes)
        mine = np.concatenate([self.fold_weights_, self.weights_[None]])[self._fold(scenes)]
        own = np.einsum("nq,nmq->nm", phi, mine[:, REGRESSORS:].reshape(len(mine), OWN, -1))
        return self._drivers(scenes, code, own, start, np.ascontiguousarray(mine[:, :REGRESSORS]))

    def status(self, code: pd.DataFrame) -> npt.NDArray[np.str_]:
        """Return "ok", or why the pooled driver stands in.

        Parameters
        ----------
        code : pandas.DataFrame
            Of :meth:`observe`.

        Returns
        -------
        str, shape (drivers,)
        """
        return self.familiar_.status(_plain(code))

    def scale(self, scenes: Scenes) -> Floats:
        """Return how uncertain the predicted positions are.

        Parameters
        ----------
        scenes : Scenes

        Returns
        -------
        float64, shape (windows, horizon)
            What :attr:`noise_` multiplies: the factor of what was observed. Its growth with time is the noise's.
        """
        factor = self.observed_scale_.factor(self._scaling(self.observe(scenes)))
        return np.asarray(np.broadcast_to(factor, (len(scenes), scenes.window.horizon)))

    def _seen(self, scenes: Scenes) -> tuple[pd.DataFrame, Floats, Floats]:
        check_is_fitted(self)
        if scenes.window.observed != self.observed_:
            raise InputError(
                f"residual: {scenes.window.observed} frames are observed, the predictor was fitted to "
                f"{self.observed_}; cut the windows alike, or fit another one"
            )
        code = self.observe(scenes)
        return code, self._phi(scenes, code), _leader_acceleration(code)

    def _drivers(
        self, scenes: Scenes, code: pd.DataFrame, own: Floats, start: Floats, weights: Floats | None
    ) -> ResidualDrivers:
        status = self.status(code)
        own = np.where((status == OK)[:, None], own, 0.0)
        return ResidualDrivers(self.model_, own, start, status, scenes.keys(), weights)

    def _standardise(self, every: list[Scenes], codes: list[pd.DataFrame]) -> None:
        """Remember means, deviations and ranges of the training drivers."""
        plain = np.concatenate([_plain(code) for code in codes])
        usual = np.isfinite(plain[:, 1]) & np.isfinite(plain[:, 3])
        self.familiar_ = Familiar.fit(plain[usual] if usual.any() else np.zeros((1, plain.shape[1])), self.drivers_)
        raw = np.concatenate([self._facts(one, code) for one, code in zip(every, codes, strict=True)])
        kept = raw[usual] if usual.any() else raw
        self.mean_, self.deviation_ = kept.mean(axis=0), np.maximum(kept.std(axis=0), LEAST_SCALE)
        more = expanded(self._standard(kept))[:, 1:]
        self.more_mean_, self.more_deviation_ = more.mean(axis=0), np.maximum(more.std(axis=0), LEAST_SCALE)
        state = _state(plain[usual] if usual.any() else np.zeros((1, plain.shape[1])))
        self.center_, self.scale_ = state.mean(axis=0), np.maximum(state.std(axis=0), 1e-3)

    def _facts(self, scenes: Scenes, code: pd.DataFrame) -> Floats:
        return facts(scenes, code, self.pooled_, self.desired_speed_)

    def _standard(self, values: Floats) -> Floats:
        return np.asarray(np.clip((values - self.mean_) / self.deviation_, -FURTHEST, FURTHEST))

    def _phi(self, scenes: Scenes, code: pd.DataFrame) -> Floats:
        """Return the constant and standardised facts.

        All 0 for drivers that get no residual.
        """
        more = expanded(self._standard(self._facts(scenes, code)))
        more[:, 1:] = np.clip((more[:, 1:] - self.more_mean_) / self.more_deviation_, -FURTHEST, FURTHEST)
        return np.asarray(np.where(self.familiar_.known(_plain(code))[:, None], more, 0.0))

    def _part(self, scenes: Scenes, code: pd.DataFrame, fold: Integers) -> Part:
        problem = prepare(scenes, desired_speed=self.desired_speed)
        return Part(problem, self._phi(scenes, code), _leader_acceleration(code), fold)

    def _learn(self, parts: list[Part]) -> None:
        """Fit the weights, and those of every fold."""
        shared = Shared(np.asarray(self.pooled_, dtype=np.float64), self.center_, self.scale_)
        size = REGRESSORS + OWN * parts[0].phi.shape[1]
        self.ridge_, self.weights_ = max(self.ridges), np.zeros(size)
        self.fold_weights_ = np.zeros((self.folds, size))
        if self.drivers_ >= FEWEST_DRIVERS:
            known = [part.only(np.flatnonzero(part.phi[:, 0] > 0.0)) for part in parts]
            known = [part for part in known if len(part.phi)]
            middle = sorted(self.ridges)[(len(self.ridges) - 1) // 2]
            self.weights_ = fit_residual(known, shared, middle)
            self.ridge_, self.fold_weights_ = fit_folds(known, shared, self.weights_, self.ridges)
            if self.ridge_ != middle:
                self.weights_ = fit_residual(known, shared, self.ridge_, self.weights_)
        self.model_ = ResidualModel(
            self.pooled_, self.weights_[:REGRESSORS], self.center_, self.scale_, self.desired_speed_, self.observed_
        )

    def _learn_noise(self, parts: list[Part], seen: Floats) -> None:
        """Learn how far drivers left out are off."""
        off = []
        for part in parts:
            weights, own, start = by_fold(part, self.fold_weights_)
            weights = np.where(part.phi[:, :1] > 0.0, weights, 0.0)
            errors = errors_of(part.problem, self.model_.shared, weights, own, start)
            off.append(np.where(part.problem.counted, -errors, np.nan))
        residuals = np.concatenate(off)
        ones = np.ones_like(residuals)
        self.observed_scale_ = ObservedScale.fit(seen, residuals, ones)
        self.noise_ = ResidualNoise.fit(residuals, ones * self.observed_scale_.factor(seen))

    def _scaling(self, code: pd.DataFrame) -> Floats:
        """Return what the scale depends on, standardised.

        0 for drivers that are not known.
        """
        plain = _plain(code)
        state = np.clip((_state(plain) - self.center_) / self.scale_, -FURTHEST, FURTHEST)[:, :2]
        return np.asarray(np.where(self.familiar_.known(plain)[:, None], state, 0.0))


def _plain(code: pd.DataFrame) -> Floats:
    return np.asarray(code[list(COLUMNS)], dtype=np.float64)


def _leader_acceleration(code: pd.DataFrame) -> Floats:
    """Return the leader's acceleration at the start (m/s²).

    0 where it is not known.
    """
    return np.asarray(np.clip(np.nan_to_num(code[o.LEADER_ACCELERATION].to_numpy(np.float64)), -HARDEST, HARDEST))


def _state(plain: Floats) -> Floats:
    """Return the state in the last observed frame."""
    v, gap, rate = plain[:, 0], np.maximum(np.nan_to_num(plain[:, 1]), LEAST_GAP), np.nan_to_num(plain[:, 2])
    headway = np.minimum(gap / np.maximum(v, SLOWEST), LONGEST)
    return np.column_stack([v, np.log(gap), rate, headway, np.nan_to_num(plain[:, 4])])
