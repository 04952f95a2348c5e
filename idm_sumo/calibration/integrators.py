"""Three ways to step a vehicle along its lane.

The paper's transition model is Euler with the old speed. SUMO offers Euler with the new
speed (its default) and the ballistic update. Every figure has to say which one made it: over
a minute the three differ by decimetres (``tests/sumo/export/test_parity.py``).

Further schemes drive by other laws with SUMO's default step: ``krauss`` is its default model, ``eidm`` its EIDM.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration.kernel import look_ahead
from idm_sumo.calibration.problem import Problem
from idm_sumo.models import idm, sumo_eidm, sumo_krauss
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]

PAPER, EULER, BALLISTIC, KRAUSS, EIDM = range(5)
CODES = {"paper": PAPER, "euler": EULER, "ballistic": BALLISTIC}
LAWS = {"krauss": KRAUSS, "eidm": EIDM}
IN_SUMO = ("euler", "ballistic")
SHARES = {"paper": 0.0, "euler": 1.0, "ballistic": 0.5}  # of the new speed in what a step travels
DT = FRAME_STEP
LONG_AGO = -1_000_000  # steps


@njit(cache=True)
def euler_old_speed(x: float, speed: float, new_speed: float, dt: float) -> float:
    r"""Return :math:`x + v\,dt` (m), the paper's step.

    Parameters
    ----------
    x : float
        m.
    speed, new_speed : float
        Before and after the step (m/s).
    dt : float
        s.

    Returns
    -------
    float
    """
    return x + speed * dt


@njit(cache=True)
def euler_new_speed(x: float, speed: float, new_speed: float, dt: float) -> float:
    r"""Return :math:`x + v'\,dt` (m), SUMO's default step.

    Semi-implicit Euler.

    Parameters
    ----------
    x : float
        m.
    speed, new_speed : float
        Before and after the step (m/s).
    dt : float
        s.

    Returns
    -------
    float
    """
    return x + new_speed * dt


@njit(cache=True)
def ballistic(x: float, speed: float, new_speed: float, dt: float) -> float:
    r"""Return :math:`x + \tfrac12(v+v')\,dt` (m), the ballistic step.

    Constant acceleration within the step, SUMO's ``--step-method.ballistic``. A vehicle that stops
    within the step stops at its end, because SUMO's IDM never plans a negative speed (Treiber and
    Kanagaraj, 2015, would let it stop earlier).

    Parameters
    ----------
    x : float
        m.
    speed, new_speed : float
        Before and after the step (m/s).
    dt : float
        s.

    Returns
    -------
    float
    """
    return x + 0.5 * (speed + new_speed) * dt


@njit(cache=True)
def speed_in_sumo(speed: float, acceleration: float, desired_speed: float, dt: float) -> float:
    r"""Return the next speed (m/s) as SUMO bounds it.

    :math:`\max(0, v - 9\,dt, \min(v + \dot v\,dt, v_0))`. SUMO does not drive above the smaller of
    ``maxSpeed`` and the lane's limit. A vehicle that is faster brakes by ``emergencyDecel`` (9 m/s²)
    until it is not, while the IDM itself would let it slow down gently.

    Parameters
    ----------
    speed : float
        m/s.
    acceleration : float
        The IDM's (m/s²).
    desired_speed : float
        m/s.
    dt : float
        s.

    Returns
    -------
    float
    """
    least = max(0.0, speed - idm.EMERGENCY_BRAKING * dt)
    return max(least, min(speed + acceleration * dt, desired_speed))


@njit(cache=True)
def advance(scheme, x, speed, acceleration, desired_speed, forward, dt):  # type: ignore[no-untyped-def]
    """Return position and speed after a step of a scheme.

    Parameters
    ----------
    scheme : int
        ``PAPER``, ``EULER`` or ``BALLISTIC``.
    x, speed : float
        m, m/s.
    acceleration : float
        m/s².
    desired_speed : float
        m/s.
    forward : float
        Metres along the road per metre driven, which the paper's model has from its steering;
        in SUMO a vehicle that keeps its lane loses nothing.
    dt : float
        s.

    Returns
    -------
    x, speed : float
        m, m/s.
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
    """Drive one driver along its lane over the horizon.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    theta : float64, shape (5,)
        ``a, b, T, d0, d1`` in SI units.
    scheme : int
        ``PAPER``, ``EULER``, ``BALLISTIC``, ``KRAUSS`` or ``EIDM``.
    x, speed : float64, shape (h + 1,)
        Filled with the front bumper (m) and m/s.
    """
    x[0], speed[0] = p.start_x[i], p.start_speed[i]
    stepping = EULER if scheme >= KRAUSS else scheme
    started = LONG_AGO
    for k in range(x.shape[0] - 1):
        rear, leader_speed = look_ahead(p, i, k, x[k])
        approach_rate, gap = speed[k] - leader_speed, rear - x[k]
        if scheme == KRAUSS:
            acceleration = sumo_krauss.acceleration(
                speed[k], approach_rate, gap, theta[0], theta[1], theta[2], theta[3], DT
            )
        elif scheme == EIDM:
            acceleration = sumo_eidm.acceleration(
                speed[k], approach_rate, gap, theta[0], theta[1], theta[2], theta[3], p.desired_speed[i]
            )
            before = (speed[k] - speed[k - 1]) / DT if k > 0 else 0.0
            if sumo_eidm.drives_off(speed[k], acceleration, before, (k - started) * DT, theta[0]):
                acceleration, started = sumo_eidm.DRIVE_OFF * acceleration, k
        else:
            acceleration = idm.acceleration(
                speed[k], approach_rate, gap, theta[0], theta[1], theta[2], theta[3], theta[4], p.desired_speed[i]
            )
        x[k + 1], speed[k + 1] = advance(
            stepping, x[k], speed[k], acceleration, p.desired_speed[i], p.forward[i, k], DT
        )


