"""Watching longer: a driver that stays the same is found out, one that changes is not believed, and nothing leaks."""

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.calibration.driver_table import check_drivers
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.prediction import MovingHorizon, RolloutPredictor, first_second, recent
from idm_sumo.prediction.driver_prediction import predict_through_rollout
from idm_sumo.prediction.moving_horizon import past
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.builders import Car
from tests.helpers.builders import scenes as build
from tests.helpers.known_drivers import draw_drivers, known_drivers

WATCHED = 150
PATHS = ("x", "y", "heading", "speed", "headway")


def watched(n, seed, drivers=None):
    """Return drivers whose parameters are their own, measured with noise, each watched for fifteen seconds."""
    scenes, theta = known_drivers(n, seconds=WATCHED / 10 + 9.1, noise=0.1, seed=seed, drivers=drivers)
    window = Window(observed=WATCHED, horizon=100)
    cut = {name: np.ascontiguousarray(getattr(scenes, name)[:, : window.frames]) for name in PATHS}
    return replace(scenes, window=window, **cut), theta


def changing(n, seed):
    """Return drivers that are replaced by somebody else when the simulation starts."""
    before, _ = watched(n, seed)
    theta, own = draw_drivers(n, np.random.default_rng(seed + 1000)), slice(before.start, before.window.frames)
    driven = drive_idm(before, theta)
    paths = {name: getattr(before, name).copy() for name in ("x", "y", "heading", "speed")}
    for name, values in paths.items():
        values[:, own] = getattr(driven, name)
    return replace(before, **paths)


def ade(scenes, theta):
    return displacement(scenes, drive_idm(scenes, theta)).mean()


@pytest.fixture(scope="module")
def training():
    return watched(120, 1)[0]


@pytest.fixture(scope="module")
def predictor(training):
    return RolloutPredictor().fit(recent(training, 10))


@pytest.fixture(scope="module")
def watcher(predictor, training):
    return MovingHorizon(predictor).fit(training)


def test_a_driver_that_stays_the_same_is_found_out_by_watching_it(watcher):
    scenes, _ = watched(80, 2)
    errors = [ade(scenes, watcher.predict(scenes, n)) for n in (10, 50, WATCHED)]
    assert errors[2] < errors[1] < errors[0]
    assert errors[2] < 0.75 * errors[0]
    assert watcher.strength_ >= 0.1


def test_a_past_that_says_nothing_of_the_future_is_not_believed():
    swapped = changing(120, 1)
    learned = MovingHorizon(RolloutPredictor(ridge=3.0, folds=3).fit(recent(swapped, 10))).fit(swapped)
    after = learned.ade_.mean(axis=1)
    assert learned.strength_ <= 0.01
    assert after[1.0] > 1.03 * after[0.0]


def test_without_strength_it_is_the_predictor_on_the_last_second(predictor, training):
    plain = MovingHorizon(predictor, strengths=(0.0,)).fit(training)
    scenes, _ = watched(20, 3)
    expected = predictor.predict_with_spread(first_second(recent(scenes, 10)))
    for frames in (10, 50, WATCHED):
        found = plain.predict_with_spread(scenes, frames)
        np.testing.assert_array_equal(found.theta, expected.theta)
        np.testing.assert_array_equal(found.covariance, expected.covariance)


def test_what_is_known_of_a_driver_grows(watcher):
    scenes, theta = watched(60, 4)
    first, last = (watcher.predict_with_spread(scenes, n) for n in (10, WATCHED))
    size = [np.linalg.slogdet(found.covariance)[1] for found in (first, last)]
    assert (size[1] < size[0]).mean() > 0.95
    off = np.log(last.theta[:, 2] / theta[:, 2])
    assert np.sqrt(np.mean(off**2)) < np.sqrt(np.mean(np.log(first.theta[:, 2] / theta[:, 2]) ** 2))


def test_the_future_is_not_seen(watcher):
    scenes, _ = watched(15, 5)
    paths = {name: getattr(scenes, name).copy() for name in PATHS}
    for values in paths.values():
        values[:, scenes.start + 1 :] += 5.0
    np.testing.assert_array_equal(watcher.predict(replace(scenes, **paths)), watcher.predict(scenes))


def test_drivers_do_not_touch_each_other(watcher):
    scenes, _ = watched(12, 6)
    together, alone = watcher.predict(scenes, 60), watcher.predict(scenes.subset(np.array([7])), 60)
    np.testing.assert_allclose(alone[0], together[7], rtol=1e-9)


def test_training_drivers_are_predicted_by_the_fold_that_left_them_out(watcher, training):
    apart, whole = watcher.predict_left_out(training, 10).theta, watcher.predict(training, 10)
    assert (np.abs(apart - whole).max(axis=1) > 1e-9).mean() > 0.9


def test_who_cannot_be_predicted_keeps_the_population(watcher, predictor):
    scenes, _ = watched(5, 7)
    speed = scenes.speed.copy()
    speed[:, scenes.start] = 0.0
    found = watcher.predict_with_spread(replace(scenes, speed=speed))
    assert set(found.status) == {"population: standing"}
    np.testing.assert_allclose(found.theta, np.tile(predictor.pooled_, (5, 1)))


def test_the_past_is_driven_from_its_first_frame_to_the_start(training):
    before, problem = past(training, 60)
    assert problem.target.shape == (len(training), 59)
    np.testing.assert_array_equal(before.x[:, 0], training.x[:, WATCHED - 60])
    np.testing.assert_array_equal(problem.target[:, -1], training.x[:, training.start])


def test_what_counts_of_the_past_ends_with_the_lane():
    window = Window(observed=30, horizon=20)
    lane = np.where(np.arange(window.frames) < 12, 2, 3)
    car = Car(1, frames=window.frames, y=US101.lane_center(lane))
    one = build(car, Car(2, x=30.0, frames=window.frames, lane=2), window=window)
    _, problem = past(one, 30)
    assert problem.rear[0, 0] == 26.0
    np.testing.assert_array_equal(problem.counted[0], np.arange(1, 30) < 12)


def test_too_short_a_past_is_said(watcher, predictor, training):
    with pytest.raises(InputError, match=f"frames = 200: must be between 1 and the {WATCHED}"):
        watcher.predict(training, 200)
    with pytest.raises(InputError, match="observed for 10 frames"):
        MovingHorizon(predictor).fit(recent(training, 10))


def test_the_table_says_how_much_the_past_counted(watcher):
    scenes, _ = watched(6, 8)
    table = predict_through_rollout(scenes, watcher)
    assert len(check_drivers(table)) == len(scenes)
    assert table["based_on"].str.contains(f"{WATCHED} frames").all()
    assert table["based_on"].str.endswith(f"those before the last 10 counting {watcher.strength_:g}").all()
    np.testing.assert_array_equal(table["T"], watcher.predict_left_out(scenes).theta[:, 2])
