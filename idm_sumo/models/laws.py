r"""Car-following laws beside the IDM, as compiled scalar kernels by the same five parameters: one equation each.

They are what a diagnosis holds against the IDM before it looks for what drivers do beyond it: of drivers who follow another law
the IDM leaves something everywhere, which would look like one effect or another. A law is a number, :data:`NAMES` its spelling.

``a``, ``b``, ``T``, ``d0`` and the desired speed mean what they mean for the IDM where a law has them; where it has a sensitivity
in place of one, that is written below by ``a`` or ``b``, so that one population prior serves all laws.
"""

from __future__ import annotations

from math import sqrt, tanh

from numba import njit

from idm_sumo.models import idm

IDM, FULL_VELOCITY_DIFFERENCE, SMOOTH_VELOCITY_DIFFERENCE, KRAUSS, OPTIMAL_VELOCITY, GIPPS, IMPROVED_IDM = range(7)
NAMES = (
    "idm", "full_velocity_difference", "smooth_velocity_difference", "krauss", "optimal_velocity", "gipps", "improved_idm",
)  # fmt: skip
IN_WORDS = (
    "the IDM", "full velocity difference", "full velocity difference with a smooth optimal velocity", "Krauss's safe speed",
    "optimal velocity", "Gipps's safe speed", "the improved IDM",
)  # fmt: skip
WITHIN = 4.0  # m/s: by how much the optimal velocity must differ for all of `a`
OF_RATE = 3.0  # m/s: of approach rate, that is answered by `b`
AT_ONCE = 1.0  # m/s: of the optimal velocity law, by how much it must differ for an acceleration of `b`
REACTION = 1.0  # s, in which Krauss's safe speed is reached, if nothing else is said
OF_HEADWAY = 2.0 / 3.0  # of the time headway, that Gipps's reaction time is: the rest is his margin
LEAST_FREE = 1e-3  # m/s²: a free acceleration by which one can divide


def in_the_type(law: float) -> tuple[int, ...]:
    """Return a tuple that is as long as the law's number: compiled functions that take it are compiled for each law apart."""
    return (0,) * int(law)


@njit(cache=True, error_model="numpy", forceinline=True)
def velocity_difference(speed, approach_rate, wanted, a, b):  # type: ignore[no-untyped-def]
    r"""Return :math:`\dot v = \min(a, \kappa(V - v) - \lambda\,\Delta v)` (m/s²), :math:`\kappa = a/4`, :math:`\lambda = b/3`.

    Jiang, Wu and Zhu (2001), eq. 3; ``wanted`` is the optimal velocity :math:`V` (m/s) of the gap.
    """
    return min(a, (a / WITHIN) * (wanted - speed) - (b / OF_RATE) * approach_rate)


@njit(cache=True, error_model="numpy", forceinline=True)
def triangular(gap, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return :math:`V = \max(0, \min(v_0, (d - d_0)/T))` (m/s): Treiber and Kesting (2013), eq. 10.19."""
    return min(desired_speed, max(0.0, gap - d0) / T)


@njit(cache=True, error_model="numpy", forceinline=True)
def smooth(gap, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return :math:`V = v_0\tanh((d - d_0)/(v_0 T))` (m/s): the hyperbolic tangent of Bando et al. (1995), from the jam distance on."""
    return desired_speed * tanh(max(0.0, gap - d0) / (desired_speed * T))


@njit(cache=True, error_model="numpy", forceinline=True)
def krauss(speed, approach_rate, gap, a, b, T, d0, desired_speed, reaction):  # type: ignore[no-untyped-def]
    r"""Return the acceleration (m/s²) towards Krauss's safe speed :math:`v_l + (d - d_0 - v_l T)/((v + v_l)/2b + T)`.

    Krauss (1998), eq. 3.6 in the form of SUMO's default model, without its imperfection: reached within ``reaction`` (s), no faster
    than with ``a`` (1 - v/v0).
    """
    ahead = max(0.0, speed - approach_rate)
    safe = ahead + (gap - d0 - ahead * T) / ((speed + ahead) / (2.0 * b) + T)
    return min(a * (1.0 - speed / desired_speed), (safe - speed) / reaction)


@njit(cache=True, error_model="numpy", forceinline=True)
def gipps(speed, approach_rate, gap, a, b, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return the acceleration (m/s²) towards Gipps's safe speed, reached within his reaction time :math:`\tau = T/1.5`.

    :math:`-b\tau + \sqrt{b^2\tau^2 + b(2(d - d_0) - v\tau) + v_l^2}`, no faster than with
    :math:`2.5\,a(1 - v/v_0)\sqrt{0.025 + v/v_0}`: Gipps (1981), the leader thought to brake as the driver does.
    """
    tau = OF_HEADWAY * T
    ahead, share = max(0.0, speed - approach_rate), max(0.0, speed / desired_speed)
    under = (b * tau) * (b * tau) + b * (2.0 * (gap - d0) - speed * tau) + ahead * ahead
    safe = sqrt(max(0.0, under)) - b * tau
    return min(2.5 * a * (1.0 - share) * sqrt(0.025 + share), (safe - speed) / tau)


@njit(cache=True, error_model="numpy", forceinline=True)
def improved_idm(speed, approach_rate, gap, a, b, weight, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    r"""Return the acceleration (m/s²) of the improved IDM: the desired gap is kept exactly at every speed below the desired one.

    With :math:`z = d^*/d` and the free acceleration :math:`f`: below the desired speed :math:`a(1-z^2)` where :math:`z \ge 1`, else
    :math:`f(1-z^{2a/f})`; above it :math:`f + \min(0, a(1-z^2))`. Treiber and Kesting (2013), section 11.3.7.
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
    r"""Return :math:`\dot v = \min(a, \kappa(V - v))` (m/s²), :math:`\kappa = b` per m/s: blind to the approach rate.

    Bando et al. (1995), eq. 4. With a high :math:`\kappa` it follows Newell's (2002) line between gap and speed.
    """
    return min(a, (b / AT_ONCE) * (wanted - speed))


@njit(cache=True, error_model="numpy", forceinline=True)
def acceleration(law, speed, approach_rate, gap, a, weight, T, d0, desired_speed, reaction):  # type: ignore[no-untyped-def]
    """Return the acceleration (m/s²) by a law other than the IDM.

    Parameters
    ----------
    law : float
        Number of the law.
    speed, approach_rate, gap : float
        m/s, m/s, m (not below the IDM's smallest gap).
    a, weight, T, d0, desired_speed : float
        ``weight`` of :func:`idm_sumo.models.idm.closing_weight`, in which ``b`` is.
    reaction : float
        s, in which Krauss's safe speed is reached.
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
