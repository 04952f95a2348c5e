"""Lane-change parameters: what a misfit sees, and that the search goes where it is small."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.evaluation.traffic_measures import TrafficMeasures, measure_traffic
from idm_sumo.roads.us101 import US101
from idm_sumo.sumo.closed_loop.lane_change_fit import BOUNDS, MISFIT, best_of, fit_lane_changes, lane_change_misfit
from tests.helpers.builders import Car, recording


def traffic(changing: int, *, cars: int = 24, speed: float = 12.0) -> TrafficMeasures:
    """Cars one after another, of which the first ones change once from lane 2 to lane 3."""
    left, right = float(US101.lane_center(2)), float(US101.lane_center(3))
    changes, stays = np.where(np.arange(300) < 150, left, right), np.full(300, left)
    paths = [changes if n < changing else stays for n in range(cars)]
    driven = (Car(n + 1, 5.0, 2, speed, y, first_frame=1 + 40 * n, frames=300) for n, y in enumerate(paths))
    return measure_traffic(recording(*driven))


def misfit(
    recorded: TrafficMeasures, simulated: TrafficMeasures, brakings: int = 0, left_out: int = 0
) -> dict[str, float]:
    return lane_change_misfit(recorded, simulated, brakings=brakings, left_out=left_out)


def test_equal_traffic_has_no_misfit() -> None:
    assert set(misfit(traffic(10), traffic(10)).values()) == {0.0}


def test_a_fifth_more_changes_counts_as_one() -> None:
    assert misfit(traffic(19), traffic(23))["changes"] == pytest.approx(1.0)
    assert misfit(traffic(23), traffic(19))["changes"] == pytest.approx(1.0)


def test_speeds_emergency_brakings_and_vehicles_left_out_are_seen() -> None:
    found = misfit(traffic(5), traffic(5, speed=13.5))
    assert found["speeds"] == pytest.approx(1.0, abs=0.05)
    found = misfit(traffic(5), traffic(5), brakings=24, left_out=12)
    assert found["brakings"] == pytest.approx(100.0)
    assert found["left_out"] == pytest.approx(50.0)


def test_the_search_ends_nearer_than_it_began_and_is_repeatable() -> None:
    names = ("lcSpeedGain", "lcLookaheadLeft")
    there = {"lcSpeedGain": 12.0, "lcLookaheadLeft": 2.5}

    def evaluate(parameters: dict[str, float]) -> dict[str, float]:
        return {MISFIT: 0.1 + sum(np.log(parameters[name] / there[name]) ** 2 for name in names)}

    table = fit_lane_changes(evaluate, names, seed=3)
    assert table.loc[0, list(names)].tolist() == [1.0, 1.0]
    assert table[MISFIT].min() < 0.1 + 0.05 * (table[MISFIT][0] - 0.1)
    best = best_of(table, names)
    assert all(BOUNDS[name][0] <= value <= BOUNDS[name][1] for name, value in best.items())
    assert best == best_of(fit_lane_changes(evaluate, names, seed=3), names)
