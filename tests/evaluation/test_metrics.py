import numpy as np
import pandas as pd
import pytest

from idm_sumo.evaluation.metrics import displacement, is_critical, score, standard_error_name, summary
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Window
from idm_sumo.simulation.rollout import drive_constant_velocity, drive_idm
from tests.helpers.builders import Car, scenes, trajectories

STEPS = np.arange(21)
MIDDLE = float(US101.lane_center(3))


def scored(*cars, **path):
    some = scenes(*cars)
    return score(some, trajectories(some, **path)).iloc[0]


def test_the_twin_itself_has_no_error():
    row = scored(Car(1), Car(2, x=30.0))
    assert row[["ade_m", "fde_m", "speed_rmse_m_s", "gap_rmse_m"]].tolist() == [0, 0, 0, 0]
    assert row[["critical_ttc_share", "hard_acceleration_share", "lane_departure_share"]].tolist() == [0, 0, 0]
    assert row["jerk_rms_m_s3"] == pytest.approx(0, abs=1e-9)
    assert row["min_gap_m"] == pytest.approx(26.0)
    assert (row["period"], row["vehicle"], row["first_frame"]) == ("p1", 1, 1)
    assert not row["collision"]
    assert not row["at_fault"]


def test_displacement_is_euclidean_and_the_start_does_not_count():
    # 0.3 m a step ahead and 0.4 m a step to the left: 0.5 m a step.
    some = scenes(Car(1))
    path = trajectories(some, x=3.0 + 1.3 * STEPS, y=MIDDLE + 0.4 * STEPS)
    np.testing.assert_allclose(displacement(some, path), [0.5 * STEPS[1:]])
    row = score(some, path).iloc[0]
    assert row["ade_m"] == pytest.approx(0.5 * np.arange(1, 21).mean())
    assert row["fde_m"] == pytest.approx(10.0)
    # The paper's sum from t = 0 divided by T is the same number.
    assert row["ade_m"] == pytest.approx(np.hypot(0.3 * STEPS, 0.4 * STEPS).sum() / 20)


def test_errors_are_against_the_twin_from_the_start_of_the_simulation():
    x = np.concatenate([np.zeros(3), np.arange(37.0)])  # stands for three frames, then drives
    assert scored(Car(1, x=x), x=STEPS.astype(float))["ade_m"] == pytest.approx(0.0)


def test_speed_and_gap_errors():
    row = scored(Car(1), Car(2, x=30.0), x=3.0 + STEPS - 0.1 * STEPS, speed=np.full(21, 9.0))
    assert row["speed_rmse_m_s"] == pytest.approx(1.0)
    assert row["gap_rmse_m"] == pytest.approx(np.sqrt(np.mean((0.1 * STEPS[1:]) ** 2)))
    assert row["min_gap_m"] == pytest.approx(26.1)


def test_the_gap_is_compared_with_the_twins_own_leader_after_its_lane_change():
    y = np.where(np.arange(40) < 13, MIDDLE, US101.lane_center(2))  # the twin changes at step 10
    row = scored(Car(1, y=y), Car(2, x=30.0), Car(3, x=50.0, lane=2), y=np.full(21, MIDDLE))
    assert row["gap_rmse_m"] == pytest.approx(np.sqrt(11 / 20 * 20.0**2))


def test_without_a_leader_gaps_are_missing_and_counted():
    row = scored(Car(1), Car(2, x=30.0, lane=4))
    assert np.isnan(row["min_gap_m"])
    assert np.isnan(row["gap_rmse_m"])
    assert row["critical_ttc_share"] == 0
    total = summary(pd.DataFrame([row]))
    assert (total["vehicles"], total["vehicles_with_leader"]) == (1, 0)
    assert np.isnan(total["min_gap_m"])


def test_gap_errors_are_over_the_steps_in_which_both_have_a_leader():
    row = scored(Car(1), Car(2, x=30.0, frames=14), x=3.0 + STEPS - 1.0)
    assert row["gap_rmse_m"] == pytest.approx(1.0)


def test_time_to_collision():
    gap, rate = np.array([3.0, 3.0, 3.0, 1.0, -0.5, np.inf]), np.array([2.1, 1.9, -5.0, 0.0, -1.0, np.nan])
    assert is_critical(gap, rate).tolist() == [True, False, False, False, True, False]
    # 10 m/s towards a standing car: 26 m at step 0, below 15 m from step 12 on.
    row = scored(Car(1), Car(2, x=33.0, speed=0.0))
    assert row["critical_ttc_share"] == pytest.approx(9 / 20)
    assert row["min_gap_m"] == pytest.approx(6.0)


def test_the_gap_that_counts_is_that_of_the_lane_the_front_is_in():
    y = np.where(STEPS < 10, MIDDLE, US101.lane_center(2))
    row = scored(Car(1), Car(2, x=50.0), Car(3, x=20.0, lane=2), y=y)
    assert row["min_gap_m"] == pytest.approx(16.0)
    assert row["lane_departure_share"] == pytest.approx(11 / 20)


