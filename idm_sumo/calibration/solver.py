"""The compiled fit of one driver: a tournament of starts.

Projected, reweighted Gauss-Newton. Why this solver: a rollout is cheap (microseconds), and eight with
their exact sensitivities side by side (:mod:`idm_sumo.calibration.lanes`) take little more, so
second-order information is nearly free. The ADE is a sum of distances, not of squares: *iteratively reweighted* least
squares turns it into squares that touch it from above, so its steps are never too long, and
the lateral error keeps most distances away from their kink. It is not convex and jumps where
the leader perceived changes, so a fixed design of starts is screened by plain evaluation
first. The best eight then go on, one trial step a round each; after some rounds the better
half, two trial steps a round each; and so on to the last one with eight. Every trial is
judged by the objective itself, which therefore only falls. Levenberg and Marquardt's damping, bounds by
projection (:mod:`idm_sumo.calibration.steps`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration import lanes, steps
from idm_sumo.calibration.coordinates import LOWER, PARAMETERS, UPPER, to_search
from idm_sumo.calibration.lanes import LANES, PAIRS, WHOLE, costs_of, roll_with_derivatives
from idm_sumo.calibration.problem import Problem
from idm_sumo.calibration.steps import STEPS, step_lanes
from idm_sumo.models import idm
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]

SMOOTHING = 0.05  # m, below which the weight of a distance grows no more
STARTS = 64  # screened; LANES of them are refined
OVERSHOOT = 0.15  # of the range, in the design of starts: so that a share of them is at a bound
NEGLIGIBLE = 1e-6  # m (or the objective's unit): a smaller drop is none

# The tournament's stages: 8, 4, 2 and 1 candidates; the most rounds, the relative drop of the
# cost that is still worth a round, and what every candidate tries: the last damping times FAN, and
# (FAN = 0) ALONG times its last step, because valleys are long.
STAGES = 4
ROUNDS = np.array([7, 5, 10, 20])
DROP = np.array([1e-3, 1e-3, 1e-4, 1e-4])
FAN = np.zeros((STAGES, LANES))
FAN[0, :1] = 0.2
FAN[1, :2] = 0.1, 2.0
FAN[2, :4] = 0.03, 0.6, 12.0, 0.0
FAN[3] = 10**-2.5, 10**-1.5, 10**-0.5, 10**0.5, 10**1.5, 10**2.5, 0.0, 0.0
ALONG = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 3.0])
FIRST_DAMPING, DAMPING_LEAST, DAMPING_MOST = 0.5, 1e-3, 1e3
DAMPING_JUMP = np.array([8.0, 10.0, 30.0, 30.0])  # where nothing was better

# Rows of what is known of the candidates, a column each.
VALUE, Z, SLOPE, MATRIX, DAMPING, LAST = 0, 1, 6, 11, 11 + PAIRS, 12 + PAIRS
ROWS = LAST + PARAMETERS


def design_of_starts(points: int) -> Floats:
    """Return a fixed design of starts.

    Parameters
    ----------
    points : int

    Returns
    -------
    float64, shape (points, 5)
        Search coordinates: the textbook's driver, then a Sobol sequence over the bounds.
    """
    from scipy.stats import qmc  # here: scipy.stats takes long to load

    sobol = qmc.Sobol(PARAMETERS, scramble=True, rng=20050615).random_base2(max(points - 1, 1).bit_length())
    spread = LOWER + np.clip(sobol[: points - 1] * (1.0 + 2.0 * OVERSHOOT) - OVERSHOOT, 0.0, 1.0) * (UPPER - LOWER)
    return np.ascontiguousarray(np.vstack([np.clip(to_search(idm.TEXTBOOK), LOWER, UPPER), spread]))


@njit(cache=True)
def first_of(values, order):  # type: ignore[no-untyped-def]
    """Find the places of the smallest values.

    Parameters
    ----------
    values : float64, shape (m,)
        NaN is never one of the smallest.
    order : int64
        Filled with places of ``values``, the smallest first; -1 where there is none.
    """
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
def keep(rolled, trials, lane, known, c):  # type: ignore[no-untyped-def]
    """Note a trial as a candidate.

    Parameters
    ----------
    rolled : float64, shape (WHOLE,)
        State of :func:`~idm_sumo.calibration.lanes.roll_with_derivatives`.
    trials : float64, shape (LANES, 5)
        Search coordinates.
    lane : int
        Of the trial.
    known : float64, shape (ROWS, LANES)
        What is known of the candidates, changed.
    c : int
        The candidate.
    """
    known[VALUE, c] = rolled[lanes.TOTAL + lane]
    for j in range(PARAMETERS):
        known[Z + j, c], known[SLOPE + j, c] = trials[lane, j], rolled[lanes.GRADIENT + j * LANES + lane]
    for j in range(PAIRS):
        known[MATRIX + j, c] = rolled[lanes.NORMAL + j * LANES + lane]


@njit(cache=True)
def keep_better(known, candidates):  # type: ignore[no-untyped-def]
    """Put the better half of the candidates first.

    Parameters
    ----------
    known : float64, shape (ROWS, LANES)
        What is known of the candidates, changed.
    candidates : int
        How many stay, of twice as many.
    """
    for c in range(candidates):
        for other in range(c + 1, 2 * candidates):
            if known[VALUE, other] < known[VALUE, c]:
                for row in range(ROWS):
                    known[row, c], known[row, other] = known[row, other], known[row, c]


@njit(cache=True, error_model="numpy")
def propose(known, candidates, stage, work, trials):  # type: ignore[no-untyped-def]
    """Fill every candidate's next trials.

    Parameters
    ----------
    known : float64, shape (ROWS, LANES)
        What is known of the candidates.
    candidates, stage : int
    work : float64, shape (STEPS,)
        Storage of :func:`~idm_sumo.calibration.steps.step_lanes`.
    trials : float64, shape (LANES, 5)
        Filled with search coordinates, ``LANES // candidates`` a candidate.
    """
    each = LANES // candidates
    for lane in range(LANES):
        c = lane // each
        for j in range(PAIRS):
            work[steps.MATRIX + j * LANES + lane] = known[MATRIX + j, c]
        for j in range(PARAMETERS):
            work[steps.GRADIENT + j * LANES + lane] = known[SLOPE + j, c]
            work[steps.AT + j * LANES + lane] = known[Z + j, c]
        work[steps.DAMPING + lane] = known[DAMPING, c] * FAN[stage, lane % each]
    step_lanes(work)
    for lane in range(LANES):
        c, along = lane // each, ALONG[lane % each]
        for j in range(PARAMETERS):
            further = min(max(known[Z + j, c] + along * known[LAST + j, c], LOWER[j]), UPPER[j])
            trials[lane, j] = work[steps.THERE + j * LANES + lane] if FAN[stage, lane % each] > 0.0 else further


@njit(cache=True, error_model="numpy")
def accept(rolled, trials, first, each, stage, known, c):  # type: ignore[no-untyped-def]
    """Move a candidate to its best trial if better.

    Parameters
    ----------
    rolled : float64, shape (WHOLE,)
        State of :func:`~idm_sumo.calibration.lanes.roll_with_derivatives`.
    trials : float64, shape (LANES, 5)
        Search coordinates.
    first, each : int
        The candidate's first lane, and how many it has.
    stage : int
    known : float64, shape (ROWS, LANES)
        What is known of the candidates, changed.
    c : int
        The candidate.

    Returns
    -------
    bool
        Whether it is worth going on.
    """
    best, value = -1, known[VALUE, c]
    for t in range(each):
        if rolled[lanes.TOTAL + first + t] < value:
            best, value = t, rolled[lanes.TOTAL + first + t]
    if best < 0:
        tried = known[DAMPING, c]
        known[DAMPING, c] = tried * DAMPING_JUMP[stage]
        return tried <= DAMPING_MOST
    drop = known[VALUE, c] - value
    for j in range(PARAMETERS):
        known[LAST + j, c] = trials[first + best, j] - known[Z + j, c]
    if FAN[stage, best] > 0.0:
        known[DAMPING, c] = min(max(known[DAMPING, c] * FAN[stage, best], DAMPING_LEAST), DAMPING_MOST)
    keep(rolled, trials, first + best, known, c)
    return drop > DROP[stage] * value + NEGLIGIBLE


@njit(cache=True, error_model="numpy")
def play(p, i, known, candidates, stage, rolled, work, trials):  # type: ignore[no-untyped-def]
    """Play the rounds of one stage.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    known : float64, shape (ROWS, LANES)
        What is known of the candidates, changed.
    candidates, stage : int
    rolled : float64, shape (WHOLE,)
        Storage of the rollouts.
    work : float64, shape (STEPS,)
        Storage of the steps.
    trials : float64, shape (LANES, 5)
        Storage of the trials.

    Returns
    -------
    bool
        Whether every candidate came to rest.
    """
    each, left, going = LANES // candidates, ROUNDS[stage], True
    while going and left > 0:
        left -= 1
        propose(known, candidates, stage, work, trials)
        roll_with_derivatives(p, i, trials, 0.0, SMOOTHING, rolled)
        going = False
        for c in range(candidates):
            going |= accept(rolled, trials, c * each, each, stage, known, c)
    return not going


@njit(cache=True, error_model="numpy")
def fit(p, i, designs, z):  # type: ignore[no-untyped-def]
    """Fit one driver.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    designs : float64, shape (m, 5)
        Starts in search coordinates.
    z : float64, shape (5,)
        Filled with search coordinates.

    Returns
    -------
    cost : float
        In the objective's unit.
    rested : bool
        Whether the search came to rest within its rounds.
    """
    rolled, work, trials = np.empty(WHOLE), np.empty(STEPS), np.empty((LANES, PARAMETERS))
    known, screened, order = np.zeros((ROWS, LANES)), np.empty(designs.shape[0]), np.empty(LANES, dtype=np.int64)
    costs_of(p, i, designs, 0.0, screened)
    first_of(screened, order)
    for lane in range(LANES):
        for j in range(PARAMETERS):
            trials[lane, j] = designs[max(order[lane], 0), j]
    roll_with_derivatives(p, i, trials, 0.0, SMOOTHING, rolled)
    for lane in range(LANES):
        keep(rolled, trials, lane, known, lane)
        known[DAMPING, lane] = FIRST_DAMPING
    rested = False
    for stage in range(STAGES):
        candidates = LANES >> stage
        if stage > 0:
            keep_better(known, candidates)
        rested = play(p, i, known, candidates, stage, rolled, work, trials)
    for j in range(PARAMETERS):
        z[j] = known[Z + j, 0]
    return known[VALUE, 0], rested


@njit(cache=True, nogil=True)
def _fit(first, last, p, which, designs, z, value, rested):  # type: ignore[no-untyped-def]
    for q in range(first, last):
        value[q], rested[q] = fit(p, which[q], designs, z[q])


def fit_all(
    problem: Problem, which: npt.NDArray[np.int64], designs: Floats
) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Fit some of the drivers.

    Parameters
    ----------
    problem : Problem
    which : int64, shape (m,)
        The drivers.
    designs : float64, shape (starts, 5)
        Starts in search coordinates.

    Returns
    -------
    z : float64, shape (m, 5)
        Search coordinates.
    value : float64, shape (m,)
        The objective.
    rested : bool, shape (m,)
        Whether the search came to rest within its rounds.
    """
    m = len(which)
    z, value, rested = np.empty((m, PARAMETERS)), np.empty(m), np.empty(m, dtype=np.bool_)
    in_threads(_fit, m, problem, which, designs, z, value, rested)
    return z, value, rested
