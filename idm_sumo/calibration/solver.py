r"""Projected, reweighted Gauss-Newton: the compiled fit of one driver.

Why this solver. A rollout is cheap (microseconds) and its exact sensitivities cost little
more, so second-order information is nearly free. The ADE is a sum of distances, not of
squares: *iteratively reweighted* least squares turns it into squares that touch it from
above, and the lateral error keeps most distances away from their kink. It is not convex and
jumps where the leader perceived changes, so a fixed design of starts is screened by
plain evaluation first, the best few are refined, and a compass search on the ADE itself
finishes: it needs no derivative, crosses kinks and can only improve. Levenberg and
Marquardt's damping, bounds by projection with an active set (Bertsekas, 1982).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit, prange
from scipy.stats import qmc

from idm_sumo import idm
from idm_sumo.calibration.kernel import LOWER, PARAMETERS, UPPER, cost_and_derivatives, costs_of, to_search

Floats = npt.NDArray[np.float64]

SMOOTHING = 0.05  # m, in the steps' matrices; every step is judged by the cost itself, without any
STARTS = 64  # screened, of which
CANDIDATES = 8  # are refined shortly, and
FINALISTS = 2  # to the end
FIRST_ITERATIONS, FIRST_DROP = 3, 1e-3  # the relative drop of the cost that ends them
LAST_ITERATIONS, LAST_DROP = 20, 1e-4
NEGLIGIBLE = 1e-6  # m (or the objective's unit): a smaller drop is none
REACH, LEAST_REACH = 0.02, 0.004  # of the polish, in search coordinates
FAN = 10.0 ** np.array([-1.5, 0.0, 1.5])  # times the last damping: tried side by side
FURTHER = np.array([1.0, 3.0])  # times the last step: valleys are long
TRIALS = 2 * len(FAN) + len(FURTHER)
DAMPING_LEAST, DAMPING_MOST, DAMPING_JUMP = 1e-3, 1e3, 30.0
LEAST_SCALE = 1e-3  # of the largest diagonal element: damps what the window says nothing of
TINY = 1e-12
OVERSHOOT = 0.15  # of the range, in the design of starts: so that a share of them is at a bound


def design_of_starts(points: int) -> Floats:
    """Return ``points`` search coordinates: the textbook's driver and a Sobol sequence over the bounds, fixed."""
    sobol = qmc.Sobol(PARAMETERS, scramble=True, rng=20050615).random_base2(max(points - 1, 1).bit_length())
    spread = LOWER + np.clip(sobol[: points - 1] * (1.0 + 2.0 * OVERSHOOT) - OVERSHOOT, 0.0, 1.0) * (UPPER - LOWER)
    return np.ascontiguousarray(np.vstack([np.clip(to_search(idm.TEXTBOOK), LOWER, UPPER), spread]))


@njit(cache=True, error_model="numpy")
def solve_free(matrix, right, free, factor, x):  # type: ignore[no-untyped-def]
    """Solve the free part of a symmetric positive definite system by Cholesky; say whether it was one."""
    for j in range(PARAMETERS):
        for m in range(j + 1):
            value = matrix[j, m] if free[j] and free[m] else (1.0 if j == m else 0.0)
            for q in range(m):
                value -= factor[j, q] * factor[m, q]
            if j == m:
                if value <= 0.0:
                    return False
                factor[j, j] = np.sqrt(value)
            else:
                factor[j, m] = value / factor[m, m]
    for j in range(PARAMETERS):
        value = right[j] if free[j] else 0.0
        for q in range(j):
            value -= factor[j, q] * x[q]
        x[j] = value / factor[j, j]
    for j in range(PARAMETERS - 1, -1, -1):
        for q in range(j + 1, PARAMETERS):
            x[j] -= factor[q, j] * x[q]
        x[j] /= factor[j, j]
    return True


