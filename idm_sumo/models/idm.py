"""The Intelligent Driver Model (IDM) as compiled scalar kernels.

Source: Treiber, Hennecke and Helbing (2000), eqs. 2-3, with the non-linear jam distance
``d1`` that the paper keeps. The exponent is 4, the desired speed is the speed limit.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

EXPONENT = 4.0
EMERGENCY_BRAKING = 9.0  # m/s^2, SUMO's default emergencyDecel: no car brakes harder
SLOWEST = 1e-9  # m/s; below it the derivative of the square root of the speed is that at standstill
SMALLEST_GAP = 0.01  # m, below it the bumpers touch and the interaction would divide by zero


class IDMParameters(NamedTuple):
    r"""The five parameters in which drivers differ.

    Attributes
    ----------
    a : float
        Maximum acceleration :math:`a` (m/s²).
    b : float
        Comfortable deceleration :math:`b` (m/s²).
    T : float
        Safe time headway :math:`T` (s).
    d0 : float
        Jam distance :math:`d_0` (m), the gap kept at standstill.
    d1 : float
        Non-linear jam distance :math:`d_1` (m), which grows with :math:`\sqrt{v/v_0}`.
    """

    a: float
    b: float
    T: float
    d0: float
    d1: float


# Bounds of every calibration, wide enough for motorcycles and trucks. Where a fit ends on
# one, the window did not determine that parameter (`at_bound` in the driver table).
LOWER = IDMParameters(a=0.1, b=0.1, T=0.1, d0=0.1, d1=0.0)
UPPER = IDMParameters(a=6.0, b=6.0, T=5.0, d0=10.0, d1=10.0)

# Treiber, Hennecke and Helbing (2000), table 1: the start of searches, never a result.
TEXTBOOK = IDMParameters(a=0.73, b=1.67, T=1.6, d0=2.0, d1=0.0)


@njit(cache=True, error_model="numpy")
def closing_weight(a: float, b: float) -> float:
    r"""Return the approach rate's weight in the desired gap.

    Parameters
    ----------
    a, b : float
        Maximum acceleration and comfortable deceleration (m/s²).

    Returns
    -------
    float
        :math:`1/(2\sqrt{ab})` (s²/m).
    """
    return 1.0 / (2.0 * sqrt(a * b))


@njit(cache=True, error_model="numpy")
def desired_gap(
    speed: float, approach_rate: float, a: float, b: float, T: float, d0: float, d1: float, desired_speed: float
) -> float:
    r"""Return the gap that a driver wants to keep.

    .. math:: d^* = d_0 + d_1\sqrt{v/v_0} + \max\Big(0, Tv + \frac{v\,\Delta v}{2\sqrt{ab}}\Big)

    Parameters
    ----------
    speed, approach_rate : float
        Own speed :math:`v`, and own speed minus the leader's :math:`\Delta v` (m/s).
    a, b, T, d0, d1 : float
        See :class:`IDMParameters`.
    desired_speed : float
        Desired speed :math:`v_0` (m/s).

    Returns
    -------
    float
        Desired gap :math:`d^*` (m).

    Notes
    -----
    The paper prints the equation without the maximum. A leader that pulls away fast then makes
    :math:`d^*` negative, and its square brakes. Treiber and Kesting (2013, eq. 11.15) and SUMO
    take the maximum, and so does this function. Both agree where the sum is positive.
    """
    return desired_gap_of(speed, approach_rate, closing_weight(a, b), T, d0, d1, 1.0 / desired_speed)


@njit(cache=True, error_model="numpy")
def desired_gap_of(
    speed: float, approach_rate: float, weight: float, T: float, d0: float, d1: float, inverse: float
) -> float:
    """Return :func:`desired_gap` from precomputed constants of the driver.

    A caller computes ``weight`` and ``inverse`` once, since they do not change from frame to frame.

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    weight : float
        :func:`closing_weight` (s²/m).
    T, d0, d1 : float
        See :class:`IDMParameters`.
    inverse : float
        :math:`1/v_0` (s/m).

    Returns
    -------
    float
        Desired gap (m).
    """
    return d0 + d1 * sqrt(max(speed * inverse, 0.0)) + max(0.0, T * speed + speed * approach_rate * weight)


@njit(cache=True, error_model="numpy")
def acceleration(
    speed: float,
    approach_rate: float,
    gap: float,
    a: float,
    b: float,
    T: float,
    d0: float,
    d1: float,
    desired_speed: float,
) -> float:
    r"""Return the acceleration of the IDM.

    .. math:: \dot v = a\,\big(1 - (v/v_0)^4 - (d^*/d)^2\big)

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap :math:`d`, bumper to bumper (m); infinite without a leader, which leaves the free-road term.
    a, b, T, d0, d1 : float
        See :class:`IDMParameters`.
    desired_speed : float
        Desired speed :math:`v_0` (m/s), the speed limit in the paper. Above it the free-road term is
        negative, and the driver slows down.

    Returns
    -------
    float
        Acceleration (m/s²), at least ``-EMERGENCY_BRAKING``. At a gap of ``SMALLEST_GAP`` or less it is
        exactly that.
    """
    return acceleration_of(speed, approach_rate, gap, a, closing_weight(a, b), T, d0, d1, 1.0 / desired_speed)


@njit(cache=True, error_model="numpy")
def acceleration_of(
    speed: float,
    approach_rate: float,
    gap: float,
    a: float,
    weight: float,
    T: float,
    d0: float,
    d1: float,
    inverse: float,
) -> float:
    """Return :func:`acceleration` from precomputed constants of the driver.

    The function has no branches, so a loop over many drivers becomes vector instructions.

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m).
    a : float
        Maximum acceleration (m/s²).
    weight : float
        :func:`closing_weight` (s²/m).
    T, d0, d1 : float
        See :class:`IDMParameters`.
    inverse : float
        :math:`1/v_0` (s/m).

    Returns
    -------
    float
        Acceleration (m/s²).
    """
    ratio = speed * inverse
    wanted = desired_gap_of(speed, approach_rate, weight, T, d0, d1, inverse)
    interaction = wanted * (1.0 / max(gap, SMALLEST_GAP))
    free = max(a * (1.0 - ratio * ratio * ratio * ratio - interaction * interaction), -EMERGENCY_BRAKING)
    return free if gap > SMALLEST_GAP else -EMERGENCY_BRAKING


@njit(cache=True, error_model="numpy")
def acceleration_partials(
    speed: float,
    approach_rate: float,
    gap: float,
    a: float,
    weight: float,
    T: float,
    d0: float,
    d1: float,
    inverse: float,
) -> tuple[float, float, float, float, float, float, float]:
    r"""Return the partial derivatives of :func:`acceleration_of`.

    With the interaction :math:`s = d^*/d`, :math:`\partial\dot v/\partial d^* = -2as/d` and
    :math:`\partial\dot v/\partial d = 2as^2/d`.

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m).
    a, weight, T, d0, d1, inverse : float
        As in :func:`acceleration_of`.

    Returns
    -------
    by_speed : float
        Total derivative by the own speed, which is part of the approach rate, too (1/s).
    by_gap : float
        Derivative by the gap (1/s²).
    by_log_a, by_log_b : float
        Derivatives by the logarithms of ``a`` and ``b`` (m/s²).
    by_T, by_d0, by_d1 : float
        Derivatives by ``T`` (m/s³), ``d0`` and ``d1`` (1/s²).

    Notes
    -----
    At the kinks (the maximum in :func:`desired_gap`, the bound ``-EMERGENCY_BRAKING``, the smallest
    gap) the derivatives are taken from the side on which the equation is used: zero where the braking
    is bounded, no dynamic term where it is not positive. At standstill :math:`\sqrt{v/v_0}` has no
    finite derivative, and zero is returned for that term.
    """
    ratio = speed * inverse
    cube, root = ratio * ratio * ratio, sqrt(max(ratio, 0.0))
    per_gap = 1.0 / max(gap, SMALLEST_GAP)
    interaction = desired_gap_of(speed, approach_rate, weight, T, d0, d1, inverse) * per_gap
    free = 1.0 - cube * ratio - interaction * interaction
    # Factors of 0 or 1 in place of branches let the compiler vectorize over frames.
    used = (1.0 if gap > SMALLEST_GAP else 0.0) * (1.0 if a * free > -EMERGENCY_BRAKING else 0.0)
    dynamic = 1.0 if speed * (T + approach_rate * weight) > 0.0 else 0.0
    by_wanted = -2.0 * a * interaction * per_gap * used
    by_log_b = -0.5 * dynamic * by_wanted * speed * approach_rate * weight
    wanted_by_speed = dynamic * (T + (approach_rate + speed) * weight) + 0.5 * d1 * root / max(speed, SLOWEST)
    return (
        by_wanted * wanted_by_speed - used * 4.0 * a * cube * inverse,
        -by_wanted * interaction,
        used * a * free + by_log_b,
        by_log_b,
        by_wanted * dynamic * speed,
        by_wanted,
        by_wanted * root,
    )


def equilibrium_gap(speed: npt.ArrayLike, parameters: IDMParameters, desired_speed: float) -> npt.NDArray[np.float64]:
    r"""Return the gap at which a follower keeps its speed.

    .. math:: d_e = \frac{d_0 + d_1\sqrt{v/v_0} + Tv}{\sqrt{1 - (v/v_0)^4}}

    Parameters
    ----------
    speed : array_like
        Speed :math:`v` (m/s), below ``desired_speed``.
    parameters : IDMParameters
        The driver.
    desired_speed : float
        Desired speed :math:`v_0` (m/s).

    Returns
    -------
    float64 array, shape of ``speed``
        Equilibrium gap :math:`d_e` (m).

    Notes
    -----
    Source: Treiber, Hennecke and Helbing (2000), eq. 5.
    """
    v = np.asarray(speed, dtype=np.float64)
    wanted = parameters.d0 + parameters.d1 * np.sqrt(v / desired_speed) + parameters.T * v
    return np.asarray(wanted / np.sqrt(1.0 - (v / desired_speed) ** EXPONENT))
