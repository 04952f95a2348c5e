"""The desired speed: estimated, kept in the driver table, and named where it is too low."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import calibrate
from idm_sumo.calibration.desired_speed import estimate_desired_speeds
from idm_sumo.calibration.status import FASTER, OK
from idm_sumo.calibration.without_d1 import refit_table
from idm_sumo.evaluation.metrics import score
from idm_sumo.roads import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.builders import Car, recording

WANTED = 39.0  # m/s, of drivers who follow at 33
STEPS = 100


@pytest.fixture(scope="module")
def fast():
    """Drivers who follow a leader of 31 to 35 m/s exactly as an IDM with v0 = 39 m/s."""
    rng = np.random.default_rng(4)
    cars, time = [], 0.1 * np.arange(STEPS + 1)
    for k in range(12):
        speed = 33.0 + 2.0 * np.sin(2.0 * np.pi * (time / rng.uniform(6.0, 14.0) + rng.uniform()))
        gap, lane = rng.uniform(50.0, 75.0), 1 + k % 5
        first = 1 + 200 * (k // 5)  # nobody meets another pair
        leader = gap + np.concatenate([[0.0], np.cumsum(0.1 * speed[:-1])])
        cars.append(Car(2 * k + 1, x=0.0, lane=lane, speed=33.0, first_frame=first, frames=STEPS + 1))
        cars.append(Car(2 * k + 2, x=leader, lane=lane, speed=speed, first_frame=first, frames=STEPS + 1))
    window = Window(observed=1, horizon=STEPS, from_entry=True)
    scenes = build_scenes(recording(*cars), window, modelled=range(1, 25, 2))
    theta = rng.uniform([1.0, 1.0, 0.8, 2.0, 0.0], [2.5, 2.5, 1.6, 4.0, 2.0], (12, 5))
    true = drive_idm(scenes, theta, desired_speed=WANTED)
    return replace(scenes, x=true.x, y=true.y, heading=true.heading, speed=true.speed)


def test_drivers_above_their_desired_speed_are_named(fast):
    table = calibrate(fast)
    assert (table["status"] == FASTER).all()
    assert (table["desired_speed_m_s"] == US101.speed_limit).all()
    assert table["ade_m"].mean() > 1.0
    right = calibrate(fast, desired_speed=WANTED)
    assert (right["status"] == OK).all()
    assert right["ade_m"].max() < 0.05


def test_the_estimate_is_near_and_nobody_wants_less_than_it_drives(fast):
    found = estimate_desired_speeds(fast)
    assert (found >= fast.speed.max(axis=1)).all()
    assert found == pytest.approx(WANTED, rel=0.1)
    table = calibrate(fast, desired_speed="auto")
    np.testing.assert_array_equal(table["desired_speed_m_s"], found)
    assert (table["status"] == OK).all()
    assert table["ade_m"].mean() < 0.05


def test_another_word_is_refused(fast):
    with pytest.raises(InputError, match="'automatic' is unknown"):
        calibrate(fast, desired_speed="automatic")


def test_whoever_drives_the_table_uses_its_desired_speed(fast):
    table = calibrate(fast, desired_speed=np.linspace(38.0, 40.0, len(fast)))
    driven = drive_idm(fast, table.sample(frac=1.0, random_state=1))  # rows are found by their keys
    np.testing.assert_allclose(score(fast, driven)["ade_m"], table["ade_m"], rtol=1e-9)
    assert score(fast, drive_idm(fast, table, desired_speed=US101.speed_limit))["ade_m"].mean() > 1.0
    assert refit_table(table, fast, integration="paper")["ade_refit_m"].mean() < 0.5


def test_a_driver_without_a_row_or_without_parameters_is_named(fast):
    table = calibrate(fast, desired_speed=WANTED)
    with pytest.raises(InputError, match="vehicle 1 of period p1 is missing"):
        drive_idm(fast, table[1:])
    lost = table.assign(a=table["a"].where(table.index != 2))
    with pytest.raises(InputError, match="vehicle 5 of period p1 has no parameters"):
        drive_idm(fast, lost)


def test_trajectories_know_their_vehicles(fast):
    driven = drive_idm(fast, calibrate(fast, desired_speed=WANTED))
    table = driven.to_pandas()
    assert len(table) == len(fast) * (STEPS + 1)
    own = table[table["vehicle"] == 3]
    np.testing.assert_array_equal(own["x"], driven.x[1])
    np.testing.assert_array_equal(own["acceleration"].iloc[:-1], driven.acceleration[1])
    assert np.isnan(own["acceleration"].iloc[-1])
    assert own["frame"].tolist() == list(range(1, STEPS + 2))
    assert set(table["period"]) == {"p1"}
    assert repr(driven) == "<Trajectories: 12 vehicles, 100 steps of 0.1 s>"
    pd.testing.assert_frame_equal(driven.rows(slice(1, 2)).to_pandas(), own.reset_index(drop=True))
