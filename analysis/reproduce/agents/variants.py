"""Agents on rewards learned in several ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import cpu_count

from idm_sumo.evaluation.metrics import summary
from idm_sumo.irl import features
from idm_sumo.irl.inverse_control import LearnedReward
from idm_sumo.irl.learning import Lessons, lessons_of, require_rl, train_agent
from idm_sumo.irl.policy import drive_policy
from idm_sumo.irl.reward import Reward
from idm_sumo.irl.variants import VARIANTS, Variant, learn_variant
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.handover import handed_over, received
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.spread import gathered

from ..drivers import Drivers
from ..settings import Settings
from .study import sides

MEANS = ("ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "contacts")


def variants(
    settings: Settings,
    out: Path,
    *,
    which: Sequence[Variant] = VARIANTS,
    cluster: str | None = None,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Train and score an agent on every variant's reward.

    Parameters
    ----------
    settings : Settings
        Settings of the run; ``agent_steps`` and ``agent_seeds`` hold for every variant.
    out : Path
        CSV file to write.
    which : sequence of Variant
        The ways.
    cluster : str, optional
        Address of a dask scheduler whose workers train and score; all machines see the folder of ``out``.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    pandas.DataFrame
        One row a variant: means over seeds and test drivers, what the weights became, and the standard deviation
        of the ADE over seeds.

    Raises
    ------
    InputError
        If the extra ``rl`` is not installed, too few drivers keep moving, or a training fails.
    """
    require_rl()
    train, test = sides(settings, progress)
    lessons = lessons_of(train.scenes)
    rewards = _rewards(lessons, which, settings.seed, progress)
    seeds = range(settings.seed, settings.seed + settings.agent_seeds)
    with new_file(out) as part, handed_over((lessons, test), part.parent) as file:
        calls = [(file, reward, settings.agent_steps, seed) for _, reward in rewards for seed in seeds]
        scores = gathered(
            _train_and_score, calls, jobs=min(len(calls), cpu_count()), cluster=cluster,
            done=lambda done: progress("training agents", done, len(calls)),
        )  # fmt: skip
        by_variant = [scores[i : i + len(seeds)] for i in range(0, len(scores), len(seeds))]
        table = pd.DataFrame([_row(v, r[0], s) for v, r, s in zip(which, rewards, by_variant, strict=True)])
        table.to_csv(part, index=False, float_format="%.6g")
    return table


def _rewards(
    lessons: Lessons, which: Sequence[Variant], seed: int, progress: Progress
) -> list[tuple[LearnedReward, Reward]]:
    """Return each variant's reward; a penalty changes nothing learned."""
    known: dict[Variant, tuple[LearnedReward, Reward]] = {}
    found = []
    for done, variant in enumerate(which):
        progress("learning rewards", done, len(which))
        same = replace(variant, name="", penalty=0.0)
        if same not in known:
            known[same] = learn_variant(lessons, variant, seed=seed)
        learned, reward = known[same]
        found.append((learned, reward._replace(penalty=variant.penalty)))
    progress("learning rewards", len(which), len(which))
    return found


def _train_and_score(file: Path, reward: Reward, steps: int, seed: int) -> dict[str, float]:
    """Train an agent and score it on all test drivers."""
    from idm_sumo.irl.ppo import Training

    lessons: Lessons
    test: Drivers
    lessons, test = received(file)
    policy, _ = train_agent(lessons, reward, replace(Training(), steps=steps), seed=seed)
    driven = [drive_policy(scenes, policy) for scenes in test.scenes]
    left = [
        ((path.y > 0.0) | (path.y < -scenes.road.width)).any(axis=1)
        for scenes, path in zip(test.scenes, driven, strict=True)
    ]
    figures = summary(test.score(driven))
    return {name: figures[name] for name in (*MEANS, "vehicles")} | {"off_road": int(np.concatenate(left).sum())}


def _row(variant: Variant, learned: LearnedReward, scores: list[dict[str, float]]) -> dict[str, object]:
    """Return a variant's row: means over its seeds."""
    by_seed = pd.DataFrame(scores)
    weights = dict(zip((f"weight_{name}" for name in features.NAMES), learned.weights.tolist(), strict=True))
    return {
        "variant": variant.name,
        "demonstrations": learned.demonstrations,
        "converged": learned.converged,
        **by_seed.mean().to_dict(),
        "seeds": len(by_seed),
        "ade_seed_sd_m": by_seed["ade_m"].std(ddof=1),
        **weights,
    }
