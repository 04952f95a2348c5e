"""``inspect``, ``fetch`` and ``surrogate``: recordings and where they come from."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.cli import options as shared
from idm_sumo.cli import outputs
from idm_sumo.cli.console import progress_bar, say, text_table

if TYPE_CHECKING:
    import pandas as pd

    from idm_sumo.recordings.recording import Recording

INSPECT = """\
account for every row of a recording, and list its vehicles

reads   RECORDING
leaves  nothing; prints rows read, dropped (and why) and used, periods, lanes,
        classes
next    idm-sumo calibrate RECORDING -o drivers.parquet, or idm-sumo replay
        RECORDING --vehicle ID -o out with a number of --vehicles"""
SURROGATE = """\
make a stand-in recording with SUMO, for people without the files

Several car-following models, a character for every driver, lane changes, ramps,
trucks, waves from a bottleneck and a camera's noise, in NGSIM's layout. It is
not measured: Parquet and CSV say so to every command that reads them, the
official text cannot.

reads   nothing
leaves  FILE, three periods of equal length
next    idm-sumo inspect FILE; the word `surrogate` as RECORDING does without a
        file"""
FETCH = """\
download the official recording from the agency's data portal

An interrupted download goes on where it stopped when the same command is run
again.

reads   the portal of the U.S. Department of Transportation, page by page
leaves  DIR/..., a Parquet file, and the account of its rows on standard output
next    idm-sumo inspect FILE"""


def add(commands: Any) -> None:
    """Add the commands of this module.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    parser = shared.command(commands, "inspect", inspect, INSPECT,
                            "idm-sumo inspect surrogate --vehicles", "idm-sumo inspect RECORDING --json")  # fmt: skip
    shared.recording_argument(parser)
    parser.add_argument(
        "--vehicles",
        action="store_true",
        help="list every vehicle: its number, frames and times, and whether it can be used",
    )
    parser.add_argument("--json", action="store_true", help="print JSON for programs")

    parser = shared.command(
        commands, "surrogate", surrogate, SURROGATE, "idm-sumo surrogate -o surrogate.parquet --minutes 4"
    )
    shared.output_argument(parser, "FILE", ".parquet, .txt (official layout) or .csv (portal layout)")
    outputs.declare(parser, endings=(".parquet", ".txt", ".csv"))
    parser.add_argument(
        "--minutes", type=shared.minutes, default=45.0, metavar="N", help="length (default 45, three periods of 15)"
    )

    parser = shared.command(commands, "fetch", fetch, FETCH, "idm-sumo fetch --dest data")
    outputs.declare(parser, output="dest", kept=True)
    parser.add_argument(
        "--dest", type=shared.path, default=Path("data"), metavar="DIR", help="where it goes (default data)"
    )
    parser.add_argument("--location", default="us-101", metavar="NAME", help="which study area (default us-101)")
    parser.add_argument(
        "--verify", action="store_true", help="compare every page with the portal, even where nothing seems changed"
    )
    parser.add_argument("--json", action="store_true", help="print JSON for programs")


def inspect(options: argparse.Namespace) -> None:
    """Print the accounting.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.recordings.cleaning import clean
    from idm_sumo.recordings.inspection import summarise

    read = shared.read(options)
    cleaned = clean(read)
    path = options.recording if options.net_file else shared.recording_path(options)
    inspection = summarise(read, cleaned, str(path))
    vehicles = _vehicles(read, cleaned) if options.vehicles else None
    if options.json:
        listed = {} if vehicles is None else {"vehicles": json.loads(vehicles.to_json(orient="records"))}
        say(json.dumps(inspection.to_json() | listed, indent=2))
        return
    say(*inspection.lines())
    if vehicles is not None:
        say("", text_table(vehicles.assign(eligible=vehicles["eligible"].map({True: "yes", False: "no"}))))


def _vehicles(read: Recording, cleaned: Recording) -> pd.DataFrame:
    from idm_sumo.recordings.inspection import vehicle_table
    from idm_sumo.scenes.windows import Window

    return vehicle_table(read, cleaned, least_frames=Window().frames)


def fetch(options: argparse.Namespace) -> None:
    """Download, then account for every row.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.recordings.fetch import fetch as download
    from idm_sumo.roads import BUILT_IN

    with progress_bar() as report:
        result = download(options.dest, location=options.location, verify=options.verify, progress=report)
    if options.location.lower() not in BUILT_IN:  # what its rows mean on another road is not known
        say(f"wrote {result.path}: {result.rows:,} rows of {options.location}")
        return
    inspection = result.inspect()
    say(
        json.dumps(inspection.to_json(), indent=2)
        if options.json
        else "\n".join([*inspection.lines(), f"wrote {result.path}"])
    )


def surrogate(options: argparse.Namespace) -> None:
    """Make the stand-in.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.sumo.surrogate.make import make_surrogate

    with progress_bar() as report:
        make_surrogate(
            options.output, minutes=options.minutes, seed=options.seed,
            progress=lambda done, total: report("simulating", done, total),
        )  # fmt: skip
    say(f"wrote {options.output}")
