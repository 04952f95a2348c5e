"""What is seen at a frame is told by the past alone."""

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.prediction import observation as o
from idm_sumo.prediction.past_only import LEADER_MEAN_ACCELERATION, MEAN_ACCELERATION, PastOnly, raw_paths
from tests.helpers.known_drivers import known_drivers


def noisy(n, seed, noise):
    """Return scenes with raw positions beside their exact ones."""
    scenes, _ = known_drivers(n, seed=seed)
    rng = np.random.default_rng(seed)
    raw = {name: getattr(scenes, name[-1]) + rng.normal(0.0, noise, scenes.x.shape) for name in ("raw_x", "raw_y")}
    traffic = replace(scenes.traffic, raw_x=scenes.traffic.x + rng.normal(0.0, noise, scenes.traffic.x.shape))
    return replace(scenes, traffic=traffic, **raw)


@pytest.fixture(scope="module")
def training():
    return noisy(300, 1, 0.02)


def test_speed_and_acceleration_are_those_of_exact_drivers():
    scenes, _ = known_drivers(200, seed=1)
    seen = PastOnly.fit([scenes]).first_second(known_drivers(50, seed=2)[0])
    exact = known_drivers(50, seed=2)[0]
    last = exact.window.observed - 1
    np.testing.assert_allclose(seen[o.SPEED], exact.speed[:, last], atol=0.03)
    acceleration = (exact.speed[:, last + 1] - exact.speed[:, last - 1]) / 0.2
    np.testing.assert_allclose(seen[o.ACCELERATION], acceleration, atol=0.3)
    assert np.corrcoef(seen[MEAN_ACCELERATION], acceleration)[0, 1] > 0.9


def test_noise_is_taken_for_what_it_is(training):
    past, fresh = PastOnly.fit([training]), noisy(200, 2, 0.02)
    exact = fresh.speed[:, fresh.window.observed - 1]
    differenced = (fresh.raw_x[:, 9] - fresh.raw_x[:, 8]) / 0.1
    off = past.first_second(fresh)[o.SPEED] - exact
    assert off.std() < 0.5 * (differenced - exact).std()


def test_what_comes_later_changes_nothing(training):
    past, last = PastOnly.fit([training]), training.window.observed - 1
    later = np.arange(training.x.shape[1]) > last
    moved = {name: np.where(later, getattr(training, name) + 5.0, getattr(training, name)) for name in
             ("x", "speed", "raw_x")}  # fmt: skip
    frame = np.repeat(np.arange(len(training.traffic.offsets) - 1), np.diff(training.traffic.offsets)) % len(later)
    traffic = replace(
        training.traffic,
        speed=np.where(later[frame], 0.0, training.traffic.speed),
        raw_x=np.where(later[frame], 0.0, training.traffic.raw_x),
    )
    changed = past.first_second(replace(training, traffic=traffic, **moved))
    np.testing.assert_array_equal(changed.to_numpy(), past.first_second(training).to_numpy())


def test_a_leader_is_followed_back_to_where_it_took_over(training):
    scenes = known_drivers(5, seed=3)[0]
    traffic = scenes.traffic
    frame = np.repeat(np.arange(len(traffic.offsets) - 1), np.diff(traffic.offsets)) % scenes.x.shape[1]
    cut_in = replace(traffic, x=np.where(frame < 6, traffic.x + 40.0, traffic.x))
    rear = raw_paths(replace(scenes, traffic=cut_in), 10).rear
    assert np.isnan(rear[:, :6]).all()
    assert np.isfinite(rear[:, 6:]).all()
    seen = PastOnly.fit([training]).first_second(replace(scenes, traffic=cut_in))
    assert np.isfinite(seen[o.LEADER_ACCELERATION]).all()
    assert seen[LEADER_MEAN_ACCELERATION].isna().all()


def test_one_frame_tells_no_rate(training):
    one = replace(training, window=replace(training.window, observed=1))
    seen = PastOnly.fit([one]).first_second(one)
    assert seen[o.ACCELERATION].isna().all()
    np.testing.assert_allclose(seen[o.SPEED], one.speed[:, 0])
