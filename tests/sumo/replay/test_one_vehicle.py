"""Replays in SUMO agree with the compiled one."""

import os
from dataclasses import replace as changed

import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.simulation.rollout import Trajectories, drive_idm
from idm_sumo.sumo.replay.ghosts import replay_ghosts
from idm_sumo.sumo.replay.one_vehicle import replay
from idm_sumo.sumo.replay.perception import HAS_LEFT, OVERLAP, STRADDLES, compare_perception
from idm_sumo.sumo.replay.playback import play
from idm_sumo.sumo.surrogate.make import make_surrogate
from tests.helpers.replays import DRIVER, assert_same, crowd, vehicle

SHORT = Window(observed=2, horizon=30)


def scenes_of(*vehicles, window=SHORT, modelled=None, has_leader_rows=True) -> Scenes:
    recording = Recording.from_table(pd.concat(vehicles), road=US101, has_leader_rows=has_leader_rows)
    return build_scenes(recording, window, modelled=modelled)


def assert_back_ends_agree(scenes: Scenes, parameters=DRIVER) -> Trajectories:
    kernel = drive_idm(scenes, parameters)
    assert_same(replay(scenes, parameters), kernel)
    assert_same(replay_ghosts(scenes, parameters), kernel)
    return kernel


@pytest.mark.parametrize("seed", [0, 1])
def test_all_back_ends_agree_over_100_frames_of_awkward_traffic(seed) -> None:
    scenes = scenes_of(crowd(seed), window=Window())
    parameters = np.random.default_rng(seed).uniform([0.5, 0.5, 0.4, 1, 0], [3, 3, 2, 4, 2], (len(scenes), 5))
    kernel = assert_back_ends_agree(scenes, parameters)
    changes = (np.diff(kernel.leader, axis=1) != 0).any(axis=1)
    assert kernel.x.shape == (50, 101)
    assert changes.any()
    assert (kernel.gap < 0).any()  # overlapping cars are among them


def test_a_leader_farther_than_the_surroundings_is_perceived() -> None:
    kernel = assert_back_ends_agree(scenes_of(vehicle(1, 10.0, -2.0, 9.0), vehicle(2, 600.0, -2.0, 9.0), modelled=[1]))
    assert kernel.gap[0, 0] == pytest.approx(590 - 4.7)


def test_the_recorded_vehicle_is_not_there() -> None:
    fast = vehicle(1, 50.0, -2.0, 20.0)  # the model is slower than the recorded vehicle and would see it ahead
    kernel = assert_back_ends_agree(scenes_of(fast, vehicle(2, 100.0, -2.0, 5.0), vehicle(3, 130.0, -2.0, 5.0)))
    assert np.isinf(kernel.gap[2]).all()
    assert kernel.x[0, -1] < 50 + 20 * 3.0


def test_the_lane_stays_that_of_the_start_when_the_front_drifts_beyond_its_edge() -> None:
    edge = -US101.widths[0]
    drifting = vehicle(1, 20.0, edge + 0.02, 8.0, heading=-0.35)  # turned to the right, on lane 1's right edge
    kernel = assert_back_ends_agree(
        scenes_of(drifting, vehicle(2, 60.0, -1.8, 8.0), vehicle(3, 35.0, -5.5, 8.0), modelled=[1])
    )
    assert kernel.y.min() < edge - 0.1
    assert kernel.gap[0, 0] == pytest.approx(40 - 4.7)


@pytest.mark.parametrize("x", [150.0, 250.0, 360.0])
@pytest.mark.parametrize("y", [-5 * US101.widths[0] - 1.2, 0.9])
def test_who_is_recorded_beyond_the_outer_edges_counts_as_in_the_outer_lane(x, y) -> None:
    own = float(US101.lane_center(US101.lane_at(y)))
    kernel = assert_back_ends_agree(scenes_of(vehicle(1, x, own, 9.0), vehicle(2, x + 30, y, 9.0)))
    np.testing.assert_array_equal(kernel.leader[0] >= 0, True)


