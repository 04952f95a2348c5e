r"""Drivers as random effects: an empirical-Bayes fit of the closed-loop rollouts.

Gauss-Newton over the rollouts' Jacobians, EM over the population's mean and covariance and the residuals' pooled covariance;
windows that fit badly count less (Student-like weights).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import norm
from scipy.stats.qmc import Sobol

from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis.rolled import Rolled, roll
from idm_sumo.diagnosis.rollout import PARAMETERS, positions, positions_beside
from idm_sumo.diagnosis.windows import EVERY, Windows
from idm_sumo.models import laws
from idm_sumo.models.effects import slots
from idm_sumo.recordings.columns import FRAME_STEP

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ROUNDS = 12  # of a fit from scratch
LONGEST_STEP = 0.5  # of a log-parameter in one Gauss-Newton step
TEXTBOOK = np.log([1.2, 1.8, 1.2, 2.2, 28.0])  # a, b, T, d0, v0
BELIEF = np.array([0.7, 0.7, 0.5, 0.5, 0.15])  # sd of the population's mean around it
LOWER, UPPER = np.log([0.15, 0.15, 0.2, 0.3, 12.0]), np.log([6.0, 8.0, 4.5, 9.0, 50.0])
# What all drivers of a law share and is fitted with their population: its slot; how unsure the textbook is of it, bounds and step (s).
# (A tenth of a second off in Krauss's reaction time leaves what no driver can do at nine standard errors.)
SHARED = {laws.KRAUSS: slots.REACTION_CHANGE}
SHARED_BELIEF, SHARED_BOUNDS, SHARED_STEP = 0.5, (0.3 - laws.REACTION, 2.0 - laws.REACTION), 0.02
SHARES = (0.0, 0.1, 0.35)  # of a Gauss-Newton step, that are tried where all of it makes a driver fit worse
# Standard deviations from the population's mean, of places where drivers may start anew.
STARTS = norm.ppf(np.clip(Sobol(PARAMETERS, scramble=False).random(32)[1:], 0.06, 0.94))
ASKED = 0.67  # quantile of what is left of drivers, from which on they may
LOOKS_ROUND = (2, 6)  # rounds of a fit before which drivers may start anew
FREEDOM = 10.0  # of the weights: fewer punish outliers harder


@dataclass(frozen=True)
class Fit:
    """Fitted drivers, and the linear model around them.

    Attributes
    ----------
    mean, spread : float64, shapes (5,), (5, 5)
        Of the drivers' log-parameters a, b, T, d0, v0.
    own : float64, shape (drivers, 5)
        Log-parameters of each driver.
    residual : float64, shape (moments, moments)
        Pooled covariance of the residuals (m²).
    weight : float64, shape (windows,)
    start_variance : float64, shape (2,)
        Of the recorded start: m², m²/s².
    by_lane : float64, shape (9, slots.COUNT) or (18, slots.COUNT)
        Accepted magnitudes by lane number; the second half, if there is one, of drivers without what only some have.
    rolled : Rolled or None
        Rollouts that the last step ended with: the next one begins there.
    """

    mean: Floats
    spread: Floats
    own: Floats
    residual: Floats
    weight: Floats
    start_variance: Floats
    by_lane: Floats
    rolled: Rolled | None = None

    @property
    def theta(self) -> Floats:
        """Parameters of each driver in SI units, shape ``(drivers, 5)``."""
        return np.exp(self.own)


@dataclass(frozen=True)
class Linear:
    """Rollouts linearised at the fitted drivers, shapes ``(windows, moments, ...)``."""

    error: Floats  # recorded minus simulated, plus what the drivers' deviation from the mean explains
    jacobian: Floats
    shared: Floats  # the same by what all drivers share, its last axis empty for most laws
    simulated: Floats
    whitener: Floats  # whatever is multiplied by it is white where it had the covariance


def linearise(windows: Windows, fit: Fit) -> Linear:
    """Return the linear model of the windows around a fit."""
    rolled = rollouts(windows, fit)
    base, jacobian = rolled.base, rolled.by_own
    deviation = (fit.own - fit.mean)[windows.driver]
    error = windows.target - base + (jacobian @ deviation[:, :, None])[:, :, 0]
    return Linear(error, jacobian, _shared(windows, fit, base), base, _whitener(fit, rolled))


def rollouts(windows: Windows, fit: Fit) -> Rolled:
    """Return the rollouts of the fitted drivers: those that the fit's last step ended with, or new ones."""
    if fit.rolled is not None and fit.rolled.is_of(windows, fit.own, fit.by_lane):
        return fit.rolled
    return roll(windows, fit.own, fit.by_lane)


