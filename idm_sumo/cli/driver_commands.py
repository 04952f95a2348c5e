"""``calibrate``, ``predict`` and ``export``: IDM parameters of drivers, fitted, foreseen, and as SUMO types."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.cli import options as shared
from idm_sumo.cli.console import note, progress_bar, say, text_table

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd

    from idm_sumo.scenes.windows import Scenes


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

    parser = shared.command(commands, "predict", predict, "predict IDM parameters from the first observed frames",
                            "idm-sumo predict RECORDING --drivers drivers.parquet -o predicted.parquet")  # fmt: skip
    shared.recording_argument(parser)
    parser.add_argument("--method", choices=("knn", "rollout"), default="knn",
                        help="knn: the paper's, average the calibrated neighbours (default); rollout: weights fitted to drive the "
                        "RECORDING right, with spread; a driver is left out of what predicts it")  # fmt: skip
    parser.add_argument(
        "--drivers",
        type=Path,
        metavar="FILE",
        help="calibrated drivers to learn from (rollout: all of RECORDING without)",
    )
    parser.add_argument(
        "--period", action="append", metavar="LABEL", help="only this recording period; may be repeated"
    )
    parser.add_argument(
        "--observed",
        type=int,
        default=10,
        metavar="FRAMES",
        help="frames to observe (default 10, one second); "
        "with rollout those before the last ten are driven again, and count as much as they help in drivers left out",
    )
    parser.add_argument("--neighbours", type=int, default=8, metavar="K", help="drivers to average (default 8)")
    parser.set_defaults(horizon=1, rollout_start="observed")
    shared.output_argument(parser, "FILE", ".parquet or .csv, one row a driver")

    parser = shared.command(commands, "export", export, "write calibrated drivers as SUMO vehicle types that drive as calibrated",
                            "idm-sumo export drivers.parquet -o drivers.rou.xml && sumo -c drivers.sumocfg")  # fmt: skip
    parser.add_argument("drivers", type=Path, metavar="DRIVERS", help="table of `calibrate` or `predict`")
    shared.output_argument(parser, "FILE.rou.xml", "FILE.sumocfg and FILE.net.xml are written beside it")
    parser.add_argument("--jam-distance", choices=("refit", "linearised", "none"), default="refit",
                        help="what stands for d1, which SUMO's IDM lacks: a refit without it (default), its tangent at the "
                        "driver's mean speed, or nothing")  # fmt: skip
    parser.add_argument(
        "--integration", choices=("euler", "ballistic"), default="euler", help="of the SUMO run (default euler)"
    )
    parser.add_argument(
        "-n", "--net-file", type=Path, metavar="FILE", help="another build of our network, say with another speed limit"
    )
    parser.add_argument("--distribution", action="store_true",
                        help="write a vTypeDistribution of the population instead, for any network (FILE.add.xml)")  # fmt: skip
    parser.add_argument(
        "--representatives", type=int, metavar="N", help="with --distribution: only so many typical drivers"
    )
    parser.add_argument("--model", type=Path, metavar="FILE",
                        help="extended model of `diagnose`: what SUMO's types can hold of it goes into them, the rest is said")  # fmt: skip
    parser.add_argument("--no-check", action="store_true", help="do not run SUMO once to see who departs late")


def calibrate(options: argparse.Namespace) -> None:
    """Fit every driver."""
    import pandas as pd

    from idm_sumo.calibration import calibrate as fit
    from idm_sumo.calibration.departures import departures
    from idm_sumo.calibration.without_d1 import jam_distance_costs, refit_table
    from idm_sumo.prediction.driving_code import driving_code

    scenes, left_out = shared.scenes_of(options, shared.window_of(options, options.every))
    tables = []
    with progress_bar() as report:
        for one in scenes:
            fits = fit(
                one, objective=options.objective, solver=options.solver, desired_speed=options.desired_speed,
                seed=options.seed, jobs=options.jobs, progress=report,
            )  # fmt: skip
            fits = _beside(fits, refit_table(fits, one, desired_speed=options.desired_speed))
            costs = jam_distance_costs(fits, one, desired_speed=options.desired_speed)
            tables.append(_beside(fits, costs, driving_code(one), departures(one)))
    table = pd.concat(tables, ignore_index=True)
    write(table.assign(desired_speed_m_s=options.desired_speed), options.output)
    for reason, count in left_out.items():
        note(f"{count} vehicles not calibrated: {reason}")
    statuses = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    say(f"{len(table)} drivers, mean ADE {table['ade_m'].mean():.2f} m; status: {statuses}", f"wrote {options.output}")


def predict(options: argparse.Namespace) -> None:
    """Predict every driver from its first frames."""
    import pandas as pd

    from idm_sumo.calibration.departures import departures

    foresee = _through_rollout(options) if options.method == "rollout" else _neighbours(options)
    scenes, left_out = shared.scenes_of(options, shared.window_of(options))
    predicted = [_beside(foresee(one), departures(one)) for one in scenes]
    table = pd.concat(predicted, ignore_index=True)
    write(table, options.output)
    for reason, count in left_out.items():
        note(f"{count} vehicles not predicted: {reason}")
    statuses = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    say(f"{len(table)} drivers; status: {statuses}", f"wrote {options.output}")


def _neighbours(options: argparse.Namespace) -> Callable[[Scenes], pd.DataFrame]:
    """Return the paper's prediction."""
    from idm_sumo.calibration.driver_table import read_drivers
    from idm_sumo.prediction import predict_drivers
    from idm_sumo.runtime.errors import InputError

    if options.drivers is None:
        raise InputError(
            "--drivers: the neighbours need calibrated drivers; `idm-sumo calibrate RECORDING -o FILE` writes them"
        )
    library = read_drivers(options.drivers)
    return lambda scenes: predict_drivers(scenes, library, observed=options.observed, neighbours=options.neighbours)


