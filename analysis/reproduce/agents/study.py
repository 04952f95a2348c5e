"""The learner by itself, as `idm-sumo irl` runs it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.irl.learning import learn_reward, lessons_of
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.siblings import locked

from ...page.style import save
from ..drivers import Drivers
from ..settings import Settings
from ..source import load_source
from . import figures as agent_figures
from . import rows as agents
from .learners import learners_of, read_learners


def sides(settings: Settings, progress: Progress = silent) -> tuple[Drivers, Drivers]:
    """Return the training and the test drivers of `reproduce`.

    Parameters
    ----------
    settings : Settings
        Settings of the run.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    train, test : Drivers
        Both sides.
    """
    source = load_source(settings, progress)
    rng = np.random.default_rng(settings.seed)
    train, test = (
        source.drivers(side, name, settings.window)[0]
        for side, name in ((source.train, "train"), (source.test, "test"))
    )
    return train.sample(settings.max_drivers, rng), test.sample(settings.max_drivers, rng)


def learn(
    settings: Settings, out: Path, *, demonstrations: int, steps: int, progress: Progress = silent
) -> tuple[pd.DataFrame, str]:
    """Learn the reward and write it as JSON.

    Parameters
    ----------
    settings : Settings
        Settings of the run.
    out : Path
        File to write.
    demonstrations : int
        Largest number of drivers to learn from.
    steps : int
        Steps of each, 0.1 s.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    weights : pandas.DataFrame
        One row a feature.
    text : str
        A description of the fit.

    Raises
    ------
    InputError
        If a number is out of range, or too few drivers keep moving.
    """
    if demonstrations < 1 or not 1 <= steps <= settings.horizon:
        raise InputError(
            f"--demonstrations must be 1 or more, and --steps from 1 to the horizon of {settings.horizon} frames"
        )
    train, _ = sides(settings, progress)
    report = learn_reward(
        lessons_of(train.scenes), most=demonstrations, steps=steps, seed=settings.seed, progress=progress
    )
    with new_file(out) as part:
        part.write_text(json.dumps(report.to_json(), indent=2) + "\n", encoding="utf-8")
    words = (
        f"{report.wanted.demonstrations} demonstrations, mean log-likelihood {report.wanted.log_likelihood:.2f}, "
        "of held-out ones "
        f"{report.held_out:.2f}; {report.standing} drivers left out because they (almost) stand"
    )
    return agents.weights_table(report.to_json()), words


def train(settings: Settings, out: Path, *, cluster: str | None = None, progress: Progress = silent) -> pd.DataFrame:
    """Learn reward and agents into a folder.

    An interrupted training continues from the folder's checkpoints.

    Parameters
    ----------
    settings : Settings
        Settings of the run.
    out : Path
        Folder of the results.
    cluster : str, optional
        Address of a dask scheduler whose workers train the agents; all machines see the folder.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    pandas.DataFrame
        The last rows of the learning curves.

    Raises
    ------
    InputError
        If the folder holds agents of other drivers or settings, or another training is at work there.
    """
    train_drivers, _ = sides(settings, progress)
    with locked(out, "training"):
        learners = learners_of(train_drivers, settings, out, progress, cluster=cluster)
        with new_file(out / "learning_curve.png") as part:
            save(agent_figures.learning_curve(learners.curve), part)
    return learners.curve.groupby("seed").tail(1).drop(columns="seconds")


def evaluate(settings: Settings, folder: Path, out: Path, *, progress: Progress = silent) -> tuple[pd.DataFrame, str]:
    """Drive and score the test drivers by a folder's policies.

    Parameters
    ----------
    settings : Settings
        Settings of the run.
    folder : Path
        Folder of `idm-sumo irl train`.
    out : Path
        CSV file to write.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    table : pandas.DataFrame
        One row a method and seed.
    missing : str
        How to install what a missing row needs, or empty.
    """
    learners = read_learners(folder)
    _, test = sides(settings, progress)
    table = agents.by_seed(test, agents.drive_agents(test, learners, in_sumo=False, progress=progress))
    with new_file(out) as part:
        table.to_csv(part, index=False, float_format="%.6g")
    return table, learners.missing
