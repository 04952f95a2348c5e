"""``inspect``, ``fetch`` and ``surrogate``: what is in a recording, and where to get one."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from idm_sumo.cli import options as shared
from idm_sumo.cli.console import progress_bar, say


def add(commands: Any) -> None:
    """Add the commands of this module."""
    parser = shared.command(commands, "inspect", inspect, "account for every row of a recording",
                            "idm-sumo inspect trajectories-0750am-0805am.txt")  # fmt: skip
    shared.recording_argument(parser)
    parser.add_argument("--json", action="store_true", help="print JSON for programs")

    parser = shared.command(commands, "surrogate", surrogate, "make a stand-in recording with SUMO, for people without the files",
                            "idm-sumo surrogate -o surrogate.parquet --minutes 45 --seed 1")  # fmt: skip
    shared.output_argument(parser, "FILE", ".parquet, .txt (official layout) or .csv (portal layout)")
    parser.add_argument("--minutes", type=float, default=45.0, help="length (default 45, three periods of 15)")

    parser = shared.command(commands, "fetch", fetch, "download the official recording from the agency's data portal",
                            "idm-sumo fetch --dest data")  # fmt: skip
    parser.add_argument("--dest", type=Path, default=Path("data"), metavar="DIR", help="where it goes (default data)")
    parser.add_argument("--location", default="us-101", help="which study area (default us-101)")
    parser.add_argument(
        "--verify", action="store_true", help="compare every page with the portal, even where nothing seems changed"
    )
    parser.add_argument("--json", action="store_true", help="print JSON for programs")


def inspect(options: argparse.Namespace) -> None:
    """Print the accounting."""
    from idm_sumo.recordings.inspection import inspect_recording

    inspection = inspect_recording(options.recording, location=options.location)
    say(json.dumps(inspection.to_json(), indent=2) if options.json else "\n".join(inspection.lines()))


def fetch(options: argparse.Namespace) -> None:
    """Download, then account for every row."""
    from idm_sumo.recordings.fetch import fetch as download

    with progress_bar() as report:
        result = download(options.dest, location=options.location, verify=options.verify, progress=report)
    if options.location != "us-101":  # the reader knows the geometry of US-101 only
        say(f"wrote {result.path}: {result.rows:,} rows of {options.location}")
        return
    inspection = result.inspect()
    say(
        json.dumps(inspection.to_json(), indent=2)
        if options.json
        else "\n".join([*inspection.lines(), f"wrote {result.path}"])
    )


def surrogate(options: argparse.Namespace) -> None:
    """Make the stand-in."""
    from idm_sumo.sumo.surrogate.make import make_surrogate

    with progress_bar() as report:
        make_surrogate(
            options.output, minutes=options.minutes, seed=options.seed,
            progress=lambda done, total: report("simulating", done, total),
        )  # fmt: skip
    say(f"wrote {options.output}")
