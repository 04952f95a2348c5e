"""``compare`` and ``interactive``: recordings side by side, vehicles that react."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from idm_sumo.cli import many, outputs
from idm_sumo.cli import options as shared
from idm_sumo.cli.console import progress_bar, say, study_module, text_table
from idm_sumo.runtime import limits
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.surrogate import SURROGATE

SHOWN = [
    "recording",
    "period",
    "vehicles",
    "mean_speed_m_s",
    "travel_time_s",
    "gap_m",
    "time_headway_s",
    "lane_changes_per_km",
    "gap_wasserstein_m",
    "time_headway_wasserstein_s",
]

SHOWN_LOOP = [
    "population",
    "vehicles",
    "mean_speed_m_s",
    "flow_veh_h",
    "travel_time_s",
    "gap_m",
    "time_headway_s",
    "lane_changes_per_km",
    "late",
    "never_inserted",
    "collisions",
    "emergency_brakings",
    "rank",
]
FIT, LANE_CHANGE_FILE = "fit", "file"
TYPES = ("drawn", "drivers", "predicted", "pooled", "default-idm", "krauss")
RESIDUAL = "residual"


COMPARE = """\
hold recordings against the first: speeds, gaps, waves, lane changes

reads   RECORDING, the reference, and one OTHER or more, all in any layout
leaves  DIR/report.html, tables/comparison.csv (one row a recording and period,
        distances from the reference with 95 % intervals), figures/,
        manifest.json
next    open DIR/report.html"""
INTERACTIVE = """\
let the recorded demand drive as vehicles that react, and compare

Every recorded vehicle enters in its recorded lane, in time to reach the section
when it was recorded; from there on all of them react to each other. Populations
with different parameters are held against the recording and ranked.

reads   RECORDING; with --drivers a driver table, without one the drivers are
        calibrated
leaves  DIR/report.html, tables/closed_loop.csv (a row `recorded`, one a
        population and seed), figures/, fcd/ (trajectories), simulation/ (the
        SUMO runs), manifest.json
next    open DIR/report.html, or watch one population with --gui"""


def add(commands: Any) -> None:
    """Add the commands of this module.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    _add_compare(commands)
    _add_interactive(commands)


def _add_compare(commands: Any) -> None:
    parser = shared.command(
        commands, "compare", compare, COMPARE, "idm-sumo compare RECORDING surrogate --minutes 1 -o out/comparison"
    )
    parser.add_argument(
        "recording", type=shared.recording_name, metavar="RECORDING", help=f"the reference: {shared.RECORDING_HELP}"
    )
    parser.add_argument(
        "others", type=shared.recording_name, metavar="OTHER", nargs="+", help="further recordings of any such layout"
    )
    shared.location_argument(parser)
    shared.network_arguments(parser)
    shared.minutes_argument(parser, 45.0)
    shared.output_argument(parser, "DIR", "tables/, figures/, report.html, manifest.json go there")
    outputs.declare(parser, "recording", "others")


def compare(options: argparse.Namespace) -> None:
    """Compare recordings.

    Parameters
    ----------
    options : argparse.Namespace
    """
    module = study_module("comparison.run")
    with progress_bar(module.STAGES) as report:
        table = module.compare_files(
            [options.recording, *options.others],
            options.output,
            minutes=options.minutes,
            seed=options.seed,
            location=options.location,
            command=sys.argv,
            read=lambda path: many.source_of(options, path).read(),
            progress=report,
        )
    say(text_table(table[SHOWN]), f"open {options.output / 'report.html'}")
    shared.note_origin_of(options.output)


def _add_interactive(commands: Any) -> None:
    parser = shared.command(
        commands,
        "interactive",
        interactive,
        INTERACTIVE,
        "idm-sumo interactive RECORDING --types drivers --replay-bias 0 -o out/loop",
        jobs=None,
    )
    parser.add_argument(
        "recording",
        type=shared.recording_name,
        metavar="RECORDING",
        nargs="?",
        help=f"whose demand drives: {shared.RECORDING_HELP} (default: that)",
    )
    shared.location_argument(parser)
    shared.network_arguments(parser)
    shared.minutes_argument(parser, 45.0)
    parser.add_argument("--period", metavar="PERIOD", help="recording period to run (default: the first)")
    parser.add_argument(
        "--drivers",
        type=shared.path,
        metavar="FILE",
        help="parameters from `calibrate` (default: calibrated in the run)",
    )
    parser.add_argument(
        "--types",
        action="append",
        choices=(*TYPES, RESIDUAL),
        metavar="POPULATION",
        help=f"who drives: {', '.join(TYPES)}; may be repeated (default: all of them, compared). "
        f"`{RESIDUAL}`: those of a table of `predict --method residual`, driven by our own loop",
    )
    parser.add_argument(
        "--law",
        action="append",
        choices=shared.LAWS,
        default=[],
        metavar="LAW",
        help="adds the population `fitted-LAW`: each driver by this one of SUMO's models, krauss or eidm, as "
        "`calibrate --law` fits it to all its windows; may be repeated",
    )
    parser.add_argument(
        "--without-d1",
        "--jam-distance",
        choices=("linearised", "refit"),
        default="linearised",
        help="what stands for d1, which SUMO lacks, in drivers calibrated here (default linearised: quick)",
    )
    parser.add_argument("--lane-change-model", default="LC2013", metavar="MODEL", help="LC2013 (default) or SL2015")
    parser.add_argument(
        "--lane-change",
        action="append",
        default=[],
        type=_setting,
        metavar="KEY=VALUE|fit|FILE",
        help="a parameter of it, such as lcSpeedGain=2; `fit`: those not given are fitted to the recorded lane changes "
        "on the first half, judged on the second, and left as lane_change.json; such a FILE; may be repeated",
    )
    parser.add_argument(
        "--ego",
        type=shared.whole((0, limits.VEHICLE[1])),
        metavar="ID",
        help="a vehicle that we drive by our own IDM, steering and bicycle",
    )
    parser.add_argument("--gui", action="store_true", help="watch it in sumo-gui")
    parser.add_argument(
        "--no-downstream-speed",
        action="store_true",
        help="do not impose the recorded speeds behind the section, where the bottleneck is",
    )
    parser.add_argument(
        "--no-place-speeds",
        action="store_true",
        help="let vehicles drive faster at a place than free vehicles were recorded there",
    )
    parser.add_argument(
        "--seeds",
        type=shared.whole(limits.COUNT),
        default=1,
        metavar="N",
        help="runs of each population, with --seed and the next ones (default 1)",
    )
    shared.cluster_argument(parser, "run populations and seeds")
    parser.add_argument(
        "--replay-bias",
        type=shared.whole((0, limits.COUNT[1])),
        default=150,
        metavar="N",
        help="vehicles driven with replayed and with reacting followers (default 150, 0: none)",
    )
    parser.add_argument(
        "--model",
        type=shared.path,
        metavar="FILE",
        help="extended model of `diagnose`: adds populations that our own loop drives, `own-loop` without "
        "its causes and `extended`"
        " with them, by the drivers that were refitted with them (drivers.parquet beside it)",
    )
    shared.output_argument(parser, "DIR", "tables/, figures/, fcd/, simulation/, report.html, manifest.json go there")
    outputs.declare(parser, "recording", "drivers", "model")


