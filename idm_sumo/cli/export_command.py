"""``export``: drivers as SUMO vehicle types."""

from __future__ import annotations

import argparse
import shlex
from typing import TYPE_CHECKING, Any

from idm_sumo.cli import options as shared
from idm_sumo.cli import outputs
from idm_sumo.cli.console import note, say, text_table
from idm_sumo.runtime import limits

if TYPE_CHECKING:
    import pandas as pd

    from idm_sumo.sumo.export.routes import Exported

LISTED = 20  # late departures that are shown

EXPORT = """\
write drivers as SUMO vehicle types that drive as calibrated

reads   DRIVERS, the table of `calibrate` or `predict`
leaves  FILE.rou.xml with a vType, a route and a departure for each driver, the
        network and a configuration beside it
next    sumo -c FILE.sumocfg, or include the vTypes in a simulation of your own"""


def add(commands: Any) -> None:
    """Add the command of this module.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    parser = shared.command(commands, "export", export, EXPORT, "idm-sumo export drivers.parquet -o drivers.rou.xml")
    parser.add_argument("drivers", type=shared.path, metavar="DRIVERS", help="table of `calibrate` or `predict`")
    shared.output_argument(parser, "FILE.rou.xml", "FILE.sumocfg and FILE.net.xml are written beside it")
    outputs.declare(parser, "drivers", "net_file", "model", endings=(".xml",))
    parser.add_argument(
        "--parameters",
        choices=("drawn", "whole", "fitted", "pooled"),
        help="drawn to the population by all windows of the driver: no parameter at a bound, for traffic that reacts "
        "(default where the table has it); fitted to all its windows; to its first ten seconds, which it gives back "
        "best (default for predicted drivers); one set for all",
    )
    parser.add_argument(
        "--law",
        choices=("idm", *shared.LAWS),
        default="idm",
        help="SUMO's model: the IDM (default), or the types of another one that `calibrate --law` fitted",
    )
    parser.add_argument(
        "--without-d1",
        "--jam-distance",
        choices=("refit", "linearised", "none"),
        help="what stands for d1, which SUMO's IDM lacks: a refit without it, its tangent at the driver's mean "
        "speed, or nothing (default: the refit, where the table has none the tangent)",
    )
    parser.add_argument(
        "--integration", choices=("euler", "ballistic"), default="euler", help="of the SUMO run (default euler)"
    )
    parser.add_argument(
        "-n",
        "--net-file",
        type=shared.path,
        metavar="FILE",
        help="another build of our network, say with another speed limit",
    )
    parser.add_argument(
        "--distribution",
        action="store_true",
        help="write a vTypeDistribution of the population instead, for any network (FILE.add.xml)",
    )
    parser.add_argument(
        "--representatives",
        type=shared.whole(limits.COUNT),
        metavar="N",
        help="with --distribution: only so many typical drivers",
    )
    parser.add_argument(
        "--which",
        choices=("determined", "every"),
        default="determined",
        help="with --distribution: only drivers whose fit succeeded within its bounds (default), or every driver",
    )
    parser.add_argument(
        "--model",
        type=shared.path,
        metavar="FILE",
        help="extended model of `diagnose`: what SUMO's types can hold of it goes into them, the rest is said",
    )
    parser.add_argument("--no-check", action="store_true", help="do not run SUMO once to see who departs late")


def export(options: argparse.Namespace) -> None:
    """Write vehicle types, vehicles and a SUMO configuration.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.calibration.driver_table import read_drivers, road_of_drivers
    from idm_sumo.calibration.parameter_sets import usual_set, with_set
    from idm_sumo.calibration.without_d1 import cost_summary
    from idm_sumo.models.effects import ExtendedModel
    from idm_sumo.runtime.errors import InputError
    from idm_sumo.sumo.closed_loop.insertion import departure_delays
    from idm_sumo.sumo.export.distribution import export_distribution
    from idm_sumo.sumo.export.routes import export_routes

    drivers = read_drivers(options.drivers)
    said: tuple[str, ...]
    if options.law != "idm":
        drivers, price = _of_law(drivers, options)
        which, said = f"{options.law}, all windows", (price,)
    else:
        which = options.parameters or usual_set(drivers)
        said = _said_of(which, drivers, options)
        drivers = with_set(drivers, which, str(options.drivers))
    model = None if options.model is None else ExtendedModel.read(options.model)
    if options.distribution:
        if model is not None:
            raise InputError("--model: a distribution is for any network and time; leave out --distribution")
        written = export_distribution(
            drivers,
            options.output,
            which=options.which,
            representatives=options.representatives,
            seed=options.seed,
            without_d1=options.without_d1,
            road=road_of_drivers(options.drivers),
            source=str(options.drivers),
        )
        for line in (*said, *written.notes):
            note(line)
        say(f"wrote {written.file}: {written.types} types that stand for {written.drivers} drivers ({which})")
        return
    exported = export_routes(
        drivers,
        options.output,
        net_file=options.net_file,
        road=road_of_drivers(options.drivers),
        model=model,
        law=options.law,
        without_d1=options.without_d1 if options.law == "idm" else "none",
        integration=options.integration,
        source=str(options.drivers),
    )
    for line in (*said, *exported.notes):
        note(line)
    count = f"{len(exported.vehicles)} drivers ({which})"
    say(f"wrote {exported.route_file}: {count}; run them with `{_run_line(exported)}`")
    if which == "fitted" and {"ade_m", "ade_exact_m"} <= set(drivers.columns):
        say(
            "what each way to do without d1 costs (m of ADE over the calibration window):",
            text_table(cost_summary(_costs(drivers))),
        )
    if not options.no_check:
        delays = departure_delays(exported.config_file)
        late = delays[delays["delay_s"] > 0].sort_values("delay_s", ascending=False, kind="stable")
        say(f"{len(late)} of {len(delays)} departures are late, for want of room behind the vehicle ahead")
        if len(late):
            more = [f"... and {len(late) - LISTED} that are less late"] if len(late) > LISTED else []
            say(text_table(late.head(LISTED)), *more)


