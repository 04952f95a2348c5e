r"""Weights of the residual, fitted through the rollout.

As in :mod:`idm_sumo.prediction.through_rollout` the driven positions decide,

.. math:: \min_w \frac1n\sum_i \mathrm{ADE}_i(w) + \frac\lambda2\lVert w\rVert^2,

by Gauss-Newton steps with the rollout's exact derivatives. The ADE is minimised by reweighted least squares, whose
steps are short; they are stretched as long as that helps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.calibration.problem import Problem, only
from idm_sumo.calibration.solver import SMOOTHING
from idm_sumo.models.residual import OWN, REGRESSORS
from idm_sumo.prediction.residual_rollout import Shared, costs, costs_and_derivatives
from idm_sumo.runtime.threads import one_blas_thread

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ITERATIONS = 7
STRETCHES = (1.8, 1.0, 0.2)  # of a step, in the order in which they are tried
SETTLED = 1e-3  # relative drop


class Part(NamedTuple):
    """Windows of one period.

    Attributes
    ----------
    problem : Problem
    phi : float64, shape (windows, facts)
        The constant, and standardised facts.
    leader_acceleration : float64, shape (windows,)
        At the start (m/s²).
    fold : int64, shape (windows,)
        In which the driver is left out.
    """

    problem: Problem
    phi: Floats
    leader_acceleration: Floats
    fold: Integers

    def only(self, which: Integers) -> Part:
        """Return some of the windows.

        Parameters
        ----------
        which : int64, shape (windows,)

        Returns
        -------
        Part
        """
        return Part(only(self.problem, which), self.phi[which], self.leader_acceleration[which], self.fold[which])


class Normal(NamedTuple):
    """Sums over windows: gradient, Gauss-Newton matrix, how many."""

    gradient: Floats
    matrix: Floats
    windows: int

    def plus(self, other: Normal, sign: int = 1) -> Normal:
        """Return the sum with, or the difference from, another.

        Parameters
        ----------
        other : Normal
        sign : int
            1 or -1.

        Returns
        -------
        Normal
        """
        return Normal(
            self.gradient + sign * other.gradient,
            self.matrix + sign * other.matrix,
            self.windows + sign * other.windows,
        )

    def step(self, weights: Floats, ridge: float) -> Floats:
        """Return the Gauss-Newton step from some weights.

        Parameters
        ----------
        weights : float64, shape (weights,)
        ridge : float

        Returns
        -------
        float64, shape (weights,)
        """
        matrix = self.matrix / self.windows + (ridge + 1e-9) * np.eye(len(weights))
        return np.asarray(np.linalg.solve(matrix, self.gradient / self.windows + ridge * weights))


def own_numbers(weights: Floats, phi: Floats) -> Floats:
    """Return the drivers' own three numbers.

    Parameters
    ----------
    weights : float64, shape (weights,)
        The shared ones, then one a fact for each of the numbers.
    phi : float64, shape (drivers, facts)

    Returns
    -------
    float64, shape (drivers, 3)
        m/s².
    """
    return np.ascontiguousarray(phi @ weights[REGRESSORS:].reshape(OWN, -1).T)


@one_blas_thread
def fit_residual(parts: Sequence[Part], shared: Shared, ridge: float, start: Floats | None = None) -> Floats:
    """Fit the weights.

    Parameters
    ----------
    parts : sequence of Part
    shared : Shared
    ridge : float
        How strongly the weights are drawn to 0, the pooled driver.
    start : float64, shape (weights,), optional
        By default 0.

    Returns
    -------
    float64, shape (weights,)
    """
    weights = np.zeros(REGRESSORS + OWN * parts[0].phi.shape[1]) if start is None else start
    best = _objective(parts, shared, weights, ridge)
    for _ in range(ITERATIONS):
        total = sums(parts, shared, weights)
        step = total.step(weights, ridge)
        for stretch in STRETCHES:
            value = _objective(parts, shared, weights - stretch * step, ridge)
            if value < best:
                break
        else:
            break
        drop, best, weights = best - value, value, weights - stretch * step
        if drop < SETTLED * best:
            break
    return weights


@one_blas_thread
def fit_folds(parts: Sequence[Part], shared: Shared, weights: Floats, ridges: Sequence[float]) -> tuple[float, Floats]:
    """Choose the ridge and fit the weights of every fold.

    Parameters
    ----------
    parts : sequence of Part
    shared : Shared
    weights : float64, shape (weights,)
        Of all windows, where the folds' steps begin.
    ridges : sequence of float
        The one with which drivers that were left out are driven best is taken.

    Returns
    -------
    ridge : float
    folds : float64, shape (folds, weights)
        Each fitted without its fold.
    """
    folds = 1 + max(int(part.fold.max()) for part in parts)
    own = [sums([part.only(np.flatnonzero(part.fold == k)) for part in parts], shared, weights) for k in range(folds)]
    total = own[0]
    for other in own[1:]:
        total = total.plus(other)
    tried = [np.stack([weights - total.plus(one, -1).step(weights, ridge) for one in own]) for ridge in ridges]
    best = int(np.argmin([left_out_ade(parts, shared, found) for found in tried]))
    found = [
        fit_residual([part.only(np.flatnonzero(part.fold != k)) for part in parts], shared, ridges[best], start)
        for k, start in enumerate(tried[best])
    ]
    return ridges[best], np.stack(found)


def left_out_ade(parts: Sequence[Part], shared: Shared, folds: Floats) -> float:
    """Return the mean ADE (m) of drivers left out.

    Parameters
    ----------
    parts : sequence of Part
    shared : Shared
    folds : float64, shape (folds, weights)

    Returns
    -------
    float
    """
    return float(np.concatenate([costs(part.problem, shared, *by_fold(part, folds)) for part in parts]).mean())


def by_fold(part: Part, folds: Floats) -> tuple[Floats, Floats, Floats]:
    """Return what drives each window without having seen its driver.

    Parameters
    ----------
    part : Part
    folds : float64, shape (folds, weights)

    Returns
    -------
    weights : float64, shape (windows, 20)
    own : float64, shape (windows, 3)
    leader_acceleration : float64, shape (windows,)
    """
    mine = folds[part.fold]
    own = np.einsum("nq,nmq->nm", part.phi, mine[:, REGRESSORS:].reshape(len(mine), OWN, -1))
    return np.ascontiguousarray(mine[:, :REGRESSORS]), own, part.leader_acceleration


def sums(parts: Sequence[Part], shared: Shared, weights: Floats) -> Normal:
    """Return gradient and Gauss-Newton matrix, summed over windows.

    Parameters
    ----------
    parts : sequence of Part
    shared : Shared
    weights : float64, shape (weights,)

    Returns
    -------
    Normal
    """
    size = len(weights)
    gradient, matrix, count = np.zeros(size), np.zeros((size, size)), 0
    for part in parts:
        own = own_numbers(weights, part.phi)
        _, g, h = costs_and_derivatives(
            part.problem, shared, weights[None, :REGRESSORS], own, part.leader_acceleration, SMOOTHING
        )
        gradient += _gathered(g, part.phi)
        matrix += _gathered_matrix(h, part.phi)
        count += len(g)
    return Normal(gradient, matrix, count)


def _objective(parts: Sequence[Part], shared: Shared, weights: Floats, ridge: float) -> float:
    total, count = 0.0, 0
    for part in parts:
        own = own_numbers(weights, part.phi)
        total += costs(part.problem, shared, weights[None, :REGRESSORS], own, part.leader_acceleration).sum()
        count += len(own)
    return total / count + 0.5 * ridge * float(weights @ weights)


def _gathered(gradients: Floats, phi: Floats) -> Floats:
    """Return the gradient by the weights from those by directions."""
    return np.concatenate([gradients[:, :REGRESSORS].sum(axis=0), (gradients[:, REGRESSORS:].T @ phi).ravel()])


def _gathered_matrix(matrices: Floats, phi: Floats) -> Floats:
    """Return the matrix by the weights from those by directions."""
    q = phi.shape[1]
    out = np.empty((REGRESSORS + OWN * q, REGRESSORS + OWN * q))
    out[:REGRESSORS, :REGRESSORS] = matrices[:, :REGRESSORS, :REGRESSORS].sum(axis=0)
    for m in range(OWN):
        rows = slice(REGRESSORS + m * q, REGRESSORS + (m + 1) * q)
        out[:REGRESSORS, rows] = matrices[:, :REGRESSORS, REGRESSORS + m].T @ phi
        out[rows, :REGRESSORS] = out[:REGRESSORS, rows].T
        for k in range(m + 1):
            columns = slice(REGRESSORS + k * q, REGRESSORS + (k + 1) * q)
            out[rows, columns] = phi.T @ (matrices[:, REGRESSORS + m, REGRESSORS + k, None] * phi)
            out[columns, rows] = out[rows, columns].T
    return out
