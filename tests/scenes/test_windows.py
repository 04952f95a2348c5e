from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from idm_sumo.evaluation.metrics import score
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import LEADER_FROM_LANE, LEADER_OF_RECORDED, TOO_SHORT, Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm
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
    scenes = build_scenes(
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
    assert (scenes.periods, scenes.leader_source) == (["p1"], LEADER_FROM_LANE)
    assert scenes.excluded.empty


def test_a_window_too_short_is_named():
    cars = Car(1), Car(2, frames=WINDOW.frames - 1), Car(3, frames=WINDOW.frames)
    scenes = build_scenes(recording(*cars), WINDOW)
    assert scenes.vehicle.tolist() == [1, 3]
    assert scenes.excluded.to_dict("records") == [{"period": "p1", "vehicle": 2, "reason": TOO_SHORT}]


def test_a_broken_trajectory_is_cut_from_its_longest_unbroken_part():
    broken = [Car(1, x=0.0, frames=10), Car(1, x=500.0, first_frame=12, frames=30)]
    scenes = build_scenes(recording(*broken), WINDOW)
    assert scenes.first_frame.tolist() == [12]
    assert scenes.x[0, 0] == 500.0
    scenes = build_scenes(recording(broken[0], broken[1]._replace(frames=12)), WINDOW)
    assert len(scenes) == 0
    assert scenes.excluded["vehicle"].tolist() == [1]


def test_only_modelled_vehicles_are_drivers_and_all_are_traffic():
    scenes = build_scenes(recording(Car(1), Car(2), Car(3, frames=5)), WINDOW, modelled=[2])
    assert scenes.vehicle.tolist() == [2]
    assert set(scenes.traffic.vehicle) == {1, 2, 3}
    assert scenes.excluded.empty  # 3 is too short, and nobody asked for it


def test_every_cuts_several_windows():
    window = Window(observed=4, horizon=20, every=5)
    scenes = build_scenes(recording(Car(1, frames=35), Car(2, frames=28)), window)
    assert scenes.vehicle.tolist() == [1, 1, 1, 2]  # 24 + 2 * 5 <= 35; 24 <= 28 < 29
    assert scenes.first_frame.tolist() == [1, 6, 11, 1]
    np.testing.assert_allclose(scenes.x[:3, 0], [0.0, 5.0, 10.0])
    np.testing.assert_array_equal(scenes.cell[:3], scenes.traffic.cell(3, [1, 6, 11]))


def test_the_lane_is_that_of_the_start_not_of_entry():
    y = np.concatenate([np.full(2, US101.lane_center(2)), np.full(38, US101.lane_center(3))])
    changer = Car(1, y=y)
    assert build_scenes(recording(changer), WINDOW).lane.tolist() == [3]
    from_entry = build_scenes(recording(changer), Window(observed=4, horizon=20, from_entry=True))
    assert from_entry.lane.tolist() == [2]


def test_a_subset_keeps_the_traffic():
    scenes = build_scenes(recording(Car(1), Car(2, x=50.0), Car(3, x=90.0)), WINDOW)
    for which in (np.array([True, False, True]), np.array([0, 2])):
        some = scenes.subset(which)
        assert some.vehicle.tolist() == [1, 3]
        assert some.headway.shape == some.x.shape == (2, 24)
        np.testing.assert_array_equal(some.x, scenes.x[[0, 2]])
        assert some.traffic is scenes.traffic


def test_without_rows_of_the_leaders_each_recorded_vehicle_brings_its_own():
    headway = np.where(np.arange(40) < 30, 25.0, np.nan)
    cars = Car(1, x=0.0, headway=headway, speed=8.0), Car(2, x=7.0, speed=8.0)  # 2 sees nobody
    scenes = build_scenes(recording(*cars, has_leader_rows=False), Window(observed=10, horizon=25))
    assert scenes.leader_source == LEADER_OF_RECORDED
    t = scenes.traffic
    rows = [t.offsets[scenes.cell[0] + k] for k in range(35)]
    counts = np.diff(t.offsets)
    assert counts[scenes.cell[0] : scenes.cell[0] + 35].tolist() == [1] * 30 + [0] * 5
    assert counts[scenes.cell[1] : scenes.cell[1] + 35].sum() == 0
    np.testing.assert_allclose(t.x[rows[:30]], 25.0 + 0.8 * np.arange(30), atol=1e-9)
    np.testing.assert_allclose(t.speed[rows[:30]], 8.0, atol=1e-9)
    assert set(t.length) == {US101.car_length}


def two_periods(**how):
    """The same numbers drive in both periods, elsewhere and at other frames."""
    first = recording(Car(1, x=0.0), Car(2, x=40.0, frames=5), Car(3, x=90.0, lane=2), **how)
    second = recording(Car(1, x=200.0, first_frame=5), Car(3, x=260.0, first_frame=5), **how)
    other = second.table.assign(period="p2")
    return Recording.from_table(
        pd.concat([first.table, other]), road=first.road, has_leader_rows=first.has_leader_rows, source="two"
    )


@pytest.mark.parametrize("has_leader_rows", [True, False])
def test_periods_are_kept_apart(has_leader_rows):
    both = two_periods(has_leader_rows=has_leader_rows)
    scenes = build_scenes(both, WINDOW)
    assert scenes.periods == ["p1", "p2"]
    assert scenes.keys().to_dict("list") == {
        "period": ["p1", "p1", "p2", "p2"], "vehicle": [1, 3, 1, 3], "first_frame": [1, 1, 5, 5],
    }  # fmt: skip
    assert scenes.excluded.to_dict("records") == [{"period": "p1", "vehicle": 2, "reason": TOO_SHORT}]
    together = drive_idm(scenes, TEXTBOOK)
    for part in scenes.by_period():
        alone = build_scenes(both.of_period(part.one_period), WINDOW)
        which = scenes.period == part.one_period
        for one in (part, alone):
            np.testing.assert_array_equal(one.x, scenes.x[which])
            np.testing.assert_array_equal(one.headway, scenes.headway[which])
            driven = drive_idm(one, TEXTBOOK)
            np.testing.assert_array_equal(driven.x, together.x[which])
            np.testing.assert_array_equal(driven.gap, together.gap[which])
            pd.testing.assert_frame_equal(score(one, driven), score(scenes, together)[which].reset_index(drop=True))


def test_what_plays_the_traffic_by_the_clock_takes_one_period():
    scenes = build_scenes(two_periods(), WINDOW)
    with pytest.raises(InputError, match=r"p1, p2: take one period at a time"):
        scenes.check_one_period()
    assert [part.one_period for part in scenes.by_period()] == ["p1", "p2"]


def test_vehicles_that_cleaning_found_unfit_are_traffic_and_named():
    whole = recording(Car(1), Car(2, x=50.0), Car(3, x=90.0))
    vehicles = pd.DataFrame({"period": "p1", "vehicle": [1, 2, 3], "reason": ["", "wrong leader", ""]})
    scenes = build_scenes(replace(whole, vehicles=vehicles), WINDOW)
    assert scenes.vehicle.tolist() == [1, 3]
    assert set(scenes.traffic.vehicle) == {1, 2, 3}
    assert scenes.excluded.to_dict("records") == [{"period": "p1", "vehicle": 2, "reason": "wrong leader"}]
    assert len(build_scenes(replace(whole, vehicles=vehicles), WINDOW, modelled=[2])) == 1


def test_some_vehicles_of_some_periods_are_named_by_a_table():
    wanted = pd.DataFrame({"period": ["p2"], "vehicle": [3]})
    scenes = build_scenes(two_periods(), WINDOW, modelled=wanted)
    assert scenes.keys().to_dict("list") == {"period": ["p2"], "vehicle": [3], "first_frame": [5]}


def test_scenes_as_a_table_and_in_one_line():
    scenes = build_scenes(two_periods(), WINDOW)
    table = scenes.to_pandas()
    assert len(table) == 4 * WINDOW.frames
    one = table[(table["period"] == "p2") & (table["vehicle"] == 3)]
    assert one["frame"].tolist() == list(range(5, 5 + WINDOW.frames))
    np.testing.assert_array_equal(one["x"], scenes.x[3])
    assert repr(scenes) == "<Scenes: 4 windows of 4 drivers, period p1, p2, 4 frames observed, 20 simulated>"
    assert repr(two_periods()) == f"<Recording two: 5 vehicles, {len(two_periods().table)} rows, period p1, p2>"
