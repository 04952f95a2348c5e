"""``calibrate`` and ``predict``: IDM parameters of drivers."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.cli import many, outputs
from idm_sumo.cli import options as shared
from idm_sumo.cli.console import note, progress_bar, say, study_module
from idm_sumo.runtime import limits

if TYPE_CHECKING:
    import pandas as pd

    from idm_sumo.roads import Road


CALIBRATE = f"""\
fit five IDM parameters to every driver (the oracle)

Each driver is simulated behind its recorded leader for 10 s, and a, b, T, d0
and d1 are chosen so that it stays as near to its recording as it can. Vehicle
types for SUMO are fitted to all of its windows, without d1.

{many.ABOUT}

reads   RECORDING ...
leaves  FILE, one row a driver: period, vehicle, a, b, T, d0, d1 (SI),
        desired_speed_m_s, ade_m (mean distance from the recording, m), status,
        at_bound, what SUMO needs (a_whole, ...), the driver's first second
next    idm-sumo predict RECORDING --drivers FILE -o predicted.parquet, or
        idm-sumo export FILE -o drivers.rou.xml"""
PREDICT = f"""\
predict IDM parameters from the first observed frames

{many.ABOUT}

reads   RECORDING ..., and the table of `calibrate`, or its data set, to learn
        from
leaves  FILE with the key columns of that table, for drivers as if only their
        first second were known
next    idm-sumo export FILE -o drivers.rou.xml, or idm-sumo replay RECORDING
        --vehicle ID --drivers FILE -o out"""


def add(commands: Any) -> None:
    """Add the commands of this module.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    _add_calibrate(commands)
    _add_predict(commands)


def _add_calibrate(commands: Any) -> None:
    parser = shared.command(
        commands, "calibrate", calibrate, CALIBRATE, "idm-sumo calibrate RECORDING -o drivers.parquet"
    )
    many.add_arguments(parser)
    shared.window_arguments(parser)
    parser.add_argument(
        "--desired-speed", type=shared.desired_speed, metavar="V|auto",
        help="v0 in m/s, kept in the table (default: the speed limit of the recorded road); auto: the "
             "one speed of the recording "
        "with which its drivers are fitted best, and for each driver at least the highest speed it is recorded at",
    )  # fmt: skip
    parser.add_argument(
        "--every",
        type=shared.whole(limits.FRAMES),
        metavar="FRAMES",
        help="a row for a further window every so many frames (default: one row, of the window at entry)",
    )
    parser.add_argument(
        "--all-windows", action="store_true",
        help="a, b, T, d0 and d1, too, from all of a driver's windows, as its vehicle type is anyway: ten seconds give "
        "back those seconds, not the driver (windows follow each other unless --every says otherwise)",
    )  # fmt: skip
    parser.add_argument(
        "--law", action="append", choices=shared.LAWS, metavar="LAW",
        help="types of this one of SUMO's models, too, fitted to all of a driver's windows, for `export --law` and "
        "`interactive --law`: krauss or eidm",
    )  # fmt: skip
    parser.add_argument(
        "--objective", choices=("ade", "gap", "speed", "log-gap"), default="ade", help="what is minimised (default ade)"
    )
    parser.add_argument(
        "--solver",
        choices=("gauss-newton", "l-bfgs-b"),
        default="gauss-newton",
        help="gauss-newton: fast, exact derivatives (default); l-bfgs-b: the paper's",
    )
    shared.output_argument(parser, "FILE|DIR", ".parquet or .csv, one row a driver; a folder for many recordings")
    outputs.declare(parser, "recording", endings=many.TABLES, many=True)


def _add_predict(commands: Any) -> None:
    parser = shared.command(
        commands,
        "predict",
        predict,
        PREDICT,
        "idm-sumo predict RECORDING --drivers drivers.parquet -o predicted.parquet",
    )
    many.add_arguments(parser)
    parser.add_argument(
        "--method",
        choices=("knn", "rollout", "residual"),
        default="knn",
        help="knn: the paper's, average the calibrated neighbours (default); rollout: weights fitted to drive the "
        "RECORDING right, with spread; residual: rollout's parameters for SUMO, and beside them what drives nearer in "
        "`replay`, an acceleration beyond the pooled IDM that no vehicle type holds; a driver is left out of what "
        "predicts it",
    )
    parser.add_argument(
        "--drivers",
        type=shared.path,
        metavar="FILE",
        help="calibrated drivers to learn from (rollout, residual: all of RECORDING without)",
    )
    parser.add_argument(
        "--period", action="append", metavar="PERIOD", help="only this recording period; may be repeated"
    )
    parser.add_argument(
        "--observed",
        type=shared.whole(limits.OBSERVED),
        default=10,
        metavar="FRAMES",
        help="frames to observe (default 10, one second); rollout predicts from the last ten, residual from all",
    )
    parser.add_argument(
        "--neighbours",
        type=shared.whole(limits.NEIGHBOURS),
        default=8,
        metavar="K",
        help="drivers to average (default 8)",
    )
    parser.set_defaults(horizon=1, rollout_start="observed")
    shared.output_argument(parser, "FILE|DIR", ".parquet or .csv, one row a driver; a folder for many recordings")
    outputs.declare(parser, "recording", "drivers", endings=many.TABLES, many=True)