def _through_rollout(options: argparse.Namespace) -> Callable[[Scenes], pd.DataFrame]:
    """Learn from the recording; return the prediction."""
    from idm_sumo.calibration.driver_table import read_drivers
    from idm_sumo.prediction import MovingHorizon, RolloutPredictor
    from idm_sumo.prediction.driver_prediction import (
        LEARNING_STEP,
        SECOND,
        WATCHING_STEP,
        drivers_of,
        predict_through_rollout,
    )
    from idm_sumo.scenes.windows import Window

    def training(window: Window) -> list[Scenes]:
        found, _ = shared.scenes_of(options, window)
        return found if options.drivers is None else drivers_of(found, read_drivers(options.drivers))

    second = min(options.observed, SECOND)
    predictor = RolloutPredictor(seed=options.seed).fit(training(Window(observed=second, every=LEARNING_STEP)))
    if options.observed == second:
        return lambda scenes: predict_through_rollout(scenes, predictor)
    watched = training(Window(observed=options.observed, every=WATCHING_STEP))
    watcher = MovingHorizon(predictor, seed=options.seed).fit(watched)
    return lambda scenes: predict_through_rollout(scenes, watcher)


def _beside(table: pd.DataFrame, *more: pd.DataFrame) -> pd.DataFrame:
    """Put further columns of the same drivers, in the same order, beside a table."""
    for other in more:
        table = table.join(other[[name for name in other.columns if name not in table.columns]])
    return table


def export(options: argparse.Namespace) -> None:
    """Write vehicle types, their vehicles and the run that drives them."""
    from idm_sumo.calibration.driver_table import read_drivers
    from idm_sumo.calibration.without_d1 import cost_summary
    from idm_sumo.models.effects import ExtendedModel
    from idm_sumo.runtime.errors import InputError
    from idm_sumo.sumo.closed_loop.insertion import departure_delays
    from idm_sumo.sumo.export.distribution import export_distribution
    from idm_sumo.sumo.export.routes import export_routes

    drivers, shared_options = (
        read_drivers(options.drivers),
        {"jam_distance": options.jam_distance, "integration": options.integration},
    )
    model = None if options.model is None else ExtendedModel.read(options.model)
    if options.distribution:
        if model is not None:
            raise InputError("--model: a distribution is for any network and time; leave out --distribution")
        written = export_distribution(
            drivers, options.output, representatives=options.representatives, seed=options.seed,
            source=str(options.drivers), **shared_options,
        )  # fmt: skip
        say(f"wrote {written}")
        return
    exported = export_routes(
        drivers, options.output, net_file=options.net_file, model=model, source=str(options.drivers), **shared_options
    )
    for line in exported.notes:
        note(line)
    say(
        f"wrote {exported.route_file}: {len(exported.vehicles)} drivers; run them with `sumo -c {exported.config_file}`"
    )
    if {"ade_m", "ade_exact_m"} <= set(drivers.columns):
        say(
            "what each way to do without d1 costs (m of ADE over the calibration window):",
            text_table(cost_summary(_costs(drivers))),
        )
    if not options.no_check:
        delays = departure_delays(exported.config_file)
        late = delays[delays["delay_s"] > 0]
        say(f"{len(late)} of {len(delays)} departures are late, for want of room behind the vehicle ahead")
        if len(late):
            say(text_table(late))


def _costs(drivers: pd.DataFrame) -> pd.DataFrame:
    """Return the columns of the jam distance's costs that a table holds."""
    return drivers[[name for name in drivers.columns if name.startswith("ade_")]]


def write(table: pd.DataFrame, path: Path) -> None:
    """Write a driver table, Parquet or CSV by its ending.

    Raises
    ------
    InputError
        If the ending is neither.
    """
    from idm_sumo.runtime.errors import InputError
    from idm_sumo.runtime.files import new_file

    if path.suffix not in (".parquet", ".csv"):
        raise InputError(f"{path}: a driver table ends in .parquet or .csv")
    with new_file(path) as part:
        if path.suffix == ".csv":
            table.to_csv(part, index=False)
        else:
            table.to_parquet(part, index=False)
