r"""The three ways to step a vehicle along its lane, and rollouts of many drivers by each.

The paper's transition model is Euler with the old speed. SUMO offers Euler with the new
speed (its default) and the ballistic update. Every figure has to say which one made it: over
a minute the three differ by decimetres (``tests/sumo/export/test_parity.py``).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration.kernel import look_ahead
from idm_sumo.calibration.problem import Problem
from idm_sumo.models import idm
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]

PAPER, EULER, BALLISTIC = 0, 1, 2
CODES = {"paper": PAPER, "euler": EULER, "ballistic": BALLISTIC}
IN_SUMO = ("euler", "ballistic")
DT = FRAME_STEP


@njit(cache=True)
def euler_old_speed(x: float, speed: float, new_speed: float, dt: float) -> float:
    r"""Return :math:`x + v\,dt` (m), the paper's step."""
    return x + speed * dt


@njit(cache=True)
def euler_new_speed(x: float, speed: float, new_speed: float, dt: float) -> float:
    r"""Return :math:`x + v'\,dt` (m): semi-implicit Euler, SUMO's default."""
    return x + new_speed * dt


@njit(cache=True)
def ballistic(x: float, speed: float, new_speed: float, dt: float) -> float:
    r"""Return :math:`x + \tfrac12 (v + v')\,dt` (m): constant acceleration within the step, SUMO's ``--step-method.ballistic``.

    A vehicle that stops within the step stops at its end, because SUMO's IDM never plans a
    negative speed (Treiber and Kanagaraj, 2015, would let it stop earlier).
    """
    return x + 0.5 * (speed + new_speed) * dt


@njit(cache=True)
def speed_in_sumo(speed: float, acceleration: float, desired_speed: float, dt: float) -> float:
    r"""Return the next speed (m/s) as SUMO bounds it: :math:`\max(0, v - 9\,dt, \min(v + \dot v\,dt, v_0))`.

    SUMO does not drive above the smaller of ``maxSpeed`` and the lane's limit. A vehicle that
    is faster brakes by ``emergencyDecel`` (9 m/s²) until it is not, while the IDM itself would
    let it slow down gently.
    """
    least = max(0.0, speed - idm.EMERGENCY_BRAKING * dt)
    return max(least, min(speed + acceleration * dt, desired_speed))


@njit(cache=True)
def advance(scheme, x, speed, acceleration, desired_speed, forward, dt):  # type: ignore[no-untyped-def]
    """Return position (m) and speed (m/s) ``dt`` seconds later by one of the three schemes.

    ``forward`` is the metres along the road per metre driven, which the paper's model has
    from its steering; in SUMO a vehicle that keeps its lane loses nothing.
    """
    if scheme == PAPER:
        new_speed = max(0.0, speed + acceleration * dt)
        return euler_old_speed(x, speed * forward, new_speed, dt), new_speed
    new_speed = speed_in_sumo(speed, acceleration, desired_speed, dt)
    if scheme == EULER:
        return euler_new_speed(x, speed, new_speed, dt), new_speed
    return ballistic(x, speed, new_speed, dt), new_speed


@njit(cache=True)
def drive_one(p, i, theta, scheme, x, speed):  # type: ignore[no-untyped-def]
    """Fill ``x`` (m) and ``speed`` (m/s), shape ``(h + 1,)``, of driver ``i`` with parameters ``theta``, shape ``(5,)``."""
    x[0], speed[0] = p.start_x[i], p.start_speed[i]
    for k in range(x.shape[0] - 1):
        rear, leader_speed = look_ahead(p, i, k, x[k])
        acceleration = idm.acceleration(
            speed[k], speed[k] - leader_speed, rear - x[k],
            theta[0], theta[1], theta[2], theta[3], theta[4], p.desired_speed[i],
        )  # fmt: skip
        x[k + 1], speed[k + 1] = advance(scheme, x[k], speed[k], acceleration, p.desired_speed[i], p.forward[i, k], DT)


@njit(cache=True)
def ade_one(p, i, theta, scheme):  # type: ignore[no-untyped-def]
    """Return the ADE (m) of driver ``i``: the mean distance from the recorded twin; NaN if no frame counts."""
    h = p.target.shape[1]
    x, speed = np.empty(h + 1), np.empty(h + 1)
    drive_one(p, i, theta, scheme, x, speed)
    total, frames = 0.0, 0
    for k in range(h):
        if p.counted[i, k]:
            total += np.hypot(x[k + 1] - p.target[i, k], p.lateral[i, k])
            frames += 1
    return total / frames if frames else np.nan


@njit(cache=True, nogil=True)
def _drive_all(first, last, p, theta, scheme, x, speed):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        drive_one(p, i, theta[i], scheme, x[i], speed[i])


@njit(cache=True, nogil=True)
def _ade_all(first, last, p, theta, scheme, values):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        values[i] = ade_one(p, i, theta[i], scheme)


def drive(problem: Problem, parameters: npt.ArrayLike, integration: str) -> tuple[Floats, Floats]:
    """Drive every driver along its lane from its start over the horizon.

    Parameters
    ----------
    problem : Problem
        Of :func:`idm_sumo.calibration.problem.prepare`.
    parameters : array_like, shape (n, 5) or (5,)
        ``a, b, T, d0, d1``.
    integration : {"paper", "euler", "ballistic"}

    Returns
    -------
    x, speed : float64, shape (n, h + 1)
        Front bumper (m), m/s.
    """
    theta = as_parameters(problem, parameters)
    n, h = problem.target.shape
    x, speed = np.empty((n, h + 1)), np.empty((n, h + 1))
    in_threads(_drive_all, n, problem, theta, code(integration), x, speed)
    return x, speed


def ades(problem: Problem, parameters: npt.ArrayLike, integration: str) -> Floats:
    """Return every driver's ADE (m), shape ``(n,)``; arguments as in :func:`drive`. The problem's objective is the ADE."""
    values = np.empty(len(problem.start_x))
    in_threads(_ade_all, len(values), problem, as_parameters(problem, parameters), code(integration), values)
    return values


def as_parameters(problem: Problem, parameters: npt.ArrayLike) -> Floats:
    """Return one contiguous row of five parameters a driver."""
    theta = np.asarray(parameters, dtype=np.float64)
    return np.array(np.broadcast_to(theta, (len(problem.start_x), 5)), order="C")


def code(integration: str) -> int:
    """Return the number of a scheme.

    Raises
    ------
    InputError
        If there is no such scheme.
    """
    if integration not in CODES:
        raise InputError(f"integration: {integration!r} is unknown; use one of {', '.join(CODES)}")
    return CODES[integration]