def _shared_slot(fit: Fit) -> list[int]:
    """Return the slot of what all drivers of the fit's law share, if there is such a thing."""
    slot = SHARED.get(int(fit.by_lane[0, slots.LAW]))
    return [] if slot is None else [slot]


def _shared(windows: Windows, fit: Fit, base: Floats) -> Floats:
    """Return the derivative of the positions by what all drivers share, shape ``(windows, moments, 0 or 1)``."""
    which = _shared_slot(fit)
    if not which:
        return np.empty((*base.shape, 0))
    moved = fit.by_lane.copy()
    moved[:, which] += SHARED_STEP
    return np.asarray((positions(windows, fit.theta, moved) - base)[:, :, None] / SHARED_STEP)


def _whitener(fit: Fit, rolled: Rolled) -> Floats:
    """Return what makes white what the windows' errors and their starts leave."""
    start = rolled.by_start
    covariance = fit.residual / fit.weight[:, None, None] + (start * fit.start_variance) @ start.transpose(0, 2, 1)
    return gls.whitener(covariance)


def first_guess(windows: Windows, by_lane: Floats, start_variance: Floats) -> Fit:
    """Return textbook drivers with wide spreads."""
    moments = windows.target.shape[1]
    lag = EVERY * FRAME_STEP * (1.0 + np.arange(moments))
    rough = 0.3 * 0.05 * np.minimum.outer(lag, lag) ** 2 + 0.1 * np.eye(moments)
    spread = np.diag([0.3, 0.3, 0.3, 0.3, 0.1]) ** 2
    own = np.tile(TEXTBOOK, (windows.drivers, 1))
    return Fit(TEXTBOOK.copy(), spread, own, rough, np.ones(len(windows.seen)), start_variance, by_lane)


def improve(windows: Windows, fit: Fit, *, hyper: bool = True, new_mean: bool = True) -> Fit:
    """Return the fit after one Gauss-Newton and EM step.

    With ``hyper`` off spreads, covariance and weights stay; with ``new_mean`` off the population's mean, too.
    """
    line = linearise(windows, fit)
    sums = _sums(windows, fit, line)
    moved = _with_common(fit, _common(fit) + _common_step(fit, sums)) if new_mean else fit
    shift = _common(moved) - _common(fit)
    of_own, pull = sums.information[:, :PARAMETERS], sums.pull[:, :PARAMETERS]
    deviation = np.einsum("ipq,iq->ip", sums.inner, pull - of_own @ shift, optimize=True)
    own = np.clip(moved.mean + deviation, fit.own - LONGEST_STEP, fit.own + LONGEST_STEP)
    rolled = _no_worse(windows, moved, line, np.clip(own, LOWER, UPPER))
    fit = replace(moved, own=rolled.own, rolled=rolled)
    if not hyper:
        return fit
    spread = (deviation.T @ deviation + sums.inner.sum(axis=0)) / windows.drivers + 1e-4 * np.eye(PARAMETERS)
    residual, weight = _residuals(windows, fit, line, deviation, sums.inner, shift)
    return replace(fit, spread=spread, residual=residual, weight=weight)


class Sums(NamedTuple):
    """Normal equations of each driver; what is common to all is its population's mean, and what a law's drivers share."""

    information: Floats  # of what is common, shape (drivers, common, common); the first are the own parameters'
    pull: Floats  # shape (drivers, common)
    inner: Floats  # covariance of the own parameters given the windows, shape (drivers, 5, 5)


def _sums(windows: Windows, fit: Fit, line: Linear) -> Sums:
    error = line.whitener @ line.error[:, :, None]
    by_common = line.whitener @ np.concatenate([line.jacobian, line.shared], axis=2)
    turned = by_common.transpose(0, 2, 1)
    information = gls.by_driver(turned @ by_common, windows.driver, windows.drivers)
    pull = gls.by_driver(turned @ error, windows.driver, windows.drivers)[:, :, 0]
    inner = np.linalg.inv(information[:, :PARAMETERS, :PARAMETERS] + np.linalg.inv(fit.spread))
    return Sums(information, pull, inner)


