"""Training: repeats, goes on after being killed, gets better; cloning imitates."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from idm_sumo.irl import simulation as sim
from idm_sumo.irl.cloning import clone
from idm_sumo.irl.demonstrations import Demonstrations
from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.features import weights_from
from idm_sumo.irl.learning import Lessons, learn_reward, lessons_of, reward_of_json, train_agent
from idm_sumo.irl.policy import drive_policy
from idm_sumo.irl.reward import Reward
from idm_sumo.runtime.errors import InputError
from tests.helpers.irl_traffic import busy

REWARD = Reward(weights_from({"speed": 20.0, "acceleration": 0.05, "lane": 1.0, "steering": 0.1}), 10.0, 5.0)


@pytest.fixture(scope="module")
def lessons() -> Lessons:
    return lessons_of([busy(6)])


def _training(**changes: int) -> object:
    ppo = pytest.importorskip("idm_sumo.irl.ppo", reason="needs the extra rl: pip install 'idm-sumo[rl]'")
    small = ppo.Training(
        steps=4 * 16 * 20, episodes=16, rollout=20, batch=80, passes=2, hidden=(16,), checkpoint_every=1
    )
    return replace(small, **changes)


def _train(lessons: Lessons, training: object, **options: object):  # type: ignore[no-untyped-def]
    return train_agent(lessons, REWARD, training, seed=5, **options)  # type: ignore[arg-type]


def test_the_same_seed_gives_the_same_agent_and_another_another(lessons: Lessons) -> None:
    (one, curve), (same, _) = (_train(lessons, _training()) for _ in range(2))
    other, _ = train_agent(lessons, REWARD, _training(), seed=6)  # type: ignore[arg-type]
    np.testing.assert_array_equal(one.layers[0][0], same.layers[0][0])
    assert (one.layers[0][0] != other.layers[0][0]).any()
    assert curve["steps"].tolist() == [320, 640, 960, 1280]


def test_killed_and_resumed_ends_as_if_it_had_never_been_interrupted(lessons: Lessons, tmp_path: Path) -> None:
    whole, curve = _train(lessons, _training())

    class Killed(Exception):
        pass

    def kill(stage: str, done: float, total: float) -> None:
        if done == 3:  # two updates are in the checkpoint, the third is not
            raise Killed

    checkpoint = tmp_path / "agent.pt"
    with pytest.raises(Killed):
        _train(lessons, _training(), checkpoint=checkpoint, progress=kill)
    assert checkpoint.is_file()
    resumed, resumed_curve = _train(lessons, _training(), checkpoint=checkpoint)
    for (w, b), (v, c) in zip(whole.layers, resumed.layers, strict=True):
        np.testing.assert_array_equal(w, v)
        np.testing.assert_array_equal(b, c)
    assert resumed_curve.drop(columns="seconds").equals(curve.drop(columns="seconds"))


def test_a_checkpoint_of_other_settings_is_refused(lessons: Lessons, tmp_path: Path) -> None:
    checkpoint = tmp_path / "agent.pt"
    _train(lessons, _training(steps=320), checkpoint=checkpoint)
    with pytest.raises(InputError, match="other settings"):
        _train(lessons, _training(passes=3), checkpoint=checkpoint)
    checkpoint.write_bytes(b"half")
    with pytest.raises(InputError, match="cannot be read"):
        _train(lessons, _training(), checkpoint=checkpoint)


def test_an_agent_that_is_paid_for_speed_learns_to_speed_up(lessons: Lessons) -> None:
    chosen = busy(6)
    training = _training(steps=40 * 16 * 20, passes=4)
    policy, curve = _train(lessons, training)
    assert curve["mean_return"].iloc[-5:].mean() > curve["mean_return"].iloc[:5].mean()
    assert drive_policy(chosen, policy).speed[:, -1].mean() > chosen.speed[:, -1].mean() + 1.0


def test_a_clone_does_what_was_shown() -> None:
    episodes, around = episodes_of([busy(40)])
    rng = np.random.default_rng(0)
    control = np.zeros((40, 25, 2))
    state = np.empty((40, 26, 4))
    state[:] = (100.0, -9.0, 0.0, 10.0)
    state[:, :, 3] = rng.uniform(5, 15, (40, 1))
    control[:, :, 0] = 0.3 * (10.0 - state[:, :-1, 3])  # a driver who wants 10 m/s
    policy = clone(Demonstrations(state, control, np.zeros(40)), episodes, around, seed=1, epochs=150)
    seen = sim.observe_along(state[:, :1], episodes, around)[:, 0]
    assert policy(seen)[:, 0] * sim.ACCELERATION_LIMIT == pytest.approx(control[:, 0, 0], abs=0.3)
    assert policy.facts["kind"] == "cloning"


def test_a_reward_is_learned_from_lessons_and_survives_json(lessons: Lessons) -> None:
    report = learn_reward(lessons, most=4, steps=10, seed=1)
    assert report.wanted.demonstrations == 4
    assert (report.wanted.weights >= 0).all()
    again = reward_of_json(json.loads(json.dumps(report.to_json())))
    np.testing.assert_array_equal(again.weights, report.reward.weights)
    assert (again.shift, again.scale) == (report.reward.shift, report.reward.scale)


def test_core_works_without_the_extra_and_says_what_to_install() -> None:
    """In a fresh interpreter in which torch, stable-baselines3 and gymnasium cannot be imported."""
    code = """
import sys
from importlib.abc import MetaPathFinder
class Blocker(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("torch", "stable_baselines3", "gymnasium"):
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Blocker())
import pkgutil, importlib, idm_sumo, analysis
NEEDED = {"idm_sumo.irl.ppo", "idm_sumo.irl.vec_environment", "idm_sumo.irl.environment", "idm_sumo.__main__"}
for package in (idm_sumo, analysis):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if module.name not in NEEDED and not module.name.startswith(("idm_sumo.analysis", "idm_sumo.network")):
            importlib.import_module(module.name)
from idm_sumo.cli import main
main(["irl", "train", "surrogate", "-o", "never"])
"""
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "pip install 'idm-sumo[rl]'" in done.stderr
