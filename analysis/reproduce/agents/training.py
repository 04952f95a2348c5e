"""Agents trained into a folder, one a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from joblib import cpu_count

from idm_sumo.irl.learning import Lessons, train_agent
from idm_sumo.irl.reward import Reward
from idm_sumo.runtime.files import new_files
from idm_sumo.runtime.handover import handed_over, received
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.spread import gathered

AGENT = "irl_rl"


def train_agents(
    folder: Path,
    lessons: Lessons,
    reward: Reward,
    steps: int,
    seeds: Sequence[int],
    *,
    cluster: str | None = None,
    progress: Progress = silent,
) -> None:
    """Train the agents that a folder lacks, several at once.

    Parameters
    ----------
    folder : Path
        Workers find the lessons in it, and leave policies and checkpoints there; a checkpoint is continued.
    lessons : Lessons
        Training drivers in their traffic.
    reward : Reward
        Of a step.
    steps : int
        Environment steps of each agent.
    seeds : sequence of int
        One an agent.
    cluster : str, optional
        Address of a dask scheduler.
    progress : Progress
        Called as the work proceeds.

    Raises
    ------
    InputError
        If a training fails.
    """
    missing = [seed for seed in seeds if not (folder / f"{AGENT}-seed{seed}.npz").is_file()]
    jobs = min(len(missing), cpu_count())
    if jobs < 2 and cluster is None:
        for seed in missing:
            _train_one(folder, lessons, reward, steps, seed, progress)
        return
    progress("training agents", 0, len(missing))
    with handed_over(lessons, folder) as file:
        calls = [(file, folder.resolve(), reward, steps, seed) for seed in missing]
        gathered(
            _train_from, calls, jobs=jobs, cluster=cluster,
            done=lambda done: progress("training agents", done, len(missing)),
        )  # fmt: skip


def _train_from(file: Path, folder: Path, reward: Reward, steps: int, seed: int) -> None:
    """Train one agent by the lessons in a file."""
    _train_one(folder, received(file), reward, steps, seed)


def _train_one(
    folder: Path, lessons: Lessons, reward: Reward, steps: int, seed: int, progress: Progress = silent
) -> None:
    """Train the agent of one seed, from its checkpoint on."""
    from idm_sumo.irl.ppo import Training

    checkpoint = folder / f"{AGENT}-seed{seed}.pt"
    training = replace(Training(), steps=steps)
    policy, curve = train_agent(lessons, reward, training, seed=seed, checkpoint=checkpoint, progress=progress)
    with new_files([folder / f"{AGENT}-seed{seed}.{kind}" for kind in ("csv", "npz")]) as (table, arrays):
        curve.to_csv(table, index=False, float_format="%.6g")
        policy.write(arrays)
    checkpoint.unlink(missing_ok=True)
