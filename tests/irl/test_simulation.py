"""The agent's world: what it sees, how it moves, when it has failed; alone, side by side and in SUMO."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.irl import simulation as sim
from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.policy import Policy, drive_policy
from idm_sumo.irl.reward import ALIVE, PENALTY, WORST, Reward
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import drive_constant_velocity
from idm_sumo.sumo.replay.actions import replay_controls
from tests.helpers.builders import Car, scenes
from tests.helpers.irl_traffic import busy, drive_controls


def _start(chosen: Scenes) -> sim.Simulation:
    return sim.Simulation(*episodes_of([chosen]), np.arange(len(chosen)))


def test_observation_of_a_scene_counted_by_hand() -> None:
    ahead, behind = Car(2, 24.0, speed=12.0, length=5.0), Car(3, -14.0, speed=9.0)
    left, right = Car(4, 34.0, lane=2), Car(5, -9.0, lane=4, speed=11.0)
    y = float(US101.lane_center(3)) + 0.5
    seen = _start(scenes(Car(1, 0.0, y=np.full(40, y)), ahead, behind, left, right)).observation[0]
    dt = 3 * FRAME_STEP  # the builders' windows start at their fourth frame
    assert seen[0] == pytest.approx(10 / US101.speed_limit)
    assert seen[1] == pytest.approx(0.5 / US101.widths[0], abs=1e-6)
    assert seen[2] == 0.0
    assert seen[3] == pytest.approx(-y / US101.width)
    gaps = [24 + 2 * dt - 5, 10 + 1 * dt]  # to the leader's rear; from the own rear (4 m long) to the follower's front
    assert seen[4:8] == pytest.approx([gaps[0] / (gaps[0] + 20), 0.2, gaps[1] / (gaps[1] + 20), -0.1], abs=1e-6)
    assert seen[8:12] == pytest.approx([30 / 50, 0.0, 1.0, 0.0], abs=1e-6)
    beside = 5 - dt
    assert seen[12:16] == pytest.approx([1.0, 0.0, beside / (beside + 20), 0.1], abs=1e-6)


def test_the_twin_is_not_there() -> None:
    assert _start(scenes(Car(1, 0.0))).observation[0, 4:] == pytest.approx([1.0, 0.0] * 6)


def test_no_lane_beyond_the_edges() -> None:
    leftmost = _start(scenes(Car(1, 0.0, lane=1), Car(2, 20.0, lane=2))).observation[0]
    assert leftmost[8:12] == pytest.approx([1, 0, 1, 0])
    assert leftmost[12] < 1


def test_constant_velocity_is_the_action_zero() -> None:
    chosen = busy(3)
    zero = np.zeros((3, chosen.window.horizon))
    driven, expected = drive_controls(chosen, zero, zero), drive_constant_velocity(chosen)
    assert driven.x == pytest.approx(expected.x)
    assert driven.y == pytest.approx(expected.y)


def test_side_by_side_is_what_each_is_alone() -> None:
    chosen = busy(4)
    rng = np.random.default_rng(1)
    acceleration, steering = rng.normal(0, 1, (4, 30)), rng.normal(0, 0.01, (4, 30))
    together = drive_controls(chosen, acceleration, steering)
    for i in range(4):
        alone = drive_controls(chosen.subset(np.array([i])), acceleration[i : i + 1], steering[i : i + 1])
        np.testing.assert_array_equal(alone.x[0], together.x[i])
        np.testing.assert_array_equal(alone.heading[0], together.heading[i])


@pytest.mark.parametrize("has_leader_rows", [True, False])
def test_sumo_agrees_on_the_same_actions_within_a_millimetre(has_leader_rows: bool) -> None:
    chosen = busy(3, has_leader_rows=has_leader_rows)
    rng = np.random.default_rng(1)
    acceleration = np.clip(rng.normal(0, 1.5, (3, 30)), -sim.ACCELERATION_LIMIT, sim.ACCELERATION_LIMIT)
    steering = np.clip(rng.normal(0, 0.02, (3, 30)), -sim.STEERING_LIMIT, sim.STEERING_LIMIT)
    steering[2] = 0.02  # leaves its lane
    ours, theirs = (drive(chosen, acceleration, steering) for drive in (drive_controls, replay_controls))
    assert np.abs(ours.y[2] - ours.y[2, 0]).max() > US101.widths[0] / 2
    assert np.hypot(ours.x - theirs.x, ours.y - theirs.y).max() < 1e-3
    assert np.abs(ours.heading - theirs.heading).max() < 1e-6


def test_a_collision_and_leaving_the_road_are_noticed() -> None:
    chosen = scenes(Car(1, 0.0, speed=20.0), Car(2, 12.0, speed=2.0))
    world = _start(chosen)
    for _ in range(10):
        world.advance(np.zeros((1, 2)))
    assert world.status[0] == sim.COLLIDED
    world = _start(scenes(Car(1, 0.0, lane=1)))
    for _ in range(20):
        world.advance(np.array([[0.0, 1.0]]))
    assert world.status[0] == sim.OFF_ROAD


def test_an_overlap_of_the_start_is_no_collision() -> None:
    world = _start(scenes(Car(1, 0.0), Car(2, 2.0)))
    world.advance(np.zeros((1, 2)))
    assert world.status[0] == sim.RUNNING


def test_actions_are_clipped_to_their_limits() -> None:
    world = _start(scenes(Car(1, 0.0)))
    world.advance(np.array([[9.0, -9.0]]))
    assert world.control[0] == pytest.approx([sim.ACCELERATION_LIMIT, -sim.STEERING_LIMIT])
    assert sim.actions_of([[2.5, 0.1]])[0] == pytest.approx([0.5, 1.0])


def test_reward_is_linear_and_penalties_are_for_training_only() -> None:
    rng = np.random.default_rng(0)
    recorded = rng.normal(size=(50, 30, 7))
    weights = rng.uniform(0, 2, 7)
    reward = Reward.brought_to_scale(weights, recorded)
    assert reward.of(recorded).mean() == pytest.approx(ALIVE, abs=0.01)
    assert reward.of(recorded).std() == pytest.approx(1.0, abs=0.05)
    one, other = recorded[0, :2]
    difference = reward.of(one) - reward.of(other)
    assert difference == pytest.approx((one - other) @ weights / reward.scale)
    status = np.array([sim.RUNNING, sim.COLLIDED, sim.OFF_ROAD])
    trained = reward.in_training(recorded[0, :3], status)
    assert trained == pytest.approx(reward.of(recorded[0, :3]) - [0, PENALTY, PENALTY])
    assert reward.of(np.full((1, 7), -1e9))[0] == WORST


def test_a_policy_drives_and_survives_the_disk(tmp_path) -> None:  # type: ignore[no-untyped-def]
    layers = ((np.zeros((sim.OBSERVATIONS, 3)), np.zeros(3)), (np.zeros((3, 2)), np.array([0.2, 0.0])))
    policy = Policy(layers, {"kind": "irl_rl", "seed": 3})
    driven = drive_policy(busy(2), policy)
    assert driven.acceleration == pytest.approx(1.0)
    policy.save(tmp_path / "policy.npz")
    again = Policy.load(tmp_path / "policy.npz")
    assert again.facts == {"kind": "irl_rl", "seed": 3}
    np.testing.assert_array_equal(drive_policy(busy(2), again).x, driven.x)


def test_what_is_no_policy_is_refused_in_one_line(tmp_path) -> None:  # type: ignore[no-untyped-def]
    from idm_sumo.runtime.errors import InputError

    (tmp_path / "policy.npz").write_text("no")
    with pytest.raises(InputError, match="not a file of arrays"):
        Policy.load(tmp_path / "policy.npz")