@njit(cache=True, error_model="numpy")
def damped_step(z, gradient, normal, damping, trial, work):  # type: ignore[no-untyped-def]
    """Fill ``trial`` with the damped Gauss-Newton step from ``z``, inside the bounds; say whether it moves.

    Coordinates at a bound towards which the descent points stay there; those that the step
    takes over a bound are put on it and the others are solved again. ``work`` is scratch of
    shape ``(14, 5)``.
    """
    matrix, factor, right, step, fixed, free = work[:5], work[5:10], work[10], work[11], work[12], work[13]
    largest = 0.0
    for j in range(PARAMETERS):
        outwards = (z[j] <= LOWER[j] and gradient[j] > 0.0) or (z[j] >= UPPER[j] and gradient[j] < 0.0)
        free[j], fixed[j], trial[j] = 0.0 if outwards else 1.0, 0.0, z[j]
        largest = max(largest, normal[j, j])
    for _ in range(PARAMETERS):
        for j in range(PARAMETERS):
            right[j] = -gradient[j]
            for m in range(PARAMETERS):
                matrix[j, m] = normal[j, m]
                right[j] -= normal[j, m] * fixed[m]
            matrix[j, j] += damping * (normal[j, j] + LEAST_SCALE * largest) + TINY
        if not solve_free(matrix, right, free, factor, step):
            return False
        inside = True
        for j in range(PARAMETERS):
            if free[j] and not LOWER[j] <= z[j] + step[j] <= UPPER[j]:
                fixed[j] = (LOWER[j] if z[j] + step[j] < LOWER[j] else UPPER[j]) - z[j]
                free[j], inside = 0.0, False
        if inside:
            break
    moved = False
    for j in range(PARAMETERS):
        trial[j] = min(max(z[j] + (step[j] if free[j] else fixed[j]), LOWER[j]), UPPER[j])
        moved = moved or trial[j] != z[j]
    return moved


@njit(cache=True)
def copy(source, to):  # type: ignore[no-untyped-def]
    """Copy search coordinates. Compiled ten times faster than a slice assignment, which must check shapes."""
    for j in range(PARAMETERS):
        to[j] = source[j]


@njit(cache=True)
def first_of(values, order):  # type: ignore[no-untyped-def]
    """Fill ``order`` with the rows of the smallest ``values``, smallest first; NaN is never one of them."""
    for place in range(order.shape[0]):
        least = -1
        for row in range(values.shape[0]):
            taken = False
            for before in range(place):
                taken = taken or order[before] == row
            if not taken and (least < 0 or values[row] < values[least] or values[least] != values[least]):
                least = row
        order[place] = least


@njit(cache=True, error_model="numpy")
def fan_of_steps(z, gradient, normal, curved, damping, last, trials, work):  # type: ignore[no-untyped-def]
    """Fill ``trials``: dampings of both matrices, then further along the last step."""
    fan = FAN.shape[0]
    for q in range(fan):
        damped_step(z, gradient, normal, damping * FAN[q], trials[q], work)
        damped_step(z, gradient, curved, damping * FAN[q], trials[fan + q], work)
    for q in range(FURTHER.shape[0]):
        for j in range(PARAMETERS):
            trials[2 * fan + q, j] = min(max(z[j] + FURTHER[q] * last[j], LOWER[j]), UPPER[j])


