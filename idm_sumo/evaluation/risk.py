r"""Ellipsoidal Gaussian risk of a collision between two vehicles, and its derivatives.

Each vehicle is a two-dimensional Gaussian about its middle, longer along its heading than
across: :math:`\Sigma = R(\psi)\,\mathrm{diag}(\sigma_L^2, \sigma_W^2)\,R(\psi)^\top`. The
risk is the integral of the product of both densities over the plane (the paper's appendix),

.. math:: \text{risk} = \iint \mathcal N(\eta; \mu, \Sigma)\,\mathcal N(\eta; \theta, \Gamma)\,d\eta
    = \mathcal N(\mu - \theta;\, 0,\, \Sigma + \Gamma),

the density of the difference of the two positions at zero, in 1/m². The appendix arrives at
the same number by :math:`\Omega = (\Sigma^{-1} + \Gamma^{-1})^{-1}`; the tests compare both,
and numerical integration.

The paper does not say how long and wide its Gaussians are: it prints :math:`L` and :math:`W` on
the diagonal of :math:`\Sigma` and gives no numbers. Here :math:`\sigma_L` is ``LENGTH_SCALE``
times the vehicle's length and :math:`\sigma_W` ``WIDTH_SCALE`` times its width.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt

import numpy as np
import numpy.typing as npt
from numba import njit

LENGTH_SCALE = 1.0  # standard deviation along the vehicle, in lengths
WIDTH_SCALE = 0.5  # standard deviation across the vehicle, in widths


@njit(cache=True)
def covariance(heading: float, length: float, width: float) -> tuple[float, float, float]:
    """Return ``xx, xy, yy`` (m²) of the Gaussian of a vehicle ``length`` by ``width`` m at ``heading`` (rad)."""
    mean, half = _mean_and_half(length, width)
    return mean + half * cos(2.0 * heading), half * sin(2.0 * heading), mean - half * cos(2.0 * heading)


@njit(cache=True)
def _mean_and_half(length: float, width: float) -> tuple[float, float]:
    """Return half the sum and half the difference (m²) of the variances along and across."""
    along, across = (LENGTH_SCALE * length) ** 2, (WIDTH_SCALE * width) ** 2
    return 0.5 * (along + across), 0.5 * (along - across)


@njit(cache=True)
def gaussian_overlap(dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
    """Return the risk (1/m²) of two vehicles ``dx, dy`` (m) apart whose covariances add up to ``xx, xy, yy`` (m²)."""
    determinant = xx * yy - xy * xy
    square = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / determinant
    return exp(-0.5 * square) / (2.0 * pi * sqrt(determinant))


@njit(cache=True)
def risk(  # type: ignore[no-untyped-def]
    dx, dy, heading, length, width, other_heading, other_length, other_width
):  # fmt: skip
    """Return the risk (1/m²) of a vehicle whose middle is ``dx, dy`` (m) away from another's; angles in rad."""
    xx, xy, yy = covariance(heading, length, width)
    oxx, oxy, oyy = covariance(other_heading, other_length, other_width)
    return gaussian_overlap(dx, dy, xx + oxx, xy + oxy, yy + oyy)