@pytest.mark.parametrize("line", range(1, US101.main_lanes))
def test_a_front_exactly_on_a_line_belongs_to_one_lane(line) -> None:
    y = -line * US101.widths[0]
    assert_back_ends_agree(
        scenes_of(
            vehicle(1, 170.0, y + 1.8, 9.0), vehicle(2, 170.0, y - 1.8, 9.0),
            vehicle(3, 190.0, y, 9.0), vehicle(4, 220.0, y, 9.0),
        )
    )  # fmt: skip


def test_a_leader_known_by_its_headway_may_change_and_vanish() -> None:
    headway = np.repeat([30.0, 12.0, 45.0, np.nan, 8.0], 8)  # cut-in, cut-out, none, cut-in
    changer = vehicle(1, 150.0, np.linspace(-2, -5, 40), 9.0, headway=headway)
    slower = vehicle(2, 380.0, -9.0, 6.0, headway=headway[::-1])
    window = Window(observed=1, horizon=39)
    scenes = scenes_of(changer, slower, window=window, has_leader_rows=False)
    assert scenes.leader_source == "twin"
    kernel = assert_back_ends_agree(scenes, (3.0, 1.0, 0.3, 1.0, 0.0))
    assert len(np.unique(kernel.leader >= 0)) == 2
    assert_same(replay_ghosts(scenes.subset(np.array([1])), DRIVER), drive_idm(scenes.subset(np.array([1])), DRIVER))


def test_a_leader_that_jumps_behind_is_the_leader_no_more() -> None:
    headway = np.r_[np.full(20, 25.0), np.full(20, -15.0)]
    jumping = vehicle(1, 100.0, -2.0, 9.0, headway=np.abs(headway))
    scenes = scenes_of(jumping, window=Window(observed=1, horizon=39), has_leader_rows=False)
    behind = scenes.traffic.x - np.where(np.arange(40) < 20, 0.0, 60.0)
    scenes = changed(scenes, traffic=changed(scenes.traffic, x=behind))
    kernel = assert_back_ends_agree(scenes)
    assert (kernel.leader[0] >= 0).sum() == 20


def test_windows_can_be_chosen_and_shared_among_processes() -> None:
    scenes = scenes_of(crowd(2, vehicles=12), window=Window(observed=2, horizon=20))
    parameters = np.random.default_rng(0).uniform([0.5, 0.5, 0.4, 1, 0], [3, 3, 2, 4, 2], (len(scenes), 5))
    seen = []
    whole = replay(scenes, parameters, jobs=2, progress=lambda _, done, total: seen.append((done, total)))
    assert_same(whole, drive_idm(scenes, parameters))
    assert seen[-1] == (12, 12)
    assert_same(replay_ghosts(scenes, parameters, jobs=2), whole)
    some = replay(scenes, parameters, which=np.array([7, 3]))
    np.testing.assert_array_equal(some.x, whole.x[[7, 3]])


def test_nobody_may_leave_the_network() -> None:
    with pytest.raises(InputError, match="vehicle 1 drives off the network"):
        replay(scenes_of(vehicle(1, np.full(40, 1120.0), -2.0, 24.0)), DRIVER)
    with pytest.raises(InputError, match=r"vehicle 2, frame 100: x = 9000 m is off the network, .* check units"):
        replay_ghosts(scenes_of(vehicle(1, 10.0, -2.0, 9.0), vehicle(2, 9000.0, -2.0, 9.0), modelled=[1]), DRIVER)


def test_perception_of_points_is_ours_in_every_frame() -> None:
    check = compare_perception(scenes_of(crowd(3)), as_points=True)
    assert check.compared == 50 * 112
    assert check.differences.empty


def test_every_difference_to_getleader_has_its_cause() -> None:
    check = compare_perception(scenes_of(crowd(3)))
    assert check.largest_gap_difference < 1.1e-3  # SUMO's own, in the last millimetre of an edge
    assert set(check.differences["cause"]) == {STRADDLES, HAS_LEFT, OVERLAP}
    assert (check.differences["ours"] != check.differences["sumo"]).all()


