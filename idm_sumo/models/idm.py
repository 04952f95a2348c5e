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
def closing_weight(a: float, b: float) -> float:
    r"""Return :math:`1/(2\sqrt{ab})` (s²/m): how much an approach rate weighs in the desired gap."""
    return 1.0 / (2.0 * sqrt(a * b))


@njit(cache=True, error_model="numpy")
def desired_gap(
    speed: float, approach_rate: float, a: float, b: float, T: float, d0: float, d1: float, desired_speed: float
) -> float:
    r"""Return the gap (m) a driver wants: :math:`d^* = d_0 + d_1\sqrt{v/v_0} + \max(0, Tv + v\,\Delta v/(2\sqrt{ab}))`.

    The paper prints it without the maximum. Then a leader that pulls away fast makes
    :math:`d^*` negative and its square brakes; Treiber and Kesting (2013, eq. 11.15) and
    SUMO take the maximum, and so do we. Where the sum is positive both are the same.
    """
    return desired_gap_of(speed, approach_rate, closing_weight(a, b), T, d0, d1, 1.0 / desired_speed)


@njit(cache=True, error_model="numpy")
def desired_gap_of(
    speed: float, approach_rate: float, weight: float, T: float, d0: float, d1: float, inverse: float
) -> float:
    """Return :func:`desired_gap` by :func:`closing_weight` and :math:`1/v_0`: what does not change from frame to frame."""
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
    """Return :func:`acceleration` by :func:`closing_weight` and :math:`1/v_0`; without branches, for many at once."""
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
    r"""Return the derivatives of :func:`acceleration_of`: by own speed, gap, log(a), log(b), T, d0 and d1.

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
    ratio = speed * inverse
    cube, root = ratio * ratio * ratio, sqrt(max(ratio, 0.0))
    per_gap = 1.0 / max(gap, SMALLEST_GAP)
    interaction = desired_gap_of(speed, approach_rate, weight, T, d0, d1, inverse) * per_gap
    free = 1.0 - cube * ratio - interaction * interaction
    # 0 or 1 in place of branches: so a compiler can take many frames at once.
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
    r"""Return the gap (m) at which a follower at ``speed`` (m/s, below ``desired_speed``) keeps its speed.

    :math:`d_e = (d_0 + d_1\sqrt{v/v_0} + Tv)/\sqrt{1 - (v/v_0)^4}`, Treiber et al. (2000), eq. 5.
    """
    v = np.asarray(speed, dtype=np.float64)
    wanted = parameters.d0 + parameters.d1 * np.sqrt(v / desired_speed) + parameters.T * v
    return np.asarray(wanted / np.sqrt(1.0 - (v / desired_speed) ** EXPONENT))
