r"""The Intelligent Driver Model, as compiled scalar kernels: one equation each.

Source: Treiber, Hennecke and Helbing (2000), eqs. 2-3, with the non-linear jam distance
``d1`` that the paper keeps; the exponent is 4 and the desired speed the speed limit.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

EXPONENT = 4.0
EMERGENCY_BRAKING = 9.0  # m/s^2, SUMO's default emergencyDecel: no car brakes harder
SLOWEST = 1e-9  # m/s, below it the derivative of the square root of the speed is taken for that of a standing car
SMALLEST_GAP = 0.01  # m, below it the bumpers touch and the interaction would divide by zero


class IDMParameters(NamedTuple):
    r"""What distinguishes one driver from another.

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


PARAMETER_UNITS = IDMParameters("m/s^2", "m/s^2", "s", "m", "m")  # type: ignore[arg-type]

# Bounds of every calibration. Wide enough for a motorcyclist and a truck; where a fit ends on
# one, the window did not determine that parameter (`at_bound` in the driver table).
LOWER = IDMParameters(a=0.1, b=0.1, T=0.1, d0=0.1, d1=0.0)
UPPER = IDMParameters(a=6.0, b=6.0, T=5.0, d0=10.0, d1=10.0)

# Treiber, Hennecke and Helbing (2000), table 1: the start of searches, never a result.
TEXTBOOK = IDMParameters(a=0.73, b=1.67, T=1.6, d0=2.0, d1=0.0)


@njit(cache=True, error_model="numpy")
def desired_gap(
    speed: float, approach_rate: float, a: float, b: float, T: float, d0: float, d1: float, desired_speed: float
) -> float:
    r"""Return the gap (m) a driver wants: :math:`d^* = d_0 + d_1\sqrt{v/v_0} + \max(0, Tv + v\,\Delta v/(2\sqrt{ab}))`.

    The paper prints it without the maximum. Then a leader that pulls away fast makes
    :math:`d^*` negative and its square brakes; Treiber and Kesting (2013, eq. 11.15) and
    SUMO take the maximum, and so do we. Where the sum is positive both are the same.
    """
    dynamic = T * speed + speed * approach_rate / (2.0 * sqrt(a * b))
    return d0 + d1 * sqrt(max(speed, 0.0) / desired_speed) + max(0.0, dynamic)


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
    r"""Return :math:`\dot v = a\,(1 - (v/v_0)^4 - (d^*/d)^2)` (m/s²).

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Bumper to bumper (m); infinite without a leader, which leaves the free road.
    a, b, T, d0, d1 : float
        See :class:`IDMParameters`.
    desired_speed : float
        :math:`v_0` (m/s), the speed limit in the paper. Above it the free term is negative
        and the driver slows down, the more the faster.

    Notes
    -----
    Never below ``-EMERGENCY_BRAKING``; at a gap of ``SMALLEST_GAP`` or less exactly that.
    """
    if gap <= SMALLEST_GAP:
        return -EMERGENCY_BRAKING
    ratio = speed / desired_speed
    interaction = desired_gap(speed, approach_rate, a, b, T, d0, d1, desired_speed) / gap
    return max(a * (1.0 - ratio * ratio * ratio * ratio - interaction * interaction), -EMERGENCY_BRAKING)


@njit(cache=True, error_model="numpy")
def acceleration_partials(
    speed: float,
    approach_rate: float,
    gap: float,
    a: float,
    b: float,
    T: float,
    d0: float,
    d1: float,
    desired_speed: float,
) -> tuple[float, float, float, float, float, float, float]:
    r"""Return the derivatives of :func:`acceleration`: by own speed, gap, a, b, T, d0 and d1.

    With the interaction :math:`s = d^*/d`, :math:`\partial\dot v/\partial d^* = -2as/d` and
    :math:`\partial\dot v/\partial d = 2as^2/d`. The first value is the total derivative by
    the own speed, which is in the approach rate too.

    Notes
    -----
    At the kinks (the maximum in :func:`desired_gap`, the clip at ``-EMERGENCY_BRAKING``, the
    smallest gap) they are the derivatives from the side on which the equation is used: zero
    where the braking is clipped, no dynamic term where it is not positive. At a standing
    vehicle :math:`\sqrt{v/v_0}` has no finite derivative; zero is returned for that term.
    """
    ratio = speed / desired_speed
    cube, root = ratio * ratio * ratio, sqrt(max(ratio, 0.0))
    halving = 1.0 / (2.0 * sqrt(a * b))
    inverse = 1.0 / max(gap, SMALLEST_GAP)
    interaction = desired_gap(speed, approach_rate, a, b, T, d0, d1, desired_speed) * inverse
    free = 1.0 - cube * ratio - interaction * interaction
    # 0 or 1 in place of branches: so a compiler can take many frames at once.
    used = (1.0 if gap > SMALLEST_GAP else 0.0) * (1.0 if a * free > -EMERGENCY_BRAKING else 0.0)
    dynamic = 1.0 if speed * (T + approach_rate * halving) > 0.0 else 0.0
    by_wanted = -2.0 * a * interaction * inverse * used
    by_product = -0.5 * dynamic * by_wanted * speed * approach_rate * halving  # by log(a b)
    wanted_by_speed = dynamic * (T + (approach_rate + speed) * halving) + 0.5 * d1 * root / max(speed, SLOWEST)
    return (
        by_wanted * wanted_by_speed - used * 4.0 * a * cube / desired_speed,
        -by_wanted * interaction,
        used * free + by_product / a,
        by_product / b,
        by_wanted * dynamic * speed,
        by_wanted,
        by_wanted * root,
    )


def equilibrium_gap(speed: npt.ArrayLike, parameters: IDMParameters, desired_speed: float) -> npt.NDArray[np.float64]:
    r"""Return the gap (m) at which a follower at ``speed`` (m/s, below ``desired_speed``) keeps its speed.

    :math:`d_e = (d_0 + d_1\sqrt{v/v_0} + Tv)/\sqrt{1 - (v/v_0)^4}`, Treiber et al. (2000), eq. 5.
    """
    v = np.asarray(speed, dtype=np.float64)
    wanted = parameters.d0 + parameters.d1 * np.sqrt(v / desired_speed) + parameters.T * v
    return np.asarray(wanted / np.sqrt(1.0 - (v / desired_speed) ** EXPONENT))
