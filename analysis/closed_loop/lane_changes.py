"""Lane changing of a closed loop, fitted on the first half of a recording and judged on the second."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from idm_sumo.evaluation.traffic_measures import measure_traffic
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime import inputs
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress
from idm_sumo.sumo.closed_loop.lane_change_fit import BOUNDS, best_of, fit_lane_changes, lane_change_misfit
from idm_sumo.sumo.closed_loop.measurement import run_and_measure
from idm_sumo.sumo.closed_loop.populations import lane_change_attributes

from .cases import files_of, traffic_of, types_of
from .populations import Drivers
from .settings import Settings

LONGEST = 180.0  # s of each half: as many lane changes as tell a fifth more from a fifth less
FILE = "lane_change.json"
HALF, WITH = "half", "with"


def fitted(
    settings: Settings, recorded: Recording, drivers: Drivers | None, progress: Progress
) -> tuple[dict[str, str], pd.DataFrame]:
    """Fit SUMO's lane changing to the recorded one.

    The first population drives. Parameters that are given stay as they are.

    Parameters
    ----------
    settings : Settings
    recorded : Recording
        One period, smoothed.
    drivers : Drivers or None
    progress : Progress

    Returns
    -------
    parameters : dict of str to str
        Given and fitted ones.
    table : pandas.DataFrame
        One row a run: ``half`` (1: fitted to, 2: judged by), ``with`` (trial, default or fitted), the parameters, and
        the parts of the misfit (:func:`idm_sumo.sumo.closed_loop.lane_change_fit.lane_change_misfit`).
    """
    given = dict(settings.lane_change or {})
    names = [name for name in BOUNDS if name not in given]
    first, second = (_trial(settings, part, drivers, given) for part in _halves(recorded))
    table = fit_lane_changes(
        first, names, seed=settings.seed, progress=lambda done, total: progress("lane changes", done, total)
    )
    best = best_of(table, names)
    default = dict.fromkeys(names, 1.0)
    judged = [{HALF: 2, WITH: how, **one, **second(one)} for how, one in (("default", default), ("fitted", best))]
    table = pd.concat([table.assign(**{HALF: 1, WITH: "trial"}), pd.DataFrame(judged)], ignore_index=True)
    return given | {name: f"{value:g}" for name, value in best.items()}, table


def _halves(recorded: Recording) -> tuple[Recording, Recording]:
    """Return the beginnings of both halves of a recording."""
    frame = recorded.table[c.FRAME]
    middle, frames = (int(frame.min()) + int(frame.max())) // 2, round(LONGEST / FRAME_STEP)
    first, second = (
        recorded.with_table(recorded.table[frame.between(begin, end - 1)].reset_index(drop=True))
        for begin, end in ((int(frame.min()), middle), (middle, int(frame.max()) + 1))
        for end in (min(end, begin + frames),)
    )
    return first, second


def _trial(
    settings: Settings, recorded: Recording, drivers: Drivers | None, given: dict[str, str]
) -> Callable[[dict[str, float]], dict[str, float]]:
    """Return what runs SUMO with lane change parameters and says how far off it is."""
    traffic, reference = traffic_of(settings, recorded, drivers), measure_traffic(recorded)

    def run(parameters: dict[str, float]) -> dict[str, float]:
        own = given | {name: f"{value:g}" for name, value in parameters.items()}
        types, _, _ = types_of(traffic, settings.types[0], lane_change_attributes(settings.lane_change_model, own))
        with TemporaryDirectory() as folder:
            files = files_of(settings, traffic, "trial", types, Path(folder))
            one = run_and_measure(files, Path(folder) / "trial.parquet", recorded, name="trial", seed=settings.seed)
        return lane_change_misfit(
            reference, one.measured,
            brakings=one.outcome.incidents.emergency_brakings,
            left_out=int(one.outcome.departures["departed_s"].isna().sum()),
        )  # fmt: skip

    return run


def write_file(path: Path, model: str, parameters: dict[str, str]) -> None:
    """Write lane change parameters that ``--lane-change FILE`` takes.

    Parameters
    ----------
    path : Path
    model : str
        SUMO's lane-change model.
    parameters : dict of str to str
    """
    path.write_text(json.dumps({"model": model, "parameters": parameters}, indent=1) + "\n")


def read_file(path: Path, model: str) -> dict[str, str]:
    """Read lane change parameters.

    Parameters
    ----------
    path : Path
        As :func:`write_file` writes it.
    model : str
        The model that the run has.

    Returns
    -------
    dict of str to str

    Raises
    ------
    InputError
        If it is no such file, or for another model.
    """
    advice = "`idm-sumo interactive --lane-change fit` writes one"
    content = inputs.parse_json(inputs.read_text(inputs.existing_file(path, advice), advice), str(path))
    parameters = content.get("parameters") if isinstance(content, dict) else None
    if not isinstance(parameters, dict):
        raise InputError(f"{path}: has no lane change parameters; {advice}")
    if content.get("model") != model:
        raise InputError(f"{path}: is for {content.get('model')}; give --lane-change-model {content.get('model')}")
    return {str(name): str(value) for name, value in parameters.items()}