@njit(cache=True)
def ade_one(p, i, theta, scheme):  # type: ignore[no-untyped-def]
    """Return the ADE (m) of one driver.

    Parameters
    ----------
    p : Problem
    i : int
        The driver.
    theta : float64, shape (5,)
        ``a, b, T, d0, d1`` in SI units.
    scheme : int
        ``PAPER``, ``EULER``, ``BALLISTIC``, ``KRAUSS`` or ``EIDM``.

    Returns
    -------
    float
        Mean distance from the recorded vehicle over the frames that count; NaN if none does.
    """
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
    """Drive every driver along its lane over the horizon.

    Parameters
    ----------
    problem : Problem
        Of :func:`idm_sumo.calibration.problem.prepare`.
    parameters : array_like, shape (n, 5) or (5,)
        ``a, b, T, d0, d1``.
    integration : {"paper", "euler", "ballistic", "krauss", "eidm"}

    Returns
    -------
    x, speed : float64, shape (n, h + 1)
        Front bumper (m), m/s.

    Raises
    ------
    InputError
        If there is no such integration.
    """
    theta = as_parameters(problem, parameters)
    n, h = problem.target.shape
    x, speed = np.empty((n, h + 1)), np.empty((n, h + 1))
    in_threads(_drive_all, n, problem, theta, code(integration), x, speed)
    return x, speed


def ades(problem: Problem, parameters: npt.ArrayLike, integration: str) -> Floats:
    """Return every driver's ADE (m).

    Parameters
    ----------
    problem : Problem
        With the objective ``"ade"``.
    parameters : array_like, shape (n, 5) or (5,)
        ``a, b, T, d0, d1``.
    integration : {"paper", "euler", "ballistic", "krauss", "eidm"}

    Returns
    -------
    float64, shape (n,)

    Raises
    ------
    InputError
        If there is no such integration.
    """
    values = np.empty(len(problem.start_x))
    in_threads(_ade_all, len(values), problem, as_parameters(problem, parameters), code(integration), values)
    return values


def integrated(problem: Problem, integration: str) -> Problem:
    """Return a problem whose fits are driven by a scheme.

    Parameters
    ----------
    problem : Problem
    integration : {"paper", "euler", "ballistic"}

    Raises
    ------
    InputError
        If there is no such integration.
    """
    if integration in LAWS:
        raise InputError(f"integration: {integration!r} is a law; its fits have no derivatives")
    if code(integration) == PAPER:
        return problem
    return problem._replace(share=SHARES[integration], in_sumo=True, forward=np.ones_like(problem.forward))


def as_parameters(problem: Problem, parameters: npt.ArrayLike) -> Floats:
    """Return one contiguous row of five parameters a driver.

    Parameters
    ----------
    problem : Problem
    parameters : array_like, shape (n, 5) or (5,)

    Returns
    -------
    float64, shape (n, 5)
    """
    theta = np.asarray(parameters, dtype=np.float64)
    return np.array(np.broadcast_to(theta, (len(problem.start_x), 5)), order="C")


def code(integration: str) -> int:
    """Return the number of a scheme.

    Parameters
    ----------
    integration : {"paper", "euler", "ballistic", "krauss", "eidm"}

    Returns
    -------
    int

    Raises
    ------
    InputError
        If there is no such scheme.
    """
    schemes = CODES | LAWS
    if integration not in schemes:
        raise InputError(f"integration: {integration!r} is unknown; use one of {', '.join(schemes)}")
    return schemes[integration]
