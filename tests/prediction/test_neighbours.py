"""The paper's nearest neighbours, as scikit-learn and by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.utils.estimator_checks import parametrize_with_checks

from idm_sumo.models import idm
from idm_sumo.models.idm import LOWER, TEXTBOOK, UPPER
from idm_sumo.prediction import KNNPredictor, average_parameters, first_gap_parameters, predict_drivers
from idm_sumo.prediction.driving_code import FEATURES, driving_code
from idm_sumo.roads.units import FOOT
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.builders import Car, scenes
from tests.helpers.known_drivers import known_drivers

NAMES = list(FEATURES.values())


@pytest.fixture
def drivers():
    rng = np.random.default_rng(3)
    codes = pd.DataFrame(rng.normal([10, 2, 0], [3, 1, 0.4], (60, 3)), columns=NAMES)
    return codes, rng.uniform(LOWER, UPPER, (60, 5))


@parametrize_with_checks([KNNPredictor(), KNNPredictor(n_neighbors=3, features=None)])
def test_is_a_scikit_learn_estimator(estimator, check):
    check(estimator)


def test_is_the_mean_of_the_nearest_standardised_codes(drivers):
    codes, theta = drivers
    predicted = KNNPredictor(n_neighbors=8).fit(codes[:40], theta[:40]).predict(codes[40:])
    train, test = codes[:40].to_numpy(), codes[40:].to_numpy()
    scaled = [(values - train.mean(axis=0)) / train.std(axis=0) for values in (train, test)]
    for row, expected in zip(scaled[1], predicted, strict=True):
        nearest = np.argsort(((scaled[0] - row) ** 2).sum(axis=1))[:8]
        np.testing.assert_allclose(expected, theta[nearest].mean(axis=0), rtol=1e-12)


def test_a_single_neighbour_gives_every_training_driver_itself(drivers):
    codes, theta = drivers
    np.testing.assert_array_equal(KNNPredictor(n_neighbors=1).fit(codes, theta).predict(codes), theta)


def test_all_neighbours_give_the_average(drivers):
    codes, theta = drivers
    predicted = KNNPredictor(n_neighbors=60).fit(codes, theta).predict(codes[:3])
    np.testing.assert_allclose(predicted, np.tile(average_parameters(theta), (3, 1)), rtol=1e-12)


def test_the_unit_of_a_feature_does_not_matter(drivers):
    codes, theta = drivers
    expected = KNNPredictor().fit(codes[:40], theta[:40]).predict(codes[40:])
    in_feet = codes * [1.0, 1.0, 1 / FOOT]
    np.testing.assert_allclose(KNNPredictor().fit(in_feet[:40], theta[:40]).predict(in_feet[40:]), expected)


def test_only_the_chosen_features_count(drivers):
    codes, theta = drivers
    predictor = KNNPredictor(features=("time_headway_s",)).fit(codes, theta)
    assert predictor.n_features_in_ == 1
    scrambled = codes.assign(mean_speed_m_s=0.0, offset_m=9.0)
    np.testing.assert_array_equal(predictor.predict(scrambled), predictor.predict(codes))
    with pytest.raises(InputError, match="no column 'time_headway_s'"):
        predictor.predict(codes.drop(columns="time_headway_s"))


def test_a_missing_headway_takes_the_training_mean_and_is_counted(drivers):
    codes, theta = drivers
    with_gaps = codes.copy()
    with_gaps.loc[[2, 5], "time_headway_s"] = np.nan
    predictor = KNNPredictor().fit(with_gaps, theta)
    assert predictor.imputed_.tolist() == [0, 2, 0]
    blind = codes[:4].assign(time_headway_s=np.nan)
    assert predictor.missing(blind).tolist() == [0, 4, 0]
    average = codes[:4].assign(time_headway_s=with_gaps["time_headway_s"].mean())
    np.testing.assert_array_equal(predictor.predict(blind), predictor.predict(average))


def test_a_feature_nobody_has_is_left_out_of_account(drivers):
    codes, theta = drivers
    blind = codes.assign(time_headway_s=np.nan)
    expected = KNNPredictor(features=("mean_speed_m_s", "offset_m")).fit(codes, theta).predict(codes)
    np.testing.assert_allclose(KNNPredictor().fit(blind, theta).predict(blind), expected)


def test_more_neighbours_than_drivers_are_refused(drivers):
    codes, theta = drivers
    with pytest.raises(InputError, match="n_neighbors = 61: only n_samples = 60 training drivers"):
        KNNPredictor(n_neighbors=61).fit(codes, theta)


def test_fitting_leaves_the_settings_alone(drivers):
    predictor = KNNPredictor(n_neighbors=5, features=("offset_m",)).fit(*drivers)
    assert clone(predictor).get_params() == {"n_neighbors": 5, "features": ("offset_m",)}


def test_from_scenes_to_parameters(drivers):
    _, theta = drivers
    cars = [Car(i + 1, x=30.0 * i, speed=10.0) for i in range(9)]
    code = driving_code(scenes(*cars, modelled=tuple(range(1, 10))))
    predictor = KNNPredictor(n_neighbors=9).fit(code, theta[:9])
    assert predictor.imputed_.tolist() == [0, 1, 0]  # the first car has nobody ahead
    np.testing.assert_allclose(predictor.predict(code), np.tile(theta[:9].mean(axis=0), (9, 1)))


def test_average_parameters_have_names():
    assert average_parameters([[1, 2, 1, 2, 0], [3, 2, 2, 4, 1]]) == (2.0, 2.0, 1.5, 3.0, 0.5)
    assert average_parameters([[1, 2, 1, 2, 0], [3, 2, 2, 4, 1]]).T == 1.5


POOLED = TEXTBOOK._replace(d1=1.5)


@given(st.floats(0.5, 24.0), st.floats(1.0, 150.0))
def test_keeping_the_first_gap_means_starting_in_equilibrium(speed, gap):
    some = scenes_with(speed, gap)
    theta = first_gap_parameters(some, POOLED)
    T = theta[0, 2]
    assert theta[0, [0, 1, 3, 4]].tolist() == [POOLED.a, POOLED.b, POOLED.d0, POOLED.d1]
    assert LOWER.T <= T <= UPPER.T
    at_start = idm.acceleration(speed, 0.0, gap, *theta[0], US101.speed_limit)
    if LOWER.T < T < UPPER.T:
        assert at_start == pytest.approx(0.0, abs=1e-9)
    else:
        assert (at_start < 0) == (T == LOWER.T)


BASE = scenes(Car(1), Car(2, x=20.0))


def scenes_with(speed, gap):
    """Return a follower at ``speed`` and a gap (m), without another pass through the table's checks."""
    x = np.where(np.arange(24) == 3, BASE.traffic.x[BASE.traffic.offsets[BASE.cell[0] + 3] + 1] - 4.0 - gap, 0.0)
    return replace(BASE, speed=np.full((1, 24), speed), x=x[None])


