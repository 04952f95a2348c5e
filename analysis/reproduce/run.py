"""One run of the study: from recordings to tables, figures, report and manifest."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.runtime.files import MANIFEST, new_folder
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import LEADER_OF_TWIN
from idm_sumo.simulation.rollout import Trajectories, drive_idm

from ..page.manifest import manifest, write_manifest
from ..page.page import not_measured, render
from ..page.style import save
from . import figures, paper, tables
from .agents import figures as agent_figures
from .agents import rows as agents
from .agents import words as agent_words
from .drivers import Drive
from .prediction import figures as prediction_figures
from .prediction import words as prediction_words
from .prediction.reasons import prediction_tables
from .results import Results
from .settings import Settings
from .source import Source, load_source
from .study import Study, predictions, prepare
from .words import describe

COLUMNS_FIRST = ["ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "vehicles"]
QUICK_DEMONSTRATIONS = 50
QUICK_AGENT_STEPS = 100_000  # shows that it works; far from trained
QUALITY = ["method", "min_gap_m", "critical_ttc_share", "hard_acceleration_share", "jerk_rms_m_s3",
           "lane_departure_share", "gap_rmse_m", "speed_rmse_m_s", "contacts"]  # fmt: skip


def reproduce(
    settings: Settings, out: Path, *, command: list[str], jobs: int = 1, progress: Progress = silent
) -> pd.DataFrame:
    """Run the study and leave its results in the folder ``out``; return the table of methods.

    Raises
    ------
    InputError
        If a recording, a setting or the output folder cannot be used; nothing is left then.
    """
    begin = time.perf_counter()
    with new_folder(out) as part:
        results = compute(settings, jobs, progress)
        progress("writing", 0, 1)
        (part / "tables").mkdir()
        (part / "figures").mkdir()
        _write_tables(results, part / "tables")
        _write_figures(results, part / "figures")
        _write_report(results, part)
        _write_manifest(results, part / MANIFEST, command, time.perf_counter() - begin)
        progress("writing", 1, 1)
    return results.methods


def stages(settings: Settings) -> tuple[str, ...]:
    """Return the names of a run's stages, in order."""
    training = () if settings.agent else ("tracking the training drivers", "inverse optimal control", "training agents")
    learned = () if settings.agent_seeds == 0 and not settings.agent else (*training, "driving by agents")
    return ("reading", "calibration", "driving the test drivers", *learned, "tables", "writing")


def compute(settings: Settings, jobs: int = 1, progress: Progress = silent) -> Results:
    """Compute every table of the study; ``jobs`` processes share SUMO's pass over the recording."""
    source = load_source(settings, progress)
    study = prepare(source, settings, settings.window, progress)
    drive = _driver(settings, jobs)
    methods, driven, scores = tables.methods(study, drive, progress)
    learned = _agents(study, settings, progress)
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
        source, study, _ordered(methods), scores, driven, _ordered(by_features), _ordered(by_frames),
        _ordered(by_neighbours), _ordered(other_methods), _backend_difference(study, driven, settings), learned,
        prediction_tables(source, study),
    )  # fmt: skip


def _agents(study: Study, settings: Settings, progress: Progress) -> agents.Agents | None:
    """Learn from the training drivers and drive the test drivers, if the settings want it."""
    if settings.agent_seeds == 0 and not settings.agent:
        return None
    learners = (
        agents.read_learners(Path(settings.agent))
        if settings.agent
        else agents.learners_of(study.train, settings, None, progress)
    )
    return agents.drive_agents(study.test, learners, in_sumo=settings.backend == "sumo", progress=progress)


def _kernel(settings: Settings) -> Drive:
    return lambda scenes, theta: drive_idm(scenes, theta, desired_speed=settings.desired_speed)


def _driver(settings: Settings, jobs: int) -> Drive:
    """Return what drives the modelled vehicles of the table of methods."""
    if settings.backend == "kernel":
        return _kernel(settings)
    from idm_sumo.sumo.replay.ghosts import replay_ghosts

    return lambda scenes, theta: replay_ghosts(scenes, theta, desired_speed=settings.desired_speed, jobs=jobs)


