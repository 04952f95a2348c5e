"""Closest approaches, measured with a ruler."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.irl.approaches import closest_approaches
from idm_sumo.roads.us101 import US101
from idm_sumo.simulation.rollout import drive_constant_velocity
from tests.helpers.builders import Car, scenes


def test_the_gap_to_a_leader() -> None:
    chosen = scenes(Car(1, 0.0), Car(2, 20.0, length=5.0))
    close = closest_approaches(chosen, drive_constant_velocity(chosen)).iloc[0]
    assert close["clearance_m"] == pytest.approx(15.0)
    assert not close["lateral"]
    assert close["other"] == 2


def test_passing_another_beside() -> None:
    chosen = scenes(Car(1, 0.0, speed=20.0, width=2.0), Car(2, 15.0, lane=2, speed=5.0, width=2.0), Car(3, 60.0))
    close = closest_approaches(chosen, drive_constant_velocity(chosen)).iloc[0]
    assert close["clearance_m"] == pytest.approx(US101.widths[0] - 2.0)
    assert close["lateral"]
    assert close["other"] == 2


def test_an_overlap_is_negative_and_nobody_is_infinite() -> None:
    chosen = scenes(Car(1, 0.0, speed=20.0), Car(2, 12.0, speed=2.0))
    assert closest_approaches(chosen, drive_constant_velocity(chosen))["clearance_m"].iloc[0] < 0
    alone = scenes(Car(1, 0.0))
    close = closest_approaches(alone, drive_constant_velocity(alone)).iloc[0]
    assert np.isinf(close["clearance_m"])
    assert close["other"] == 0
