"""Prediction through the rollout: a planted relation is found and uncertainty is honest."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from idm_sumo.calibration.driver_table import check_drivers
from idm_sumo.calibration.kernel import to_search
from idm_sumo.calibration.problem import prepare
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.models.idm import LOWER, UPPER
from idm_sumo.prediction import RolloutPredictor, first_second
from idm_sumo.prediction import statuses as rp
from idm_sumo.prediction.driver_prediction import drivers_of, predict_through_rollout
from idm_sumo.prediction.noise import ObservedScale, ResidualNoise
from idm_sumo.prediction.observation import ACCELERATION, APPROACH_RATE, GAP, LATERAL_SPEED, LEADER_ACCELERATION, SPEED
from idm_sumo.prediction.through_rollout import _derivatives, _values, fit_weights
from idm_sumo.runtime.errors import InputError
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.builders import Car
from tests.helpers.builders import scenes as build
from tests.helpers.known_drivers import known_drivers


def planted(n, seed):
    """Return drivers whose time headway is linear in their first speed, driven exactly, and that headway."""
    scenes, _ = known_drivers(n, seed=seed)
    theta = np.tile([1.2, 1.6, 1.0, 2.0, 0.0], (n, 1))
    theta[:, 2] = np.clip(0.4 + 0.12 * first_second(scenes)[SPEED], 0.2, 3.0)
    driven, own = drive_idm(scenes, theta), slice(scenes.start, scenes.start + scenes.window.horizon + 1)
    paths = {name: getattr(scenes, name).copy() for name in ("x", "y", "heading", "speed")}
    for name, values in paths.items():
        values[:, own] = getattr(driven, name)
    return replace(scenes, **paths), theta[:, 2]


@pytest.fixture(scope="module")
def training():
    return planted(150, 1)[0]


@pytest.fixture(scope="module")
def predictor(training):
    return RolloutPredictor(ridge=1e-3).fit(training)


def test_a_planted_relation_is_found_for_drivers_never_seen(predictor):
    scenes, headway = planted(80, 2)
    theta = predictor.predict(first_second(scenes))
    ade = displacement(scenes, drive_idm(scenes, theta)).mean()
    pooled = displacement(scenes, drive_idm(scenes, predictor.pooled_)).mean()
    assert ade < 0.4 * pooled
    assert np.corrcoef(theta[:, 2], headway)[0, 1] > 0.8


def test_drivers_all_alike_are_predicted_alike():
    scenes, _ = known_drivers(60, seed=5)
    driven, own = drive_idm(scenes, [1.2, 1.6, 1.3, 2.0, 0.0]), slice(scenes.start, None)
    paths = {name: getattr(scenes, name).copy() for name in ("x", "y", "heading", "speed")}
    for name, values in paths.items():
        values[:, own] = getattr(driven, name)
    same = replace(scenes, **paths)
    theta = RolloutPredictor().fit(same).predict(first_second(same))
    assert displacement(same, drive_idm(same, theta)).mean() < 0.1


def test_a_strong_ridge_is_the_pooled_driver(training):
    strong = RolloutPredictor(ridge=1e6).fit(training)
    z = to_search(strong.predict(first_second(training)))
    assert np.ptp(z, axis=0).max() < 1e-3
    np.testing.assert_allclose(z[0], to_search(np.asarray(strong.pooled_)), atol=0.1)


def test_the_gradient_is_that_of_the_objective(training):
    problem, rng = prepare(training), np.random.default_rng(0)
    phi = np.column_stack([np.ones(len(training)), rng.normal(size=(len(training), 2))])
    center, penalty, weights = to_search([1.2, 1.6, 1.2, 2.0, 1.0]), np.full(3, 0.1), rng.normal(0.0, 0.05, (3, 5))
    gradient, matrix = _derivatives([(problem, phi)], center, weights, penalty)
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    step = 1e-5
    moved = weights + step * np.eye(15).reshape(15, 3, 5)
    back = weights - step * np.eye(15).reshape(15, 3, 5)
    up, down = (_values([(problem, phi)], center, trials, penalty) for trials in (moved, back))
    np.testing.assert_allclose(gradient, (up - down) / (2 * step), rtol=2e-3, atol=2e-3)


def test_fitted_weights_beat_none(training):
    problem, phi = prepare(training), np.column_stack([np.ones(len(training)), first_second(training)[SPEED] / 10.0])
    center, penalty = to_search([1.2, 1.6, 1.2, 2.0, 0.5]), np.full(2, 1e-3)
    weights = fit_weights([problem], [phi], center, 1e-3)
    values = _values([(problem, phi)], center, np.stack([weights, np.zeros((2, 5))]), penalty)
    assert values[0] < 0.7 * values[1]


def test_what_cannot_be_predicted_is_the_population_and_says_so(predictor, training):
    code = first_second(training)[:5].copy()
    code.loc[1, [GAP, APPROACH_RATE]] = np.nan
    code.loc[2, ACCELERATION] = np.nan
    code.loc[3, SPEED] = 0.1
    code.loc[4, GAP] = 900.0
    found = predictor.predict_with_spread(code)
    assert found.status.tolist() == [rp.OK, rp.NO_LEADER, rp.ONE_FRAME, rp.STANDING, rp.OUTSIDE]
    np.testing.assert_allclose(found.theta[1:], np.tile(predictor.pooled_, (4, 1)))
    assert not np.allclose(found.theta[0], predictor.pooled_)
    np.testing.assert_array_equal(found.covariance[1:], np.tile(predictor.population_covariance_, (4, 1, 1)))


def test_a_handful_of_drivers_is_not_learned_from():
    scenes, _ = planted(6, 3)
    found = RolloutPredictor(folds=3).fit(scenes).predict_with_spread(first_second(scenes))
    assert set(found.status) == {rp.FEW}
    assert np.ptp(found.theta, axis=0).max() == 0.0


def test_training_drivers_are_predicted_by_weights_that_have_not_seen_them(predictor, training):
    apart, whole = predictor.predict_left_out(training).theta, predictor.predict(predictor.observe(training))
    assert (np.abs(apart - whole).max(axis=1) > 1e-9).mean() > 0.9
    stranger = replace(training, period=np.full(len(training), "another"))
    np.testing.assert_array_equal(predictor.predict_left_out(stranger).theta, whole)


def test_windows_of_one_driver_are_never_on_both_sides(training):
    twice = replace(training, vehicle=np.arange(len(training)) // 2)
    fitted = RolloutPredictor().fit(twice)
    assert fitted.drivers_ == 75
    assert fitted.windows_ == 150
    assert len(fitted.fold_of_driver_) == 75


def test_the_table_of_predictions_can_be_driven(predictor, training):
    table = predict_through_rollout(training, predictor)
    assert len(check_drivers(table)) == len(training)
    for name in ("a", "b", "T", "d0", "d1"):
        assert (table[f"{name}_low"] <= table[name] + 1e-9).all()
        assert (table[f"{name}_high"] >= table[name] - 1e-9).all()
        assert table[f"{name}_low"].min() >= getattr(LOWER, name)
        assert table[f"{name}_high"].max() <= getattr(UPPER, name)
    assert table["based_on"].str.contains("150 drivers").all()


def test_only_the_named_drivers_are_learned_from(training):
    table = pd.DataFrame({"period": training.period[:7], "vehicle": training.vehicle[:7]})
    assert drivers_of(training, table).vehicle.tolist() == training.vehicle[:7].tolist()
    with pytest.raises(InputError, match="none of its drivers"):
        drivers_of(training, table.assign(period="another"))


def test_settings_are_left_alone_and_columns_named(predictor, training):
    assert clone(predictor).get_params()["ridge"] == 1e-3
    with pytest.raises(InputError, match=f"no column '{GAP}'"):
        predictor.predict(first_second(training).drop(columns=GAP))


def test_a_table_and_its_values_are_the_same(predictor, training):
    code = first_second(training)
    np.testing.assert_array_equal(predictor.predict(code), predictor.predict(code.to_numpy()))
    np.testing.assert_allclose(predictor.predict(code[3:4])[0], predictor.predict(code)[3])


def test_intervals_of_normal_noise_cover_what_they_say():
    rng = np.random.default_rng(0)
    scale = rng.uniform(0.5, 2.0, (20_000, 3))
    noise = ResidualNoise.fit(*(values[:10_000] for values in (scale * rng.normal(size=scale.shape), scale)))
    fresh, s = scale[10_000:] * rng.normal(size=(10_000, 3)), scale[10_000:]
    for share in (0.5, 0.9):
        low, high = noise.interval(share, s)
        np.testing.assert_allclose(((fresh >= low) & (fresh <= high)).mean(axis=0), share, atol=0.015)
    exact = s.mean() / np.sqrt(np.pi)  # mean CRPS of a right normal forecast, Gneiting and Raftery (2007)
    assert noise.crps(fresh, s).mean() == pytest.approx(exact, rel=0.03)


def test_crps_punishes_a_spread_that_is_too_wide():
    rng = np.random.default_rng(1)
    noise = ResidualNoise.fit(rng.normal(size=(5000, 1)), np.ones((5000, 1)))
    fresh = rng.normal(size=(5000, 1))
    right, wide, narrow = (noise.crps(fresh, np.full((5000, 1), s)).mean() for s in (1.0, 3.0, 0.2))
    assert right < min(wide, narrow)


def test_the_first_second_is_read_off_the_motion():
    some = build(Car(1, speed=12.0), Car(2, x=30.0, speed=14.0))
    seen = first_second(some).iloc[0]
    assert seen[SPEED] == pytest.approx(12.0)
    assert seen[APPROACH_RATE] == pytest.approx(-2.0)
    assert seen[[ACCELERATION, LEADER_ACCELERATION, LATERAL_SPEED]].abs().max() < 1e-9
    assert first_second(some, 1)[ACCELERATION].isna().all()
    with pytest.raises(InputError, match="frames = 0"):
        first_second(some, 0)


def test_nobody_ahead_is_missing():
    seen = first_second(build(Car(1))).iloc[0]
    assert np.isnan(seen[GAP])
    assert np.isnan(seen[APPROACH_RATE])
    assert seen["leader_share"] == 0.0


def test_a_scale_that_depends_on_what_is_seen_is_found():
    rng = np.random.default_rng(2)
    seen = rng.normal(size=(6000, 2))
    residuals = np.exp(0.4 * seen[:, :1]) * rng.normal(size=(6000, 100))
    flat = np.ones_like(residuals)
    learned = ObservedScale.fit(seen[:3000], residuals[:3000], flat[:3000])
    np.testing.assert_allclose(learned.weights, [0.4, 0.0], atol=0.05)
    covered = []
    for scale in (flat, learned.factor(seen) * flat):
        noise = ResidualNoise.fit(residuals[:3000], scale[:3000])
        low, high = noise.interval(0.9, scale)
        inside = (residuals >= low) & (residuals <= high)
        covered.append([inside[3000:][which[3000:]].mean() for which in (seen[:, 0] < -1.0, seen[:, 0] > 1.0)])
    assert max(np.abs(np.array(covered[0]) - 0.9)) > 0.05
    np.testing.assert_allclose(covered[1], 0.9, atol=0.02)


def test_slow_drivers_are_predicted_to_within_less_if_they_were_in_training(predictor, training):
    some, usual = training.subset(np.arange(4)), predictor.observed_scale_
    prediction = predictor.predict_with_spread(first_second(some))
    predictor.observed_scale_ = ObservedScale(np.zeros(2))
    plain = predictor.scale(some, prediction)
    predictor.observed_scale_ = ObservedScale(np.array([0.5, 0.0]))
    by_speed = predictor.scale(some, prediction) / plain
    predictor.observed_scale_ = usual
    np.testing.assert_allclose(by_speed, by_speed[:, :1] * np.ones(by_speed.shape[1]))
    speed = first_second(some)[SPEED].to_numpy()
    np.testing.assert_array_equal(np.argsort(by_speed[:, 0]), np.argsort(speed))


def test_a_prediction_is_a_driver_table_that_can_be_driven(predictor, training):
    found = predictor.predict_left_out(training)
    table = found.to_pandas()
    assert check_drivers(table)[["period", "vehicle"]].equals(training.keys()[["period", "vehicle"]])
    assert (table["desired_speed_m_s"] == predictor.desired_speed_).all()
    np.testing.assert_array_equal(drive_idm(training, table).x, drive_idm(training, found.theta).x)
    assert len(repr(found)) < 80
