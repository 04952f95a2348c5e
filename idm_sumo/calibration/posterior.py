"""Drivers given their windows and the population they come from."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from idm_sumo.calibration import identifiability
from idm_sumo.calibration.kernel import (
    PARAMETERS,
    costs_and_derivatives,
    from_search,
    sensitivities,
    slopes_at,
    to_search,
)
from idm_sumo.calibration.population import LOWER, SHIFT, UPPER, Population, to_parameters
from idm_sumo.calibration.problem import Problem
from idm_sumo.calibration.solver import SMOOTHING, STARTS, design_of_starts, fit_all

Floats = npt.NDArray[np.float64]

MOST_CURVED = 1e8  # nothing is known of the logarithm of a parameter to better than 1e-4


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
