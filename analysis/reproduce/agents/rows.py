"""The paper's less constrained learner in the study: reward, agents of several seeds, clones, their rows."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, cpu_count, delayed

from idm_sumo.evaluation import risk
from idm_sumo.evaluation.metrics import summary
from idm_sumo.irl import approaches, simulation
from idm_sumo.irl.demonstrations import Demonstrations, rollout
from idm_sumo.irl.learning import (
    INSTALL,
    Lessons,
    clone_drivers,
    learn_reward,
    lessons_of,
    reward_of_json,
    rl_is_installed,
    train_agent,
)
from idm_sumo.irl.policy import Policy, drive_policy
from idm_sumo.irl.trajectory import step_features
from idm_sumo.runtime.cache import cache_folder
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.simulation.rollout import Trajectories

from ..drivers import Drivers
from ..settings import Settings

AGENT, CLONE = "irl_rl", "behaviour_cloning"
COUNTED = ("collisions", "contacts", "critical_ttc_vehicles")  # of a seed; the mean of seeds is no whole number
SPREAD = ("ade_m", "fde_m", "collisions")
LEFT_OUT = f"the row {AGENT} is left out; {INSTALL} adds what trains its agents"
CHECKED = 6  # test drivers whose actions are driven in SUMO too


@dataclass(frozen=True)
class Learners:
    """What was learned from the training drivers.

    Attributes
    ----------
    reward : dict
        See :meth:`idm_sumo.irl.learning.RewardReport.to_json`.
    policies : dict of str to tuple of Policy
        By method, one a seed; ``irl_rl`` is not there without the extra ``rl``.
    curve : pandas.DataFrame
        Learning curves, with a column ``seed``; empty without agents.
    missing : str
        What to install for the row that is missing, or empty.
    """

    reward: dict[str, Any]
    policies: dict[str, tuple[Policy, ...]]
    curve: pd.DataFrame
    missing: str


@dataclass(frozen=True)
class Agents:
    """Test drivers driven by what was learned, one entry a seed."""

    learners: Learners
    driven: dict[str, tuple[list[Trajectories], ...]]
    scores: dict[str, tuple[pd.DataFrame, ...]]
    sumo_difference_m: float


def learners_of(
    train: Drivers, settings: Settings, folder: Path | None = None, progress: Progress = silent
) -> Learners:
    """Learn reward, agents and clones, or take them from ``folder``, by default one in the user's cache.

    The cache's folder is named after the training drivers, the settings and the learner's own
    source, so that a changed one does not serve old agents. What is there already is not made
    again, and training goes on from its last checkpoint.
    """
    folder = folder or cache_folder() / f"agent-{fingerprint(train, settings)}"
    folder.mkdir(parents=True, exist_ok=True)
    seeds = range(settings.seed, settings.seed + settings.agent_seeds)
    wanted = [folder / f"{name}-seed{seed}.npz" for seed in seeds for name in (AGENT, CLONE)]
    lessons = None
    if not (folder / "reward.json").is_file() or not all(path.is_file() for path in wanted):
        progress("tracking the training drivers", 0, 1)
        lessons = lessons_of(train.scenes)
        progress("tracking the training drivers", 1, 1)
        _learn_reward(folder / "reward.json", lessons, settings, progress)
        _make_clones(folder, lessons, list(seeds))
        if rl_is_installed():
            _train(folder, lessons, settings, list(seeds), progress)
    return read_learners(folder)


def read_learners(folder: Path) -> Learners:
    """Read what :func:`learners_of` left in a folder.

    Raises
    ------
    InputError
        If it holds no reward or no policy.
    """
    policies = {
        name: tuple(Policy.load(path) for path in sorted(folder.glob(f"{name}-seed*.npz"))) for name in (AGENT, CLONE)
    }
    policies = {name: found for name, found in policies.items() if found}
    try:
        reward = json.loads((folder / "reward.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: holds no reward.json ({error}); make it with `idm-sumo irl train`") from None
    if not policies:
        raise InputError(f"{folder}: holds no policy; make one with `idm-sumo irl train`")
    curves = [pd.read_csv(path).assign(seed=_seed_of(path)) for path in sorted(folder.glob(f"{AGENT}-seed*.csv"))]
    missing = "" if AGENT in policies else LEFT_OUT
    return Learners(reward, policies, pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(), missing)


def _seed_of(path: Path) -> int:
    return int(path.stem.rpartition("seed")[2])


def fingerprint(train: Drivers, settings: Settings) -> str:
    """Return what names the agents of these drivers, settings and sources."""
    sources = [Path(risk.__file__), *sorted(Path(simulation.__file__).parent.glob("*.py"))]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources))
    digest.update(
        json.dumps([settings.agent_steps, settings.agent_demonstrations, settings.seed, settings.horizon]).encode()
    )
    for scenes in train.scenes:
        for array in (scenes.x, scenes.y, scenes.speed, scenes.vehicle, scenes.traffic.x, scenes.traffic.offsets):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(str(scenes.window).encode())
    return digest.hexdigest()[:12]


def _learn_reward(path: Path, lessons: Lessons, settings: Settings, progress: Progress) -> None:
    if path.is_file():
        return
    report = learn_reward(lessons, most=settings.agent_demonstrations, seed=settings.seed, progress=progress)
    with new_file(path) as part:
        part.write_text(json.dumps(report.to_json(), indent=2) + "\n", encoding="utf-8")


def _make_clones(folder: Path, lessons: Lessons, seeds: list[int]) -> None:
    for seed in seeds:
        path = folder / f"{CLONE}-seed{seed}.npz"
        if not path.is_file():
            clone_drivers(lessons, seed=seed).save(path)


def _train(folder: Path, lessons: Lessons, settings: Settings, seeds: list[int], progress: Progress) -> None:
    """Train the agents that are not there, side by side if there are several and the machine has the cores."""
    missing = [seed for seed in seeds if not (folder / f"{AGENT}-seed{seed}.npz").is_file()]
    processes = min(len(missing), cpu_count())
    if processes < 2:
        for seed in missing:
            train_one(folder, lessons, settings.agent_steps, seed, progress)
        return
    progress("training agents", 0, len(missing))
    tasks = (delayed(train_one)(folder, lessons, settings.agent_steps, seed) for seed in missing)
    for done, _ in enumerate(Parallel(n_jobs=processes, backend="loky", return_as="generator")(tasks)):
        progress("training agents", done + 1, len(missing))


def train_one(folder: Path, lessons: Lessons, steps: int, seed: int, progress: Progress = silent) -> None:
    """Train the agent of one seed on the folder's reward, from its checkpoint if there is one."""
    from idm_sumo.irl.ppo import Training

    reward = reward_of_json(json.loads((folder / "reward.json").read_text(encoding="utf-8")))
    checkpoint = folder / f"{AGENT}-seed{seed}.pt"
    training = replace(Training(), steps=steps)
    policy, curve = train_agent(lessons, reward, training, seed=seed, checkpoint=checkpoint, progress=progress)
    with new_file(folder / f"{AGENT}-seed{seed}.csv") as part:
        curve.to_csv(part, index=False, float_format="%.6g")
    policy.save(folder / f"{AGENT}-seed{seed}.npz")
    checkpoint.unlink(missing_ok=True)


