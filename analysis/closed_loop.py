"""``interactive``: the recorded demand as vehicles that react, held against the recording."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, cpu_count, delayed

from idm_sumo import columns as c
from idm_sumo import driver_table as d
from idm_sumo import road
from idm_sumo.comparison import RECORDING, Comparison, compare_portraits, portray
from idm_sumo.errors import InputError
from idm_sumo.outputs import MANIFEST, new_folder
from idm_sumo.progress import Progress, silent
from idm_sumo.recording import Recording
from idm_sumo.smoothing import smooth
from idm_sumo.sumo.closed_loop import Measured, RunFiles, glimpse_of, run_and_measure, write_run
from idm_sumo.sumo.demand import boundary_speeds, demand_of
from idm_sumo.sumo.ego import Ego
from idm_sumo.sumo.gui import gui_binary
from idm_sumo.sumo.populations import DEFAULTS, SUBLANE, calibrated_types, default_types, lane_change_attributes

from . import closed_loop_words as words
from .closed_loop_words import POPULATION, RECORDED
from .comparison import read_all, shown
from .manifest import manifest, write_manifest
from .populations import CALIBRATED, PARAMETERS, Drivers, drivers_of, mean_speed_of, parameters_for
from .replay_bias import in_words, replay_bias
from .report import render
from .settings import SURROGATE
from .style import save
from .traffic_figures import overview, time_space

POPULATIONS = (*CALIBRATED, *DEFAULTS)
FIRST = ["population", "seed", "vehicles", "mean_speed_m_s", "flow_veh_h", "density_veh_km", "travel_time_s", "gap_m", "time_headway_s",
         "lane_changes_per_km", "wave_speed_m_s", "late", "largest_delay_s", "mean_delay_s", "never_inserted", "collisions"]  # fmt: skip


@dataclass(frozen=True)
class Settings:
    """What a closed loop is asked to be.

    Attributes
    ----------
    recording : str
        A file, or ``surrogate``.
    period : str or None
        The first by default.
    drivers : Path or None
        A driver table; calibrated in the run by default.
    types : tuple of str
        Populations to run.
    lane_change_model : str
    lane_change : dict of str to str
        Parameters of it.
    ego : int or None
        A vehicle we drive.
    gui : bool
    downstream_speed : bool
        Whether the recorded speeds at the end of the section are imposed behind it.
    seeds : int
        Runs of each population, with ``seed``, ``seed + 1``, ...
    bias_sample : int
        Vehicles of the replay bias; 0 leaves it out.
    minutes : float
        Of the built-in recording.
    location : str
    seed, jobs : int
    """

    recording: str = SURROGATE
    period: str | None = None
    drivers: Path | None = None
    types: tuple[str, ...] = POPULATIONS
    lane_change_model: str = "LC2013"
    lane_change: Mapping[str, str] | None = None
    ego: int | None = None
    gui: bool = False
    downstream_speed: bool = True
    seeds: int = 1
    bias_sample: int = 150
    minutes: float = 45.0
    location: str = "us-101"
    seed: int = 1
    jobs: int | None = None


@dataclass(frozen=True)
class Case:
    """One run: a population with a seed."""

    population: str
    seed: int
    files: RunFiles
    pooled: int  # vehicles that drive by the pooled parameters

    @property
    def name(self) -> str:
        """How it is called in tables."""
        return self.population if self.seed == 0 else f"{self.population}, seed {self.seed}"


def interactive(settings: Settings, out: Path, *, command: list[str], progress: Progress = silent) -> pd.DataFrame:
    """Run the populations, compare them with the recording, leave the results in ``out`` and return the table.

    Raises
    ------
    InputError
        If the recording is no demand, a type, lane change parameter, period or ego is not there, or a display is missing.
    """
    begin = time.perf_counter()
    lane_change = lane_change_attributes(settings.lane_change_model, settings.lane_change or {})
    if settings.gui:
        gui_binary()
        if len(settings.types) > 1:
            raise InputError("--gui shows one population; choose it with --types")
    with new_folder(out) as part:
        recorded, path = _recorded(settings, progress)
        demand = demand_of(recorded)
        _check_ego(settings, demand, recorded)
        needed = bool(set(settings.types) & set(CALIBRATED)) or settings.ego is not None or settings.bias_sample > 0
        drivers = drivers_of(recorded, settings.drivers, settings.seed, progress) if needed else None
        cases = _cases(settings, recorded, demand, drivers, lane_change, part)
        measured = _run_all(settings, cases, recorded, demand, drivers, part, progress)
        bias = (
            replay_bias(drivers, settings.bias_sample, settings.seed, progress)
            if drivers is not None and settings.bias_sample
            else pd.DataFrame()
        )
        progress("writing", 0, 1)
        comparison = compare_portraits(
            {RECORDED: portray(recorded)} | {case.name: m.portrait for case, m in measured}, seed=settings.seed
        )
        table = closed_loop_table(comparison, measured)
        _write(part, table, comparison, measured, bias, recorded, demand, settings)
        plain = {key: value for key, value in asdict(settings).items() if key not in ("gui",)}
        record = manifest(command, plain, [path, *([settings.drivers] if settings.drivers else [])], seconds=round(time.perf_counter() - begin, 1),
                          integrator="SUMO, Euler with the new speed, 0.1 s", lane_change=lane_change, period=recorded.periods[0],
                          drivers=None if drivers is None else drivers.origin, pooled=None if drivers is None else drivers.pooled._asdict(),
                          pooled_vehicles={case.name: case.pooled for case, _ in measured})  # fmt: skip
        write_manifest(part / MANIFEST, record)
        progress("writing", 1, 1)
    return table


def _recorded(settings: Settings, progress: Progress) -> tuple[Recording, Path]:
    """Return the wanted period, smoothed, all lanes and ramps, and the file."""
    recordings, paths = read_all([settings.recording], settings.minutes, settings.seed, settings.location, progress)
    whole = next(iter(recordings.values()))
    one = whole.of_period(settings.period or whole.periods[0])
    table = one.table.assign(**{c.PERIOD: one.table[c.PERIOD].cat.remove_unused_categories()})
    return smooth(one.with_table(table)), paths[0]


def _check_ego(settings: Settings, demand: pd.DataFrame, recorded: Recording) -> None:
    if settings.ego is None:
        return
    own = demand[demand[c.VEHICLE] == settings.ego]
    if own.empty:
        raise InputError(
            f"--ego {settings.ego}: is not in period {recorded.periods[0]} of {recorded.source}; see `idm-sumo inspect`"
        )
    if own[d.LANE].iloc[0] > road.MAIN_LANES:
        raise InputError(
            f"--ego {settings.ego}: enters by the on-ramp, and we drive on main lanes only; choose another vehicle"
        )
    if len(settings.types) > 1:
        raise InputError("--ego drives among one population; choose it with --types")


def _cases(
    settings: Settings,
    recorded: Recording,
    demand: pd.DataFrame,
    drivers: Drivers | None,
    lane_change: dict[str, str],
    part: Path,
) -> list[Case]:
    """Write the inputs of every population."""
    speeds = mean_speed_of(recorded)
    downstream = boundary_speeds(recorded) if settings.downstream_speed else None
    cases = []
    for population in settings.types:
        pooled = 0
        if population in DEFAULTS:
            types = default_types(demand, population, lane_change)
        elif drivers is not None:
            theta, pooled = parameters_for(population, drivers, demand, speeds)
            types = calibrated_types(demand, theta, lane_change)
        options = SUBLANE.get(settings.lane_change_model, ())
        files = write_run(
            part / "simulation", population, recorded, demand, types, downstream=downstream, options=options
        )
        seeds = [0] if settings.seeds == 1 else range(settings.seed, settings.seed + settings.seeds)
        cases += [Case(population, seed, files, pooled) for seed in seeds]
    return cases


def _run_all(
    settings: Settings,
    cases: list[Case],
    recorded: Recording,
    demand: pd.DataFrame,
    drivers: Drivers | None,
    part: Path,
    progress: Progress,
) -> list[tuple[Case, Measured]]:
    """Run the cases, each in a process of its own where there are several."""
    (part / "fcd").mkdir()
    jobs = min(settings.jobs or cpu_count(), len(cases))
    work: list[tuple[Case, dict[str, Any]]] = [
        (case, {"fcd": part / "fcd" / f"{case.name.replace(', ', '-').replace(' ', '')}.parquet", "name": case.name,
                "seed": case.seed or settings.seed, "ego": _ego(settings, demand, drivers), "gui": settings.gui})
        for case in cases
    ]  # fmt: skip
    clock = Recording(
        recorded.table.iloc[[0]], recorded.source
    )  # all that a worker needs of it: period and first frame
    if jobs == 1:
        return [(case, run_and_measure(case.files, recorded=clock, progress=progress, **more)) for case, more in work]
    progress("simulating", 0, len(cases))
    results = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(run_and_measure)(case.files, recorded=clock, **more) for case, more in work
    )
    done = []
    for case, measured in zip(cases, results, strict=True):
        done.append((case, measured))
        progress("simulating", len(done), len(cases))
    return done


def _ego(settings: Settings, demand: pd.DataFrame, drivers: Drivers | None) -> Ego | None:
    """Return the vehicle we drive, by its own calibrated parameters or else the pooled ones."""
    if settings.ego is None or drivers is None:
        return None
    own = demand[demand[c.VEHICLE] == settings.ego].iloc[0]
    fitted = drivers.table[drivers.table[c.VEHICLE] == settings.ego]
    theta = np.asarray(drivers.pooled if fitted.empty else fitted[PARAMETERS].iloc[0], dtype=np.float64)
    return Ego(settings.ego, int(own[d.LANE]), theta, float(own[d.LENGTH]))


def closed_loop_table(comparison: Comparison, measured: list[tuple[Case, Measured]]) -> pd.DataFrame:
    """Return ``tables/closed_loop.csv``: the recording's row, then one row a population and seed.

    Columns of :func:`idm_sumo.comparison.compare`'s summary, and ``population, seed, late`` (vehicles inserted later than recorded,
    or never), ``largest_delay_s, mean_delay_s`` (over all vehicles), ``never_inserted, collisions``.
    """
    rows: list[dict[str, Any]] = [{POPULATION: RECORDED, RECORDING: RECORDED}]
    for case, m in measured:
        delays = m.outcome.departures["delay_s"]
        rows.append({
            POPULATION: case.population, RECORDING: case.name, "seed": case.seed or 1, "late": len(m.outcome.late),
            "largest_delay_s": float(delays.max()), "mean_delay_s": float(delays.mean()),
            "never_inserted": int(m.outcome.departures["departed_s"].isna().sum()), "collisions": m.outcome.collisions,
        })  # fmt: skip
    table = pd.DataFrame(rows).merge(comparison.summary, on=RECORDING, validate="1:1")
    return table[[*FIRST, *(name for name in table if name not in (*FIRST, RECORDING))]]


def _write(
    part: Path, table: pd.DataFrame, comparison: Comparison, measured: list[tuple[Case, Measured]], bias: pd.DataFrame,
    recorded: Recording, demand: pd.DataFrame, settings: Settings,
) -> None:  # fmt: skip
    tables, figures = part / "tables", part / "figures"
    tables.mkdir()
    figures.mkdir()
    ranks = words.ranking(table)
    fields = pd.concat({key: p.fields for key, p in comparison.portraits.items()}, names=[RECORDING]).reset_index(
        level=0
    )
    late = pd.concat({case.name: m.outcome.late for case, m in measured}, names=[POPULATION]).reset_index(level=0)
    for name, content in (
        ("closed_loop", table),
        ("ranking", ranks),
        ("replay_bias", bias),
        ("fields", fields),
        ("late_departures", late),
    ):
        if len(content.columns):
            content.to_csv(tables / f"{name}.csv", index=False, float_format="%.6g")
    ego = measured[0][1].outcome.ego
    if ego is not None:
        ego.to_csv(tables / "ego.csv", index=False, float_format="%.6g")
    firsts = {case.population: m for case, m in reversed(measured)}  # the first seed of each
    glimpses = {RECORDED: glimpse_of(recorded)} | {
        case.population: firsts[case.population].glimpse for case, _ in measured
    }
    save(overview(comparison), figures / "comparison.png")
    save(time_space(glimpses), figures / "time_space.png")
    measures, distances = shown(comparison)
    render(
        part / "report.html", "closed_loop.html.j2", title=f"Closed loop: {recorded.source}, {recorded.periods[0]}", figures=figures,
        surrogate=settings.recording == SURROGATE, findings=words.in_words(table), setup=_setup(settings, demand, measured), measures=measures,
        distances=distances, ranks=ranks, insertion=table[table[POPULATION] != RECORDED][["population", "seed", *FIRST[-5:]]],
        bias=bias if len(bias) else None, bias_words=in_words(bias), notes=[*recorded.notes, *comparison.notes],
    )  # fmt: skip


def _setup(settings: Settings, demand: pd.DataFrame, measured: list[tuple[Case, Measured]]) -> str:
    """Say what the run was; every number computed."""
    duration = measured[0][0].files.duration
    boundary = (
        "The recorded speeds at the end of the section, lane by lane and smoothed over 7 s, are imposed as speed limits on the 300 m behind it: "
        "what holds recorded traffic up lies downstream of the section, and without that a closed loop runs free. "
        if settings.downstream_speed
        else "Nothing is imposed downstream of the section, so the bottleneck that held the recorded traffic up is missing. "
    )
    pooled = "; ".join(
        f"{case.name}: {case.pooled} of {len(demand)}"
        for case, _ in measured
        if case.population in ("drivers", "predicted")
    )
    ego = f"Vehicle {settings.ego} is driven by our own IDM, steering and bicycle. " if settings.ego is not None else ""
    return (
        f"{len(demand)} recorded vehicles over {duration / 60:.1f} minutes enter at their recorded place, lane, speed and time, with their route, length and "
        f"class, and then react. {boundary}Lane changes by SUMO's {settings.lane_change_model}, equal for all populations. {ego}"
        + (
            f"Vehicles without a calibration of their own, which have the pooled parameters: {pooled}."
            if pooled
            else ""
        )
    )
