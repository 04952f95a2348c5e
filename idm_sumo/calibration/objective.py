r"""What a fit minimises: a frame's error and its cost.

The cost of a driver is the mean over its counted frames. With the *weight*
:math:`w(e) = \rho'(e)/e` of a cost :math:`\rho`, iteratively reweighted least squares
minimises any of them: :math:`\rho` lies below the parabola :math:`\tfrac12 w(e_k) e^2 + c`
that touches it at :math:`e_k`, so a step that lowers the parabolas lowers the cost
(Holland and Welsch, 1977; Lange, Hunter and Yang, 2000). Compiled scalars.
"""

from __future__ import annotations

from math import log, sqrt

from numba import njit

from idm_sumo.models.idm import SMALLEST_GAP

ADE, GAP, SPEED, LOG_GAP = 0, 1, 2, 3
CODES = {"ade": ADE, "gap": GAP, "speed": SPEED, "log-gap": LOG_GAP}

SQUARED, HUBER, SOFT_L1 = 0, 1, 2
LOSSES = {"squared": SQUARED, "huber": HUBER, "soft-l1": SOFT_L1}


@njit(cache=True, error_model="numpy")
def distance(error: float, lateral: float, smoothing: float) -> float:
    r"""Return the smoothed distance from the recorded vehicle.

    :math:`\sqrt{e_x^2 + e_y^2 + \epsilon^2}` (m), the ADE's cost of one frame at :math:`\epsilon = 0`.

    Parameters
    ----------
    error, lateral, smoothing : float
        :math:`e_x, e_y, \epsilon` (m).

    Returns
    -------
    float
    """
    return sqrt(error * error + lateral * lateral + smoothing * smoothing)


@njit(cache=True, error_model="numpy")
def robust_cost(error: float, loss: int, scale: float) -> float:
    r"""Return the cost of an error.

    :math:`\tfrac12 e^2`, linear beyond ``scale`` if the loss is robust.
    Huber: :math:`s|e| - s^2/2` beyond :math:`s`; soft L1: :math:`s\sqrt{e^2 + s^2} - s^2`.

    Parameters
    ----------
    error : float
        In the objective's unit.
    loss : int
        ``SQUARED``, ``HUBER`` or ``SOFT_L1``.
    scale : float
        :math:`s`, in the objective's unit.

    Returns
    -------
    float
    """
    if loss == SQUARED:
        return 0.5 * error * error
    if loss == HUBER:
        return 0.5 * error * error if abs(error) <= scale else scale * (abs(error) - 0.5 * scale)
    return scale * (sqrt(error * error + scale * scale) - scale)


@njit(cache=True, error_model="numpy")
def robust_weight(error: float, loss: int, scale: float) -> float:
    """Return the weight of an error.

    The derivative of :func:`robust_cost` divided by the error.

    Parameters
    ----------
    error : float
        In the objective's unit.
    loss : int
        ``SQUARED``, ``HUBER`` or ``SOFT_L1``.
    scale : float
        In the objective's unit.

    Returns
    -------
    float
    """
    if loss == SQUARED:
        return 1.0
    if loss == HUBER:
        return 1.0 if abs(error) <= scale else scale / abs(error)
    return scale / sqrt(error * error + scale * scale)


@njit(cache=True, error_model="numpy")
def measured(objective: int, x: float, speed: float, rear: float) -> float:
    """Return what an objective compares.

    Parameters
    ----------
    objective : int
        ``ADE``, ``GAP``, ``SPEED`` or ``LOG_GAP``.
    x, speed : float
        Front bumper (m), m/s.
    rear : float
        The leader's rear bumper (m).

    Returns
    -------
    float
        Position (m), gap (m), speed (m/s) or the gap's logarithm.
    """
    if objective == ADE:
        return x
    if objective == SPEED:
        return speed
    gap = rear - x
    return log(max(gap, SMALLEST_GAP)) if objective == LOG_GAP else gap


@njit(cache=True, error_model="numpy")
def measured_partials(objective: int, x: float, rear: float) -> tuple[float, float]:
    """Return the derivatives of :func:`measured`, the leader held.

    Parameters
    ----------
    objective : int
        ``ADE``, ``GAP``, ``SPEED`` or ``LOG_GAP``.
    x, rear : float
        Front bumper and the leader's rear bumper (m).

    Returns
    -------
    by_x, by_speed : float
    """
    if objective == ADE:
        return 1.0, 0.0
    if objective == SPEED:
        return 0.0, 1.0
    if objective == GAP:
        return -1.0, 0.0
    gap = rear - x
    return (-1.0 / gap, 0.0) if gap > SMALLEST_GAP else (0.0, 0.0)