def _setting(text: str) -> tuple[str, str]:
    if text == FIT or text.endswith(".json"):
        return (FIT, "") if text == FIT else (LANE_CHANGE_FILE, text)
    key, equals, value = text.partition("=")
    if not (key and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r} is not KEY=VALUE, such as lcSpeedGain=2, `fit` or a .json file")
    return key, value


def _lane_change(given: list[tuple[str, str]], model: str) -> dict[str, str]:
    """Return given lane change parameters; single ones take precedence over a file's."""
    read_file = study_module("closed_loop.lane_changes").read_file
    of_files: dict[str, str] = {}
    for key, value in given:
        if key == LANE_CHANGE_FILE:
            of_files |= read_file(Path(value), model)
    return of_files | {key: value for key, value in given if key not in (FIT, LANE_CHANGE_FILE)}


def interactive(options: argparse.Namespace) -> None:
    """Run the closed loop.

    Parameters
    ----------
    options : argparse.Namespace
    """
    module, loop = study_module("closed_loop.run"), study_module("closed_loop.settings")
    options.recording = options.recording or SURROGATE
    if options.gui and options.cluster is not None:
        raise InputError("--gui shows a run on this machine; leave out --cluster")
    single = options.gui or options.ego is not None  # one population is all that can be watched or driven among
    types = tuple(dict.fromkeys(options.types or (TYPES[:1] if single else _types_for(options.drivers))))
    of_laws = tuple(loop.FITTED[law] for law in dict.fromkeys(options.law))
    if of_laws:
        types = of_laws if single and not options.types else (*types, *of_laws)
    if options.model is not None:
        from idm_sumo.models.effects import ExtendedModel

        ExtendedModel.read(options.model)  # before hours of simulation
        types = ("extended",) if single and not options.types else (*types, "own-loop", "extended")
    settings = loop.Settings(
        recording=str(shared.recording_path(options)) if options.net_file else options.recording,
        period=options.period,
        drivers=options.drivers,
        types=types,
        refit=options.without_d1 == "refit",
        lane_change_model=options.lane_change_model,
        lane_change=_lane_change(options.lane_change, options.lane_change_model),
        fit_lane_change=(FIT, "") in options.lane_change,
        ego=options.ego,
        gui=options.gui,
        downstream_speed=not options.no_downstream_speed,
        place_speeds=not options.no_place_speeds,
        seeds=options.seeds,
        bias_sample=0 if single else options.replay_bias,
        minutes=options.minutes,
        location=options.location,
        seed=options.seed,
        jobs=options.jobs,
        cluster=shared.cluster_of(options),
        model=options.model,
    )
    with progress_bar(module.stages(settings)) as report:
        table = module.interactive(settings, options.output, command=sys.argv, progress=report)
    say(
        text_table(table[SHOWN_LOOP]),
        study_module("closed_loop.words").in_words(table),
        f"open {options.output / 'report.html'}",
    )
    shared.note_origin_of(options.output)


def _types_for(drivers: Path | None) -> tuple[str, ...]:
    """Return the populations that can be had of a driver table; all of drivers that are calibrated in the run.

    A table of predicted drivers has none drawn to the population, and often no driving codes to predict from.
    """
    if drivers is None:
        return TYPES
    from idm_sumo.calibration.drawn import DRAWN
    from idm_sumo.calibration.driver_table import read_drivers
    from idm_sumo.prediction.driving_code import FEATURES
    from idm_sumo.prediction.residual_drive import MODEL, POPULATION

    table = read_drivers(drivers)
    columns = {name for name in table if name != MODEL or (table[name] != POPULATION).any()}
    needed = {"drawn": set(DRAWN), "predicted": set(FEATURES.values()), RESIDUAL: {MODEL}}
    return tuple(name for name in (*TYPES, RESIDUAL) if needed.get(name, set()) <= columns)
