"""The status of a driver's window, known before any fit.

Never an exception: whatever is recorded has a status.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from idm_sumo.calibration.problem import Problem

OK = "ok"
START_MISSING = "start not recorded"
TOO_FEW = "too few frames"
OVERLAP = "overlap at start"
NO_LEADER = "no leader"
STANDING = "standing"
JUMPS = "leader jumps"
FASTER = "above desired speed"  # on average: the model keeps no gap at such a speed, whatever its parameters
NOT_CONVERGED = "not converged"

FEWEST_FRAMES = 10  # counted: twice the parameters
STANDING_SPEED = 0.3  # m/s, never exceeded by a standing vehicle
JUMP = 3.0  # m in one frame, beyond what the leader's speed explains: another leader
MOST_CHANGES = 0.05  # of the frames; more is a recording that does not know its leader

WITHOUT_FIT = frozenset({START_MISSING, TOO_FEW})


def leader_frames(problem: Problem) -> npt.NDArray[np.int64]:
    """Return in how many simulated frames somebody is ahead.

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    int64, shape (n,)
        Ahead of the recorded vehicle, in its lane.
    """
    return np.asarray(np.isfinite(problem.rear[:, 1:]).sum(axis=1))


def leader_changes(problem: Problem) -> npt.NDArray[np.int64]:
    """Return how often the recorded vehicle's leader changes.

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    int64, shape (n,)
    """
    with np.errstate(invalid="ignore"):
        moved = np.diff(problem.rear, axis=1)
        driven = 0.1 * 0.5 * (problem.leader_speed[:, 1:] + problem.leader_speed[:, :-1])
        jumps = np.abs(moved - driven) > JUMP
    appears = np.isfinite(problem.rear[:, 1:]) != np.isfinite(problem.rear[:, :-1])
    return np.asarray((jumps | appears).sum(axis=1))


def statuses(problem: Problem, speed: npt.NDArray[np.float64]) -> npt.NDArray[np.object_]:
    """Return the status of every window.

    Parameters
    ----------
    problem : Problem
    speed : float64, shape (n, h + 1)
        Recorded speed from the start on (m/s).

    Returns
    -------
    str objects, shape (n,)
    """
    frames = problem.target.shape[1]
    result = np.full(len(problem.start_x), OK, dtype=object)
    known = np.isfinite(speed)
    with np.errstate(invalid="ignore"):
        mean = np.where(known, speed, 0.0).sum(axis=1) / known.sum(axis=1)
        result[mean > problem.desired_speed] = FASTER
        result[leader_changes(problem) > max(MOST_CHANGES * frames, 1.0)] = JUMPS
        result[np.nanmax(np.nan_to_num(speed), axis=1) < STANDING_SPEED] = STANDING
        result[leader_frames(problem) == 0] = NO_LEADER
        result[problem.rear[:, 0] <= problem.start_x] = OVERLAP
    result[problem.counted.sum(axis=1) < FEWEST_FRAMES] = TOO_FEW
    result[~(np.isfinite(problem.start_x) & np.isfinite(problem.start_speed))] = START_MISSING
    return result
