"""Car-following laws beside the IDM, as compiled scalar kernels.

A diagnosis compares drivers with these laws before it looks for effects beyond the IDM: drivers
of another law leave residuals everywhere that would look like effects. A law is a number, and
:data:`NAMES` holds its spelling.

``a``, ``b``, ``T``, ``d0`` and the desired speed mean what they mean in the IDM where a law has
them. Where a law has a sensitivity instead, it is expressed by ``a`` or ``b``, so that one prior
of the population serves all laws.
"""

from __future__ import annotations

from math import sqrt, tanh

from numba import njit

from idm_sumo.models import idm

IDM, FULL_VELOCITY_DIFFERENCE, SMOOTH_VELOCITY_DIFFERENCE, KRAUSS, OPTIMAL_VELOCITY, GIPPS, IMPROVED_IDM = range(7)
NAMES = (
    "idm",
    "full_velocity_difference",
    "smooth_velocity_difference",
    "krauss",
    "optimal_velocity",
    "gipps",
    "improved_idm",
)
TITLES = (
    "the IDM",
    "full velocity difference",
    "full velocity difference with a smooth optimal velocity",
    "Krauss's safe speed",
    "optimal velocity",
    "Gipps's safe speed",
    "the improved IDM",
)
WITHIN = 4.0  # m/s: difference to the optimal velocity that is answered by an acceleration of `a`
OF_RATE = 3.0  # m/s: approach rate that is answered by a deceleration of `b`
AT_ONCE = 1.0  # m/s: the same difference for the optimal velocity law, answered by `b`
REACTION = 1.0  # s, default time within which Krauss's safe speed is reached
OF_HEADWAY = 2.0 / 3.0  # Gipps's reaction time as a share of the time headway; the rest is his safety margin
LEAST_FREE = 1e-3  # m/s², least free acceleration in a divisor


def as_type(law: float) -> tuple[int, ...]:
    """Return a tuple as long as the law's number.

    Compiled functions that take the tuple are compiled for each law separately.

    Parameters
    ----------
    law : float
        Number of the law.

    Returns
    -------
    tuple of int
        Zeros; only the length has a meaning.
    """
    return (0,) * int(law)


@njit(cache=True, error_model="numpy", forceinline=True)
def velocity_difference(speed, approach_rate, wanted, a, b):  # type: ignore[no-untyped-def]
    r"""Return the acceleration of the full velocity difference model.

    .. math:: \dot v = \min\big(a,\, \kappa(V - v) - \lambda\,\Delta v\big),\quad \kappa = a/4,\quad \lambda = b/3

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    wanted : float
        Optimal velocity :math:`V` of the gap (m/s).
    a, b : float
        Maximum acceleration and comfortable deceleration (m/s²).

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    Source: Jiang, Wu and Zhu (2001), eq. 3.
    """
    return min(a, (a / WITHIN) * (wanted - speed) - (b / OF_RATE) * approach_rate)


