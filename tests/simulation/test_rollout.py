from math import atan, cos, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idm_sumo.models.idm import LOWER, TEXTBOOK, UPPER, IDMParameters, equilibrium_gap
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Window
from idm_sumo.simulation.rollout import drive_constant_velocity, drive_idm
from tests.helpers.builders import Car, scenes

parameters = st.builds(
    IDMParameters, **{f: st.floats(getattr(LOWER, f), getattr(UPPER, f)) for f in IDMParameters._fields}
)


def drive_slowly(car, others, p, steps, start, v0=US101.speed_limit):
    """Drive one car in plain Python from the equations of the paper; no function of the package."""
    x, y, psi, v = car["x"][start], car["y"][start], car["heading"], car["speed"]
    lane = int(-y // 3.6576) + 1
    lane_y, wheelbase, dt = -(lane - 0.5) * 3.6576, 0.6 * car["length"], 0.1
    cx, cy = x - car["length"] / 2 * cos(psi), y - car["length"] / 2 * sin(psi)
    path = []
    for k in range(steps + 1):
        ahead = [o for o in others if o["x"][start + k] > x and int(-o["y"][start + k] // 3.6576) + 1 == lane]
        leader = min(ahead, key=lambda o: o["x"][start + k]) if ahead else None
        gap = leader["x"][start + k] - leader["length"] - x if leader else float("inf")
        path.append((x, y, psi, v, gap))
        dv = v - leader["speed"] if leader else 0.0
        wanted = p.d0 + p.d1 * sqrt(v / v0) + max(0.0, p.T * v + v * dv / (2 * sqrt(p.a * p.b)))
        acc = -9.0 if gap <= 0.01 else max(p.a * (1 - (v / v0) ** 4 - (wanted / gap) ** 2), -9.0)
        # Pure pursuit by angles: the goal lies on the lane's middle, max(8 m, 1.5 s) ahead of the rear axle.
        goal_x, goal_y = max(8.0, 1.5 * v), lane_y - (cy - wheelbase / 2 * sin(psi))
        distance, alpha = sqrt(goal_x**2 + goal_y**2), atan(goal_y / goal_x) - psi
        delta = min(max(atan(2 * wheelbase * sin(alpha) / distance), -0.5), 0.5)
        beta = atan(tan(delta) / 2)
        cx, cy = cx + v * cos(psi + beta) * dt, cy + v * sin(psi + beta) * dt
        psi, v = psi + v / (wheelbase / 2) * sin(beta) * dt, max(0.0, v + acc * dt)
        x, y = cx + car["length"] / 2 * cos(psi), cy + car["length"] / 2 * sin(psi)
    return np.array(path).T


def as_dict(car):
    steps = np.arange(car.frames)
    y = np.full(car.frames, US101.lane_center(car.lane)) if car.y is None else car.y
    return {"x": car.x + car.speed * 0.1 * steps, "y": y, "heading": car.heading, "speed": car.speed,
            "length": car.length}  # fmt: skip


# A car that changes from lane 2 into lane 3, in front or behind, during the simulation.
changer = US101.lane_center(2) + np.linspace(0.0, -US101.widths[0], 40)


@settings(max_examples=25)  # a recording each
@given(
    parameters, st.floats(0.0, 30.0), st.floats(-1.7, 1.7), st.floats(-0.1, 0.1), st.floats(2.0, 15.0),
    st.lists(st.tuples(st.floats(-20.0, 80.0), st.floats(0.0, 30.0), st.sampled_from([2, 3, 4])), max_size=4),
    st.floats(-20.0, 60.0),
)  # fmt: skip
def test_is_the_plain_loop_written_from_the_paper(p, speed, offset, heading, length, others, changer_x):
    y = np.full(40, US101.lane_center(3) + offset)
    ego = Car(1, x=100.0, y=y, speed=speed, heading=heading, length=length)
    cars = [Car(i, x=100.0 + x, lane=lane, speed=v) for i, (x, v, lane) in enumerate(others, start=3)]
    cars.append(Car(2, x=100.0 + changer_x, y=changer, speed=12.0))
    driven = drive_idm(scenes(ego, *cars), p)
    expected = drive_slowly(as_dict(ego), [as_dict(car) for car in cars], p, steps=20, start=3)
    for name, values in zip(("x", "y", "heading", "speed", "gap"), expected, strict=True):
        np.testing.assert_allclose(getattr(driven, name)[0], values, rtol=0, atol=1e-9, err_msg=name)


def test_behind_a_constant_leader_the_gap_tends_to_the_equilibrium():
    frames = 1203
    window = Window(observed=4, horizon=1199)
    some = scenes(Car(1, speed=15.0, frames=frames), Car(2, x=60.0, speed=10.0, frames=frames), window=window)
    driven = drive_idm(some, TEXTBOOK)
    assert driven.gap[0, -1] == pytest.approx(float(equilibrium_gap(10.0, TEXTBOOK, US101.speed_limit)), abs=0.02)
    assert driven.speed[0, -1] == pytest.approx(10.0, abs=1e-3)
    assert driven.gap.min() > 0.0


def test_on_a_free_road_the_speed_tends_to_the_desired_one():
    some = scenes(Car(1, speed=5.0, frames=1203), window=Window(observed=4, horizon=1199))
    driven = drive_idm(some, TEXTBOOK, desired_speed=20.0)
    assert driven.speed[0, -1] == pytest.approx(20.0, abs=1e-2)
    assert np.all(np.diff(driven.speed) > 0)
    assert np.all(np.isinf(driven.gap))
    assert np.all(driven.leader == -1)


def test_in_the_middle_of_a_lane_a_car_stays_there_exactly():
    some = scenes(Car(1), Car(2, x=30.0, speed=9.0))
    driven = drive_idm(some, TEXTBOOK)
    assert np.all(driven.y == US101.lane_center(3))
    assert np.all(driven.heading == 0.0)


def test_the_leader_is_perceived_in_the_lane_of_the_start_at_the_simulated_position():
    # The recorded vehicle overtakes vehicle 2 after a lane change; the model stays and keeps following 2.
    y = np.where(np.arange(40) < 10, US101.lane_center(3), US101.lane_center(2))
    some = scenes(Car(1, y=y, speed=20.0), Car(2, x=15.0, speed=8.0), Car(3, x=40.0, lane=2, speed=20.0))
    driven = drive_idm(some, TEXTBOOK)
    assert set(some.traffic.vehicle[driven.leader[0]]) == {2}


def test_drivers_are_independent_and_take_their_own_parameters():
    cars = Car(1, speed=15.0), Car(2, x=40.0, speed=10.0), Car(3, x=70.0, speed=12.0, lane=2)
    theta = np.array([TEXTBOOK, (2.0, 3.0, 0.8, 1.0, 1.0), (1.0, 1.0, 1.0, 1.0, 0.0)])
    limit = np.array([20.0, 22.0, 24.0])
    together = drive_idm(scenes(*cars, modelled=(1, 2, 3)), theta, desired_speed=limit)
    for i in range(3):
        alone = drive_idm(scenes(*cars, modelled=(i + 1,)), theta[i], desired_speed=limit[i])
        for name in ("x", "y", "heading", "speed", "acceleration", "steering", "gap"):
            np.testing.assert_array_equal(getattr(together, name)[i], getattr(alone, name)[0])


def test_a_simulation_starts_where_the_recorded_vehicle_is():
    some = scenes(Car(1, x=3.0, speed=7.0, heading=0.05), Car(2, x=30.0))
    for driven in (drive_idm(some, TEXTBOOK), drive_constant_velocity(some)):
        assert driven.x.shape == (1, 21)
        assert driven.acceleration.shape == (1, 20)
        assert (driven.x[0, 0], driven.y[0, 0]) == (some.x[0, 3], some.y[0, 3])
        assert (driven.heading[0, 0], driven.speed[0, 0]) == (0.05, 7.0)


@settings(max_examples=15)  # a recording each
@given(st.floats(0.0, 35.0), st.floats(-0.2, 0.2))
def test_constant_velocity_is_a_straight_line_at_constant_speed(speed, heading):
    driven = drive_constant_velocity(scenes(Car(1, speed=speed, heading=heading)))
    steps = np.hypot(np.diff(driven.x[0]), np.diff(driven.y[0]))
    np.testing.assert_allclose(steps, speed * 0.1, rtol=0, atol=1e-9)
    assert driven.y[0, -1] - driven.y[0, 0] == pytest.approx(2.0 * speed * sin(heading), abs=1e-9)
    assert np.all(driven.speed == speed)
    assert np.all(driven.acceleration == 0)


def test_the_recorded_leader_is_followed_where_only_its_headway_is_known():
    headway = np.full(40, 20.0)
    lone = scenes(Car(1, speed=10.0, headway=headway), has_leader_rows=False)
    length = US101.car_length
    seen = scenes(Car(1, speed=10.0), Car(2, x=20.0, speed=10.0, length=length))
    driven, expected = drive_idm(lone, TEXTBOOK), drive_idm(seen, TEXTBOOK)
    np.testing.assert_allclose(driven.x, expected.x, rtol=0, atol=1e-9)
    assert driven.gap[0, 0] == pytest.approx(20.0 - length)


def test_parameters_of_a_wrong_shape_are_refused():
    with pytest.raises(ValueError, match="broadcast"):
        drive_idm(scenes(Car(1)), np.ones((2, 5)))
