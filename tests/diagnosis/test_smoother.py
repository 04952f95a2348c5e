"""Smoothing: lines stay lines, no other filter is nearer to the truth, ends are as good as they can be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.smoother import LONGEST, Smoother, local_cubic, posterior_mean, travelled, window_for
from idm_sumo.recordings.smoothing import WINDOW
from tests.helpers.followers import ERRORS, MOTION

FILTERS = [local_cubic(21), posterior_mean(ERRORS, MOTION)]


def measured_paths(rows: int, frames: int, rng: np.random.Generator) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return positions, speeds and accelerations of vehicles, and the positions as measured."""
    held = MOTION.draw(rows, frames, rng)  # from each frame to the next
    speed, path = np.full((rows, frames), 12.0), np.zeros((rows, frames))
    for k in range(frames - 1):
        path[:, k + 1] = path[:, k] + speed[:, k] * 0.1 + 0.5 * held[:, k] * 0.1**2
        speed[:, k + 1] = speed[:, k] + held[:, k] * 0.1
    acceleration = np.concatenate([held[:, :1], 0.5 * (held[:, 1:] + held[:, :-1])], axis=1)
    return (path, speed, acceleration), path + ERRORS.draw(rows, frames, rng)


@pytest.mark.parametrize("smoother", FILTERS)
@given(st.floats(-50.0, 900.0), st.floats(0.0, 30.0), st.integers(2, 200))
def test_a_steady_speed_stays_what_it_is(smoother: Smoother, begin: float, speed: float, frames: int):
    path = begin + speed * 0.1 * np.arange(frames)
    x, v, a = smoother.rows(path)
    np.testing.assert_allclose(x, path, atol=1e-5)
    np.testing.assert_allclose(v, speed, atol=1e-5)
    np.testing.assert_allclose(a, 0.0, atol=1e-4)


@pytest.mark.parametrize("smoother", FILTERS)
def test_runs_in_a_row_are_smoothed_as_each_alone(smoother: Smoother):
    rng = np.random.default_rng(1)
    lengths = np.array([5, 300, 81, 40, 120])
    starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    position = np.concatenate([measured_paths(1, length, rng)[1][0] for length in lengths])
    along = smoother.along(position, starts, lengths)
    for start, length in zip(starts, lengths, strict=True):
        alone = smoother.rows(position[start : start + length])
        middle = slice(smoother.half, max(length - smoother.half, 0)) if length > 2 * smoother.half else slice(None)
        for one, other in zip(along, alone, strict=True):
            # Longer runs are told from what is near; what is far says next to nothing.
            np.testing.assert_allclose(one[start : start + length][middle], other[middle], atol=0.05)


@given(st.floats(0.0, 30.0), st.floats(-2.0, 2.0))
def test_parts_of_paths_of_one_acceleration_stay_what_they_are(speed: float, acceleration: float):
    time = 0.1 * np.arange(146)
    path = (speed * time + 0.5 * acceleration * time**2)[None]
    x, v, a = local_cubic(41).within(path, (speed + acceleration * time)[None])
    np.testing.assert_allclose(x, path, atol=1e-6)
    np.testing.assert_allclose(v, (speed + acceleration * time)[None], atol=1e-6)
    np.testing.assert_allclose(a, acceleration, atol=1e-5)


def test_a_part_of_a_path_is_smoothed_at_its_ends_about_as_it_is_within_the_whole():
    (path, speed, _), _ = measured_paths(400, 300, np.random.default_rng(3))
    part, smoother = slice(80, 226), local_cubic(41)
    whole, within, alone = (
        smoother.rows(path)[0][:, part], smoother.within(path[:, part], speed[:, part])[0], smoother.rows(path[:, part])[0],
    )  # fmt: skip
    made, guessed, one_sided = (path[:, part] - each for each in (whole, within, alone))
    np.testing.assert_allclose(guessed[:, 20:-20], made[:, 20:-20], atol=1e-9)
    for end in (0, -1):
        assert guessed[:, end].std() == pytest.approx(made[:, end].std(), rel=0.4)
        assert (
            np.corrcoef(guessed[:, end], made[:, end])[0, 1] > 0.5 > np.corrcoef(one_sided[:, end], made[:, end])[0, 1]
        )


