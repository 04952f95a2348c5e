"""The environments keep their libraries' contracts and agree with each other."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra rl: pip install 'idm-sumo[rl]'")

from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_for_baselines

from idm_sumo.irl import ReplayEnv, ReplayVecEnv
from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.features import COUNT
from idm_sumo.irl.reward import PENALTY, Reward
from tests.helpers.builders import Car, scenes
from tests.helpers.irl_traffic import busy

REWARD = Reward(np.linspace(0.1, 1.0, COUNT), 0.0, 1.0)
HORIZON = 30


def _many(number: int, seed: int = 1) -> ReplayVecEnv:
    return ReplayVecEnv(*episodes_of([busy(6)]), REWARD, horizon=HORIZON, number=number, seed=seed)


def test_gymnasium_and_stable_baselines_find_nothing_wrong() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings(
            "ignore", message=".*(spec|infinity).*"
        )  # no registered name; observations have no bounds
        check_env(ReplayEnv([busy(4)], REWARD), skip_render_check=True)
        check_for_baselines(ReplayEnv([busy(4)], REWARD))


def test_same_seed_same_episode() -> None:
    environment = ReplayEnv([busy(6)], REWARD)
    first = [environment.reset(seed=seed)[1]["window"] for seed in (3, 3, 4, 5, 6)]
    assert first[0] == first[1]
    assert len(set(first)) > 1
    assert environment.reset(options={"window": 2})[1]["window"] == 2


def test_side_by_side_gives_what_one_alone_gives() -> None:
    many, single = _many(5), ReplayEnv([busy(6)], REWARD)
    rng = np.random.default_rng(0)
    seen = many.reset()
    windows = many.simulation.row.copy()
    actions = rng.uniform(-0.3, 0.3, (HORIZON, 5, 2)).astype(np.float32) * (1, 0.1)
    rewards, dones = [], []
    for action in actions:
        _, reward, done, _ = many.step(action)
        rewards.append(reward)
        dones.append(done)
    for i, window in enumerate(windows):
        assert single.reset(options={"window": window})[0] == pytest.approx(seen[i])
        for k in range(HORIZON):
            _, reward, ended, cut, _ = single.step(actions[k, i])
            assert reward == pytest.approx(rewards[k][i], rel=1e-5)
            assert (ended or cut) == dones[k][i]
            if ended or cut:
                break


def test_the_horizon_cuts_off_and_a_collision_ends() -> None:
    chosen = scenes(Car(1, 0.0, speed=20.0), Car(2, 12.0, speed=2.0))
    many = ReplayVecEnv(*episodes_of([chosen]), REWARD, horizon=20, number=2, seed=1)
    many.reset()
    for _ in range(20):
        _, rewards, dones, infos = many.step(np.array([[0.0, 0.0], [-1.0, 0.0]], dtype=np.float32))
        if dones[0]:
            assert infos[0]["episode"]["outcome"] == "collision"
            assert not infos[0]["TimeLimit.truncated"]
            assert rewards[0] < -PENALTY + 5
            assert infos[0]["terminal_observation"].shape == (16,)
            break
    else:
        pytest.fail("no collision")


def test_without_penalties_an_episode_lasts_to_the_horizon() -> None:
    chosen = scenes(Car(1, 0.0, speed=20.0), Car(2, 12.0, speed=2.0))
    environment = ReplayEnv([chosen], REWARD, penalties=False)
    environment.reset()
    results = [environment.step(np.zeros(2, dtype=np.float32)) for _ in range(20)]
    assert [ended for _, _, ended, _, _ in results] == [False] * 20
    assert [cut for _, _, _, cut, _ in results] == [False] * 19 + [True]
    assert results[-1][4]["outcome"] == "collision"
    assert min(reward for _, reward, _, _, _ in results) > -PENALTY


def test_state_is_taken_up_exactly() -> None:
    one, other = _many(8), _many(8, seed=99)
    one.reset()
    rng = np.random.default_rng(2)
    for _ in range(25):
        one.step(rng.uniform(-1, 1, (8, 2)).astype(np.float32))
    other.restore(one.state())
    for _ in range(40):
        action = rng.uniform(-1, 1, (8, 2)).astype(np.float32)
        for a, b in zip(one.step(action)[:3], other.step(action)[:3], strict=True):
            np.testing.assert_array_equal(a, b)
