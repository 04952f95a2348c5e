"""``calibrate`` and ``predict``: IDM parameters of drivers, fitted or foreseen."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.cli import options as shared
from idm_sumo.cli.console import note, progress_bar, say

if TYPE_CHECKING:
    import pandas as pd


def add(commands: Any) -> None:
    """Add the commands of this module."""
    parser = shared.command(commands, "calibrate", calibrate, "fit five IDM parameters to every driver (the oracle)",
                            "idm-sumo calibrate RECORDING -o drivers.parquet")  # fmt: skip
    shared.recording_argument(parser)
    shared.window_arguments(parser)
    parser.add_argument(
        "--every", type=int, metavar="FRAMES", help="a further window every so many frames (default: one, at entry)"
    )
    parser.add_argument(
        "--objective", choices=("ade", "gap", "speed", "log-gap"), default="ade", help="what is minimised (default ade)"
    )
    parser.add_argument("--solver", choices=("gauss-newton", "l-bfgs-b"), default="gauss-newton",
                        help="gauss-newton: fast, exact derivatives (default); l-bfgs-b: the paper's")  # fmt: skip
    shared.output_argument(parser, "FILE", ".parquet or .csv, one row a driver")

    parser = shared.command(commands, "predict", predict, "predict IDM parameters from the first observed frames (KNN on the driving code)",
                            "idm-sumo predict RECORDING --drivers drivers.parquet -o predicted.parquet")  # fmt: skip
    shared.recording_argument(parser)
    parser.add_argument("--drivers", type=Path, required=True, metavar="FILE", help="calibrated drivers to learn from")
    parser.add_argument(
        "--period", action="append", metavar="LABEL", help="only this recording period; may be repeated"
    )
    parser.add_argument(
        "--observed", type=int, default=10, metavar="FRAMES", help="frames to observe (default 10, one second)"
    )
    parser.add_argument("--neighbours", type=int, default=8, metavar="K", help="drivers to average (default 8)")
    parser.set_defaults(horizon=1, rollout_start="observed")
    shared.output_argument(parser, "FILE", ".parquet or .csv, one row a driver")


def calibrate(options: argparse.Namespace) -> None:
    """Fit every driver."""
    import pandas as pd

    from idm_sumo.calibration import calibrate as fit
    from idm_sumo.departures import departures
    from idm_sumo.driving_code import driving_code

    scenes, left_out = shared.scenes_of(options, shared.window_of(options, options.every))
    tables = []
    with progress_bar() as report:
        for one in scenes:
            fits = fit(
                one, objective=options.objective, solver=options.solver, desired_speed=options.desired_speed,
                seed=options.seed, jobs=options.jobs, progress=report,
            )  # fmt: skip
            place = departures(one).drop(columns=["period", "vehicle", "first_frame"])
            tables.append(fits.join(driving_code(one)).join(place))
    table = pd.concat(tables, ignore_index=True)
    write(table.assign(desired_speed_m_s=options.desired_speed), options.output)
    for reason, count in left_out.items():
        note(f"{count} vehicles not calibrated: {reason}")
    statuses = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    say(f"{len(table)} drivers, mean ADE {table['ade_m'].mean():.2f} m; status: {statuses}", f"wrote {options.output}")


def predict(options: argparse.Namespace) -> None:
    """Predict every driver from its first frames."""
    import pandas as pd

    from idm_sumo.driver_table import read_drivers
    from idm_sumo.prediction import predict_drivers

    library = read_drivers(options.drivers)
    scenes, left_out = shared.scenes_of(options, shared.window_of(options))
    predicted = [
        predict_drivers(one, library, observed=options.observed, neighbours=options.neighbours) for one in scenes
    ]
    table = pd.concat(predicted, ignore_index=True)
    write(table, options.output)
    for reason, count in left_out.items():
        note(f"{count} vehicles not predicted: {reason}")
    statuses = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    say(f"{len(table)} drivers; status: {statuses}", f"wrote {options.output}")


def write(table: pd.DataFrame, path: Path) -> None:
    """Write a driver table, Parquet or CSV by its ending.

    Raises
    ------
    InputError
        If the ending is neither.
    """
    from idm_sumo.errors import InputError
    from idm_sumo.outputs import new_file

    if path.suffix not in (".parquet", ".csv"):
        raise InputError(f"{path}: a driver table ends in .parquet or .csv")
    with new_file(path) as part:
        if path.suffix == ".csv":
            table.to_csv(part, index=False)
        else:
            table.to_parquet(part, index=False)
