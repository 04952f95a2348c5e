"""Gradient and Hessian along a trajectory against finite differences of plain rollouts."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from idm_sumo.irl import features
from idm_sumo.irl.demonstrations import Demonstrations, demonstrations_of, rollout
from idm_sumo.irl.episodes import Episodes, Surroundings, episodes_of
from idm_sumo.irl.trajectory import derivatives, step_features
from tests.helpers.irl_traffic import busy

Floats = npt.NDArray[np.float64]
STEPS = 12


@pytest.fixture(scope="module")
def swerving() -> tuple[Floats, Episodes, Surroundings]:
    """Controls that slow down, speed up and swerve, so that no derivative vanishes."""
    episodes, around = episodes_of([busy(3)])
    rng = np.random.default_rng(2)
    control = rng.normal(scale=(1.0, 0.02), size=(3, STEPS, 2))
    return control, episodes, around


def _driven(control: Floats, episodes: Episodes) -> Demonstrations:
    return Demonstrations(rollout(episodes, control), control, np.zeros(len(control)))


def test_gradient_is_that_of_the_sums(swerving: tuple[Floats, Episodes, Surroundings]) -> None:
    control, episodes, around = swerving
    gradient, _ = derivatives(_driven(control, episodes), episodes, around)
    for t in range(STEPS):
        for u, size in enumerate((1e-4, 1e-6)):
            shift = np.zeros_like(control)
            shift[:, t, u] = size
            up, down = (
                step_features(_driven(control + s, episodes), episodes, around).sum(axis=1) for s in (shift, -shift)
            )
            scale = np.abs(gradient).max(axis=2)
            error = np.abs((up - down) / (2 * size) - gradient[:, :, 2 * t + u]) / np.maximum(scale, 1e-9)
            assert error.max() < 1e-6


def test_hessian_is_that_of_the_gradient(swerving: tuple[Floats, Episodes, Surroundings]) -> None:
    control, episodes, around = swerving
    _, hessian = derivatives(_driven(control, episodes), episodes, around)
    assert hessian == pytest.approx(hessian.swapaxes(2, 3))
    scale = np.abs(hessian).max(axis=(2, 3))
    assert (scale > 0).all()
    for t in range(STEPS):
        for u, size in enumerate((1e-4, 1e-6)):
            shift = np.zeros_like(control)
            shift[:, t, u] = size
            up, down = (derivatives(_driven(control + s, episodes), episodes, around)[0] for s in (shift, -shift))
            error = np.abs((up - down) / (2 * size) - hessian[:, :, :, 2 * t + u]).max(axis=2) / scale
            assert error.max() < 1e-5


def test_demonstrations_drive_the_recorded_path() -> None:
    chosen = busy(4)
    found = demonstrations_of(chosen)
    episodes, _ = episodes_of([chosen])
    assert found.error.max() < 0.01  # straight, at constant speed: the bicycle can do exactly that
    assert found.state == pytest.approx(rollout(episodes, found.control))
    assert found.control == pytest.approx(0.0, abs=1e-2)
    assert found.moving.all()
    assert found.first(5).control.shape == (4, 5, 2)


def test_a_swerve_is_tracked_by_steering() -> None:
    from tests.helpers.builders import Car, scenes

    time = 0.1 * np.arange(40)
    y = -9.0 + 0.5 * np.sin(time)
    heading = np.arctan2(0.5 * np.cos(time), 12.0)
    found = demonstrations_of(scenes(Car(1, 12.0 * time, y=y, speed=12.0, heading=heading)))
    assert found.error.max() < 0.05
    assert np.abs(found.control[:, :, 1]).max() > 1e-3


def test_features_by_name() -> None:
    assert features.weights_from({"speed": 2.0})[features.SPEED] == 2.0
    with pytest.raises(ValueError, match="no feature"):
        features.weights_from({"velocity": 1.0})
