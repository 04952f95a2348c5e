"""Reward, agents and clones, learned into folders."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.evaluation import risk
from idm_sumo.irl import simulation
from idm_sumo.irl.learning import (
    CURVE,
    INSTALL,
    Lessons,
    clone_drivers,
    learn_reward,
    lessons_of,
    reward_of_json,
    rl_is_installed,
)
from idm_sumo.irl.policy import Policy
from idm_sumo.runtime.cache import cache_folder
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_files
from idm_sumo.runtime.inputs import parse_json, read_text
from idm_sumo.runtime.progress import Progress, silent

from ..drivers import Drivers
from ..settings import Settings
from .training import AGENT, train_agents

MARK = "drivers.json"  # of a folder: the fingerprint of what was learned from
CLONE = "behaviour_cloning"
LEFT_OUT = f"the row {AGENT} is left out; {INSTALL} installs what its training needs"


@dataclass(frozen=True)
class Learners:
    """What was learned from the training drivers.

    Attributes
    ----------
    reward : dict
        See :meth:`idm_sumo.irl.learning.RewardReport.to_json`.
    policies : dict of str to tuple of Policy
        By method, one a seed; without the extra ``rl`` there is no ``irl_rl``.
    curve : pandas.DataFrame
        Learning curves, with a column ``seed``; empty without agents.
    missing : str
        How to install what a missing row needs, or empty.
    """

    reward: dict[str, Any]
    policies: dict[str, tuple[Policy, ...]]
    curve: pd.DataFrame
    missing: str


def learners_of(
    train: Drivers,
    settings: Settings,
    folder: Path | None = None,
    progress: Progress = silent,
    *,
    cluster: str | None = None,
) -> Learners:
    """Learn reward, agents and clones, or read what exists.

    The default folder is named after the training drivers, the settings and the source code of the
    learner, so that a change of any of them starts again. What is in the folder is not made again, and
    training continues from its last checkpoint.

    Parameters
    ----------
    train : Drivers
        Training drivers.
    settings : Settings
        Settings of the run.
    folder : Path, optional
        Folder of the results, by default one in the user's cache.
    progress : Progress
        Called as the work proceeds.
    cluster : str, optional
        Address of a dask scheduler whose workers train the agents; all machines see the folder.

    Returns
    -------
    Learners
        Reward and policies.

    Raises
    ------
    InputError
        If the folder holds what was learned from other drivers, settings or code.
    """
    identity = {"drivers": fingerprint(train, settings)}
    folder = folder or cache_folder() / f"agent-{identity['drivers']}"
    _check_same(folder, identity)
    seeds = range(settings.seed, settings.seed + settings.agent_seeds)
    wanted = [folder / f"{name}-seed{seed}.npz" for seed in seeds for name in (AGENT, CLONE)]
    lessons = None
    if not (folder / "reward.json").is_file() or not all(path.is_file() for path in wanted):
        progress("tracking the training drivers", 0, 1)
        lessons = lessons_of(train.scenes)
        progress("tracking the training drivers", 1, 1)
        _learn_reward(folder, identity, lessons, settings, progress)
        _make_clones(folder, lessons, list(seeds))
        if rl_is_installed():
            reward = reward_of_json(read_reward(folder / "reward.json"))
            train_agents(folder, lessons, reward, settings.agent_steps, seeds, cluster=cluster, progress=progress)
    return read_learners(folder)


def read_learners(folder: Path) -> Learners:
    """Read the folder that :func:`learners_of` wrote.

    Parameters
    ----------
    folder : Path
        Folder to read.

    Returns
    -------
    Learners
        Reward and policies.

    Raises
    ------
    InputError
        If it holds no reward or no policy.
    """
    policies = {
        name: tuple(Policy.load(path) for path in sorted(folder.glob(f"{name}-seed*.npz"))) for name in (AGENT, CLONE)
    }
    policies = {name: found for name, found in policies.items() if found}
    reward = read_reward(folder / "reward.json")
    if not policies:
        raise InputError(f"{folder}: holds no policy; make one with `idm-sumo irl train`")
    curves = [read_curve(path) for path in sorted(folder.glob(f"{AGENT}-seed*.csv"))]
    missing = "" if AGENT in policies else LEFT_OUT
    return Learners(reward, policies, pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(), missing)


def read_reward(path: Path) -> dict[str, Any]:
    """Return the learned reward of a folder of agents.

    Parameters
    ----------
    path : Path
        The folder's ``reward.json``.

    Returns
    -------
    dict
        As stored.

    Raises
    ------
    InputError
        If the file is missing or does not hold a reward.
    """
    advice = "make it with `idm-sumo irl train`"
    reward = parse_json(read_text(path, advice), path, finite=False)
    try:
        if not np.isfinite([*reward_of_json(reward).weights, reward["shift"], reward["scale"]]).all():
            raise ValueError("a weight is not finite")
        for kind in ("wanted", "free"):
            for name in reward["features"]:
                float(reward[kind]["weights"][name]), float(reward[kind]["standard_errors"][name])
    except (AttributeError, KeyError, IndexError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: not a learned reward ({type(error).__name__}: {error}); {advice}") from None
    return dict(reward)


def read_curve(path: Path) -> pd.DataFrame:
    """Return the learning curve of one agent, with its seed.

    Parameters
    ----------
    path : Path
        ``NAME-seedN.csv`` of a folder of agents.

    Returns
    -------
    pandas.DataFrame

    Raises
    ------
    InputError
        If it is no such curve.
    """
    advice = "make it with `idm-sumo irl train`"
    text, seed = read_text(path, advice), path.stem.rpartition("seed")[2]
    try:
        curve = pd.read_csv(io.StringIO(text))[list(CURVE)].apply(pd.to_numeric)
        values = curve.to_numpy(dtype=np.float64)  # a rollout in which no episode ends has no means
        if curve.empty or np.isinf(values).any() or np.isnan(values[:, 0]).any():
            raise ValueError("rows or finite numbers are missing")
        return curve.assign(seed=int(seed))
    except (ValueError, KeyError, TypeError, OverflowError) as error:  # pandas' own errors are ValueErrors
        raise InputError(f"{path}: not a learning curve ({error}); {advice}") from None


def fingerprint(train: Drivers, settings: Settings) -> str:
    """Return a digest of drivers, settings and source code.

    Parameters
    ----------
    train : Drivers
        Training drivers.
    settings : Settings
        Settings of the run.

    Returns
    -------
    str
        Twelve hexadecimal digits.
    """
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


def _check_same(folder: Path, identity: dict[str, str]) -> None:
    """Raise if what a folder holds was learned otherwise."""
    mark, reward = folder / MARK, folder / "reward.json"
    if not mark.is_file() and not reward.is_file():
        return
    if not mark.is_file() or parse_json(read_text(mark, "choose another folder"), mark) != identity:
        raise InputError(f"{folder}: holds agents of other drivers, settings or another version; choose another folder")


def _learn_reward(
    folder: Path, identity: dict[str, str], lessons: Lessons, settings: Settings, progress: Progress
) -> None:
    """Learn the reward and write it with its origin.

    Its file says what it was learned from.
    """
    path = folder / "reward.json"
    if path.is_file():
        return
    report = learn_reward(lessons, most=settings.agent_demonstrations, seed=settings.seed, progress=progress)
    with new_files([folder / MARK, path]) as (mark, part):
        mark.write_text(json.dumps(identity) + "\n", encoding="utf-8")
        part.write_text(json.dumps(report.to_json(), indent=2) + "\n", encoding="utf-8")


def _make_clones(folder: Path, lessons: Lessons, seeds: list[int]) -> None:
    for seed in seeds:
        path = folder / f"{CLONE}-seed{seed}.npz"
        if not path.is_file():
            clone_drivers(lessons, seed=seed).save(path)
