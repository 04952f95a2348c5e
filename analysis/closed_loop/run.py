"""``interactive``: recorded demand as vehicles that react.

The simulated traffic is compared with the recording.
"""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import cpu_count

from idm_sumo.calibration import driver_table as d
from idm_sumo.evaluation.comparison import compare_measures
from idm_sumo.evaluation.traffic_measures import measure_traffic
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads import Road
from idm_sumo.runtime.cluster import SEEN
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import MANIFEST, new_folder
from idm_sumo.runtime.handover import handed_back
from idm_sumo.runtime.inputs import existing_file
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.siblings import scratch
from idm_sumo.runtime.spread import gathered
from idm_sumo.sumo import network
from idm_sumo.sumo.closed_loop.demand import demand_of
from idm_sumo.sumo.closed_loop.ego import Ego
from idm_sumo.sumo.closed_loop.measurement import Measured, run_and_measure
from idm_sumo.sumo.closed_loop.populations import lane_change_attributes
from idm_sumo.sumo.gui import gui_binary

from ..comparison.run import read_all
from ..page.manifest import manifest, write_manifest
from ..reproduce.replay_bias import replay_bias
from .cases import cases_of, traffic_of
from .lane_changes import FILE, fitted, write_file
from .populations import CALIBRATED, PARAMETERS, Drivers, drivers_of
from .results import closed_loop_table, write_results
from .settings import LOOPS, OF_LAWS, RESIDUAL, Case, Settings
from .words import RECORDED


def stages(settings: Settings) -> tuple[str, ...]:
    """Return the names of a run's stages, in order.

    Parameters
    ----------
    settings : Settings
    """
    calibrating = ("calibrating",) if _needs_drivers(settings) else ()
    lanes = ("lane changes",) if settings.fit_lane_change else ()
    bias = ("replay bias",) if settings.bias_sample else ()
    return ("reading", *calibrating, *lanes, "simulating", *bias, "writing")


def _needs_drivers(settings: Settings) -> bool:
    """Whether anything drives by the recording's own drivers."""
    calibrated = bool(set(settings.types) & {*CALIBRATED, *LOOPS, *OF_LAWS, RESIDUAL})
    return calibrated or settings.ego is not None or settings.bias_sample > 0


def interactive(settings: Settings, out: Path, *, command: list[str], progress: Progress = silent) -> pd.DataFrame:
    """Run the populations and compare them with the recording.

    Parameters
    ----------
    settings : Settings
    out : Path
        Folder of the results.
    command : list of str
        As typed, for the manifest.
    progress : Progress
        Called with a stage's name, what is done of it and its total.

    Returns
    -------
    pandas.DataFrame
        ``tables/closed_loop.csv``.

    Raises
    ------
    InputError
        If the recording is no demand, a type, lane change parameter, period or ego is not there, or a
        display is missing.
    """
    begin = time.perf_counter()
    lane_change = lane_change_attributes(settings.lane_change_model, settings.lane_change or {})
    if RESIDUAL in settings.types and settings.drivers is None:
        raise InputError(f"--types {RESIDUAL}: needs --drivers FILE, a table of `idm-sumo predict --method residual`")
    if settings.gui:
        gui_binary()
        if len(settings.types) > 1:
            raise InputError("--gui shows one population; choose it with --types")
    with new_folder(out) as part:
        recorded, path = _recorded(settings, progress)
        _check_ego(settings, demand_of(recorded), recorded)
        drivers = (
            drivers_of(recorded, settings.drivers, refit=settings.refit, laws=settings.laws, progress=progress)
            if _needs_drivers(settings)
            else None
        )
        if settings.fit_lane_change:
            given, trials = fitted(settings, recorded, drivers, progress)
            lane_change = lane_change_attributes(settings.lane_change_model, given)
            write_file(part / FILE, settings.lane_change_model, given)
        traffic = traffic_of(settings, recorded, drivers)
        demand = traffic.demand
        cases = cases_of(settings, traffic, lane_change, part)
        measured = _run_all(settings, cases, recorded, demand, drivers, part, progress)
        bias = (
            replay_bias(drivers, settings.bias_sample, settings.seed, progress)
            if drivers is not None and settings.bias_sample
            else pd.DataFrame()
        )
        progress("writing", 0, 1)
        comparison = compare_measures(
            {RECORDED: measure_traffic(recorded)} | {case.name: m.measured for case, m in measured}, seed=settings.seed
        )
        table = closed_loop_table(comparison, measured)
        write_results(part, table, comparison, measured, bias, recorded, demand, settings)
        if settings.fit_lane_change:
            trials.to_csv(part / "tables" / "lane_change_fit.csv", index=False, float_format="%.6g")
        plain = {key: value for key, value in asdict(settings).items() if key not in ("gui", "cluster")}
        record = manifest(
            command,
            plain,
            [path, *(file for file in (settings.drivers, settings.model) if file)],
            seconds=round(time.perf_counter() - begin, 1),
            integrator="SUMO, Euler with the new speed, 0.1 s",
            lane_change=lane_change,
            period=recorded.periods[0],
            drivers=None if drivers is None else drivers.origin,
            pooled=None if drivers is None else drivers.pooled._asdict(),
            pooled_vehicles={case.name: case.pooled for case, _ in measured},
            notes=[*recorded.notes, *comparison.notes],
        )
        write_manifest(part / MANIFEST, record)
        progress("writing", 1, 1)
    return table