def _common(fit: Fit) -> Floats:
    """Return what is common to all drivers: their population's mean, and what their law's drivers share."""
    return np.concatenate([fit.mean, fit.by_lane[0, _shared_slot(fit)]])


def _with_common(fit: Fit, common: Floats) -> Fit:
    by_lane = fit.by_lane.copy()
    by_lane[:, _shared_slot(fit)] = np.clip(common[PARAMETERS:], *SHARED_BOUNDS)
    mean = np.clip(common[:PARAMETERS], LOWER, UPPER)  # as each driver's own
    return replace(fit, mean=mean, by_lane=by_lane)


def _common_step(fit: Fit, sums: Sums) -> Floats:
    """Return the Gauss-Newton step of what is common, whatever the drivers' own parameters."""
    of_own = sums.information[:, :PARAMETERS]
    taken = of_own.transpose(0, 2, 1) @ sums.inner
    information = (sums.information - taken @ of_own).sum(axis=0)
    grade = (sums.pull - np.einsum("irp,ip->ir", taken, sums.pull[:, :PARAMETERS])).sum(axis=0)
    shared = len(information) - PARAMETERS
    belief = np.diag(1.0 / np.concatenate([BELIEF, np.full(shared, SHARED_BELIEF)]) ** 2)
    textbook = np.concatenate([TEXTBOOK, np.zeros(shared)])
    step = np.linalg.solve(information + belief, grade + belief @ (textbook - _common(fit)))
    return np.clip(step, -LONGEST_STEP, LONGEST_STEP)


def _no_worse(windows: Windows, fit: Fit, line: Linear, proposed: Floats) -> Rolled:
    """Return the proposed drivers, driven; of those who would fit worse so, a part of the step, or none.

    All are driven as the next step asks for it: that few of them go back costs less than to judge them first.
    """
    here = line.simulated if not line.shared.shape[2] else positions(windows, fit.theta, fit.by_lane)
    whole, rolled = np.stack([fit.own, proposed], axis=2), roll(windows, proposed, fit.by_lane)
    left = misfits(windows, fit, line.whitener, whole, np.stack([here, rolled.base], axis=2))
    worse = np.flatnonzero(~(left[:, 1] < left[:, 0]))
    if not len(worse):
        return rolled
    some, rows = windows.of_drivers(worse), np.isin(windows.driver, worse)
    parts = np.stack([fit.own[worse] + share * (proposed - fit.own)[worse] for share in SHARES], axis=2)
    best = _left_by(some, fit, line.whitener[rows], here[rows], parts).argmin(axis=1)
    return rolled.with_drivers(worse, some, _of_each(parts, best))


def _left_by(windows: Windows, fit: Fit, whitener: Floats, here: Floats, tried: Floats) -> Floats:
    """Return the :func:`misfits` of several parameters of each driver; with the first of them the positions are known."""
    moved = positions_beside(windows, np.exp(tried[:, :, 1:]), fit.by_lane, np.zeros((2, tried.shape[2] - 1)))
    return misfits(windows, fit, whitener, tried, np.concatenate([here[:, :, None], moved], axis=2))


def misfits(windows: Windows, fit: Fit, whitener: Floats, tried: Floats, simulated: Floats) -> Floats:
    """Return what several parameters of each driver leave of its windows, and how far they are from the population's.

    Parameters
    ----------
    windows : Windows
    fit : Fit
        The population, and the magnitudes.
    whitener : float64, shape (windows, moments, moments)
    tried : float64, shape (drivers, 5, several)
        Log-parameters.
    simulated : float64, shape (windows, moments, several)
        Positions (m) with them.

    Returns
    -------
    float64, shape (drivers, several)
    """
    white = whitener @ (windows.target[:, :, None] - simulated)
    away = tried - fit.mean[:, None]
    far = np.einsum("ipn,pq,iqn->in", away, np.linalg.inv(fit.spread), away, optimize=True)
    return np.asarray(gls.by_driver((white**2).sum(axis=1), windows.driver, windows.drivers) + far)


def _of_each(tried: Floats, which: Integers) -> Floats:
    return np.asarray(tried[np.arange(len(tried)), :, which])


