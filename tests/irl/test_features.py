"""Every feature's derivatives against finite differences, and what each rewards."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.irl import features as f
from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.ground import Ground
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.us101 import US101
from tests.helpers.builders import Car, scenes

GROUND = Ground.of(US101)
STEP = 1e-5


@pytest.mark.parametrize(
    ("function", "low", "high"),
    [(lambda y: f.lane_middle(y, GROUND), -18.0, 0.0), (lambda y: f.boundaries(y, GROUND), -18.0, 0.0),
        (f.along_road, -0.5, 0.5), (lambda u: f.effort(u, 0.7), -3, 3)],
)  # fmt: skip
def test_derivatives_of_one_number(function: Callable[[float], tuple[float, ...]], low: float, high: float) -> None:
    for z in np.linspace(low, high, 37):
        before, here, after = (function(z + s) for s in (-STEP, 0.0, STEP))
        assert here[1] == pytest.approx((after[0] - before[0]) / (2 * STEP), rel=1e-6, abs=1e-8)
        assert here[2] == pytest.approx((after[1] - before[1]) / (2 * STEP), rel=1e-6, abs=1e-8)


@given(st.floats(0, 30), st.floats(-0.6, 0.6))
def test_derivatives_of_forward_speed(v: float, psi: float) -> None:
    _, by_v, by_psi, cross, twice = f.forward_speed(v, psi, US101.speed_limit)
    assert by_v == pytest.approx(
        (f.forward_speed(v + STEP, psi, US101.speed_limit)[0] - f.forward_speed(v - STEP, psi, US101.speed_limit)[0])
        / (2 * STEP),
        rel=1e-6,
    )
    up, down = f.forward_speed(v, psi + STEP, US101.speed_limit), f.forward_speed(v, psi - STEP, US101.speed_limit)
    assert by_psi == pytest.approx((up[0] - down[0]) / (2 * STEP), rel=1e-6, abs=1e-8)
    assert cross == pytest.approx((up[1] - down[1]) / (2 * STEP), rel=1e-6, abs=1e-8)
    assert twice == pytest.approx((up[2] - down[2]) / (2 * STEP), rel=1e-6, abs=1e-8)


def test_a_lanes_middle_is_best_and_the_edge_worst() -> None:
    middles = [f.lane_middle(float(US101.lane_center(lane)), GROUND)[0] for lane in range(1, 6)]
    assert middles == pytest.approx([1.0] * 5, abs=1e-3)
    assert f.lane_middle(-US101.widths[0], GROUND)[0] < 0.3
    assert (
        f.boundaries(0.0, GROUND)[0]
        == pytest.approx(f.boundaries(-US101.width, GROUND)[0])
        == pytest.approx(-1.0, abs=1e-6)
    )
    assert f.boundaries(-0.5 * US101.width, GROUND)[0] > -1e-3
    assert f.boundaries(1.0, GROUND)[0] < -2.0


def _collision(x: float, y: float, psi: float, *cars: Car) -> tuple[float, ...]:
    chosen = scenes(Car(1, 0.0), *cars)
    episodes, around = episodes_of([chosen])
    return f.collision(x, y, psi, 4.0, 2.0, episodes.cell[0], episodes.stride[0], episodes.lanes[0], 1, around)


def test_one_car_on_top_of_another_of_usual_size_counts_one() -> None:
    start = 3 * 10.0 * FRAME_STEP  # where the windows of the builders start
    usual = Car(2, 30.0, length=US101.car_length, width=US101.car_width)
    chosen = scenes(Car(1, 0.0), usual)
    episodes, around = episodes_of([chosen])
    middle = 30.0 + start - 0.5 * US101.car_length
    found = f.collision(middle, float(US101.lane_center(3)), 0.0, US101.car_length, US101.car_width,
                        episodes.cell[0], episodes.stride[0], 5, 1, around)  # fmt: skip
    assert found[0] == pytest.approx(-1.0)


def test_every_vehicle_but_the_twin_counts_in_every_lane() -> None:
    y = float(US101.lane_center(3))
    alone = _collision(3.0, y, 0.0)
    assert alone[0] == 0.0
    ahead, beside = Car(2, 15.0), Car(3, 2.0, lane=2)
    both = _collision(3.0, y, 0.0, ahead, beside)
    assert both[0] == pytest.approx(_collision(3.0, y, 0.0, ahead)[0] + _collision(3.0, y, 0.0, beside)[0])
    assert both[0] < _collision(3.0, y, 0.0, ahead)[0] < 0.0
    assert _collision(3.0, y, 0.0, ahead)[1] < 0.0  # nearer is worse
