import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.smoothing import running_mean, runs, smooth
from tests.helpers.builders import Car, recording

STEP = 0.1


def one(x: np.ndarray, **how: object) -> pd.DataFrame:
    return smooth(recording(Car(1, x=x, frames=len(x), **how))).table


@given(
    frames=st.integers(5, 60),
    speed=st.floats(20, 30),
    acceleration=st.floats(-1, 1),
    jerk=st.floats(-0.5, 0.5),
)
@settings(max_examples=40, deadline=None)
def test_cubic_motion_is_left_as_it_is(frames: int, speed: float, acceleration: float, jerk: float) -> None:
    t = STEP * np.arange(frames)
    x = speed * t + acceleration * t**2 / 2 + jerk * t**3 / 6
    table = one(x)
    np.testing.assert_allclose(table[c.X], x, atol=1e-6)
    np.testing.assert_allclose(table[c.SPEED], speed + acceleration * t + jerk * t**2 / 2, atol=1e-6)
    np.testing.assert_allclose(table[c.ACCELERATION], acceleration + jerk * t, atol=1e-5)


@pytest.mark.parametrize("frames", [21, 22, 40, 100])
def test_all_runs_at_once_equal_scipy_run_by_run(frames: int) -> None:
    rng = np.random.default_rng(frames)
    xs = [10 * STEP * np.arange(n) + rng.normal(0, 0.3, n) for n in (frames, 7, frames + 3, 21)]
    table = smooth(recording(*(Car(i, x=x, frames=len(x)) for i, x in enumerate(xs, 1)))).table
    for vehicle, x in enumerate(xs, 1):
        window = 7 if len(x) == 7 else 21
        mine = table[table[c.VEHICLE] == vehicle]
        np.testing.assert_allclose(mine[c.X], savgol_filter(x, window, 3), atol=1e-9)
        speed = savgol_filter(x, window, 3, deriv=1, delta=STEP)
        np.testing.assert_allclose(mine[c.SPEED], np.maximum(speed, 0), atol=1e-9)
        np.testing.assert_allclose(mine[c.ACCELERATION], savgol_filter(x, window, 3, deriv=2, delta=STEP), atol=1e-8)


def test_noise_is_reduced() -> None:
    rng = np.random.default_rng(0)
    truth = 12 * STEP * np.arange(400)
    noise = rng.normal(0, 0.2, 400)
    table = one(truth + noise)
    # A 21-point cubic keeps 3(3m^2+3m-1)/((2m-1)(2m+1)(2m+3)), m = 10, i.e. 10.7 % of the variance inside.
    kept = np.std(table[c.X].to_numpy()[10:-10] - truth[10:-10]) / np.std(noise)
    assert kept == pytest.approx(np.sqrt(0.1075), rel=0.25)
    assert np.std(table[c.SPEED].to_numpy()[10:-10]) < 0.3


def test_speed_is_the_derivative_of_position() -> None:
    t = STEP * np.arange(300)
    table = one(10 * t + 5 * np.sin(0.3 * t))
    np.testing.assert_allclose(np.gradient(table[c.X], STEP)[12:-12], table[c.SPEED][12:-12], atol=0.01)
    np.testing.assert_allclose(np.gradient(table[c.SPEED], STEP)[12:-12], table[c.ACCELERATION][12:-12], atol=0.01)


def test_neighbouring_vehicles_and_holes_do_not_mix() -> None:
    table = recording(Car(1, x=0.0, speed=10, frames=30), Car(2, x=500.0, speed=20, frames=30)).table
    later = table[30:].assign(frame=table.frame[30:] + 100, x=table.x[:30].to_numpy())
    rows = smooth(recording(Car(1)).with_table(pd.concat([table, later], ignore_index=True))).table
    np.testing.assert_allclose(rows[c.SPEED], np.repeat([10.0, 20.0, 10.0], 30), atol=1e-8)


@pytest.mark.parametrize(("frames", "speed"), [(1, 0.0), (2, 8.0), (4, 8.0)])
def test_few_frames_are_differenced(frames: int, speed: float) -> None:
    table = one(8 * STEP * np.arange(frames))
    np.testing.assert_allclose(table[c.SPEED], speed, atol=1e-12)
    np.testing.assert_allclose(table[c.ACCELERATION], 0.0, atol=1e-9)


def test_a_standing_car_neither_reverses_nor_turns() -> None:
    rng = np.random.default_rng(3)
    table = one(50 + rng.normal(0, 0.05, 200), y=-5 + rng.normal(0, 0.05, 200))
    assert table[c.SPEED].min() == 0.0
    assert table[c.HEADING][10:-10].abs().max() < 0.1
    assert table[c.HEADING].abs().max() < 0.2  # the ends of a run know less


def test_heading_points_where_the_car_goes() -> None:
    t = STEP * np.arange(60)
    table = one(10 * t, y=-9 + 1.0 * t)
    np.testing.assert_allclose(table[c.HEADING], np.arctan2(1.0, 10.0), atol=1e-9)


def test_smooth_sources_pass_unchanged() -> None:
    rec = recording(Car(1))
    assert smooth(rec, already_smooth=True) is rec


def test_headways_stay_as_recorded() -> None:
    rec = recording(Car(1, headway=23.0))
    assert (smooth(rec).table[c.HEADWAY] == 23.0).all()


def test_runs_end_at_holes_vehicles_and_periods() -> None:
    table = recording(Car(1, frames=5), Car(2, frames=4)).table.drop(index=2)
    starts, lengths = runs(table.reset_index(drop=True))
    assert starts.tolist() == [0, 2, 4]
    assert lengths.tolist() == [2, 2, 4]


def test_a_running_mean_is_of_one_run_and_of_its_last_rows_only() -> None:
    values = np.array([1.0, 3.0, 5.0, 10.0, 20.0, 40.0])
    same = np.array([False, True, True, False, True, True])
    np.testing.assert_allclose(running_mean(values, same), [1.0, 2.0, 3.0, 10.0, 15.0, 70.0 / 3.0])
    np.testing.assert_allclose(running_mean(values, same, 2), [1.0, 2.0, 4.0, 10.0, 15.0, 30.0])
