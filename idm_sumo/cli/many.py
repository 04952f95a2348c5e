"""What `calibrate`, `predict` and `diagnose` do with many recordings."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.cli import options as shared
from idm_sumo.cli.console import note, progress_bar, say, study_module
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.places import folder_place

if TYPE_CHECKING:
    from analysis.drivers.source import Source

TABLES = (".parquet", ".csv")
HELP = "; several, or folders of them: one data set"
ABOUT = """\
Several recordings, or folders of them, go into one Parquet data set,
DIR/recording=NAME/period=LABEL/drivers.parquet, with DIR/_recordings.csv (one
row a recording; a failed one with its reason) and DIR/_summary.json. The same
command again works on what is new or has changed, by content."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add RECORDING ..., what belongs to it, and --cluster.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument(
        "recording", type=shared.recording_name, metavar="RECORDING", nargs="+", help=shared.RECORDING_HELP + HELP
    )
    shared.location_argument(parser)
    shared.network_arguments(parser)
    shared.minutes_argument(parser)
    shared.cluster_argument(parser, "compute")


def are_meant(options: argparse.Namespace) -> bool:
    """Whether a data set is asked for, not the result of one recording.

    Parameters
    ----------
    options : argparse.Namespace

    Raises
    ------
    InputError
        If several recordings are to go into one table.
    """
    output: Path = options.output
    several = len(options.recording) > 1
    if not options.places.endings:
        return several or options.cluster is not None or not _is_one(Path(options.recording[0]))
    if output.name.lower().endswith(options.places.endings):
        if several:
            raise InputError(f"{output}: several recordings go into a folder; name one with -o DIR")
        return False
    return several or output.is_dir() or not output.suffix


def _is_one(path: Path) -> bool:
    return not path.is_dir() or bool(study_module("many.plan").is_one(path))


def check(output: Path) -> None:
    """Refuse a folder that holds anything but a data set of ours.

    Parameters
    ----------
    output : Path

    Raises
    ------
    InputError
    """
    study_module("many.dataset").refuse_others(folder_place(output, kept=True))


def source_of(options: argparse.Namespace, path: Path, name: str = "") -> Source:
    """Return a recording as the options say it is read.

    Parameters
    ----------
    options : argparse.Namespace
    path : Path
    name : str
        How messages call it.
    """
    if options.net_file is None:
        shared.check_alone(options)
    made: Source = study_module("drivers.source").Source(
        path, options.location, options.net_file, tuple(options.corridor), tuple(options.route_files), name
    )
    return made


def only_source(options: argparse.Namespace) -> Source:
    """Return the one recording that is asked for.

    Parameters
    ----------
    options : argparse.Namespace
    """
    (name,) = options.recording
    return source_of(options, shared.path_of(options, name), name)


def computed(options: argparse.Namespace, function: Callable[..., Any], *call: Any) -> Any:
    """Return the result of one call, computed on the cluster that the options name.

    Parameters
    ----------
    options : argparse.Namespace
    function : callable
    *call
        Its arguments.

    Raises
    ------
    InputError
        If it failed.
    """
    from idm_sumo.runtime.spread import gathered

    (result,) = gathered(function, [call], cluster=options.cluster)
    return result


def run(options: argparse.Namespace, work: Any) -> None:
    """Work on many recordings, and say what they came to.

    Parameters
    ----------
    options : argparse.Namespace
    work : Work
        What is done with each.

    Raises
    ------
    InputError
        If some failed, after the others are done.
    """
    module = study_module("many.run")
    named = [shared.path_of(options, name) for name in options.recording]
    sources = [source_of(options, path) for path in study_module("many.plan").recordings_of(named)]
    workers = module.Workers(options.jobs or os.cpu_count() or 1, options.cluster)
    with progress_bar() as report:
        outcome = module.run(sources, work, options.output, workers, command=sys.argv, progress=report)
    for row in outcome.failed.itertuples():
        note(f"{row.file}: {row.reason}")
    skipped = len(outcome.rows) - len(outcome.failed) - outcome.computed
    already = f", {skipped} of them finished before" if skipped else ""
    say(*study_module("many.summary").in_words(outcome.summary), f"wrote {options.output}{already}")
    if len(outcome.failed):
        raise InputError(
            f"{options.output}: {len(outcome.failed)} of {len(outcome.rows)} recordings failed "
            f"({outcome.failed['file'].iloc[0]}); mend them and run the same command again: the others are kept"
        )