def _of_law(drivers: pd.DataFrame, options: argparse.Namespace) -> tuple[pd.DataFrame, str]:
    """Return drivers by another law, and its price."""
    from idm_sumo.calibration.parameter_sets import with_law
    from idm_sumo.runtime.errors import InputError

    given = {
        "--parameters": options.parameters, "--without-d1": options.without_d1, "--model": options.model,
        "--distribution": options.distribution, "--integration ballistic": options.integration != "euler",
    }  # fmt: skip
    for name, value in given.items():
        if value:
            raise InputError(f"--law {options.law}: is fitted to all windows under Euler steps; leave out {name}")
    return with_law(drivers, options.law, str(options.drivers))


def _said_of(which: str, drivers: pd.DataFrame, options: argparse.Namespace) -> tuple[str, ...]:
    """Return what is to be said of types that are fitted to all windows."""
    from idm_sumo.calibration.whole import WINDOWS
    from idm_sumo.runtime.errors import InputError

    if which != "whole":
        return ()
    if options.without_d1 is not None:
        raise InputError("--parameters whole: these have no d1; leave out --without-d1")
    windows = f" ({drivers[WINDOWS].median():g} in the median)" if WINDOWS in drivers else ""
    return (f"types are fitted to all windows of a driver{windows}; --parameters fitted takes its first ten seconds",)


def _run_line(exported: Exported) -> str:
    """Return the command that runs an export; from within its folder where SUMO cannot read the folder's name."""
    from idm_sumo.sumo.plain_paths import is_plain

    config = exported.config_file
    if is_plain(config):
        return f"sumo -c {shlex.quote(str(config))}"
    return f"cd {shlex.quote(str(config.parent))} && sumo -c {shlex.quote(config.name)}"


def _costs(drivers: pd.DataFrame) -> pd.DataFrame:
    """Return the columns with the errors of doing without d1."""
    return drivers[[name for name in drivers.columns if name.startswith("ade_")]]
