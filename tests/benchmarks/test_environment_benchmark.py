"""How much faster many episodes side by side are than one environment in a plain loop, with PPO's updates in both."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from idm_sumo.irl.features import COUNT
from idm_sumo.irl.learning import Lessons, lessons_of, train_agent
from idm_sumo.irl.reward import Reward
from idm_sumo.scenes.windows import Scenes
from tests.helpers.irl_traffic import busy

ppo = pytest.importorskip("idm_sumo.irl.ppo", reason="needs the extra rl: pip install 'idm-sumo[rl]'")

REWARD = Reward(np.linspace(0.1, 1.0, COUNT), 0.0, 1.0)
TRAINING = ppo.Training(steps=8 * 128 * 50)
PLAIN_STEPS = 3200


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return busy(12)


@pytest.fixture(scope="module")
def lessons(scenes: Scenes) -> Lessons:
    found = lessons_of([scenes])
    train_agent(found, REWARD, replace(TRAINING, steps=1), seed=1)  # compiles
    return found


def _plain(scenes: Scenes, training: Any) -> Any:
    """Train on one environment with the same network and the same number of passes."""
    from stable_baselines3 import PPO

    from idm_sumo.irl.environment import ReplayEnv

    model = PPO(
        "MlpPolicy", ReplayEnv([scenes], REWARD), n_steps=1600, batch_size=training.batch, n_epochs=training.passes,
        seed=1,
        device="cpu", policy_kwargs={"net_arch": list(training.hidden)},
    )  # fmt: skip
    return model.learn(PLAIN_STEPS)


@pytest.mark.benchmark(group="environment steps with updates")
def test_side_by_side(benchmark: Any, lessons: Lessons) -> None:
    benchmark.pedantic(lambda: train_agent(lessons, REWARD, TRAINING, seed=1), rounds=1)
    benchmark.extra_info["steps_per_second"] = TRAINING.steps / benchmark.stats["min"]


@pytest.mark.benchmark(group="environment steps with updates")
def test_one_environment_in_a_plain_loop(benchmark: Any, scenes: Scenes, lessons: Lessons) -> None:
    benchmark.pedantic(lambda: _plain(scenes, TRAINING), rounds=1)
    benchmark.extra_info["steps_per_second"] = PLAIN_STEPS / benchmark.stats["min"]


def test_side_by_side_is_at_least_five_times_as_fast(benchmark: Any, scenes: Scenes, lessons: Lessons) -> None:
    from time import process_time

    def rate(steps: int, run: Any) -> float:
        begin = process_time()
        run()
        return steps / (process_time() - begin)

    def ratio() -> float:
        many = rate(TRAINING.steps, lambda: train_agent(lessons, REWARD, TRAINING, seed=1))
        return many / rate(PLAIN_STEPS, lambda: _plain(scenes, TRAINING))

    found = benchmark.pedantic(ratio, rounds=1)
    benchmark.extra_info["ratio"] = found
    assert found > 5
