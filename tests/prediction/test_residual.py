"""The residual: what is planted is found, nothing looks ahead, and nothing added is the pooled driver."""

from dataclasses import replace

import numpy as np
import pytest
from sklearn.base import clone

from idm_sumo.calibration.problem import prepare
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.models.idm import IDMParameters
from idm_sumo.models.residual import REGRESSORS
from idm_sumo.prediction import ResidualPredictor, drive_residual
from idm_sumo.prediction import statuses as st
from idm_sumo.prediction.residual_drive import ResidualDrivers, ResidualModel
from idm_sumo.prediction.residual_fit import Part, fit_residual, own_numbers
from idm_sumo.prediction.residual_rollout import Shared, costs_and_derivatives, errors_of
from idm_sumo.runtime.errors import InputError
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.known_drivers import known_drivers

POOLED = IDMParameters(1.2, 1.6, 1.2, 2.0, 0.0)
CENTER, SCALE = np.array([8.0, 2.5, 0.0, 2.0, 0.0]), np.array([3.0, 0.6, 1.0, 0.7, 0.6])
SHARED = Shared(np.asarray(POOLED), CENTER, SCALE)


def weights_of(rng, size=0.08):
    return rng.normal(0.0, size, REGRESSORS)


def planted(n, seed):
    """Return drivers with one residual for all, and a lasting and fading part that their first speed tells."""
    scenes, _ = known_drivers(n, seed=seed)
    rng = np.random.default_rng(0)
    first = (scenes.speed[:, scenes.start] - 8.0) / 3.0
    own = np.column_stack([0.1 * first, 0.4 * first, np.full(n, -0.2)])
    model = ResidualModel(POOLED, weights_of(rng, 0.04), CENTER, SCALE, float(scenes.road.speed_limit), 10)
    drivers = ResidualDrivers(model, own, np.zeros(n), np.full(n, st.OK), scenes.keys())
    driven = drive_residual(scenes, drivers)
    paths = {name: getattr(scenes, name).copy() for name in ("x", "y", "heading", "speed")}
    for name, values in paths.items():
        values[:, scenes.start :] = getattr(driven, name)
    return replace(scenes, **paths)


@pytest.fixture(scope="module")
def training():
    return planted(200, 1)


@pytest.fixture(scope="module")
def predictor(training):
    return ResidualPredictor().fit(training)


def test_known_weights_are_recovered():
    scenes, _ = known_drivers(300, seed=4)
    problem, rng = prepare(scenes), np.random.default_rng(1)
    phi = np.column_stack([np.ones(300), rng.normal(size=(300, 2))])
    weights = np.concatenate([weights_of(rng, 0.05), rng.normal(0.0, 0.1, 9)])
    own, start = own_numbers(weights, phi), np.zeros(300)
    driven = errors_of(problem, SHARED, weights[None, :REGRESSORS], own, start)
    exact = problem._replace(target=problem.target + driven, lateral=np.zeros_like(problem.lateral))
    parts, found = [Part(exact, phi, start, np.zeros(300, dtype=np.int64))], np.zeros(len(weights))
    for _ in range(6):
        found = fit_residual(parts, SHARED, 1e-9, found)
    left = errors_of(exact, SHARED, found[None, :REGRESSORS], own_numbers(found, phi), start)
    plain = errors_of(exact, SHARED, np.zeros((1, REGRESSORS)), np.zeros((300, 3)), start)
    assert np.abs(left).mean() < 0.05 * np.abs(plain).mean()
    assert np.corrcoef(found[REGRESSORS:], weights[REGRESSORS:])[0, 1] > 0.95


def test_the_gradient_is_that_of_the_rollout():
    scenes, _ = known_drivers(20, seed=5)
    problem, rng = prepare(scenes), np.random.default_rng(2)
    weights, own, start = weights_of(rng)[None], rng.normal(0.0, 0.2, (20, 3)), rng.normal(0.0, 0.3, 20)
    _, gradient, matrix = costs_and_derivatives(problem, SHARED, weights, own, start, 1e-3)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9
    step = 1e-6
    for j in range(REGRESSORS + 3):
        sides = []
        for sign in (1.0, -1.0):
            w, c = weights.copy(), own.copy()
            (w if j < REGRESSORS else c)[:, j if j < REGRESSORS else j - REGRESSORS] += sign * step
            sides.append(costs_and_derivatives(problem, SHARED, w, c, start, 1e-3)[0])
        np.testing.assert_allclose(gradient[:, j], (sides[0] - sides[1]) / (2.0 * step), rtol=1e-3, atol=1e-3)


def test_nothing_added_is_the_pooled_driver_exactly(training):
    model = ResidualModel(POOLED, np.zeros(REGRESSORS), CENTER, SCALE, float(training.road.speed_limit), 10)
    n = len(training)
    drivers = ResidualDrivers(model, np.zeros((n, 3)), np.zeros(n), np.full(n, st.OK), training.keys())
    pooled = drive_idm(training, POOLED)
    driven = drive_residual(training, drivers)
    for name in ("x", "y", "speed", "acceleration", "gap"):
        np.testing.assert_array_equal(getattr(driven, name), getattr(pooled, name))