def drive_agents(test: Drivers, learners: Learners, *, in_sumo: bool, progress: Progress = silent) -> Agents:
    """Drive the test drivers by every policy; with ``in_sumo`` also compare with SUMO on the same actions."""
    progress("driving by agents", 0, 1)
    driven = {
        name: tuple([drive_policy(scenes, policy) for scenes in test.scenes] for policy in policies)
        for name, policies in learners.policies.items()
    }
    scores = {name: tuple(test.score(trajectories) for trajectories in seeds) for name, seeds in driven.items()}
    difference = _sumo_difference(test, next(iter(driven.values()))[0]) if in_sumo else 0.0
    progress("driving by agents", 1, 1)
    return Agents(learners, driven, scores, difference)


def _sumo_difference(test: Drivers, driven: list[Trajectories]) -> float:
    """Return how far (m) SUMO and the kernels are apart at most, on the actions of a few test drivers."""
    from idm_sumo.sumo.replay.actions import replay_controls

    which = np.unique(np.linspace(0, len(test.scenes[0]) - 1, CHECKED).astype(np.int64))
    ours = driven[0].rows(which)
    theirs = replay_controls(test.scenes[0].subset(which), ours.acceleration, ours.steering)
    return float(np.hypot(theirs.x - ours.x, theirs.y - ours.y).max())