def _backend_difference(study: Study, driven: dict[str, list[Trajectories]], settings: Settings) -> float:
    """Return how far (m) SUMO's and the kernel's oracle drivers are apart at most; 0 if the kernel drove."""
    if settings.backend == "kernel":
        return 0.0
    oracle = predictions(study)["idm_oracle"]
    kernel = study.test.drive(oracle, _kernel(settings))
    return max(float(np.hypot(a.x - b.x, a.y - b.y).max()) for a, b in zip(driven["idm_oracle"], kernel, strict=True))


def _frames(source: Source, study: Study) -> pd.DataFrame:
    """Build the table of observed frames, on windows long enough for its largest row."""
    test, _ = source.drivers(source.test, "test", tables.frame_window(study))
    rng = np.random.default_rng(study.settings.seed)
    return tables.frames(study, test.sample(study.settings.max_drivers, rng))


def _ordered(table: pd.DataFrame) -> pd.DataFrame:
    """Put the interface's columns first, the further metrics behind."""
    key = list(table.columns[:1])
    rest = [name for name in table.columns if name not in key + COLUMNS_FIRST]
    return table[key + COLUMNS_FIRST + rest]


def _write_tables(results: Results, folder: Path) -> None:
    for name in ("methods", "features", "frames", "neighbours"):
        getattr(results, name).to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")
    results.other_methods.to_csv(folder / "methods_other_start.csv", index=False, float_format="%.6g")
    for name, table in results.prediction.items():
        table.to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")
    left_out(results).to_csv(folder / "left_out.csv", index=False)
    fits = pd.concat({"train": results.study.train_fits, "test": results.study.test_fits}, names=["side"])
    fits.reset_index(level=0).to_csv(folder / "oracle.csv", index=False, float_format="%.6g")
    if results.agents is not None:
        agents.by_seed(results.study.test, results.agents).to_csv(
            folder / "agents.csv", index=False, float_format="%.6g"
        )
        agents.weights_table(results.agents.learners.reward).to_csv(
            folder / "reward.csv", index=False, float_format="%.6g"
        )
        if not results.agents.learners.curve.empty:
            curve = results.agents.learners.curve.drop(columns="seconds")  # equal runs give equal tables
            curve.to_csv(folder / "learning_curve.csv", index=False, float_format="%.6g")


def left_out(results: Results) -> pd.DataFrame:
    """Return who was left out or stands apart, by reason: nobody is silently gone."""
    rows = [(f"{name}: rows, {reason}", count)
            for name, account in results.source.accounts.items() for reason, count in account.dropped.items()]  # fmt: skip
    gone = pd.concat([results.source.not_modelled, results.study.excluded], ignore_index=True)
    rows += [(f"vehicles of {period}, {reason}", count)
             for (period, reason), count in gone.groupby([c.PERIOD, "reason"], observed=True).size().items()]  # fmt: skip
    for side, drivers in (("training", results.study.train), ("test", results.study.test)):
        unknown = sum(int((~scenes.size_known).sum()) for scenes in drivers.scenes)
        codes = drivers.code(results.study.settings.observed)
        rows += [(f"{side} drivers in all", len(drivers)), (f"{side} drivers whose length is assumed", unknown),
                 (f"{side} drivers without a leader in the observed frames", int((codes["leader_frames"] == 0).sum()))]  # fmt: skip
    for side, fits in (("training", results.study.train_fits), ("test", results.study.test_fits)):
        rows += [(f"{side} fits, status {status}", count) for status, count in fits["status"].value_counts().items()]
    return pd.DataFrame(rows, columns=["what", "count"])


def _write_figures(results: Results, folder: Path) -> None:
    study = results.study
    save(figures.accuracy_against_neighbours(results.neighbours, results.methods), folder / "neighbours.png")
    fits = pd.concat([study.train_fits, study.test_fits], ignore_index=True)
    save(figures.oracle_parameters(fits), folder / "oracle_parameters.png")
    save(figures.error_growth(study, results.driven), folder / "error_growth.png")
    save(figures.flat_directions(tables.flat_directions(study)), folder / "flat_directions.png")
    save(prediction_figures.fan(study), folder / "prediction_fan.png")
    save(prediction_figures.seconds(results.prediction["prediction_seconds"]), folder / "prediction_seconds.png")
    part, which = _median_driver(results)
    chosen = {name: trajectories[part] for name, trajectories in results.driven.items()}
    save(figures.time_space(study.test.scenes[part], which, chosen), folder / "time_space.png")
    if results.agents is not None:
        _write_agent_figures(results, results.agents, part, which, folder)