@njit(cache=True)
def risk_derivatives(  # type: ignore[no-untyped-def]
    dx, dy, heading, length, width, other_heading, other_length, other_width
):  # fmt: skip
    r"""Return :func:`risk`, its gradient and its Hessian by own ``x, y, heading``.

    With :math:`S = \Sigma + \Gamma`, :math:`d = \mu - \theta`, :math:`w = S^{-1}d` and primes for
    derivatives by the own heading :math:`\psi`, the logarithm :math:`\ell` of the risk has

    .. math::
        \ell_d = -w,\quad \ell_{dd} = -S^{-1},\quad \ell_{d\psi} = S^{-1}S'w,\quad
        \ell_\psi = \tfrac12 w^\top S'w - \tfrac12\operatorname{tr}(S^{-1}S'),

    .. math::
        \ell_{\psi\psi} = -w^\top S'S^{-1}S'w + \tfrac12 w^\top S''w
        - \tfrac12\operatorname{tr}(S^{-1}S'') + \tfrac12\operatorname{tr}(S^{-1}S'S^{-1}S').

    Returns
    -------
    value : float
    x, y, psi : float
    xx, xy, xpsi, yy, ypsi, psipsi : float
    """
    sxx, sxy, syy = covariance(heading, length, width)
    oxx, oxy, oyy = covariance(other_heading, other_length, other_width)
    sxx, sxy, syy = sxx + oxx, sxy + oxy, syy + oyy
    value = gaussian_overlap(dx, dy, sxx, sxy, syy)
    determinant = sxx * syy - sxy * sxy
    ixx, ixy, iyy = syy / determinant, -sxy / determinant, sxx / determinant
    wx, wy = ixx * dx + ixy * dy, ixy * dx + iyy * dy
    _, half = _mean_and_half(length, width)
    c, s = 2.0 * half * cos(2.0 * heading), 2.0 * half * sin(2.0 * heading)
    # S' = [[-s, c], [c, s]], S'' = -2 [[c, s], [s, -c]]
    px, py = -s * wx + c * wy, c * wx + s * wy  # S'w
    qx, qy = ixx * px + ixy * py, ixy * px + iyy * py  # S^-1 S'w
    mxx, mxy, myx, myy = -s * ixx + c * ixy, c * ixx + s * ixy, -s * ixy + c * iyy, c * ixy + s * iyy  # S^-1 S'
    lpsi = 0.5 * (wx * px + wy * py) - 0.5 * (mxx + myy)
    bend = -2.0 * (c * wx * wx + 2.0 * s * wx * wy - c * wy * wy)  # w'S''w
    trace = -2.0 * (c * ixx + 2.0 * s * ixy - c * iyy)  # tr S^-1 S''
    lpsipsi = -(px * qx + py * qy) + 0.5 * bend - 0.5 * trace + 0.5 * (mxx * mxx + 2.0 * mxy * myx + myy * myy)
    return (
        value, -value * wx, -value * wy, value * lpsi,
        value * (wx * wx - ixx), value * (wx * wy - ixy), value * (qx - wx * lpsi),
        value * (wy * wy - iyy), value * (qy - wy * lpsi), value * (lpsipsi + lpsi * lpsi),
    )  # fmt: skip


def risk_by_completed_square(
    mean: npt.ArrayLike, covariance_: npt.ArrayLike, other_mean: npt.ArrayLike, other_covariance: npt.ArrayLike
) -> float:
    r"""Return the risk (1/m²) as the appendix prints it, by completing the square.

    .. math:: \frac{\sqrt{|\Omega|}}{2\pi\sqrt{|\Sigma||\Gamma|}}
        \exp\tfrac12\left(v^\top\Omega^{-1}v - \mu^\top\Sigma^{-1}\mu - \theta^\top\Gamma^{-1}\theta\right),\quad
        v = \Omega(\Sigma^{-1}\mu + \Gamma^{-1}\theta)

    Parameters
    ----------
    mean, other_mean : array_like, shape (2,)
        m.
    covariance_, other_covariance : array_like, shape (2, 2)
        m².

    Notes
    -----
    Loses digits far from the origin of coordinates; :func:`gaussian_overlap` does not.
    """
    mu, theta = np.asarray(mean, dtype=np.float64), np.asarray(other_mean, dtype=np.float64)
    sigma, gamma = np.asarray(covariance_, dtype=np.float64), np.asarray(other_covariance, dtype=np.float64)
    sigma_inverse, gamma_inverse = np.linalg.inv(sigma), np.linalg.inv(gamma)
    omega = np.linalg.inv(sigma_inverse + gamma_inverse)
    linear = sigma_inverse @ mu + gamma_inverse @ theta
    exponent = linear @ omega @ linear - mu @ sigma_inverse @ mu - theta @ gamma_inverse @ theta
    scale = np.sqrt(np.linalg.det(omega) / (np.linalg.det(sigma) * np.linalg.det(gamma))) / (2.0 * np.pi)
    return float(scale * np.exp(0.5 * exponent))