def test_a_driver_in_equilibrium_stays_there():
    some = scenes(Car(1, speed=12.0), Car(2, x=30.0, speed=12.0))
    driven = drive_idm(some, first_gap_parameters(some, POOLED))
    np.testing.assert_allclose(driven.gap, 26.0, atol=1e-9)
    np.testing.assert_allclose(driven.speed, 12.0, atol=1e-9)


@pytest.mark.parametrize(
    "cars", [(Car(1),), (Car(1, speed=0.0), Car(2, x=10.0, speed=0.0)), (Car(1, speed=26.0), Car(2, x=40.0))],
    ids=["no leader", "standing", "faster than desired"],
)  # fmt: skip
def test_where_no_headway_does_it_the_pooled_one_stays(cars):
    np.testing.assert_array_equal(first_gap_parameters(scenes(*cars), POOLED), [POOLED])


def test_the_library_tells_what_a_driver_wants_to_drive():
    some, theta = known_drivers(30, seed=2)
    library = some.keys().assign(**dict(zip(idm.IDMParameters._fields, theta.T, strict=True))).join(driving_code(some))
    foreseen = predict_drivers(some, library.assign(desired_speed_m_s=0.1 * 311), observed=10, neighbours=7)
    assert (foreseen["desired_speed_m_s"] == 0.1 * 311).all()
    wanted = np.linspace(25.0, 40.0, len(library))
    foreseen = predict_drivers(some, library.assign(desired_speed_m_s=wanted), observed=10, neighbours=7)
    assert foreseen["desired_speed_m_s"].between(25.0, 40.0).all()
    assert foreseen["desired_speed_m_s"].nunique() > 1
    without = predict_drivers(some, library, observed=10, neighbours=7)
    assert (without["desired_speed_m_s"] == US101.speed_limit).all()
    np.testing.assert_array_equal(without["T"], foreseen["T"])
