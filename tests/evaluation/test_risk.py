"""The ellipsoidal Gaussian risk against what it stands for."""

from __future__ import annotations

from math import pi

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from idm_sumo.evaluation.risk import covariance, risk, risk_derivatives

CAR = (4.7, 1.9)
TRUCK = (12.0, 2.5)
pairs = st.tuples(*(st.floats(low, high) for low, high in ((-20, 20), (-6, 6), (-pi, pi), (-pi, pi))))


def _matrix(heading: float, size: tuple[float, float]) -> np.ndarray:
    xx, xy, yy = covariance(heading, *size)
    return np.array([[xx, xy], [xy, yy]])


@pytest.mark.parametrize(("dx", "dy", "heading", "other"), [(0, 0, 0, 0), (6, 1, 0.3, -0.2), (-9, 3.6, 0.0, 1.2)])
def test_is_the_integral_of_the_product_of_both_densities(dx: float, dy: float, heading: float, other: float) -> None:
    one = stats.multivariate_normal([dx, dy], _matrix(heading, CAR))
    two = stats.multivariate_normal([0, 0], _matrix(other, TRUCK))
    grid = np.linspace(-60.0, 60.0, 601)
    points = np.stack(np.meshgrid(grid, grid), axis=2)
    value = np.trapezoid(np.trapezoid(one.pdf(points) * two.pdf(points), grid, axis=1), grid)
    assert risk(dx, dy, heading, *CAR, other, *TRUCK) == pytest.approx(value, rel=1e-8)


@given(pairs)
def test_is_the_density_of_the_difference_at_zero(pair: tuple[float, float, float, float]) -> None:
    dx, dy, heading, other = pair
    density = stats.multivariate_normal([0, 0], _matrix(heading, CAR) + _matrix(other, TRUCK)).pdf((dx, dy))
    assert risk(dx, dy, heading, *CAR, other, *TRUCK) == pytest.approx(density, rel=1e-9)


def risk_by_completed_square(
    mu: npt.NDArray[np.float64], sigma: npt.NDArray[np.float64],
    theta: npt.NDArray[np.float64], gamma: npt.NDArray[np.float64],
) -> float:  # fmt: skip
    """Return the risk (1/m²) as the paper's appendix prints it, by completing the square.

    It loses digits far from the origin of coordinates, which the shipped formula does not.
    """
    sigma_inverse, gamma_inverse = np.linalg.inv(sigma), np.linalg.inv(gamma)
    omega = np.linalg.inv(sigma_inverse + gamma_inverse)
    linear = sigma_inverse @ mu + gamma_inverse @ theta
    exponent = linear @ omega @ linear - mu @ sigma_inverse @ mu - theta @ gamma_inverse @ theta
    scale = np.sqrt(np.linalg.det(omega) / (np.linalg.det(sigma) * np.linalg.det(gamma))) / (2.0 * np.pi)
    return float(scale * np.exp(0.5 * exponent))


@given(pairs)
def test_is_what_the_appendix_prints(pair: tuple[float, float, float, float]) -> None:
    dx, dy, heading, other = pair
    printed = risk_by_completed_square(np.array([dx, dy]), _matrix(heading, CAR), np.zeros(2), _matrix(other, TRUCK))
    assert risk(dx, dy, heading, *CAR, other, *TRUCK) == pytest.approx(printed, rel=1e-7)


@given(pairs)
def test_neither_knows_who_is_who(pair: tuple[float, float, float, float]) -> None:
    dx, dy, heading, other = pair
    assert risk(dx, dy, heading, *CAR, other, *TRUCK) == pytest.approx(
        risk(-dx, -dy, other, *TRUCK, heading, *CAR), rel=1e-9
    )


def test_longer_along_the_heading_than_across() -> None:
    assert risk(6, 0, 0, *CAR, 0, *CAR) > risk(0, 6, 0, *CAR, 0, *CAR)
    assert risk(6, 0, pi / 2, *CAR, pi / 2, *CAR) == pytest.approx(risk(0, 6, 0, *CAR, 0, *CAR))


@given(pairs)
def test_derivatives_are_those_of_the_value(pair: tuple[float, float, float, float]) -> None:
    def value(z: np.ndarray) -> float:
        return float(risk(z[0], z[1], z[2], *CAR, pair[3], *TRUCK))

    def gradient(z: np.ndarray) -> np.ndarray:
        return np.array(risk_derivatives(z[0], z[1], z[2], *CAR, pair[3], *TRUCK)[1:4])

    z, step = np.array(pair[:3]), 1e-5
    found = risk_derivatives(*z, *CAR, pair[3], *TRUCK)
    shifts = np.eye(3) * step
    assert found[0] == value(z)
    slope = [(value(z + s) - value(z - s)) / (2 * step) for s in shifts]
    assert found[1:4] == pytest.approx(slope, rel=1e-5, abs=1e-10)
    bend = np.array([(gradient(z + s) - gradient(z - s)) / (2 * step) for s in shifts])
    assert found[4:] == pytest.approx(bend[np.triu_indices(3)], rel=1e-5, abs=1e-10)