def test_the_fitted_rollout_is_what_is_driven(predictor, training):
    drivers = predictor.predict(training)
    problem = prepare(training)
    errors = errors_of(
        problem, predictor.model_.shared, drivers.shared_weights(), drivers.own, drivers.leader_acceleration
    )
    own = slice(training.start + 1, training.start + 1 + training.window.horizon)
    np.testing.assert_allclose(drive_residual(training, drivers).x[:, 1:] - training.x[:, own], errors, atol=1e-9)


def test_a_planted_residual_is_found_for_drivers_never_seen(predictor):
    fresh = planted(100, 2)
    ade = displacement(fresh, drive_residual(fresh, predictor.predict(fresh))).mean()
    pooled = displacement(fresh, drive_idm(fresh, predictor.pooled_)).mean()
    assert ade < 0.5 * pooled


def test_a_strong_ridge_is_the_pooled_driver(training):
    strong = ResidualPredictor(ridges=(1e9,)).fit(training)
    driven = drive_residual(training, strong.predict(training))
    np.testing.assert_allclose(driven.x, drive_idm(training, strong.pooled_).x, atol=1e-3)


def test_what_comes_later_changes_no_prediction(predictor, training):
    last = training.window.observed - 1
    later = np.arange(training.x.shape[1]) > last
    frame = np.repeat(np.arange(len(training.traffic.offsets) - 1), np.diff(training.traffic.offsets)) % len(later)
    changed = replace(
        training,
        x=np.where(later, training.x + 3.0, training.x),
        speed=np.where(later, 0.0, training.speed),
        traffic=replace(training.traffic, speed=np.where(later[frame], 0.0, training.traffic.speed)),
    )
    one, other = predictor.predict(training), predictor.predict(changed)
    np.testing.assert_array_equal(one.own, other.own)
    np.testing.assert_array_equal(one.leader_acceleration, other.leader_acceleration)


def test_the_leaders_future_enters_only_as_it_comes(predictor, training):
    drivers, frames = predictor.predict(training), training.x.shape[1]
    moment = training.start + 40
    frame = np.repeat(np.arange(len(training.traffic.offsets) - 1), np.diff(training.traffic.offsets)) % frames
    braking = replace(training.traffic, speed=np.where(frame > moment, 0.0, training.traffic.speed))
    one, other = (drive_residual(s, drivers) for s in (training, replace(training, traffic=braking)))
    np.testing.assert_array_equal(one.acceleration[:, :41], other.acceleration[:, :41])
    assert (one.acceleration[:, 41] != other.acceleration[:, 41]).any()


def test_the_order_of_drivers_does_not_matter(predictor, training):
    order = np.random.default_rng(3).permutation(len(training))
    mixed = training.subset(order)
    np.testing.assert_array_equal(predictor.predict(mixed).own, predictor.predict(training).own[order])
    one = ResidualPredictor(ridges=(0.01,), one_for_all=POOLED)
    np.testing.assert_allclose(clone(one).fit(mixed).weights_, one.fit(training).weights_, atol=1e-6)


def test_training_drivers_are_predicted_by_weights_that_have_not_seen_them(predictor, training):
    apart, whole = predictor.predict_left_out(training), predictor.predict(training)
    assert (np.abs(apart.own - whole.own).max(axis=1) > 1e-9).mean() > 0.9
    stranger = replace(training, period=np.full(len(training), "another"))
    np.testing.assert_allclose(predictor.predict_left_out(stranger).own, whole.own, atol=1e-12)


def test_what_cannot_be_predicted_is_the_pooled_driver_and_says_so(predictor, training):
    alone = replace(training.traffic, offsets=np.zeros_like(training.traffic.offsets))
    few = replace(training.subset(np.arange(3)), traffic=alone)
    found = predictor.predict(few)
    assert set(found.status) == {st.NO_LEADER}
    np.testing.assert_array_equal(drive_residual(few, found).x, drive_idm(few, predictor.pooled_).x)
    handful = ResidualPredictor(folds=3).fit(training.subset(np.arange(6)))
    assert set(handful.predict(training).status) == {st.FEW}


def test_intervals_hold_what_they_promise(predictor):
    fresh = planted(300, 6)
    driven, scale = drive_residual(fresh, predictor.predict(fresh)), predictor.scale(fresh)
    own = slice(fresh.start + 1, fresh.start + 1 + fresh.window.horizon)
    off = fresh.x[:, own] - driven.x[:, 1:]
    for share in (0.5, 0.9):
        low, high = predictor.noise_.interval(share, scale)
        assert ((off >= low) & (off <= high))[:, 20:].mean() == pytest.approx(share, abs=0.08)


def test_a_shorter_past_needs_its_own_fit(predictor, training):
    short = replace(training, window=replace(training.window, observed=5))
    with pytest.raises(InputError, match="fitted to 10"):
        predictor.predict(short)


def test_the_model_outlives_a_file(predictor):
    again = ResidualModel.from_json(predictor.model_.to_json())
    np.testing.assert_array_equal(again.weights, predictor.model_.weights)
    assert again.pooled == predictor.model_.pooled
    for text in ("", "{}", predictor.model_.to_json().replace("[", "[[", 1).replace("]", "]]", 1)):
        with pytest.raises(InputError, match="residual_model"):
            ResidualModel.from_json(text)
