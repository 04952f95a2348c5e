r"""Weights from features to parameters, fitted through the rollout.

They make the *driven* positions right, not the parameters. A window's parameters are
:math:`z_i = z_0 + W^\top\phi_i` in search coordinates. Averages of fitted parameters move along
directions that the windows do not determine; here the windows' own rollout error decides,

.. math:: \min_W \frac1n\sum_i \mathrm{ADE}_i(z_0 + W^\top\phi_i) + \frac\lambda2\lVert W\rVert^2,

by damped Gauss-Newton steps with the rollout's exact derivatives: gradient
:math:`\sum\phi_i\otimes g_i`, matrix :math:`\sum\phi_i\phi_i^\top\otimes H_i`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from idm_sumo.calibration.kernel import LOWER, PARAMETERS, UPPER, costs, costs_and_derivatives
from idm_sumo.calibration.problem import Problem
from idm_sumo.calibration.solver import SMOOTHING
from idm_sumo.runtime.threads import one_blas_thread

Floats = npt.NDArray[np.float64]

ITERATIONS = 15
FAN = np.array([0.1, 1.0, 10.0, 100.0])  # times the last damping
LEAST_DAMPING = 1e-4
SETTLED = 1e-5  # relative drop
FREE = 1e-6  # penalty of the constant


@one_blas_thread
def fit_weights(problems: Sequence[Problem], features: Sequence[Floats], center: Floats, ridge: float) -> Floats:
    """Fit the weights from features to parameters.

    Parameters
    ----------
    problems : sequence of Problem
        Windows to drive.
    features : sequence of arrays, shape (windows, features)
        Of the same windows; the first is the constant, which alone is not drawn to 0.
    center : float64, shape (5,)
        The pooled parameters in search coordinates.
    ridge : float
        How strongly weights are drawn to 0, the pooled parameters.

    Returns
    -------
    float64, shape (features, 5)
    """
    return _descended(list(zip(problems, features, strict=True)), center, ridge)


def _descended(parts: list[tuple[Problem, Floats]], center: Floats, ridge: float) -> Floats:
    """Return the weights after damped Gauss-Newton steps.

    From the pooled driver.
    """
    penalty = np.full(parts[0][1].shape[1], ridge)
    penalty[0] = FREE
    weights, damping = np.zeros((len(penalty), PARAMETERS)), 0.1
    best = _values(parts, center, weights[None], penalty)[0]
    for _ in range(ITERATIONS):
        gradient, matrix = _derivatives(parts, center, weights, penalty)
        diagonal = np.diag(matrix)
        steps = [np.linalg.solve(matrix + np.diag(damping * f * diagonal), gradient) for f in FAN]
        trials = weights - np.stack(steps).reshape(len(FAN), -1, PARAMETERS)
        values = _values(parts, center, trials, penalty)
        q = int(np.argmin(values))
        if not values[q] < best * (1.0 - SETTLED):
            break
        best, weights, damping = values[q], trials[q], max(damping * FAN[q], LEAST_DAMPING)
    return np.asarray(weights)


def at(center: Floats, features: Floats, weights: Floats) -> Floats:
    """Return the search coordinates of drivers with some features.

    Parameters
    ----------
    center : float64, shape (5,)
        The pooled parameters in search coordinates.
    features : float64, shape (drivers, features)
    weights : float64, shape (features, 5)

    Returns
    -------
    float64, shape (drivers, 5)
        Inside the bounds.
    """
    return np.asarray(np.clip(center + features @ weights, LOWER, UPPER))


def _values(parts: list[tuple[Problem, Floats]], center: Floats, trials: Floats, penalty: Floats) -> Floats:
    """Return the objective at each trial."""
    total, count = np.zeros(len(trials)), 0
    for problem, phi in parts:
        z = np.stack([at(center, phi, weights) for weights in trials], axis=1)
        total += costs(problem, z, SMOOTHING).sum(axis=0)
        count += len(phi)
    return np.asarray(total / count + 0.5 * np.einsum("q,mqj->m", penalty, trials**2))


def _derivatives(
    parts: list[tuple[Problem, Floats]], center: Floats, weights: Floats, penalty: Floats
) -> tuple[Floats, Floats]:
    """Return gradient and Gauss-Newton matrix by the weights.

    Row by row of ``W``; a bound holds a window's coordinate.
    """
    q, count = weights.shape[0], sum(len(phi) for _, phi in parts)
    gradient, matrix = np.zeros((q, PARAMETERS)), np.zeros((q, PARAMETERS, q, PARAMETERS))
    for problem, phi in parts:
        z = at(center, phi, weights)
        _, g, h = costs_and_derivatives(problem, z, SMOOTHING)
        held = ((z <= LOWER) & (g > 0.0)) | ((z >= UPPER) & (g < 0.0))
        gradient += phi.T @ np.where(held, 0.0, g)
        h = np.where(held[:, :, None] | held[:, None, :], 0.0, h)
        for j in range(PARAMETERS):
            for k in range(j + 1):
                block = phi.T @ (h[:, j, k, None] * phi)
                matrix[:, j, :, k] += block
                if k < j:
                    matrix[:, k, :, j] += block
    flat = matrix.reshape(q * PARAMETERS, -1) / count
    flat[np.diag_indices(len(flat))] += np.repeat(penalty, PARAMETERS) + 1e-9
    return (gradient / count + penalty[:, None] * weights).ravel(), flat
