"""The paper's solver on the same compiled objective: scipy's L-BFGS-B.

It searches within the bounds by finite differences, from several random starts. A fit costs a
thousand times a rollout; it is a reference, to be compared with.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from idm_sumo.calibration.kernel import LOWER, PARAMETERS, UPPER, cost_and_derivatives, costs_of
from idm_sumo.calibration.problem import Problem, only

Floats = npt.NDArray[np.float64]

DIFFERENCE = 1e-6  # in search coordinates: the step of the finite differences


@njit(cache=True)
def value_and_difference_gradient(p, i, z):  # type: ignore[no-untyped-def]
    """Return the cost and its gradient by finite differences.

    Forward differences, backward at the upper bound.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (5,)
        Search coordinates.

    Returns
    -------
    value : float
    gradient : float64, shape (5,)
    """
    trials, values, step = np.empty((PARAMETERS + 1, PARAMETERS)), np.empty(PARAMETERS + 1), np.empty(PARAMETERS)
    trials[:] = z
    for j in range(PARAMETERS):
        step[j] = DIFFERENCE if z[j] + DIFFERENCE <= UPPER[j] else -DIFFERENCE
        trials[j + 1, j] += step[j]
    costs_of(p, i, trials, 0.0, values)
    return values[0], (values[1:] - values[0]) / step


@njit(cache=True)
def value_and_gradient(p, i, z):  # type: ignore[no-untyped-def]
    """Return the cost and its gradient by forward sensitivities.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    z : float64, shape (5,)
        Search coordinates.

    Returns
    -------
    value : float
    gradient : float64, shape (5,)
    """
    gradient = np.empty(PARAMETERS)
    value = cost_and_derivatives(p, i, z, 0.0, gradient, np.empty((PARAMETERS, PARAMETERS)))
    return value, gradient


def l_bfgs_b(
    problem: Problem,
    which: npt.NDArray[np.int64],
    *,
    starts: int = 10,
    seed: int = 0,
    first: int = 0,
    derivatives: bool = False,
) -> tuple[Floats, Floats]:
    """Fit drivers by scipy's L-BFGS-B from random starts.

    Parameters
    ----------
    problem : Problem
    which : int64, shape (m,)
        The drivers.
    starts, seed : int
        Starts within the bounds, and the seed that draws them.
    first : int
        Number of the problem's first driver in the campaign: every driver has its own random starts.
    derivatives : bool
        Whether to use our sensitivities in place of finite differences.

    Returns
    -------
    z : float64, shape (m, 5)
        Search coordinates.
    value : float64, shape (m,)
        The objective, the best of the starts.
    """
    function = value_and_gradient if derivatives else value_and_difference_gradient
    # scipy solves 10 x 10 systems by BLAS: with a thread a core that takes 50 times longer.
    with threadpool_limits(1, user_api="blas"):
        return _from_starts(function, problem, which, starts, [seed, first])


def _from_starts(
    function: Callable[[Problem, int, Floats], tuple[float, Floats]],
    problem: Problem, which: npt.NDArray[np.int64], starts: int, seeds: list[int],
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return the best of every driver's own random starts."""
    seed, first = seeds
    z, value = np.empty((len(which), PARAMETERS)), np.full(len(which), np.inf)
    bounds = list(zip(LOWER, UPPER, strict=True))
    for q, i in enumerate(which):
        rng = np.random.default_rng([seed, first + int(i)])
        one = only(problem, np.array([i]))
        for start in rng.uniform(LOWER, UPPER, (starts, PARAMETERS)):
            found = minimize(
                lambda at, one=one: function(one, 0, at), start, jac=True, method="L-BFGS-B", bounds=bounds
            )
            if found.fun < value[q]:
                z[q], value[q] = found.x, found.fun
    return z, value