def test_min_gap_is_the_gap_the_model_saw():
    some = scenes(Car(1, speed=18.0), Car(2, x=40.0, speed=6.0))
    driven = drive_idm(some, TEXTBOOK)
    assert score(some, driven)["min_gap_m"][0] == pytest.approx(driven.gap[0, 1:].min(), abs=1e-12)


def test_hard_acceleration_and_jerk_are_those_that_took_place():
    speed = np.concatenate([np.full(5, 10.0), 10.0 - 0.31 * np.arange(1, 6), np.full(11, 10.0 - 1.55)])
    row = scored(Car(1), speed=speed)
    assert row["hard_acceleration_share"] == pytest.approx(5 / 20)
    assert row["jerk_rms_m_s3"] == pytest.approx(np.sqrt(2 * 31.0**2 / 19))
    # Told to brake at standstill a car neither moves nor jerks.
    some = scenes(Car(1, speed=0.0), Car(2, x=4.005, speed=0.0))
    driven = drive_idm(some, TEXTBOOK)
    assert np.all(driven.acceleration == -9.0)
    assert score(some, driven)["hard_acceleration_share"][0] == 0.0


def test_from_the_headway_alone():
    some = scenes(Car(1, headway=np.full(40, 20.0)), has_leader_rows=False)
    row = score(some, trajectories(some, x=3.0 + 1.2 * STEPS)).iloc[0]
    assert row["min_gap_m"] == pytest.approx(20.0 - US101.car_length - 4.0)
    assert row["gap_rmse_m"] == pytest.approx(np.sqrt(np.mean((0.2 * STEPS[1:]) ** 2)))


def scores_of(rows):
    """Build scores from ``(period, vehicle, ade, at_fault)``, everything else the same."""
    base = scored(Car(1), Car(2, x=30.0))
    return pd.DataFrame([{**base, "period": p, "vehicle": v, "ade_m": a, "at_fault": f, "collision": f}
                         for p, v, a, f in rows])  # fmt: skip


def test_the_standard_error_is_over_vehicles():
    total = summary(scores_of([("p1", 1, 1.0, False), ("p1", 2, 2.0, True), ("p2", 1, 6.0, False)]))
    assert total["ade_m"] == pytest.approx(3.0)
    assert total["ade_se_m"] == pytest.approx(np.std([1, 2, 6], ddof=1) / np.sqrt(3))
    assert (total["vehicles"], total["collisions"], total["contacts"]) == (3, 1, 1)


def test_windows_of_a_vehicle_are_averaged_within_it_first():
    rows = [("p1", 1, 1.0, True), ("p1", 1, 3.0, True), ("p1", 1, 5.0, False), ("p1", 2, 9.0, False)]
    total = summary(scores_of(rows))
    assert total["ade_m"] == pytest.approx(6.0)
    assert total["ade_se_m"] == pytest.approx(3.0)
    assert (total["vehicles"], total["collisions"]) == (2, 1)


def test_one_vehicle_has_no_standard_error():
    total = summary(scores_of([("p1", 1, 1.0, False)]))
    assert total["ade_m"] == 1.0
    assert np.isnan(total["ade_se_m"])


def test_a_broken_trajectory_is_not_averaged_away():
    assert np.isnan(summary(scores_of([("p1", 1, 1.0, False), ("p1", 2, np.nan, False)]))["ade_m"])


def test_columns_of_the_table_of_methods():
    some = scenes(Car(1, speed=15.0), Car(2, x=30.0, speed=8.0), modelled=(1, 2))
    total = summary(score(some, drive_constant_velocity(some)))
    assert {"ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "vehicles"} <= set(total)
    assert (total["collisions"], total["contacts"], total["vehicles"]) == (0, 0, 2)
    assert standard_error_name("jerk_rms_m_s3") == "jerk_rms_se_m_s3"
    assert standard_error_name("speed_rmse_m_s") == "speed_rmse_se_m_s"
    assert standard_error_name("critical_ttc_share") == "critical_ttc_share_se"


def test_no_drivers_no_figures():
    some = scenes(Car(1), Car(2, x=30.0)).subset(np.array([False]))
    total = summary(score(some, drive_idm(some, TEXTBOOK)))
    assert (total["vehicles"], total["collisions"]) == (0, 0)
    assert np.isnan(total["ade_m"])


def test_several_windows_of_a_real_rollout():
    window = Window(observed=4, horizon=20, every=5)
    some = scenes(Car(1, frames=60), Car(2, x=30.0, frames=60), window=window, modelled=(1, 2))
    scores = score(some, drive_idm(some, TEXTBOOK))
    assert len(scores) == 16
    assert summary(scores)["vehicles"] == 2
    expected = scores.groupby("vehicle")["ade_m"].mean()
    assert summary(scores)["ade_m"] == pytest.approx(expected.mean())