@njit(cache=True, error_model="numpy")
def refine(p, i, z, best, iterations, least_drop):  # type: ignore[no-untyped-def]
    """Refine ``z``, whose cost is ``best``, in place; return its cost and whether it came to rest.

    Every step is the best of a fan, rolled out side by side and judged by the cost itself.
    """
    gradient, last, work = np.empty(PARAMETERS), np.zeros(PARAMETERS), np.empty((14, PARAMETERS))
    normal, curved = np.empty((PARAMETERS, PARAMETERS)), np.empty((PARAMETERS, PARAMETERS))
    trials, values, order = np.empty((TRIALS, PARAMETERS)), np.empty(TRIALS), np.empty(1, dtype=np.int64)
    errors, slopes = np.empty(p.target.shape[1]), np.empty((PARAMETERS, p.target.shape[1]))
    fan, damping, done = FAN.shape[0], 1e-1, 0
    while done < iterations:  # not a range: numba would compile one version for every number
        done += 1
        cost_and_derivatives(p, i, z, SMOOTHING, gradient, normal, curved, errors, slopes)
        fan_of_steps(z, gradient, normal, curved, damping, last, trials, work)
        costs_of(p, i, trials, 0.0, values)
        first_of(values, order)
        q = order[0]
        drop = best - values[q]
        if not drop > 0.0:
            if damping > DAMPING_MOST:
                return best, True
            damping *= DAMPING_JUMP
            continue
        for j in range(PARAMETERS):
            last[j] = trials[q, j] - z[j]
        best = values[q]
        copy(trials[q], z)
        if q < 2 * fan:
            damping = min(max(damping * FAN[q % fan], DAMPING_LEAST), DAMPING_MOST)
        if drop <= least_drop * best + NEGLIGIBLE:
            return best, True
    return best, False


@njit(cache=True, error_model="numpy")
def polish(p, i, z, value):  # type: ignore[no-untyped-def]
    """Lower the cost itself by a compass search from ``z``, in place; return it. Crosses kinks and jumps."""
    trials, values = np.empty((2 * PARAMETERS, PARAMETERS)), np.empty(2 * PARAMETERS)
    order, reach = np.empty(1, dtype=np.int64), REACH
    while reach > LEAST_REACH:
        for j in range(PARAMETERS):
            copy(z, trials[2 * j])
            copy(z, trials[2 * j + 1])
            trials[2 * j, j] = max(z[j] - reach, LOWER[j])
            trials[2 * j + 1, j] = min(z[j] + reach, UPPER[j])
        costs_of(p, i, trials, 0.0, values)
        first_of(values, order)
        if values[order[0]] < value - NEGLIGIBLE:
            value = values[order[0]]
            copy(trials[order[0]], z)
        else:
            reach *= 0.25
    return value


@njit(cache=True, error_model="numpy")
def fit(p, i, designs, z):  # type: ignore[no-untyped-def]
    """Fit driver ``i``: fill ``z``; return its cost and whether the search came to rest."""
    candidates = min(CANDIDATES, designs.shape[0])
    screened, value = np.empty(designs.shape[0]), np.empty(candidates)
    order, finalists = np.empty(candidates, dtype=np.int64), np.empty(min(FINALISTS, candidates), dtype=np.int64)
    trial = np.empty((candidates, PARAMETERS))
    costs_of(p, i, designs, 0.0, screened)
    first_of(screened, order)
    for s in range(candidates):
        copy(designs[order[s]], trial[s])
        value[s], _ = refine(p, i, trial[s], screened[order[s]], FIRST_ITERATIONS, FIRST_DROP)
    first_of(value, finalists)
    best, rests = np.inf, False
    for s in finalists:
        new, rested = refine(p, i, trial[s], value[s], LAST_ITERATIONS, LAST_DROP)
        if new < best:
            best, rests = new, rested
            copy(trial[s], z)
    return polish(p, i, z, best), rests


@njit(cache=True, parallel=True)
def fit_all(p, which, designs):  # type: ignore[no-untyped-def]
    """Fit drivers ``which``.

    Returns
    -------
    z : float64, shape (len(which), 5)
        Search coordinates.
    value : float64, shape (len(which),)
        The objective.
    rested : bool, shape (len(which),)
        Whether the search came to rest within its iterations.
    """
    m = which.shape[0]
    z, value, rested = np.empty((m, PARAMETERS)), np.empty(m), np.empty(m, dtype=np.bool_)
    for q in prange(m):
        value[q], rested[q] = fit(p, which[q], designs, z[q])
    return z, value, rested