def _recorded(settings: Settings, progress: Progress) -> tuple[Recording, Path]:
    """Return the wanted period, all lanes, smoothed, and its file."""
    recordings, paths = read_all([settings.recording], settings.minutes, settings.seed, settings.location, progress)
    whole = next(iter(recordings.values()))
    try:
        network.of(whole.road)
    except InputError as error:
        raise InputError(f"{paths[0]}: {error}") from None
    one = whole.of_period(settings.period or whole.periods[0])
    table = one.table.assign(**{c.PERIOD: one.table[c.PERIOD].cat.remove_unused_categories()})
    return smooth(one.with_table(table)), paths[0]


def _check_ego(settings: Settings, demand: pd.DataFrame, recorded: Recording) -> None:
    if settings.ego is None:
        return
    own = demand[demand[c.VEHICLE] == settings.ego]
    if own.empty:
        raise InputError(
            f"--ego {settings.ego}: is not in period {recorded.periods[0]} of {recorded.source}; `idm-sumo "
            f"inspect RECORDING --vehicles` lists its vehicles"
        )
    if own[d.LANE].iloc[0] > recorded.road.main_lanes:
        raise InputError(
            f"--ego {settings.ego}: enters by the on-ramp, and we drive on main lanes only; choose another vehicle"
        )
    if len(settings.types) > 1:
        raise InputError("--ego drives among one population; choose it with --types")


def _run_all(
    settings: Settings,
    cases: list[Case],
    recorded: Recording,
    demand: pd.DataFrame,
    drivers: Drivers | None,
    part: Path,
    progress: Progress,
) -> list[tuple[Case, Measured]]:
    """Run the cases, several at once."""
    fcd = part / "fcd"
    fcd.mkdir()
    jobs = min(settings.jobs or cpu_count(), len(cases))
    # All that a worker needs of the recording: road, period and first frame.
    clock = Recording(recorded.table.iloc[[0]], recorded.road, recorded.source)
    with scratch(part.parent) as workshop:
        work: list[tuple[Path, Path, Case, Recording, dict[str, Any]]] = [
            (
                fcd,
                workshop,
                case,
                clock,
                {
                    "name": case.name,
                    "seed": case.seed or settings.seed,
                    "ego": _ego(settings, recorded.road, demand, drivers),
                    "ours": case.ours,
                    "gui": settings.gui,
                    "shown": case.seed in (0, settings.seed),  # pictures show the first run of a population
                },
            )
            for case in cases
        ]
        if jobs == 1 and settings.cluster is None:
            measured = [run_case(*one, progress=progress) for one in work]
        else:
            progress("simulating", 0, len(cases))
            measured = gathered(
                run_case, work, jobs=jobs, cluster=settings.cluster,
                done=lambda done: progress("simulating", done, len(cases)),
            )  # fmt: skip
    return list(zip(cases, measured, strict=True))


def run_case(
    folder: Path, workshop: Path, case: Case, clock: Recording, more: dict[str, Any], progress: Progress = silent
) -> Measured:
    """Run one case; its trajectories have their name when they are whole.

    Parameters
    ----------
    folder : Path
        Of the trajectories.
    workshop : Path
        Where they are written, see :func:`idm_sumo.runtime.handover.handed_back`.
    case : Case
    clock : Recording
        Rows enough to tell road, period and first frame.
    more : dict
        Further arguments of :func:`idm_sumo.sumo.closed_loop.measurement.run_and_measure`.
    progress : Progress
        Called with the steps done and their total.

    Returns
    -------
    Measured

    Raises
    ------
    InputError
        If this machine does not see SUMO's inputs, or SUMO refuses them.
    """
    existing_file(case.files.net, SEEN)
    name = f"{case.name.replace(', ', '-').replace(' ', '')}.parquet"
    with handed_back(folder, workshop) as own:
        measured = run_and_measure(case.files, own / name, clock, progress=progress, **more)
    return replace(measured, outcome=replace(measured.outcome, fcd=folder / name))


def _ego(settings: Settings, road: Road, demand: pd.DataFrame, drivers: Drivers | None) -> Ego | None:
    """Return the vehicle we drive and its parameters.

    They are its own calibrated ones, or else the pooled ones.
    """
    if settings.ego is None or drivers is None:
        return None
    own = demand[demand[c.VEHICLE] == settings.ego].iloc[0]
    fitted = drivers.table[drivers.table[c.VEHICLE] == settings.ego]
    theta = np.asarray(drivers.pooled if fitted.empty else fitted[PARAMETERS].iloc[0], dtype=np.float64)
    return Ego(settings.ego, road, int(own[d.LANE]), theta, float(own[d.LENGTH]))