def test_the_local_cubic_is_the_house_s_filter():
    path = np.random.default_rng(2).standard_normal((3, 90)).cumsum(axis=1)
    for which, part in enumerate(local_cubic(21).rows(path)):
        np.testing.assert_allclose(part, savgol_filter(path, 21, 3, deriv=which, delta=0.1, axis=1), atol=1e-9)


@pytest.mark.parametrize("smoother", FILTERS)
def test_a_single_frame_stays_where_it_is(smoother: Smoother):
    x, v, a = smoother.rows(np.array([7.0]))
    assert (float(x[0]), float(v[0]), float(a[0])) == pytest.approx((7.0, 0.0, 0.0))


def test_paths_that_are_known_exactly_stay_what_they_are():
    truth, _ = measured_paths(20, 200, np.random.default_rng(4))
    x, v, _ = posterior_mean(Noise(0.0, np.zeros(1), np.ones(1)), MOTION).rows(truth[0])
    np.testing.assert_allclose(x, truth[0], atol=0.02)
    assert np.abs(v - truth[1]).mean() < 0.01


@pytest.mark.parametrize("smoother", [local_cubic(5), posterior_mean(Noise(0.0, np.zeros(1), np.ones(1)), MOTION)])
def test_speed_and_acceleration_are_those_of_the_frame_and_not_of_the_time_since_the_last(smoother: Smoother):
    time = 0.1 * np.arange(300)
    x, v, a = (part[20:-20] for part in smoother.rows(12.0 * time + 20.0 * np.sin(0.5 * time)))
    inner = time[20:-20]
    np.testing.assert_allclose(x, 12.0 * inner + 20.0 * np.sin(0.5 * inner), atol=0.01)
    # Half a frame late they would be off by up to 0.25 m/s and 0.13 m/s².
    np.testing.assert_allclose(v, 12.0 + 10.0 * np.cos(0.5 * inner), atol=0.02)
    np.testing.assert_allclose(a, -5.0 * np.sin(0.5 * inner), atol=0.06)


def test_what_has_travelled_is_where_constant_accelerations_lead():
    x, v, a = travelled(np.array([[2.0] * 11, [2.0, 0.0] + [0.0] * 9]))
    time = 0.1 * np.arange(11)
    np.testing.assert_allclose(x[0], time**2)
    np.testing.assert_allclose(v[0], 2.0 * time)
    np.testing.assert_allclose(x[1], np.where(time > 0.0, 0.01 + 0.2 * (time - 0.1), 0.0))
    np.testing.assert_allclose(a[1], [2.0, 1.0] + [0.0] * 9)


def test_no_other_filter_is_nearer_to_what_vehicles_did():
    truth, measured = measured_paths(800, 200, np.random.default_rng(3))
    off = {}
    for name, smoother in [("mean", posterior_mean(ERRORS, MOTION)), *((n, local_cubic(n)) for n in (11, 21, 31, 41))]:
        found = zip(smoother.rows(measured), truth, strict=True)
        off[name] = [np.sqrt(((one - true) ** 2).mean()) for one, true in found]
    best = np.array(off.pop("mean"))
    assert all((best < 1.01 * np.array(other)).all() for other in off.values())


def test_more_noise_asks_for_a_longer_cubic():
    assert window_for(0.0) == WINDOW
    windows = [window_for(noise) for noise in (0.05, 0.1, 0.2, 0.5, 5.0)]
    assert windows == sorted(windows)
    assert windows[-1] == LONGEST
    assert all(window % 2 for window in windows)
