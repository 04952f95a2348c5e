import numpy as np
import pytest

from idm_sumo.roads import US101
from idm_sumo.scenes.windows import LEADER_FROM_LANE, LEADER_OF_TWIN, TOO_SHORT, Window, build_scenes
from tests.helpers.builders import Car, recording

WINDOW = Window(observed=4, horizon=20)  # frames 0..3 observed, 3..23 simulated


@pytest.mark.parametrize(
    ("window", "start", "frames"),
    [
        (Window(), 9, 110),
        (Window(from_entry=True), 0, 101),
        (Window(observed=30, horizon=5, from_entry=True), 0, 30),
        (WINDOW, 3, 24),
    ],
)
def test_the_window_begins_at_the_last_observed_frame_or_at_entry(window, start, frames):
    assert (window.start, window.frames) == (start, frames)


def test_each_vehicle_gives_its_first_whole_window():
    scenes, excluded = build_scenes(
        recording(Car(1, x=5.0, lane=2, first_frame=7), Car(2, x=60.0, lane=4, length=np.nan, width=np.nan)), WINDOW
    )
    assert len(scenes) == 2
    assert scenes.vehicle.tolist() == [1, 2]
    assert scenes.first_frame.tolist() == [7, 1]
    assert scenes.lane.tolist() == [2, 4]
    assert scenes.x.shape == (2, 24)
    np.testing.assert_allclose(scenes.x[0], 5.0 + np.arange(24))
    np.testing.assert_allclose(scenes.y[1], US101.lane_center(4))
    assert scenes.size_known.tolist() == [True, False]
    assert scenes.length.tolist() == [4.0, US101.car_length]
    assert scenes.width.tolist() == [2.0, US101.car_width]
    assert (scenes.period, scenes.leader_source) == ("p1", LEADER_FROM_LANE)
    assert excluded.empty


def test_a_window_too_short_is_named():
    cars = Car(1), Car(2, frames=WINDOW.frames - 1), Car(3, frames=WINDOW.frames)
    scenes, excluded = build_scenes(recording(*cars), WINDOW)
    assert scenes.vehicle.tolist() == [1, 3]
    assert excluded.to_dict("records") == [{"period": "p1", "vehicle": 2, "reason": TOO_SHORT}]


def test_a_broken_trajectory_is_cut_from_its_longest_unbroken_part():
    broken = [Car(1, x=0.0, frames=10), Car(1, x=500.0, first_frame=12, frames=30)]
    scenes, _ = build_scenes(recording(*broken), WINDOW)
    assert scenes.first_frame.tolist() == [12]
    assert scenes.x[0, 0] == 500.0
    scenes, excluded = build_scenes(recording(broken[0], broken[1]._replace(frames=12)), WINDOW)
    assert len(scenes) == 0
    assert excluded["vehicle"].tolist() == [1]


def test_only_modelled_vehicles_are_drivers_and_all_are_traffic():
    scenes, excluded = build_scenes(recording(Car(1), Car(2), Car(3, frames=5)), WINDOW, modelled=[2])
    assert scenes.vehicle.tolist() == [2]
    assert set(scenes.traffic.vehicle) == {1, 2, 3}
    assert excluded.empty  # 3 is too short, and nobody asked for it


def test_every_cuts_several_windows():
    window = Window(observed=4, horizon=20, every=5)
    scenes, _ = build_scenes(recording(Car(1, frames=35), Car(2, frames=28)), window)
    assert scenes.vehicle.tolist() == [1, 1, 1, 2]  # 24 + 2 * 5 <= 35; 24 <= 28 < 29
    assert scenes.first_frame.tolist() == [1, 6, 11, 1]
    np.testing.assert_allclose(scenes.x[:3, 0], [0.0, 5.0, 10.0])
    np.testing.assert_array_equal(scenes.cell[:3], scenes.traffic.cell(3, [1, 6, 11]))


def test_the_lane_is_that_of_the_start_not_of_entry():
    y = np.concatenate([np.full(2, US101.lane_center(2)), np.full(38, US101.lane_center(3))])
    changer = Car(1, y=y)
    assert build_scenes(recording(changer), WINDOW)[0].lane.tolist() == [3]
    from_entry, _ = build_scenes(recording(changer), Window(observed=4, horizon=20, from_entry=True))
    assert from_entry.lane.tolist() == [2]


def test_a_subset_keeps_the_traffic():
    scenes, _ = build_scenes(recording(Car(1), Car(2, x=50.0), Car(3, x=90.0)), WINDOW)
    for which in (np.array([True, False, True]), np.array([0, 2])):
        some = scenes.subset(which)
        assert some.vehicle.tolist() == [1, 3]
        assert some.headway.shape == some.x.shape == (2, 24)
        np.testing.assert_array_equal(some.x, scenes.x[[0, 2]])
        assert some.traffic is scenes.traffic


def test_without_rows_of_the_leaders_each_twin_brings_its_own():
    headway = np.where(np.arange(40) < 30, 25.0, np.nan)
    cars = Car(1, x=0.0, headway=headway, speed=8.0), Car(2, x=7.0, speed=8.0)  # 2 sees nobody
    scenes, _ = build_scenes(recording(*cars, has_leader_rows=False), Window(observed=10, horizon=25))
    assert scenes.leader_source == LEADER_OF_TWIN
    t = scenes.traffic
    rows = [t.offsets[scenes.cell[0] + k] for k in range(35)]
    counts = np.diff(t.offsets)
    assert counts[scenes.cell[0] : scenes.cell[0] + 35].tolist() == [1] * 30 + [0] * 5
    assert counts[scenes.cell[1] : scenes.cell[1] + 35].sum() == 0
    np.testing.assert_allclose(t.x[rows[:30]], 25.0 + 0.8 * np.arange(30), atol=1e-9)
    np.testing.assert_allclose(t.speed[rows[:30]], 8.0, atol=1e-9)
    assert set(t.length) == {US101.car_length}