@njit(cache=True, error_model="numpy", forceinline=True)
def triangular(gap, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return the triangular optimal velocity of a gap.

    .. math:: V = \max\big(0, \min(v_0, (d - d_0)/T)\big)

    Parameters
    ----------
    gap : float
        Gap (m).
    T, d0, desired_speed : float
        Time headway (s), jam distance (m) and desired speed (m/s).

    Returns
    -------
    float
        Optimal velocity (m/s).

    Notes
    -----
    Source: Treiber and Kesting (2013), eq. 10.19.
    """
    return min(desired_speed, max(0.0, gap - d0) / T)


@njit(cache=True, error_model="numpy", forceinline=True)
def smooth(gap, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return the smooth optimal velocity of a gap.

    .. math:: V = v_0\tanh\frac{\max(0, d - d_0)}{v_0 T}

    Parameters
    ----------
    gap : float
        Gap (m).
    T, d0, desired_speed : float
        Time headway (s), jam distance (m) and desired speed (m/s).

    Returns
    -------
    float
        Optimal velocity (m/s).

    Notes
    -----
    The hyperbolic tangent of Bando et al. (1995), shifted to start at the jam distance.
    """
    return desired_speed * tanh(max(0.0, gap - d0) / (desired_speed * T))


@njit(cache=True, error_model="numpy", forceinline=True)
def krauss(speed, approach_rate, gap, a, b, T, d0, desired_speed, reaction):  # type: ignore[no-untyped-def]
    r"""Return the acceleration towards Krauss's safe speed.

    .. math:: v_{safe} = v_l + \frac{d - d_0 - v_l T}{(v + v_l)/2b + T},\quad
        \dot v = \min\Big(a(1 - v/v_0),\, \frac{v_{safe} - v}{\tau}\Big)

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m).
    a, b, T, d0, desired_speed : float
        Parameters of the driver.
    reaction : float
        Time :math:`\tau` within which the safe speed is reached (s).

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    Source: Krauss (1998), eq. 3.6, in the form of SUMO's default model without its imperfection.
    """
    ahead = max(0.0, speed - approach_rate)
    safe = ahead + (gap - d0 - ahead * T) / ((speed + ahead) / (2.0 * b) + T)
    return min(a * (1.0 - speed / desired_speed), (safe - speed) / reaction)


@njit(cache=True, error_model="numpy", forceinline=True)
def gipps(speed, approach_rate, gap, a, b, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return the acceleration towards Gipps's safe speed.

    .. math:: v_{safe} = -b\tau + \sqrt{b^2\tau^2 + b\,(2(d - d_0) - v\tau) + v_l^2},\quad \tau = T/1.5

    It is reached within the reaction time :math:`\tau`, with an acceleration of at most
    :math:`2.5\,a(1 - v/v_0)\sqrt{0.025 + v/v_0}`.

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m).
    a, b, T, d0, desired_speed : float
        Parameters of the driver.

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    Source: Gipps (1981). The driver expects the leader to brake as hard as itself.
    """
    tau = OF_HEADWAY * T
    ahead, share = max(0.0, speed - approach_rate), max(0.0, speed / desired_speed)
    under = (b * tau) * (b * tau) + b * (2.0 * (gap - d0) - speed * tau) + ahead * ahead
    safe = sqrt(max(0.0, under)) - b * tau
    return min(2.5 * a * (1.0 - share) * sqrt(0.025 + share), (safe - speed) / tau)


@njit(cache=True, error_model="numpy", forceinline=True)
def improved_idm(speed, approach_rate, gap, a, b, weight, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return the acceleration of the improved IDM.

    It keeps the desired gap exactly at every speed below the desired one. With :math:`z = d^*/d` and
    the free acceleration :math:`f` it is, below the desired speed, :math:`a(1-z^2)` where
    :math:`z \ge 1` and :math:`f(1-z^{2a/f})` elsewhere; above it :math:`f + \min(0, a(1-z^2))`.

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m).
    a, b : float
        Maximum acceleration and comfortable deceleration (m/s²).
    weight : float
        :func:`idm_sumo.models.idm.closing_weight` of ``a`` and ``b`` (s²/m).
    T, d0, desired_speed : float
        Time headway (s), jam distance (m) and desired speed (m/s).

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    Source: Treiber and Kesting (2013), section 11.3.7.
    """
    share = max(speed, 1e-9) / desired_speed
    z = idm.desired_gap_of(speed, approach_rate, weight, T, d0, 0.0, 1.0 / desired_speed) / gap
    too_near = min(0.0, a * (1.0 - z * z))
    if share > 1.0:
        return -b * (1.0 - share ** (-4.0 * a / b)) + too_near
    free = a * (1.0 - share**4)
    return too_near if z >= 1.0 else free * (1.0 - z ** (2.0 * a / max(free, LEAST_FREE)))


@njit(cache=True, error_model="numpy", forceinline=True)
def optimal_velocity(speed, wanted, a, b):  # type: ignore[no-untyped-def]
    r"""Return the acceleration of the optimal velocity model.

    .. math:: \dot v = \min\big(a,\, \kappa(V - v)\big),\quad \kappa = b \text{ per m/s}

    Parameters
    ----------
    speed : float
        Own speed (m/s).
    wanted : float
        Optimal velocity :math:`V` of the gap (m/s).
    a, b : float
        Maximum acceleration (m/s²); sensitivity as an acceleration per m/s (m/s²).

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    Source: Bando et al. (1995), eq. 4. The approach rate has no influence. With a high
    :math:`\kappa` the law follows Newell's (2002) line between gap and speed.
    """
    return min(a, (b / AT_ONCE) * (wanted - speed))


@njit(cache=True, error_model="numpy", forceinline=True)
def acceleration(law, speed, approach_rate, gap, a, weight, T, d0, desired_speed, reaction):  # type: ignore[no-untyped-def]
    """Return the acceleration by a law other than the IDM.

    It takes numbers instead of a record of parameters, so that a loop over drivers becomes vector instructions.

    Parameters
    ----------
    law : float
        Number of the law.
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m), not below the IDM's smallest gap.
    a : float
        Maximum acceleration (m/s²).
    weight : float
        :func:`idm_sumo.models.idm.closing_weight` (s²/m), from which ``b`` is recovered.
    T, d0, desired_speed : float
        Time headway (s), jam distance (m) and desired speed (m/s).
    reaction : float
        Time within which Krauss's safe speed is reached (s).

    Returns
    -------
    float
        Acceleration (m/s²).
    """
    b = 0.25 / (weight * weight * a)
    if law == FULL_VELOCITY_DIFFERENCE:
        return velocity_difference(speed, approach_rate, triangular(gap, T, d0, desired_speed), a, b)
    if law == SMOOTH_VELOCITY_DIFFERENCE:
        return velocity_difference(speed, approach_rate, smooth(gap, T, d0, desired_speed), a, b)
    if law == KRAUSS:
        return krauss(speed, approach_rate, gap, a, b, T, d0, desired_speed, reaction)
    if law == GIPPS:
        return gipps(speed, approach_rate, gap, a, b, T, d0, desired_speed)
    if law == IMPROVED_IDM:
        return improved_idm(speed, approach_rate, gap, a, b, weight, T, d0, desired_speed)
    return optimal_velocity(speed, triangular(gap, T, d0, desired_speed), a, b)
