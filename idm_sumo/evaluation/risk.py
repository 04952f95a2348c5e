r"""Gaussian collision risk of two vehicles, and its derivatives.

Each vehicle is a two-dimensional Gaussian about its middle, longer along its heading than
across: :math:`\Sigma = R(\psi)\,\mathrm{diag}(\sigma_L^2, \sigma_W^2)\,R(\psi)^\top`. The
risk is the integral of the product of both densities over the plane (the paper's appendix),

.. math:: \text{risk} = \iint \mathcal N(\eta; \mu, \Sigma)\,\mathcal N(\eta; \theta, \Gamma)\,d\eta
    = \mathcal N(\mu - \theta;\, 0,\, \Sigma + \Gamma),

the density of the difference of the two positions at zero, in 1/m². The appendix derives the same
number by :math:`\Omega = (\Sigma^{-1} + \Gamma^{-1})^{-1}`; the tests compare both, and numerical
integration.

The paper prints :math:`L` and :math:`W` on the diagonal of :math:`\Sigma` and gives no numbers. Here
:math:`\sigma_L` is ``LENGTH_SCALE`` times the vehicle's length and :math:`\sigma_W` ``WIDTH_SCALE``
times its width.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt

from numba import njit

LENGTH_SCALE = 1.0  # standard deviation along the vehicle, in lengths
WIDTH_SCALE = 0.5  # standard deviation across the vehicle, in widths


@njit(cache=True)
def covariance(heading: float, length: float, width: float) -> tuple[float, float, float]:
    r"""Return the covariance of a vehicle's Gaussian.

    Parameters
    ----------
    heading : float
        Heading (rad).
    length, width : float
        Size of the vehicle (m).

    Returns
    -------
    xx, xy, yy : float
        Elements of :math:`\Sigma` (m²).
    """
    mean, half = _mean_and_half(length, width)
    return mean + half * cos(2.0 * heading), half * sin(2.0 * heading), mean - half * cos(2.0 * heading)


@njit(cache=True)
def _mean_and_half(length: float, width: float) -> tuple[float, float]:
    """Return half sum and half difference of the variances (m²)."""
    along, across = (LENGTH_SCALE * length) ** 2, (WIDTH_SCALE * width) ** 2
    return 0.5 * (along + across), 0.5 * (along - across)


@njit(cache=True)
def gaussian_overlap(dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
    r"""Return the risk of two vehicles by their total covariance.

    Parameters
    ----------
    dx, dy : float
        Distance between the middles (m).
    xx, xy, yy : float
        Elements of :math:`\Sigma + \Gamma` (m²).

    Returns
    -------
    float
        Risk (1/m²).
    """
    determinant = xx * yy - xy * xy
    square = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / determinant
    return exp(-0.5 * square) / (2.0 * pi * sqrt(determinant))


@njit(cache=True)
def risk(  # type: ignore[no-untyped-def]
    dx, dy, heading, length, width, other_heading, other_length, other_width
):  # fmt: skip
    """Return the risk of two vehicles.

    Parameters
    ----------
    dx, dy : float
        Distance from the other vehicle's middle (m).
    heading, length, width : float
        Heading (rad) and size (m).
    other_heading, other_length, other_width : float
        Those of the other vehicle.

    Returns
    -------
    float
        Risk (1/m²).
    """
    xx, xy, yy = covariance(heading, length, width)
    oxx, oxy, oyy = covariance(other_heading, other_length, other_width)
    return gaussian_overlap(dx, dy, xx + oxx, xy + oxy, yy + oyy)


@njit(cache=True)
def risk_derivatives(  # type: ignore[no-untyped-def]
    dx, dy, heading, length, width, other_heading, other_length, other_width
):  # fmt: skip
    r"""Return the risk with its gradient and Hessian.

    With :math:`S = \Sigma + \Gamma`, :math:`d = \mu - \theta`, :math:`w = S^{-1}d` and primes for
    derivatives by the own heading :math:`\psi`, the logarithm :math:`\ell` of the risk has

    .. math::
        \ell_d = -w,\quad \ell_{dd} = -S^{-1},\quad \ell_{d\psi} = S^{-1}S'w,\quad
        \ell_\psi = \tfrac12 w^\top S'w - \tfrac12\operatorname{tr}(S^{-1}S'),

    .. math::
        \ell_{\psi\psi} = -w^\top S'S^{-1}S'w + \tfrac12 w^\top S''w
        - \tfrac12\operatorname{tr}(S^{-1}S'') + \tfrac12\operatorname{tr}(S^{-1}S'S^{-1}S').

    Parameters
    ----------
    dx, dy, heading, length, width, other_heading, other_length, other_width : float
        As in :func:`risk`.

    Returns
    -------
    value : float
        Risk (1/m²).
    x, y, psi : float
        First derivatives by own position and heading.
    xx, xy, xpsi, yy, ypsi, psipsi : float
        Second derivatives.
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