def _write_agent_figures(results: Results, learned: agents.Agents, part: int, which: int, folder: Path) -> None:
    weights = np.array(list(learned.learners.reward["wanted"]["weights"].values()))
    save(agent_figures.reward_maps(results.study.test.scenes[part], which, weights), folder / "reward_maps.png")
    against = {name: (results.driven[name], results.scores[name]) for name in ("idm_prediction", "constant_velocity")}
    save(agent_figures.approaches(results.study.test, learned, against), folder / "approaches.png")
    if not learned.learners.curve.empty:
        save(agent_figures.learning_curve(learned.learners.curve), folder / "learning_curve.png")


def _median_driver(results: Results) -> tuple[int, int]:
    """Return the period and the row of the driver whose predicted error is the median one."""
    ade = results.scores["idm_prediction"]["ade_m"].to_numpy()
    row = int(np.argsort(ade, kind="stable")[len(ade) // 2])
    for part, scenes in enumerate(results.study.test.scenes):
        if row < len(scenes):
            return part, row
        row -= len(scenes)
    raise AssertionError("the scores have more rows than the scenes")


def _write_report(results: Results, part: Path) -> None:
    settings = results.study.settings
    render(
        part / "report.html", "reproduce/report.html.j2", figures=part / "figures", surrogate=bool(not_measured(results.source.periods)),
        methods=tables.beside_paper(results.methods[["method", *COLUMNS_FIRST]], paper.METHODS, "method"),
        features=tables.beside_paper(results.features[["features", *COLUMNS_FIRST]], paper.FEATURES, "features"),
        frames=tables.beside_paper(results.frames[["frames", *COLUMNS_FIRST]], paper.FRAMES, "frames"),
        neighbours=results.neighbours[["k", *COLUMNS_FIRST]],
        other_methods=results.other_methods[["method", *COLUMNS_FIRST]],
        quality=results.methods[QUALITY], **results.prediction, at_bound=tables.at_bound(results.study), accounts=left_out(results),
        frame_start=max(settings.frame_counts), **_agent_section(results),
        **prediction_words.describe(results.prediction), **describe(results),
    )  # fmt: skip


def _agent_section(results: Results) -> dict[str, object]:
    """Return what the report shows of the learner."""
    learned, test = results.agents, results.study.test
    if learned is None:
        return {"agents": None}
    return {
        "agents": agents.by_seed(test, learned), "weights": agents.weights_table(learned.learners.reward),
        "has_curve": not learned.learners.curve.empty, "agent_clone": agent_words.clone_sentence(learned),
        **agent_words.describe(test, learned),
    }  # fmt: skip


def _write_manifest(results: Results, path: Path, command: list[str], seconds: float) -> None:
    settings = results.study.settings
    leaders = {scenes.leader_source for scenes in results.study.test.scenes}
    record = manifest(
        command, settings.as_dict(), list(results.source.files), seconds=round(seconds, 1), integrator="Euler with the old speed, 0.1 s",
        backend=settings.backend, largest_backend_difference_m=results.backend_difference_m,
        train={p: len(v) for p, v in results.source.train.items()}, test={p: len(v) for p, v in results.source.test.items()},
        leader="the recorded twin's" if leaders == {LEADER_OF_TWIN} else "whoever is ahead in the lane at the simulated position",
        pooled=results.study.pooled._asdict(), notes=results.source.notes,
    )  # fmt: skip
    write_manifest(path, record)


def quick(settings: Settings) -> Settings:
    """Return a smaller run that shows all parts in seconds: fewer drivers, a shorter built-in recording."""
    fewer = tuple(k for k in settings.neighbour_counts if k in (1, 4, 8, 16, 20, 50)) or settings.neighbour_counts[:3]
    most = min(settings.max_drivers or 200, 200)
    return replace(
        settings, neighbour_counts=fewer, max_drivers=most, minutes=min(settings.minutes, 9.0),
        agent_seeds=min(settings.agent_seeds, 1), agent_steps=min(settings.agent_steps, QUICK_AGENT_STEPS),
        agent_demonstrations=min(settings.agent_demonstrations, QUICK_DEMONSTRATIONS),
    )  # fmt: skip