def test_a_truck_beside_a_car_in_one_lane_is_ordered_by_its_rear_in_sumo() -> None:
    truck, car, follower = vehicle(1, 60.0, -1.0, 9.0, length=15.0), vehicle(2, 57.0, -2.9, 9.0), vehicle(3, 40, -2, 9)
    found = compare_perception(scenes_of(truck, car, follower)).differences
    follows = found[found["vehicle"] == 3]
    assert (follows["ours"] == 2).all()
    assert (follows["sumo"] == 1).all()
    assert (follows["cause"] == OVERLAP).all()
    assert len(follows) == 39  # in the first frame they are in order of entry


def test_perception_is_not_compared_where_leaders_are_not_recorded() -> None:
    scenes = scenes_of(vehicle(1, 10.0, -2.0, 9.0, headway=20.0), has_leader_rows=False)
    with pytest.raises(InputError, match="does not hold the leaders"):
        compare_perception(scenes)


def test_a_whole_recording_plays_with_its_ramps_and_gaps() -> None:
    auxiliary = -5.5 * US101.widths[0]
    recording = Recording.from_table(
        pd.concat([
            vehicle(1, 150.0, auxiliary, 20.0, lane=np.where(np.arange(40) < 14, 7, 6)),
            vehicle(2, 350.0, auxiliary, 20.0, lane=np.where(np.arange(40) < 20, 6, 8)),
            vehicle(3, 100.0, 0.8, 10.0),  # its front beyond the left edge, a part of it still on the lane
            vehicle(4, 300.0, -9.0, 10.0),
            vehicle(4, 340.0, -9.0, 10.0, first=145),  # seen again
            vehicle(5, 100.0, -6 * US101.widths[0], 10.0),  # nowhere near a lane of its route
        ]), road=US101)  # fmt: skip
    played = play(recording)
    assert played.vehicles == 5
    assert played.rows == 240
    assert played.frames == 80
    assert played.largest_deviation <= 1e-9
    assert played.off_lane == 40
    assert played.other_lane <= 2  # the first two change lanes at a frame, SUMO at a place


def test_periods_are_played_one_by_one() -> None:
    table = pd.concat([vehicle(1, 10.0, -2.0, 9.0), vehicle(1, 10.0, -2.0, 9.0).assign(period="q")])
    with pytest.raises(InputError, match="play them one by one"):
        play(Recording.from_table(table, road=US101))


def test_2000_replays_leave_no_memory_behind() -> None:
    scenes = scenes_of(*(vehicle(n, 20.0 * n, -2.0, 9.0) for n in range(1, 5)), window=Window(observed=1, horizon=5))
    many = scenes.subset(np.zeros(2000, dtype=np.int64))
    at = {}

    def remember(_, done, total) -> None:
        with open("/proc/self/statm") as pages:
            at[done] = int(pages.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20

    if not os.path.exists("/proc/self/statm"):
        pytest.skip("memory is read from /proc/self/statm")
    replay(many, DRIVER, progress=remember)
    assert at[2000] - at[400] < 4  # MiB


def test_the_surrogate_replays_and_is_perceived_alike(tmp_path) -> None:
    make_surrogate(tmp_path / "surrogate.txt", minutes=0.5, seed=1)
    recording = smooth(clean(read_recording(tmp_path / "surrogate.txt")))
    scenes = build_scenes(recording.of_period(recording.periods[0]), Window())
    assert len(scenes) > 10
    assert_same(replay_ghosts(scenes, DRIVER), drive_idm(scenes, DRIVER))
    assert compare_perception(scenes, as_points=True).differences.empty
    check = compare_perception(scenes, every=5)
    assert 0 < len(check.differences) < 0.05 * check.compared
    assert set(check.differences["cause"]) <= {STRADDLES, HAS_LEFT, OVERLAP}


@pytest.mark.parametrize("period", range(3))
def test_the_dense_real_scenes_play_with_all_their_vehicles(shared_data, period) -> None:
    recording = read_recording(shared_data / "us101_scenes_smoothed.parquet")
    played = play(recording.of_period(recording.periods[period]))
    assert played.largest_deviation <= 1e-9
    assert played.off_lane == 0
    assert played.other_lane < 0.02 * played.rows
    assert played.vehicles > 10
