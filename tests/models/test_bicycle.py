from math import asin, atan, hypot, pi, tan
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from idm_sumo.models import bicycle
from idm_sumo.models.bicycle import REAR_SHARE, center_of_front, front_of_center, step


class State(NamedTuple):
    """Centre of mass ``x, y`` (m), heading (rad) and speed (m/s)."""

    x: float
    y: float
    heading: float
    speed: float


def controls_between(before: State, after: State, axles: float, dt: float) -> tuple[float, float]:
    """Return acceleration (m/s²) and steering (rad) that lead from one state to the next: the inverse of the step."""
    acceleration = (after.speed - before.speed) / dt
    if hypot(after.x - before.x, after.y - before.y) == 0.0 or before.speed == 0.0:
        return acceleration, 0.0
    slip = asin((after.heading - before.heading) * REAR_SHARE * axles / (before.speed * dt))
    return acceleration, atan(tan(slip) / REAR_SHARE)


states = st.builds(
    State, x=st.floats(0.0, 700.0), y=st.floats(-20.0, 0.0), heading=st.floats(-0.5, 0.5), speed=st.floats(0.5, 35.0)
)
lengths = st.floats(2.0, 20.0)


@given(states, st.floats(-9.0, 6.0), lengths)
def test_straight_driving_keeps_the_lateral_position_exactly(state, acceleration, length):
    x, y, v = state.x, state.y, state.speed
    for _ in range(20):
        x, y, heading, v = step(x, y, 0.0, v, acceleration, 0.0, bicycle.wheelbase(length), 0.1)
        assert (y, heading) == (state.y, 0.0)
        assert v >= 0.0


@given(states, st.floats(-5.0, 6.0), st.floats(-0.5, 0.5), lengths)
def test_controls_between_is_the_inverse_of_step(state, acceleration, steering, length):
    axles = bicycle.wheelbase(length)
    after = State(*step(*state, acceleration, steering, axles, 0.1))
    found_acceleration, found_steering = controls_between(state, after, axles, 0.1)
    assert found_acceleration == pytest.approx(acceleration, abs=1e-10)
    assert found_steering == pytest.approx(steering, abs=1e-8)
    again = step(*state, found_acceleration, found_steering, axles, 0.1)
    np.testing.assert_allclose(again, after, rtol=0, atol=1e-9)


def test_at_standstill_no_steering_is_found():
    rest = State(10.0, -5.0, 0.0, 0.0)
    assert controls_between(rest, State(*step(*rest, 1.0, 0.3, 2.8, 0.1)), 2.8, 0.1) == (pytest.approx(1.0), 0.0)


@given(st.floats(0, 9), st.floats(0, 30))
def test_nobody_rolls_backwards(speed, braking):
    *_, after = step(0.0, 0.0, 0.0, speed, -braking, 0.0, 2.8, 0.1)
    assert after == max(0.0, speed - braking * 0.1)


@given(states, lengths)
def test_front_and_centre_convert_into_each_other(state, length):
    front = front_of_center(state.x, state.y, state.heading, length)
    np.testing.assert_allclose(center_of_front(*front, state.heading, length), (state.x, state.y), rtol=0, atol=1e-9)
    assert np.hypot(front[0] - state.x, front[1] - state.y) == pytest.approx(length / 2)


def test_the_front_lies_ahead():
    assert front_of_center(10.0, -5.0, 0.0, 4.0) == (12.0, -5.0)
    np.testing.assert_allclose(front_of_center(10.0, -5.0, pi / 2, 4.0), (10.0, -3.0), atol=1e-12)


def exact(state, acceleration, steering, axles, seconds):
    """Solve the continuous kinematic bicycle (Kong et al. 2015, eqs. 1a-1e), centre of mass amid the axles."""
    rear = axles / 2

    def change(_, s):
        beta = np.arctan(tan(steering) * rear / axles)
        return [
            s[3] * np.cos(s[2] + beta), s[3] * np.sin(s[2] + beta), s[3] / rear * np.sin(beta), acceleration,
        ]  # fmt: skip

    return solve_ivp(change, (0, seconds), state, rtol=1e-11, atol=1e-11).y[:, -1]


@pytest.mark.parametrize(("acceleration", "steering"), [(1.0, 0.05), (-2.0, -0.1), (0.0, 0.02)])
def test_converges_to_the_continuous_model_with_first_order(acceleration, steering):
    start, axles, seconds = State(0.0, 0.0, 0.1, 12.0), 2.8, 2.0
    reference = exact(start, acceleration, steering, axles, seconds)
    errors = []
    for steps in (200, 400, 800):
        state = tuple(start)
        for _ in range(steps):
            state = step(*state, acceleration, steering, axles, seconds / steps)
        errors.append(np.linalg.norm(np.subtract(state, reference)))
    assert errors[-1] < 0.1
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx(2.0, rel=0.05)
