"""Tables, figures and report of a run of the study."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.scenes.windows import LEADER_OF_RECORDED

from ..page.manifest import manifest
from ..page.page import not_measured, render
from ..page.style import save
from . import figures, paper, tables
from .agents import figures as agent_figures
from .agents import rows as agents
from .agents import words as agent_words
from .missing import by_share
from .prediction import figures as prediction_figures
from .prediction import words as prediction_words
from .replays import Row, part_of, write_replays
from .results import Results
from .words import describe, missing_sentence

COLUMNS_FIRST = ["ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "vehicles"]
QUALITY = [
    "method",
    "min_gap_m",
    "critical_ttc_share",
    "hard_acceleration_share",
    "jerk_rms_m_s3",
    "lane_departure_share",
    "gap_rmse_m",
    "speed_rmse_m_s",
    "contacts",
]


def write_results(results: Results, folder: Path) -> None:
    """Write tables, figures and report.

    Parameters
    ----------
    results : Results
        Results of the run.
    folder : Path
        An empty folder.
    """
    (folder / "tables").mkdir()
    (folder / "figures").mkdir()
    _write_tables(results, folder / "tables")
    _write_figures(results, folder / "figures")
    _write_report(results, folder, write_replays(results, folder))


def _write_tables(results: Results, folder: Path) -> None:
    for name in ("methods", "frames", "neighbours"):
        getattr(results, name).to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")
    printed = results.features["features"].isin(list(paper.FEATURES))  # the others read the paper's nu otherwise
    for name, rows in (("features", printed), ("features_other_reading", ~printed)):
        results.features[rows].to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")
    results.other_methods.to_csv(folder / "methods_other_start.csv", index=False, float_format="%.6g")
    for name, table in results.prediction.items():
        table.to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")
    results.missing.to_csv(folder / "missing_vehicles.csv", index=False, float_format="%.6g")
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
    """Count the rows and vehicles left out, by reason.

    Parameters
    ----------
    results : Results
        Results of the run.

    Returns
    -------
    pandas.DataFrame
        ``what, count``; also drivers with assumptions, and the status of all fits.
    """
    accounts = results.source.accounts.items()
    rows = [(f"{name}: rows, {reason}", n) for name, account in accounts for reason, n in account.dropped.items()]
    gone = pd.concat([results.source.not_modelled, results.study.excluded], ignore_index=True)
    by_reason = gone.groupby([c.PERIOD, "reason"], observed=True).size().items()
    rows += [(f"vehicles of {period}, {reason}", n) for (period, reason), n in by_reason]
    for side, drivers in (("training", results.study.train), ("test", results.study.test)):
        unknown = sum(int((~scenes.size_known).sum()) for scenes in drivers.scenes)
        codes = drivers.code(results.study.settings.observed)
        alone = int((codes["leader_frames"] == 0).sum())
        rows.append((f"{side} drivers in all", len(drivers)))
        rows.append((f"{side} drivers whose length is assumed", unknown))
        rows.append((f"{side} drivers without a leader in the observed frames", alone))
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
    told = (results.prediction["prediction_distances"], results.prediction["prediction_for_whom"])
    if len(told[1]):
        save(prediction_figures.for_whom(*told), folder / "prediction_for_whom.png")
    if len(results.missing):
        save(figures.missing_vehicles(by_share(results.missing)), folder / "missing_vehicles.png")
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
    """Return period and row of the driver with median error."""
    ade = results.scores["idm_prediction"]["ade_m"].to_numpy()
    row = int(np.argsort(ade, kind="stable")[len(ade) // 2])
    return part_of([len(scenes) for scenes in results.study.test.scenes], row)


def _write_report(results: Results, part: Path, replays: list[Row]) -> None:
    settings = results.study.settings
    render(
        part / "report.html",
        "reproduce/report.html.j2",
        figures=part / "figures",
        replays=replays,
        surrogate=bool(not_measured(results.source.periods)),
        methods=tables.beside_paper(results.methods[["method", *COLUMNS_FIRST]], paper.METHODS, "method"),
        features=tables.beside_paper(results.features[["features", *COLUMNS_FIRST]], paper.FEATURES, "features"),
        frames=tables.beside_paper(results.frames[["frames", *COLUMNS_FIRST]], paper.FRAMES, "frames"),
        neighbours=results.neighbours[["k", *COLUMNS_FIRST]],
        other_methods=results.other_methods[["method", *COLUMNS_FIRST]],
        quality=results.methods[QUALITY],
        **results.prediction,
        at_bound=tables.at_bound(results.study),
        missing=by_share(results.missing) if len(results.missing) else None,
        missing_text=missing_sentence(results.missing),
        accounts=left_out(results),
        frame_start=max(settings.frame_counts),
        **_agent_section(results),
        **prediction_words.describe(results.prediction),
        **describe(results),
    )


def _agent_section(results: Results) -> dict[str, object]:
    """Return the report's content on the learned agents."""
    learned, test = results.agents, results.study.test
    if learned is None:
        return {"agents": None}
    return {
        "agents": agents.by_seed(test, learned),
        "weights": agents.weights_table(learned.learners.reward),
        "has_curve": not learned.learners.curve.empty,
        "agent_clone": agent_words.clone_sentence(learned),
        **agent_words.describe(test, learned),
    }


def record(results: Results, command: list[str], seconds: float) -> dict[str, Any]:
    """Return the manifest of a run.

    Parameters
    ----------
    results : Results
        Results of the run.
    command : list of str
        The command line.
    seconds : float
        Duration of the run (s).

    Returns
    -------
    dict
        Settings, versions, input files and choices.
    """
    settings, source = results.study.settings, results.source
    own_leader = {scenes.leader_source for scenes in results.study.test.scenes} == {LEADER_OF_RECORDED}
    ahead = "the vehicle ahead in the lane at the simulated position"
    return manifest(
        command,
        settings.as_dict(),
        list(source.files),
        seconds=round(seconds, 1),
        integrator="Euler with the old speed, 0.1 s",
        backend=settings.backend,
        largest_backend_difference_m=results.backend_difference_m,
        train={period: len(vehicles) for period, vehicles in source.train.items()},
        test={period: len(vehicles) for period, vehicles in source.test.items()},
        leader="that of the recorded vehicle" if own_leader else ahead,
        pooled=results.study.pooled._asdict(),
        notes=source.notes,
    )
