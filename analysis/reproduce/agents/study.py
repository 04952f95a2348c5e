"""The learner by itself: what `idm-sumo irl` does."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.irl.learning import learn_reward, lessons_of
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.progress import Progress, silent

from ...page.style import save
from ..drivers import Drivers
from ..settings import Settings
from ..source import load_source
from . import figures as agent_figures
from . import rows as agents


def sides(settings: Settings, progress: Progress = silent) -> tuple[Drivers, Drivers]:
    """Return the training and the test drivers, the same ones as `reproduce` takes."""
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
    """Learn the reward, write it as JSON, return its weights as a table and the rest in words."""
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
        f"{report.wanted.demonstrations} demonstrations, mean log-likelihood {report.wanted.log_likelihood:.2f}, of unseen ones "
        f"{report.held_out:.2f}; {report.standing} drivers left out because they (almost) stand"
    )
    return agents.weights_table(report.to_json()), words


def train(settings: Settings, out: Path, *, progress: Progress = silent) -> pd.DataFrame:
    """Learn reward and agents into a folder, from its checkpoints if it was interrupted; return the ends of the curves.

    Raises
    ------
    InputError
        If the folder holds agents of other drivers or settings.
    """
    train_drivers, _ = sides(settings, progress)
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; name a folder")
    mark = out / "drivers.json"
    identity = {"drivers": agents.fingerprint(train_drivers, settings)}
    if mark.is_file() and json.loads(mark.read_text(encoding="utf-8")) != identity:
        raise InputError(f"{out}: holds agents of other drivers, settings or another version; choose another folder")
    out.mkdir(parents=True, exist_ok=True)
    with new_file(mark) as part:
        part.write_text(json.dumps(identity) + "\n", encoding="utf-8")
    learners = agents.learners_of(train_drivers, settings, out, progress)
    with new_file(out / "learning_curve.png") as part:
        save(agent_figures.learning_curve(learners.curve), part)
    return learners.curve.groupby("seed").tail(1).drop(columns="seconds")


def evaluate(settings: Settings, folder: Path, out: Path, *, progress: Progress = silent) -> tuple[pd.DataFrame, str]:
    """Drive and score the test drivers by the policies of a folder; also return what is missing, in words."""
    learners = agents.read_learners(folder)
    _, test = sides(settings, progress)
    table = agents.by_seed(test, agents.drive_agents(test, learners, in_sumo=False, progress=progress))
    with new_file(out) as part:
        table.to_csv(part, index=False, float_format="%.6g")
    return table, learners.missing
