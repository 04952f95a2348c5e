"""Residuals in a closed loop: added after the observed second, to those who have one, within what a car can do."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from idm_sumo.models.idm import EMERGENCY_BRAKING, IDMParameters
from idm_sumo.models.residual import REGRESSORS
from idm_sumo.prediction.residual_drive import ResidualDrivers, ResidualModel, residual_of
from idm_sumo.simulation.surroundings import TrafficDetails
from idm_sumo.sumo.closed_loop.extended_loop import Present, leaders
from idm_sumo.sumo.closed_loop.residual_loop import Residuals

OBSERVED = 10
CENTER, SCALE = np.array([8.0, 2.5, 0.0, 2.0, 0.0]), np.array([3.0, 0.6, 1.0, 0.7, 0.6])


def residuals(own: float, weights: np.ndarray | None = None, row: tuple[int, ...] = (0, -1)) -> Residuals:
    """Return residuals of two vehicles of which the first has one that lasts."""
    shared = np.zeros(REGRESSORS) if weights is None else weights
    model = ResidualModel(IDMParameters(1.2, 1.6, 1.2, 2.0, 0.0), shared, CENTER, SCALE, 20.0, OBSERVED)
    keys = pd.DataFrame({"period": ["one"], "vehicle": [7]})
    drivers = ResidualDrivers(model, np.array([[own, 0.0, 0.0]]), np.zeros(1), np.array(["ok"]), keys)
    return Residuals(drivers, np.array(row))


def present(gap: float, speed: float = 10.0, leader_speed: float = 8.0) -> Present:
    """Return a vehicle behind another one in lane 1."""
    x, n = np.array([100.0, 104.5 + gap]), 2
    others = TrafficDetails(np.zeros(n), np.zeros(n), np.full(n, 2.0), np.array([1, 2]))
    speeds = np.array([speed, leader_speed])
    offsets = np.array([0, 2, 2, 2, 2, 2])
    length, lane = np.full(n, 4.5), np.array([1, 1])
    ahead = leaders(lane, offsets, x, length, others.who)
    return Present(np.array([0, 1]), x, speeds, length, lane, offsets, others, *ahead)


def test_it_begins_when_as_much_is_seen_as_was_learned_from() -> None:
    one, plain = residuals(0.3), np.array([0.1, 0.2])
    found = np.array([one.add(present(20.0), plain, 0.1 * step) for step in range(OBSERVED + 3)])
    np.testing.assert_array_equal(found[:OBSERVED], np.tile(plain, (OBSERVED, 1)))
    np.testing.assert_allclose(found[OBSERVED:, 0], 0.4)
    np.testing.assert_array_equal(found[:, 1], 0.2)  # nobody ahead, and no residual


def test_the_state_counts_as_in_replay() -> None:
    weights = np.random.default_rng(1).normal(0.0, 0.1, REGRESSORS)
    one, own = residuals(0.2, weights), np.array([0.2, 0.0, 0.0])
    for step in range(OBSERVED + 1):
        found = one.add(present(20.0), np.zeros(2), 0.1 * step)
    expected = residual_of(10.0, 2.0, 20.0, 0.0, 0.0, one.shared, weights, own, np.empty((5, REGRESSORS)))
    assert found[0] == pytest.approx(expected, abs=1e-12)


def test_nobody_brakes_harder_than_a_car_can() -> None:
    one = residuals(-30.0)
    for step in range(OBSERVED + 1):
        found = one.add(present(20.0), np.zeros(2), 0.1 * step)
    assert found[0] == -EMERGENCY_BRAKING


def test_a_leader_that_brakes_is_noticed_as_it_brakes() -> None:
    one = residuals(0.0)
    for step in range(OBSERVED + 4):
        one.add(present(20.0, leader_speed=8.0 - 0.2 * max(step - OBSERVED, 0)), np.zeros(2), 0.1 * step)
    assert -2.0 < one.followed.acceleration[0] < -1.0
