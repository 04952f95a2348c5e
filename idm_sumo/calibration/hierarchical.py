r"""Partial pooling of drivers: their parameters and the population's.

Every driver is drawn to the population the more, the less its own window says.

Empirical Bayes. The drivers' parameters are log-normal, :math:`u_i \sim N(\mu, \Sigma)` with
:math:`u = \log(a, b, T, d_0, d_1 + 1\,\mathrm m)`. A window's errors are Laplace-distributed with
a scale of its own; profiled out, the log-likelihood is :math:`-n_i \log c_i(u)` with the
driver's objective :math:`c_i` and the number :math:`n_i` of independent frames its errors are
worth (:func:`~idm_sumo.calibration.identifiability.effective_frames`). EM with Laplace's
approximation (Lindstrom and Bates, 1990): each driver's maximum a posteriori and its
curvature, then :math:`\mu` and :math:`\Sigma` from them, until neither moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import identifiability, status
from idm_sumo.calibration.kernel import (
    PARAMETERS,
    costs_and_derivatives,
    from_search,
    sensitivities,
    slopes_at,
    to_search,
)
from idm_sumo.calibration.pooled import usable_windows
from idm_sumo.calibration.problem import Problem, only, prepare
from idm_sumo.calibration.solver import SMOOTHING, STARTS, design_of_starts, fit_all
from idm_sumo.calibration.table import NAMES, full_ade
from idm_sumo.models import idm
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

SHIFT = np.array([0.0, 0.0, 0.0, 0.0, 1.0])  # m, of d1, which may be 0
LOWER, UPPER = np.log(np.array(idm.LOWER) + SHIFT), np.log(np.array(idm.UPPER) + SHIFT)
ROUNDS = 80  # of EM, at most
FURTHEST = 12.0  # times two rounds of EM: the longest extrapolation
STEPS = 3  # Gauss-Newton steps a round
LAST_STEPS = 15  # in the end, the population held
SETTLED = 0.005  # change in a round, of means and of the covariance's logarithm: less than 1 %
MOST_CURVED = 1e8  # nothing is known of the logarithm of a parameter to better than 1e-4
LEAST_VARIANCE, MOST_VARIANCE = 0.02**2, 3.0**2  # of the population, in logarithms: keeps its covariance regular
FEWEST_DRIVERS = 10


class Population(NamedTuple):
    """Log-normal distribution of drivers.

    Attributes
    ----------
    mean : float64, shape (5,)
        Of ``log(a, b, T, d0, d1 + 1 m)``.
    covariance : float64, shape (5, 5)
    drivers : int
        How many it was learnt from.
    rounds : int
        Of EM until it settled.
    """

    mean: Floats
    covariance: Floats
    drivers: int
    rounds: int

    def typical(self) -> idm.IDMParameters:
        """Return the median driver, to assume of unknown drivers."""
        return idm.IDMParameters(*to_parameters(self.mean).tolist())


def to_parameters(u: npt.ArrayLike) -> Floats:
    """Return the parameters of logarithms.

    Parameters
    ----------
    u : array_like, shape (..., 5)
        ``log(a, b, T, d0, d1 + 1 m)``.

    Returns
    -------
    float64, shape (..., 5)
        ``a, b, T, d0, d1`` in SI units, within the bounds.
    """
    values = np.exp(np.asarray(u, dtype=np.float64)) - SHIFT
    return np.asarray(np.clip(values, np.array(idm.LOWER), np.array(idm.UPPER)))


def hierarchical(
    scenes: Scenes | Sequence[Scenes],
    *,
    population: Population | None = None,
    desired_speed: npt.ArrayLike | None = None,
    by_driver: bool = False,
) -> tuple[pd.DataFrame, Population]:
    """Fit all drivers together with the population they come from.

    Parameters
    ----------
    scenes : Scenes or sequence of Scenes
    population : Population, optional
        Known from other drivers: then these are only drawn to it, and one driver is enough.
    desired_speed : array_like, shape (), or (windows,) for one ``Scenes``, optional
        m/s; by default the road's speed limit.
    by_driver : bool
        Whether the windows of a driver have one set of parameters. What changes from window to window is then no
        difference between drivers.

    Returns
    -------
    drivers : pandas.DataFrame
        One row a window: ``period, vehicle, first_frame, a, b, T, d0, d1, ade_m, status``,
        ``effective_frames``, and ``drawn``: 0 where the window alone decides, 1 where it says nothing.
    population : Population

    Raises
    ------
    InputError
        If fewer than ten windows can be fitted and no population is given.
    """
    every = [scenes] if isinstance(scenes, Scenes) else list(scenes)
    problems = [prepare(one, desired_speed=desired_speed) for one in every]
    which = [np.flatnonzero(usable_windows(problem, one)) for problem, one in zip(problems, every, strict=True)]
    count = sum(len(w) for w in which)
    if population is None and count < FEWEST_DRIVERS:
        raise InputError(
            f"hierarchical calibration: {count} windows can be fitted; it needs {FEWEST_DRIVERS} or a population"
        )
    parts = [
        Part.of(only(problem, w), _drivers(one, w) if by_driver else None)
        for one, problem, w in zip(every, problems, which, strict=True)
    ]
    if population is None:
        population = _learn(parts)
    for part in parts:
        typical = np.tile(np.clip(population.mean, LOWER, UPPER), (len(part.u), 1))
        part.settle(population, (part.u, typical), LAST_STEPS)
    rows = zip(every, problems, which, parts, strict=True)
    tables = [_as_table(one, problem, w, part, population, desired_speed) for one, problem, w, part in rows]
    return pd.concat(tables, ignore_index=True), population


def _drivers(scenes: Scenes, which: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the number of each window's driver."""
    keys = scenes.keys().iloc[which]
    return np.asarray(keys.groupby([c.PERIOD, c.VEHICLE], sort=False).ngroup(), dtype=np.int64)


