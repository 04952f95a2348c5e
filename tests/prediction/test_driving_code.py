import numpy as np
import pytest

from idm_sumo.prediction.driving_code import SLOWEST, driving_code, features_of
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.perception import leaders_along
from tests.helpers.builders import Car, scenes

COLUMNS = ["mean_speed_m_s", "approach_rate_m_s", "offset_m", "time_headway_s", "leader_frames"]


def code_of(*cars, frames=None, **options):
    return driving_code(scenes(*cars, **options), frames).iloc[0]


def test_constant_traffic_in_numbers():
    y = np.full(40, US101.lane_center(3) + 0.4)
    code = code_of(Car(1, y=y, speed=8.0), Car(2, x=24.0, speed=8.0, length=4.0))
    assert list(code.index) == COLUMNS
    assert code.to_numpy() == pytest.approx([8.0, 0.0, 0.4, 20.0 / 8.0, 24])


def test_test_drivers_are_seen_for_their_first_frames_only():
    speed = np.where(np.arange(40) < 4, 8.0, 12.0)
    x = np.concatenate([[0.0], np.cumsum(speed[:-1] * 0.1)])
    some = scenes(Car(1, x=x, speed=speed), Car(2, x=24.0 + x, speed=10.0))
    observed, whole = driving_code(some, 4).iloc[0], driving_code(some).iloc[0]
    assert observed.mean_speed_m_s == pytest.approx(8.0)
    assert observed.approach_rate_m_s == pytest.approx(-2.0)
    assert observed.time_headway_s == pytest.approx(20.0 / 8.0)
    assert whole.mean_speed_m_s == pytest.approx((4 * 8.0 + 20 * 12.0) / 24)
    assert whole.time_headway_s == pytest.approx((4 * 20 / 8 + 20 * 20 / 12) / 24)  # a mean of headways
    assert (observed.leader_frames, whole.leader_frames) == (4, 24)


def test_headways_are_means_over_the_frames_with_a_leader():
    code = code_of(Car(1, speed=10.0), Car(2, x=24.0, speed=10.0, first_frame=11, frames=30))
    # At frame 11 our front is at 10 m, the leader's rear at 20 m.
    assert (code.leader_frames, code.time_headway_s) == (14, pytest.approx(1.0))


def test_without_a_leader_they_are_missing():
    code = code_of(Car(1), Car(2, x=30.0, lane=2), Car(3, x=-30.0))
    assert np.isnan(code.time_headway_s)
    assert np.isnan(code.approach_rate_m_s)
    assert (code.mean_speed_m_s, code.leader_frames) == (10.0, 0)


def test_at_walking_pace_the_headway_stays_finite():
    code = code_of(Car(1, speed=0.0), Car(2, x=7.0, speed=0.0))
    assert code.time_headway_s == pytest.approx(3.0 / SLOWEST)
    assert code_of(Car(1), Car(2, x=3.0)).time_headway_s == 0.0  # 1 m into it


def test_offset_and_leader_are_those_of_the_lane_at_each_frame():
    y = np.where(np.arange(40) < 12, US101.lane_center(3) + 0.2, US101.lane_center(2) - 0.4)
    code = code_of(Car(1, y=y, speed=10.0), Car(2, x=14.0, speed=10.0), Car(3, x=34.0, lane=2, speed=12.0))
    assert code.offset_m == pytest.approx(-0.1)
    gaps_in_lane_2 = 30.0 + 0.2 * np.arange(12, 24)
    assert code.time_headway_s == pytest.approx((12 * 1.0 + gaps_in_lane_2.sum() / 10.0) / 24)


def test_left_and_right_offsets_are_opposite():
    left, right = (code_of(Car(1, y=np.full(40, US101.lane_center(2) + d))).offset_m for d in (0.7, -0.7))
    assert left == pytest.approx(0.7) == -right


def test_from_the_headway_alone_with_the_median_length():
    headway = np.where(np.arange(40) < 20, 20.0, np.nan)
    code = code_of(Car(1, speed=10.0, headway=headway), has_leader_rows=False)
    assert code.time_headway_s == pytest.approx((20.0 - US101.car_length) / 10.0)
    assert (code.leader_frames, code.approach_rate_m_s) == (20, pytest.approx(0.0, abs=1e-9))


def test_leaders_along_a_path_of_ones_own():
    some = scenes(Car(1, x=10.0), Car(2, x=40.0, length=5.0), Car(3, x=60.0, lane=2, length=5.0))
    x = np.array([[20.0, 50.0, 21.0]])
    y = US101.lane_center([[3, 3, 2]])
    leader = leaders_along(some, x, y, 5)  # all are 5, 6, 7 m further by then
    np.testing.assert_allclose(leader.gap, [[40 + 5 - 5 - 20, np.inf, 60 + 7 - 5 - 21]])
    np.testing.assert_allclose(leader.speed, [[10.0, np.nan, 10.0]])


def test_the_papers_symbols():
    assert features_of(["nu", "omega", "tau"]) == ("mean_speed_m_s", "time_headway_s", "offset_m")
    assert features_of(["tau", "nu"], speed="relative") == ("offset_m", "approach_rate_m_s")
    with pytest.raises(InputError, match="feature 'mu': must be one of nu, omega, tau"):
        features_of(["nu", "mu"])
    with pytest.raises(InputError, match="speed = 'absolute'"):
        features_of(["nu"], speed="absolute")


@pytest.mark.parametrize("frames", [0, 25])
def test_more_frames_than_the_window_has_are_refused(frames):
    with pytest.raises(InputError, match=f"frames = {frames}: must be between 1 and the window's 24"):
        code_of(Car(1), frames=frames)
