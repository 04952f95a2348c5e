r"""Prediction of drivers that are watched for longer.

The observed past, driven through the rollout, moves what is predicted from the last second: a
moving-horizon estimate (Rao, Rawlings and Lee, 2001). The prediction from the last second is the prior,
:math:`u \sim N(\hat u, \Sigma)` in the logarithms of the parameters, with the covariance that remains
of drivers left out; the data are the closed-loop rollout over the last observed frames,

.. math:: \min_u\; s\,n\log c(u) + \tfrac12 (u - \hat u)^\top\Sigma^{-1}(u - \hat u),

with the rollout's mean distance :math:`c` and the number :math:`n` of independent frames its errors
are worth, as in :mod:`idm_sumo.calibration.hierarchical`. The errors of a model that is wrong are no
noise, and drivers change; how much the past counts is therefore one number, the strength :math:`s`,
learned by what follows in drivers left out. At 0 the past says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from idm_sumo.calibration.hierarchical import Part, Population, to_parameters
from idm_sumo.calibration.kernel import costs, to_search
from idm_sumo.calibration.pooled import usable_windows
from idm_sumo.calibration.problem import Problem, only, prepare
from idm_sumo.prediction.observation import first_second
from idm_sumo.prediction.result import Prediction
from idm_sumo.prediction.rollout_predictor import OK, RolloutPredictor
from idm_sumo.prediction.spread import logarithms
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes, Window

Floats = npt.NDArray[np.float64]

STRENGTHS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
WATCHED = (20, 50, 100, 200)  # frames, those by which a strength is judged
STEPS = 10  # Gauss-Newton steps
FEWEST_COUNTED = 10  # frames of a past that says something
MOST_WINDOWS = 400  # that the strength is learned from


class MovingHorizon(BaseEstimator):  # type: ignore[misc]
    """A predictor that learns from the driver as frames arrive.

    Parameters
    ----------
    predictor : RolloutPredictor
        Fitted; predicts a driver from its last second.
    strengths : sequence of float
        How much the past may count. The one after which training drivers that were left out are driven
        best is taken.
    seed : int
        Of the windows that are learned from if there are many.

    Attributes
    ----------
    strength_ : float
    ade_ : pandas.DataFrame
        Mean ADE (m) of what follows in drivers left out, a row a strength, a column a number of observed frames.
    """

    def __init__(self, predictor: RolloutPredictor, strengths: Sequence[float] = STRENGTHS, seed: int = 1) -> None:
        self.predictor = predictor
        self.strengths = strengths
        self.seed = seed

    def fit(self, scenes: Scenes | Sequence[Scenes], y: None = None) -> MovingHorizon:
        """Learn the strength from windows with a long past.

        Training drivers of the predictor are predicted by the fold that left them out.

        Parameters
        ----------
        scenes : Scenes or sequence of Scenes
            Windows with a long observed past, such as ``Window(observed=200, every=60)``.
        y : None
            For scikit-learn's protocol; not used.

        Returns
        -------
        MovingHorizon

        Raises
        ------
        InputError
            If no window can be driven, or none is observed for longer than what the predictor sees.
        """
        check_is_fitted(self.predictor)
        every = [scenes] if isinstance(scenes, Scenes) else list(scenes)
        longest = min(one.start + 1 for one in every) if every else 0
        watched = sorted(n for n in {longest, *WATCHED} if self.predictor.observed_ < n <= longest)
        if not watched:
            raise InputError(
                f"moving horizon: the windows are observed for {longest} frames; to learn from the past "
                f"it needs more than the {self.predictor.observed_} of the predictor"
            )
        some = self._some(every)
        errors = {n: np.concatenate([self._errors(one, n) for one in some]).mean(axis=0) for n in watched}
        self.ade_ = pd.DataFrame(errors, index=pd.Index(self.strengths, name="strength"))
        self.strength_ = float(self.strengths[int(np.argmin(self.ade_.mean(axis=1)))])
        return self

    def predict(self, scenes: Scenes, frames: int | None = None) -> Floats:
        """Return the predicted parameters of drivers.

        Parameters
        ----------
        scenes : Scenes
        frames : int, optional
            As for :meth:`predict_with_spread`.

        Returns
        -------
        float64, shape (windows, 5)
            ``a, b, T, d0, d1`` in SI units.

        Raises
        ------
        InputError
            If the windows have fewer frames before the simulation.
        """
        return self.predict_with_spread(scenes, frames).theta

    def predict_with_spread(self, scenes: Scenes, frames: int | None = None) -> Prediction:
        """Predict drivers from their last frames.

        Parameters
        ----------
        scenes : Scenes
        frames : int, optional
            How many of the observed frames, the last ones, are used; all by default. With no more than the
            predictor was fitted to, the prediction is the predictor's.

        Returns
        -------
        Prediction
            A driver that the predictor gives the population's parameters keeps them.

        Raises
        ------
        InputError
            If the windows have fewer frames before the simulation.
        """
        check_is_fitted(self)
        n = scenes.start + 1 if frames is None else frames
        prior = self.predictor.predict_with_spread(self._code(scenes, n))
        return self._moved(scenes, n, prior)

    def predict_left_out(self, scenes: Scenes, frames: int | None = None) -> Prediction:
        """Predict drivers of whom some trained the predictor.

        Each by the fold that left it out.

        Parameters
        ----------
        scenes : Scenes
        frames : int, optional
            As for :meth:`predict_with_spread`.

        Returns
        -------
        Prediction

        Raises
        ------
        InputError
            If the windows have fewer frames before the simulation.
        """
        check_is_fitted(self)
        n = scenes.start + 1 if frames is None else frames
        return self._moved(scenes, n, self.predictor.predict_left_out(recent(scenes, self._seen(n))))

    def _seen(self, frames: int) -> int:
        return min(frames, self.predictor.observed_)

    def _code(self, scenes: Scenes, frames: int) -> pd.DataFrame:
        return first_second(recent(scenes, self._seen(frames)))

    def _moved(self, scenes: Scenes, frames: int, prior: Prediction) -> Prediction:
        prior = prior._replace(keys=scenes.keys())
        if self.strength_ == 0.0 or frames <= self.predictor.observed_:
            return prior
        which, watched = self._watched(scenes, frames, prior)
        theta, covariance = prior.theta.copy(), prior.covariance.copy()
        u, covariance[which] = watched.given(self.strength_)
        theta[which] = to_parameters(u)
        return prior._replace(theta=theta, covariance=covariance)

    def _watched(self, scenes: Scenes, frames: int, prior: Prediction) -> tuple[npt.NDArray[np.int64], Watched]:
        """Return the windows whose past says something, and their pasts."""
        before, problem = past(scenes, frames, self.predictor.desired_speed)
        usable = usable_windows(problem, before) & (problem.counted.sum(axis=1) >= FEWEST_COUNTED)
        which = np.flatnonzero(usable & (prior.status == OK))
        return which, Watched(only(problem, which), logarithms(prior.theta[which]), self.predictor.covariance_)

    def _errors(self, scenes: Scenes, frames: int) -> Floats:
        """Return the ADE (m) of what follows.

        Of drivers left out; shape ``(windows, strengths)``.
        """
        latest = recent(scenes, self.predictor.observed_)
        prior = self.predictor.predict_left_out(latest)
        which, watched = self._watched(scenes, frames, prior)
        tried = np.repeat(prior.theta[:, None], len(self.strengths), axis=1)
        for k, strength in enumerate(self.strengths):
            if strength > 0.0:
                tried[which, k] = to_parameters(watched.given(strength)[0])
        return costs(prepare(latest, desired_speed=self.predictor.desired_speed), to_search(tried), 0.0)

    def _some(self, every: list[Scenes]) -> list[Scenes]:
        """Return windows that can be driven, at most ``MOST_WINDOWS``."""
        speed, found = self.predictor.desired_speed, []
        for one in every:
            latest = recent(one, self.predictor.observed_)
            found.append(one.subset(usable_windows(prepare(latest, desired_speed=speed), latest)))
        total, rng = sum(map(len, found)), np.random.default_rng(self.seed)
        if not total:
            raise InputError("moving horizon: no training window can be driven; see `idm-sumo inspect` for why")
        share = min(1.0, MOST_WINDOWS / total)
        kept = [np.sort(rng.permutation(len(one))[: int(np.ceil(share * len(one)))]) for one in found]
        return [one.subset(which) for one, which in zip(found, kept, strict=True) if len(which)]


class Watched:
    """Drivers whose past has been observed.

    Parameters
    ----------
    problem : Problem
        Their past.
    mean : float64, shape (drivers, 5)
        Logarithms expected from the last second.
    covariance : float64, shape (5, 5)
    """

    def __init__(self, problem: Problem, mean: Floats, covariance: Floats) -> None:
        self.part = Part.of(problem)
        self.own, self.frames, self.mean = self.part.u, self.part.frames, mean
        self.population = Population(mean, covariance, len(mean), 0)

    def given(self, strength: float) -> tuple[Floats, Floats]:
        """Return the most likely logarithms and their covariance.

        Searched from what was expected and from the driver's own fit to its past.

        Parameters
        ----------
        strength : float
            How much the past counts.

        Returns
        -------
        u : float64, shape (drivers, 5)
        covariance : float64, shape (drivers, 5, 5)
        """
        self.part.frames = strength * self.frames
        self.part.settle(self.population, (self.mean, self.own), STEPS)
        return self.part.u, np.asarray(np.linalg.inv(self.part.hessian))


def recent(scenes: Scenes, frames: int) -> Scenes:
    """Return the windows with only the last frames observed.

    Parameters
    ----------
    scenes : Scenes
    frames : int
        Observed before the simulation.

    Returns
    -------
    Scenes

    Raises
    ------
    InputError
        If the windows have fewer.
    """
    window = Window(frames, scenes.window.horizon)
    return _cut(scenes, _first(scenes, frames), scenes.start + scenes.window.horizon + 1, window)


def past(scenes: Scenes, frames: int, desired_speed: float | None = None) -> tuple[Scenes, Problem]:
    """Return the last observed frames as windows to be driven.

    From the first of them to the simulation's start. Where leaders come from the lane, what counts ends
    where the driver leaves the lane it is in at first.

    Parameters
    ----------
    scenes : Scenes
    frames : int
        Observed before the simulation.
    desired_speed : float, optional
        m/s; by default the road's speed limit.

    Returns
    -------
    before : Scenes
    problem : Problem

    Raises
    ------
    InputError
        If the windows have fewer frames before the simulation.
    """
    before = _cut(scenes, _first(scenes, frames), scenes.start + 1, Window(1, frames - 1))
    if scenes.leader_source != LEADER_FROM_LANE:
        return before, prepare(before, desired_speed=desired_speed)
    lanes = before.road.lane_at(before.y)
    before = replace(before, lane=lanes[:, 0], cell=before.cells(lanes[:, 0], 0))
    stayed = np.cumprod(lanes == lanes[:, :1], axis=1).astype(np.bool_)
    return before, prepare(before, desired_speed=desired_speed, mask=stayed)


def _first(scenes: Scenes, frames: int) -> int:
    if not 1 <= frames <= scenes.start + 1:
        raise InputError(
            f"frames = {frames}: must be between 1 and the {scenes.start + 1} that are observed before the simulation"
        )
    return scenes.start + 1 - frames


def _cut(scenes: Scenes, first: int, last: int, window: Window) -> Scenes:
    paths = {name: getattr(scenes, name)[:, first:last] for name in ("x", "y", "heading", "speed", "headway")}
    return replace(scenes, window=window, cell=scenes.cell + first, first_frame=scenes.first_frame + first, **paths)