def calibrate(options: argparse.Namespace) -> None:
    """Fit every driver.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.calibration.search import Search

    module = study_module("drivers.calibrated")
    how = module.Calibration(
        window=shared.window_of(options, options.every),
        periods=tuple(options.period or ()),
        objective=options.objective,
        search=Search(options.solver, seed=options.seed),
        desired_speed=options.desired_speed,
        all_windows=options.all_windows,
        laws=tuple(dict.fromkeys(options.law or ())),
    )
    if many.are_meant(options):
        many.run(options, study_module("many.work").Calibrate(how))
        return
    source = many.only_source(options)
    if options.cluster:
        found = many.computed(options, module.calibrated, source, how)
    else:
        with progress_bar() as report:
            found = module.calibrated(source, how, jobs=options.jobs, progress=report)
    table = found.table
    write(table, options.output, found.road)
    _note_faster(table)
    for reason, count in found.left_out.items():
        note(f"{count} vehicle{'s' * (count != 1)} not calibrated: {reason}")
    shared.note_origin(found.notes)
    statuses = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    say(f"{len(table)} drivers, mean ADE {table['ade_m'].mean():.2f} m; status: {statuses}", f"wrote {options.output}")


def _note_faster(table: pd.DataFrame) -> None:
    """Say what to do about drivers that are recorded above their desired speed."""
    from idm_sumo.calibration.status import FASTER

    faster = table[table["status"] == FASTER]
    if len(faster):
        note(
            f"{len(faster)} of {len(table)} drivers are recorded above their desired speed of "
            f"{faster['desired_speed_m_s'].max():.1f} m/s on average, up to {faster['mean_speed_m_s'].max():.1f} m/s, "
            "so that their parameters mean nothing; give --desired-speed auto, or a speed in m/s"
        )


def predict(options: argparse.Namespace) -> None:
    """Predict every driver from its first frames.

    Parameters
    ----------
    options : argparse.Namespace
    """
    module, work = study_module("drivers.predicted"), study_module("many.work")
    how = module.Prediction(
        window=shared.window_of(options),
        periods=tuple(options.period or ()),
        method=options.method,
        neighbours=options.neighbours,
        seed=options.seed,
    )
    module.check_library(how, options.drivers is not None)
    if many.are_meant(options):
        many.run(options, work.Predict(how, options.drivers))
        return
    source = many.only_source(options)
    call = (work.predict_one, source, how, options.drivers)
    found = many.computed(options, *call) if options.cluster else call[0](*call[1:])
    table = found.table
    write(table, options.output, found.road)
    for reason, count in found.left_out.items():
        note(f"{count} vehicle{'s' * (count != 1)} not predicted: {reason}")
    shared.note_origin(found.notes)
    statuses = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    say(f"{len(table)} drivers; status: {statuses}", f"wrote {options.output}")


def write(table: pd.DataFrame, path: Path, road: Road) -> None:
    """Write a driver table, Parquet or CSV by its ending.

    Parameters
    ----------
    table : pandas.DataFrame
    path : Path
    road : Road
        What the drivers were recorded on; a Parquet keeps one that is not the default.

    Raises
    ------
    InputError
        If the ending is neither.
    """
    from idm_sumo.calibration.driver_table import write_drivers
    from idm_sumo.runtime.errors import InputError
    from idm_sumo.runtime.files import new_file

    if path.suffix not in (".parquet", ".csv"):
        raise InputError(f"{path}: a driver table ends in .parquet or .csv")
    with new_file(path) as part:
        if path.suffix == ".csv":
            table.to_csv(part, index=False)
        else:
            write_drivers(table, part, road)