class Part:
    """The drivers of one problem and their likelihood's curvature.

    Attributes
    ----------
    problem : Problem
        Of one or several windows a driver.
    u : float64, shape (n, 5)
        Logarithms of the drivers' parameters, as far as EM has moved them.
    frames : float64, shape (windows,)
        How many independent frames the errors are worth.
    driver : int64, shape (windows,)
        The driver of each window.
    hessian : float64, shape (n, 5, 5)
        Of the negative log-posterior at ``u``.
    """

    def __init__(
        self, problem: Problem, u: Floats, frames: Floats, driver: npt.NDArray[np.int64] | None = None
    ) -> None:
        self.problem, self.u, self.frames = problem, u, frames
        self.driver = np.arange(len(frames)) if driver is None else driver
        self.hessian = np.zeros((len(u), PARAMETERS, PARAMETERS))

    @classmethod
    def of(cls, problem: Problem, driver: npt.NDArray[np.int64] | None = None) -> Part:
        """Start from the drivers' own fits.

        Parameters
        ----------
        problem : Problem
        driver : int64, shape (windows,), optional
            Numbers of the windows' drivers; by default each has its own.

        Returns
        -------
        Part
            The fits also tell how many independent frames their errors are worth.
        """
        z, _, _ = fit_all(problem, np.arange(len(problem.start_x)), design_of_starts(STARTS))
        frames = identifiability.effective_frames(sensitivities(problem, z)[0], problem.counted)
        u = np.log(from_search(z) + SHIFT)
        return cls(problem, u if driver is None else summed(u, driver) / np.bincount(driver)[:, None], frames, driver)

    def likelihood(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the negative log-likelihood and its derivatives.

        Parameters
        ----------
        u : float64, shape (n, 5)
            Logarithms of the parameters.

        Returns
        -------
        value : float64, shape (n,)
        gradient : float64, shape (n, 5)
        matrix : float64, shape (n, 5, 5)
            Of Gauss and Newton.
        """
        theta = to_parameters(u[self.driver])
        z = to_search(theta)
        value, gradient, normal = costs_and_derivatives(self.problem, z, SMOOTHING)
        scale = (theta + SHIFT) / slopes_at(z)
        weight = self.frames / value
        by_u = normal * scale[:, :, None] * scale[:, None, :]
        curved = limited(weight[:, None, None] * by_u)
        own = self.frames * np.log(value), weight[:, None] * gradient * scale, curved
        if len(u) == len(self.driver):
            return own
        value, gradient, curved = (summed(one, self.driver) for one in own)
        return value, gradient, limited(curved)

    def draw(self, population: Population, steps: int) -> None:
        """Move every driver towards its maximum a posteriori.

        Parameters
        ----------
        population : Population
        steps : int
            Damped Gauss-Newton steps.
        """
        precision = np.linalg.inv(population.covariance)
        damping = np.full(len(self.u), 1e-2)
        value, gradient, hessian = self.posterior(self.u, population.mean, precision)
        for _ in range(steps):
            trial = _step(self.u, gradient, hessian, damping)
            new, new_gradient, new_hessian = self.posterior(trial, population.mean, precision)
            better = new < value
            self.u[better], value[better] = trial[better], new[better]
            gradient[better], hessian[better] = new_gradient[better], new_hessian[better]
            damping = np.where(better, 0.2 * damping, 8.0 * damping)
        self.hessian = hessian

    def settle(self, population: Population, starts: tuple[Floats, Floats], steps: int) -> None:
        """Move every driver to its maximum a posteriori.

        Parameters
        ----------
        population : Population
        starts : two float64 arrays, shape (n, 5)
            Logarithms; the start that ends better is kept, driver by driver.
        steps : int
            Damped Gauss-Newton steps from each start.
        """
        precision, ends = np.linalg.inv(population.covariance), []
        for start in starts:
            self.u = start.copy()
            self.draw(population, steps)
            ends.append((self.u, self.posterior(self.u, population.mean, precision)[0]))
        (one, value), (other, other_value) = ends
        self.u = np.where((value <= other_value)[:, None], one, other)
        self.hessian = self.posterior(self.u, population.mean, precision)[2]

    def posterior(
        self, u: Floats, mean: Floats, precision: npt.NDArray[np.floating[Any]]
    ) -> tuple[Floats, Floats, Floats]:
        """Return the negative log-posterior and its derivatives.

        Parameters
        ----------
        u : float64, shape (n, 5)
            Logarithms of the parameters.
        mean : float64, shape (5,) or (n, 5)
            Of the population, or of each driver's prior.
        precision : float64, shape (5, 5) or as ``u - mean`` can be multiplied with
            Inverse of the prior's covariance.

        Returns
        -------
        value : float64, shape (n,)
        gradient : float64, shape (n, 5)
        matrix : float64, shape (n, 5, 5)
        """
        value, gradient, hessian = self.likelihood(u)
        off = (u - mean) @ precision
        return value + 0.5 * np.einsum("nj,nj->n", off, u - mean), gradient + off, hessian + precision


def summed(values: Floats, driver: npt.NDArray[np.int64]) -> Floats:
    """Return the sums over each driver's windows.

    Parameters
    ----------
    values : float64, shape (windows, ...)
    driver : int64, shape (windows,)

    Returns
    -------
    float64, shape (drivers, ...)
    """
    sums = np.zeros((int(driver.max()) + 1, *values.shape[1:]))
    np.add.at(sums, driver, values)
    return sums


def limited(hessian: Floats) -> Floats:
    """Return matrices of curvature, of limited size.

    An unstable rollout makes them so large that any prior drowns in rounding; those are scaled down.

    Parameters
    ----------
    hessian : float64, shape (drivers, parameters, parameters)

    Returns
    -------
    float64, of the same shape
    """
    largest = np.einsum("njj->nj", hessian).max(axis=1, initial=0.0)
    return np.asarray(hessian * np.minimum(1.0, MOST_CURVED / np.maximum(largest, 1e-300))[:, None, None])


def _step(u: Floats, gradient: Floats, hessian: Floats, damping: Floats) -> Floats:
    """Return the damped step of every driver within the bounds.

    A coordinate held by a bound does not take part.
    """
    held = ((u <= LOWER) & (gradient > 0.0)) | ((u >= UPPER) & (gradient < 0.0))
    diagonal = np.einsum("njj->nj", hessian)
    matrix = hessian + np.eye(PARAMETERS) * (damping[:, None] * diagonal)[:, None, :]
    pair = held[:, :, None] | held[:, None, :]
    matrix = np.where(pair, np.eye(PARAMETERS), matrix)
    step = np.linalg.solve(matrix, -np.where(held, 0.0, gradient)[..., None])[..., 0]
    return np.asarray(np.clip(u + step, LOWER, UPPER))


def _learn(parts: list[Part]) -> Population:
    """Return the population from which the drivers most likely come.

    EM alone creeps where the windows say little of a parameter. Two of its rounds tell how fast
    they shrink; an extrapolated step follows (SQUAREM, Varadhan and Roland, 2008, scheme S3).
    """
    u = np.concatenate([part.u for part in parts])
    population = Population(u.mean(axis=0), np.cov(u.T) + LEAST_VARIANCE * np.eye(PARAMETERS), len(u), 0)
    for rounds in range(2, ROUNDS + 1, 2):
        once = _em_round(parts, population, rounds)
        twice = _em_round(parts, once, rounds)
        if np.abs(_packed(twice) - _packed(once)).max() < SETTLED:
            return twice
        population = _extrapolated(population, once, twice)
    return twice


def _em_round(parts: list[Part], population: Population, rounds: int) -> Population:
    """Return the population after one round of EM."""
    for part in parts:
        part.draw(population, STEPS)
    u = np.concatenate([part.u for part in parts])
    spread = np.linalg.inv(np.concatenate([part.hessian for part in parts]))
    covariance = np.cov(u.T, bias=True) + spread.mean(axis=0) + LEAST_VARIANCE * np.eye(PARAMETERS)
    return Population(u.mean(axis=0), covariance, len(u), rounds)


def _packed(population: Population) -> Floats:
    """Return a population as numbers without constraints.

    The mean and the logarithm of the covariance; any such numbers are a population.
    """
    values, vectors = np.linalg.eigh(population.covariance)
    return np.concatenate([population.mean, ((vectors * np.log(values)) @ vectors.T).ravel()])


def _extrapolated(population: Population, once: Population, twice: Population) -> Population:
    """Return the population to which the rounds seem to lead.

    At most ``FURTHEST`` times as far as they went.
    """
    start, first, second = _packed(population), _packed(once), _packed(twice)
    step, bend = first - start, second - 2.0 * first + start
    far = float(np.clip(np.linalg.norm(step) / max(float(np.linalg.norm(bend)), 1e-300), 1.0, FURTHEST))
    there = start + 2.0 * far * step + far**2 * bend
    values, vectors = np.linalg.eigh(there[PARAMETERS:].reshape(PARAMETERS, PARAMETERS))
    values = np.exp(np.clip(values, np.log(LEAST_VARIANCE), np.log(MOST_VARIANCE)))
    mean = np.clip(there[:PARAMETERS], LOWER, UPPER)
    return Population(mean, (vectors * values) @ vectors.T, twice.drivers, twice.rounds)


def _as_table(
    scenes: Scenes,
    problem: Problem,
    which: npt.NDArray[np.int64],
    part: Part,
    population: Population,
    desired_speed: npt.ArrayLike | None,
) -> pd.DataFrame:
    """Return one row a window, NaN without a fit."""
    n = len(scenes)
    theta, frames, drawn = np.full((n, PARAMETERS), np.nan), np.full(n, np.nan), np.full(n, np.nan)
    theta[which], frames[which] = to_parameters(part.u)[part.driver], part.frames
    share = np.linalg.inv(part.hessian) @ np.linalg.inv(population.covariance)
    drawn[which] = (np.trace(share, axis1=1, axis2=2) / PARAMETERS)[part.driver]
    table = scenes.keys()
    table[NAMES] = theta
    table["ade_m"] = full_ade(scenes, theta, desired_speed, problem.counted)
    state = status.statuses(problem, scenes.speed[:, scenes.start : scenes.start + scenes.window.horizon + 1])
    table["status"] = pd.Series(state, dtype=str)
    table["effective_frames"], table["drawn"] = frames, drawn
    return table
