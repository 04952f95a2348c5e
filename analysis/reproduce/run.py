"""One run of the study, from recordings to results."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.runtime.files import MANIFEST, new_folder
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.simulation.rollout import Trajectories, drive_idm

from ..page.manifest import write_manifest
from . import tables
from .agents import rows as agents
from .agents.learners import learners_of, read_learners
from .drivers import Drive
from .missing import missing_vehicles
from .output import COLUMNS_FIRST, record, write_results
from .prediction.reasons import prediction_tables
from .results import Results
from .settings import Settings
from .source import Source, load_source
from .study import Study, predictions, prepare

QUICK_DEMONSTRATIONS = 50
QUICK_AGENT_STEPS = 100_000  # shows that the training runs; the agent is far from trained


def reproduce(
    settings: Settings,
    out: Path,
    *,
    command: list[str],
    jobs: int = 1,
    cluster: str | None = None,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Run the study and write its results to a folder.

    Parameters
    ----------
    settings : Settings
        Settings of the run.
    out : Path
        Folder to write; complete or not at all.
    command : list of str
        The command line, for the manifest.
    jobs : int
        Processes that share SUMO's pass over the recording.
    cluster : str, optional
        Address of a dask scheduler whose workers train the agents; all machines see the user's cache.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    pandas.DataFrame
        The table of methods.

    Raises
    ------
    InputError
        If a recording, a setting or the output folder cannot be used; nothing is left then.
    """
    begin = time.perf_counter()
    with new_folder(out) as part:
        results = compute(settings, jobs, progress, cluster=cluster)
        progress("writing", 0, 1)
        write_results(results, part)
        write_manifest(part / MANIFEST, record(results, command, time.perf_counter() - begin))
        progress("writing", 1, 1)
    return results.methods


def stages(settings: Settings) -> tuple[str, ...]:
    """Return the names of a run's stages, in order.

    Parameters
    ----------
    settings : Settings
        Settings of the run.

    Returns
    -------
    tuple of str
        As progress reports name them.
    """
    training = () if settings.agent else ("tracking the training drivers", "inverse optimal control", "training agents")
    learned = () if settings.agent_seeds == 0 and not settings.agent else (*training, "driving by agents")
    return ("reading", "calibration", "driving the test drivers", *learned, "tables", "missing vehicles", "writing")


def compute(settings: Settings, jobs: int = 1, progress: Progress = silent, *, cluster: str | None = None) -> Results:
    """Compute every table of the study.

    Parameters
    ----------
    settings : Settings
        Settings of the run.
    jobs : int
        Processes that share SUMO's pass over the recording.
    progress : Progress
        Called as the work proceeds.
    cluster : str, optional
        As of :func:`reproduce`.

    Returns
    -------
    Results
        All that is written.
    """
    source = load_source(settings, progress)
    study = prepare(source, settings, settings.window, progress)
    drive = _driver(settings, jobs)
    methods, driven, scores = tables.methods(study, drive, progress)
    learned = _agents(study, settings, cluster, progress)
    if learned is not None:
        methods = pd.concat([methods[:1], agents.rows(learned), methods[1:]], ignore_index=True)
        driven |= {name: seeds[0] for name, seeds in learned.driven.items()}
        scores |= {name: seeds[0] for name, seeds in learned.scores.items()}
    progress("tables", 0, 4)
    by_features = tables.features(study)
    progress("tables", 1, 4)
    by_neighbours = tables.neighbours(study)
    progress("tables", 2, 4)
    by_frames = _frames(source, study)
    progress("tables", 3, 4)
    other = replace(settings, rollout_start="observed" if settings.rollout_start == "entry" else "entry")
    other_study = prepare(source, other, other.window)
    other_methods, _, _ = tables.methods(other_study, _kernel(settings))
    progress("tables", 4, 4)
    return Results(
        source,
        study,
        _ordered(methods),
        scores,
        driven,
        _ordered(by_features),
        _ordered(by_frames),
        _ordered(by_neighbours),
        _ordered(other_methods),
        _backend_difference(study, driven, settings),
        learned,
        prediction_tables(source, study),
        missing_vehicles(study, progress),
    )


def _agents(study: Study, settings: Settings, cluster: str | None, progress: Progress) -> agents.Agents | None:
    """Learn from the training drivers and drive the test drivers.

    None if the settings ask for no agents.
    """
    if settings.agent_seeds == 0 and not settings.agent:
        return None
    if settings.agent:
        learners = read_learners(Path(settings.agent))
    else:
        learners = learners_of(study.train, settings, None, progress, cluster=cluster)
    return agents.drive_agents(study.test, learners, in_sumo=settings.backend == "sumo", progress=progress)


def _kernel(settings: Settings) -> Drive:
    return lambda scenes, theta: drive_idm(scenes, theta, desired_speed=settings.desired_speed)


def _driver(settings: Settings, jobs: int) -> Drive:
    """Return the function that drives the modelled vehicles."""
    if settings.backend == "kernel":
        return _kernel(settings)
    from idm_sumo.sumo.replay.ghosts import replay_ghosts

    return lambda scenes, theta: replay_ghosts(scenes, theta, desired_speed=settings.desired_speed, jobs=jobs)


def _backend_difference(study: Study, driven: dict[str, list[Trajectories]], settings: Settings) -> float:
    """Return the largest distance (m) between both back ends' oracles.

    It is 0 if the kernel drives.
    """
    if settings.backend == "kernel":
        return 0.0
    oracle = predictions(study)["idm_oracle"]
    kernel = study.test.drive(oracle, _kernel(settings))
    return max(float(np.hypot(a.x - b.x, a.y - b.y).max()) for a, b in zip(driven["idm_oracle"], kernel, strict=True))


def _frames(source: Source, study: Study) -> pd.DataFrame:
    """Build the table of frames, on windows long enough."""
    test, _ = source.drivers(source.test, "test", tables.frame_window(study))
    rng = np.random.default_rng(study.settings.seed)
    return tables.frames(study, test.sample(study.settings.max_drivers, rng))


def _ordered(table: pd.DataFrame) -> pd.DataFrame:
    """Put the interface's columns before the further metrics."""
    key = list(table.columns[:1])
    rest = [name for name in table.columns if name not in key + COLUMNS_FIRST]
    return table[key + COLUMNS_FIRST + rest]


def quick(settings: Settings) -> Settings:
    """Return settings of a smaller run, which shows all parts.

    Parameters
    ----------
    settings : Settings
        Settings of the whole run.

    Returns
    -------
    Settings
        With fewer drivers, a shorter built-in recording and a short training.
    """
    fewer = tuple(k for k in settings.neighbour_counts if k in (1, 4, 8, 16, 20, 50)) or settings.neighbour_counts[:3]
    most = min(settings.max_drivers or 200, 200)
    return replace(
        settings,
        neighbour_counts=fewer,
        max_drivers=most,
        minutes=min(settings.minutes, 9.0),
        agent_seeds=min(settings.agent_seeds, 1),
        agent_steps=min(settings.agent_steps, QUICK_AGENT_STEPS),
        agent_demonstrations=min(settings.agent_demonstrations, QUICK_DEMONSTRATIONS),
    )
