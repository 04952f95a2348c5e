from math import atan, cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.models import bicycle
from idm_sumo.models.steering import LOOKAHEAD_LEAST, STEERING_LIMIT, lookahead_distance, pure_pursuit

headings = st.floats(-0.3, 0.3)
goals_x = st.floats(8.0, 60.0)
goals_y = st.floats(-4.0, 4.0)


def drive(offset, speed, seconds, *, heading=0.0, dt=0.1, length=4.5):
    """Return the lateral positions of the rear axle of a car that pursues ``y = 0`` at constant speed."""
    x, y, v, axles = 0.0, offset, speed, bicycle.wheelbase(length)
    lateral = []
    for _ in range(round(seconds / dt)):
        rear_y = y - bicycle.REAR_SHARE * axles * sin(heading)
        lateral.append(rear_y)
        delta = pure_pursuit(cos(heading), sin(heading), lookahead_distance(speed), -rear_y, axles)
        x, y, heading, v = bicycle.step(x, y, heading, v, 0.0, delta, axles, dt)
    return np.array(lateral)


@given(st.floats(0.1, 60.0), st.floats(1.0, 12.0))
def test_aligned_on_the_centre_line_the_wheels_are_exactly_straight(distance, axles):
    assert pure_pursuit(1.0, 0.0, distance, 0.0, axles) == 0.0


@given(st.floats(-1.0, 1.0), st.floats(5.0, 60.0), st.floats(1.0, 4.0))
def test_a_car_that_already_heads_for_the_goal_goes_straight(heading, distance, axles):
    delta = pure_pursuit(cos(heading), sin(heading), distance * cos(heading), distance * sin(heading), axles)
    assert delta == pytest.approx(0.0, abs=1e-15)


@given(headings, goals_x, goals_y, st.floats(1.0, 12.0))
def test_left_and_right_are_mirror_images(heading, x, y, axles):
    left = pure_pursuit(cos(heading), sin(heading), x, y, axles)
    assert pure_pursuit(cos(heading), -sin(heading), x, -y, axles) == -left


@given(headings, goals_x, goals_y)
def test_is_coulters_arc_through_the_goal(heading, x, y):
    # Independent: turn the goal into the car's frame; the arc that is tangent to the car's
    # axis and meets it has its centre (0, r) at the same distance from both ends.
    across = -x * sin(heading) + y * cos(heading)
    along = x * cos(heading) + y * sin(heading)
    delta = pure_pursuit(cos(heading), sin(heading), x, y, 2.8)
    if abs(across) > 1e-6 and abs(delta) < STEERING_LIMIT:
        radius = (along**2 + across**2) / (2 * across)
        assert np.hypot(along, across - radius) == pytest.approx(abs(radius), rel=1e-9)
        assert delta == pytest.approx(atan(2.8 / radius), rel=1e-9)


def test_steering_is_limited():
    assert pure_pursuit(1.0, 0.0, 0.0, 1.0, 2.8) == STEERING_LIMIT
    assert pure_pursuit(1.0, 0.0, 0.0, -1.0, 2.8) == -STEERING_LIMIT


def test_the_goal_never_comes_nearer_than_at_low_speed():
    assert lookahead_distance(0.0) == LOOKAHEAD_LEAST
    assert lookahead_distance(20.0) == pytest.approx(30.0)


@pytest.mark.parametrize("speed", [2.0, 8.0, 15.0, 25.0])
@pytest.mark.parametrize("offset", [0.3, 1.8])
def test_an_offset_decays_with_hardly_any_overshoot(speed, offset):
    path = drive(offset, speed, 30.0)
    # For small angles it is an oscillator, y'' = -2 (y + L y') / L^2, with the damping ratio
    # 1/sqrt(2) whatever speed and lookahead L: it overshoots by exp(-pi) = 4.3 %. At 1.8 m
    # it is 5.3 %, 10 cm, for the angle is no longer small and the step not zero.
    overshoot = -path.min()
    assert 0.0 < overshoot < 0.055 * offset
    assert abs(path[-1]) < 0.01
    crossing = np.argmax(path <= 0.0) or len(path)
    assert np.all(np.diff(path[:crossing]) <= 1e-12)
    np.testing.assert_allclose(drive(-offset, speed, 30.0), -path, rtol=0, atol=1e-12)


@given(st.floats(1.0, 30.0), st.floats(0.05, 0.2))
def test_a_slanting_start_is_straightened(speed, heading):
    path = drive(0.0, speed, 400.0 / speed, heading=heading)
    assert abs(path[-1]) < 0.02