def missing_row(table: pd.DataFrame) -> str:
    """Return what to install if a table of methods has no row of agents, else nothing."""
    return "" if AGENT in set(table["method"]) else LEFT_OUT


def rows(agents: Agents) -> pd.DataFrame:
    """Return one row a method for the table of methods.

    Means are over seeds and vehicles, standard errors over vehicles (each vehicle's runs of
    different seeds averaged first). ``collisions`` and the other counts are means over seeds;
    ``seeds`` says how many, ``ade_seed_sd_m`` and so on how far seeds are apart (standard
    deviation).
    """
    table = []
    for name, scores in agents.scores.items():
        by_seed = pd.DataFrame([summary(score) for score in scores])
        figures: dict[str, Any] = dict(summary(pd.concat(scores, ignore_index=True)))
        figures |= {count: float(by_seed[count].mean()) for count in COUNTED}
        spread = by_seed[list(SPREAD)].std(ddof=1)
        figures |= {
            "seeds": len(scores), "ade_seed_sd_m": spread["ade_m"], "fde_seed_sd_m": spread["fde_m"],
            "collisions_seed_sd": spread["collisions"],
        }  # fmt: skip
        table.append({"method": name, **figures})
    return pd.DataFrame(table)


def by_seed(test: Drivers, agents: Agents) -> pd.DataFrame:
    """Return one row a method and seed: its figures, and how its runs are spread."""
    table = []
    for name, seeds in agents.scores.items():
        for policy, score, driven in zip(agents.learners.policies[name], seeds, agents.driven[name], strict=True):
            figures, clearance = summary(score), clearances(test, driven)["clearance_m"]
            table.append({
                "method": name, "seed": policy.facts["seed"],
                **{key: figures[key] for key in ("ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "contacts", "vehicles")},
                "ade_10th_m": score["ade_m"].quantile(0.1), "ade_90th_m": score["ade_m"].quantile(0.9),
                "ade_largest_m": score["ade_m"].max(), "brushes": int(((clearance > 0) & (clearance < 0.5)).sum()),
            })  # fmt: skip
    return pd.DataFrame(table)


def clearances(test: Drivers, driven: list[Trajectories]) -> pd.DataFrame:
    """Return the closest approach of every test driver; see :mod:`idm_sumo.irl.approaches`."""
    parts = [approaches.closest_approaches(s, t) for s, t in zip(test.scenes, driven, strict=True)]
    return pd.concat(parts, ignore_index=True)


def recorded_paths(test: Drivers) -> list[Trajectories]:
    """Return the recorded twins as if they had been driven, to hold closest approaches against."""
    paths = []
    for scenes in test.scenes:
        span = slice(scenes.start, scenes.start + scenes.window.horizon + 1)
        path = Trajectories.empty(len(scenes), scenes.window.horizon)
        for name in ("x", "y", "heading", "speed"):
            getattr(path, name)[:] = getattr(scenes, name)[:, span]
        paths.append(path)
    return paths


def rewards_a_step(test: Drivers, driven: list[Trajectories], reward: dict[str, Any]) -> tuple[float, float]:
    """Return the learned reward of a step, without penalties, of driven runs and of the recorded drivers, on average."""
    recorded = lessons_of(test.scenes)
    control = np.concatenate([np.stack([path.acceleration, path.steering], axis=2) for path in driven])
    modelled = Demonstrations(rollout(recorded.episodes, control), control, np.zeros(len(control)))
    weigh = reward_of_json(reward).of
    steps = (step_features(paths, recorded.episodes, recorded.around) for paths in (modelled, recorded.demonstrations))
    ours, theirs = (float(weigh(features).mean()) for features in steps)
    return ours, theirs


def weights_table(reward: dict[str, Any]) -> pd.DataFrame:
    """Return the learned weights, with and without the bound at zero."""
    wanted, free = reward["wanted"], reward["free"]
    return pd.DataFrame(
        [
            {
                "feature": name, "weight": wanted["weights"][name], "standard error": wanted["standard_errors"][name],
                "weight without bound": free["weights"][name], "its standard error": free["standard_errors"][name],
            }
            for name in reward["features"]
        ]
    )  # fmt: skip