def elsewhere(windows: Windows, fit: Fit) -> Fit:
    """Return the fit with drivers moved to another place of the population that leaves less of them, if there is one.

    From where they are, some never find it: a step that is too long has led them where nothing they change brings them back.
    Who fits as well as most is not asked.
    """
    own, rolled = fit.own[:, :, None], rollouts(windows, fit)
    here, whitener = rolled.base, _whitener(fit, rolled)
    left = misfits(windows, fit, whitener, own, here[:, :, None])[:, 0]
    share = left / np.maximum(np.bincount(windows.driver, minlength=windows.drivers), 1)
    asked = np.flatnonzero(share >= np.quantile(share, ASKED))
    some, rows = windows.of_drivers(asked), np.isin(windows.driver, asked)
    places = np.clip(fit.mean + STARTS @ np.linalg.cholesky(fit.spread).T, LOWER, UPPER).T
    others = np.broadcast_to(places, (len(asked), *places.shape))
    tried = np.concatenate([own[asked], others], axis=2)
    best = _left_by(some, fit, whitener[rows], here[rows], tried).argmin(axis=1)
    gone = best > 0
    there = asked[gone]
    rolled = rolled.with_drivers(there, windows.of_drivers(there), _of_each(tried, best)[gone])
    return replace(fit, own=rolled.own, rolled=rolled)


def _residuals(
    windows: Windows, fit: Fit, line: Linear, deviation: Floats, inner: Floats, shift: Floats
) -> tuple[Floats, Floats]:
    """Return the EM step of the pooled covariance and the windows' weights."""
    left = line.error - np.einsum("wkp,wp->wk", line.jacobian, (deviation + shift[:PARAMETERS])[windows.driver])
    left -= line.shared @ shift[PARAMETERS:]
    pooled = fit.residual / fit.weight[:, None, None]
    known = np.concatenate([pooled, left[:, :, None], line.jacobian], axis=2)
    solved = line.whitener.transpose(0, 2, 1) @ (line.whitener @ known)
    moments = left.shape[1]
    keep, drawn, along = solved[:, :, :moments], solved[:, :, moments], solved[:, :, moments + 1 :]
    noise = np.einsum("wkl,wl->wk", pooled, drawn)
    unsure = pooled @ along
    each = noise[:, :, None] * noise[:, None, :] + pooled - pooled @ keep
    each += unsure @ inner[windows.driver] @ unsure.transpose(0, 2, 1)
    residual = np.einsum("w,wkl->kl", fit.weight, each) / len(each)
    residual = 0.5 * (residual + residual.T) + 1e-6 * np.trace(residual) / moments * np.eye(moments)
    distance = np.einsum("wk,wk->w", left, drawn) / fit.weight
    weight = (FREEDOM + moments) / (FREEDOM + distance)
    return residual, weight / np.exp(np.log(weight).mean())


def fit_drivers(windows: Windows, by_lane: Floats, start_variance: Floats, *, rounds: int = ROUNDS) -> Fit:
    """Fit all drivers of the windows from scratch."""
    fit = first_guess(windows, by_lane, start_variance)
    for number in range(rounds):
        fit = improve(windows, elsewhere(windows, fit) if number in LOOKS_ROUND else fit)
    return fit


def for_rollouts(windows: Windows, fit: Fit, *, known: bool = False) -> Fit:
    """Fit each driver to its positions at all moments alike, as errors of rollouts count them.

    Population and magnitudes stay as they are. Unless the drivers are ``known``, the windows may be of others than those of the
    fit. The likelihood's own fit weighs moments by how they vary together: it says what is there, but drives farther from the
    recording than need be. Nor may a start be off here, as rollouts begin where the recording does: where it may, a driver at the
    edge of stability, whom a start a little off leads anywhere, is excused wherever he ends.
    """
    own = fit.own if known else np.tile(fit.mean, (windows.drivers, 1))
    alike = np.diag(np.full(len(fit.residual), np.diag(fit.residual).mean()))
    exact = np.zeros_like(fit.start_variance)
    fit = replace(fit, own=own, residual=alike, weight=np.ones(len(windows.seen)), start_variance=exact)
    fit = elsewhere(windows, fit)
    for _ in range(3 if known else 6):
        fit = improve(windows, fit, hyper=False, new_mean=False)
    return fit


def fit_to_population(windows: Windows, fit: Fit, *, rounds: int = 6) -> Fit:
    """Fit each driver by the likelihood of a fit's population, which may be of others; no window counts less than another."""
    own = np.tile(fit.mean, (windows.drivers, 1))
    fit = replace(fit, own=own, weight=np.ones(len(windows.seen)))
    for _ in range(rounds):
        fit = improve(windows, fit, hyper=False, new_mean=False)
    return fit
