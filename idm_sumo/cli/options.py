"""Options that several commands share."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.cli.console import note, progress_bar
from idm_sumo.runtime import limits
from idm_sumo.sumo.surrogate import SURROGATE

if TYPE_CHECKING:
    from idm_sumo.recordings.recording import Recording
    from idm_sumo.scenes.windows import Window

LAWS = ("krauss", "eidm")  # SUMO's models beside the IDM by which drivers are fitted
MINUTES = 4.0  # of `surrogate`: enough for hundreds of drivers, made in seconds
RECORDING_HELP = (
    "NGSIM, highD, exiD, TGSIM, I-24 MOTION, OpenACC, SUMO FCD, leader-follower pairs, our own columns, or "
    "`surrogate`: the built-in one"
)


def command(
    commands: Any,
    name: str,
    run: Callable[[argparse.Namespace], None],
    about: str,
    *examples: str,
    jobs: int | None = 1,
) -> argparse.ArgumentParser:
    """Add a command with the options that every command has.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    name : str
    run : callable
        Called with the parsed options.
    about : str
        The description; its first line stands in the list of commands.
    *examples : str
        Lines that run as they stand, shown below the options.
    jobs : int or None
        Default number of processes; None for as many as the machine has.
    """
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=about.splitlines()[0], description=about,
        epilog="\n  ".join(["example:", *examples]), formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=whole(limits.SEED), default=1, metavar="N", help="of everything random (default 1)"
    )
    shown = "1; kernels use all cores" if jobs else "as many as the machine has"
    parser.add_argument(
        "--jobs", type=whole(limits.JOBS), default=jobs, metavar="N", help=f"processes (default {shown})"
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="say more, and show where an error came from")
    parser.set_defaults(run=run)
    return parser


def recording_argument(parser: argparse.ArgumentParser) -> None:
    """Add RECORDING and what belongs to it.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument("recording", type=recording_name, metavar="RECORDING", help=RECORDING_HELP)
    location_argument(parser)
    network_arguments(parser)
    minutes_argument(parser)


def path(text: str) -> Path:
    """Return a path that somebody named.

    Parameters
    ----------
    text : str

    Raises
    ------
    argparse.ArgumentTypeError
        If it is empty, as a variable of the shell that is not set: that would be the current folder.
    """
    if not text:
        raise argparse.ArgumentTypeError("is empty, perhaps a variable that is not set; name a file or folder")
    return Path(text)


def recording_name(text: str) -> str:
    """Return RECORDING, a path or the word for the built-in one.

    Parameters
    ----------
    text : str

    Raises
    ------
    argparse.ArgumentTypeError
        If it is the word, and a file or folder of that name is there: both can be meant. If it is empty.
    """
    path(text)
    if text == SURROGATE and os.path.lexists(text):
        raise argparse.ArgumentTypeError(
            f"`{text}` is the built-in recording, and something of that name is here: give ./{text} to read that, "
            "or rename it to get the built-in one"
        )
    return text


def location_argument(parser: argparse.ArgumentParser) -> None:
    """Add --location.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument(
        "--location", default="us-101", metavar="NAME", help="which part of a file that mixes several (default us-101)"
    )


def network_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --net-file, --corridor and --route-files.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    group = parser.add_argument_group("a road of your own", "where RECORDING was not recorded on a road that is known")
    group.add_argument(
        "-n", "--net-file", type=path, metavar="NET", help="SUMO network that it was recorded on (.net.xml)"
    )
    group.add_argument(
        "--corridor", nargs="+", action="extend", default=[], metavar="EDGE",
        help="edges of the road in driving order, those between are found (default: the network, if it is one road)",
    )  # fmt: skip
    group.add_argument(
        "--route-files", nargs="+", action="extend", type=path, default=[], metavar="FILE",
        help="route files whose vTypes tell lengths, widths and classes of a SUMO recording's vehicles",
    )  # fmt: skip


def minutes_argument(parser: argparse.ArgumentParser, default: float = MINUTES) -> None:
    """Add --minutes.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    default : float
    """
    parser.add_argument(
        "--minutes", type=minutes, default=default, metavar="N", help=f"length of `surrogate` (default {default:g})"
    )


def minutes(text: str) -> float:
    """Return a length in minutes.

    Parameters
    ----------
    text : str

    Raises
    ------
    argparse.ArgumentTypeError
        If it is outside :data:`idm_sumo.runtime.limits.MINUTES`.
    """
    return float(real(limits.MINUTES)(text))


def window_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a driver's window is.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument(
        "--period", action="append", metavar="PERIOD", help="only this recording period; may be repeated"
    )
    parser.add_argument(
        "--observed",
        type=whole(limits.FRAMES),
        default=10,
        metavar="FRAMES",
        help="frames the driving code sees (default 10)",
    )
    parser.add_argument(
        "--horizon",
        type=whole(limits.FRAMES),
        default=100,
        metavar="FRAMES",
        help="simulated frames of 0.1 s (default 100)",
    )
    parser.add_argument("--rollout-start", choices=("observed", "entry"), default="observed",
                        help="simulate from the last observed frame (default) or from entry")  # fmt: skip


def desired_speed(text: str) -> float | str:
    """Return a speed in m/s, or "auto".

    Parameters
    ----------
    text : str

    Raises
    ------
    argparse.ArgumentTypeError
        If it is neither, or outside :data:`idm_sumo.runtime.limits.DESIRED_SPEED`.
    """
    if text == "auto":
        return text
    try:
        return real(limits.DESIRED_SPEED)(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a speed in m/s nor `auto`") from None


def cluster_argument(parser: argparse.ArgumentParser, what: str) -> None:
    """Add --cluster.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    what : str
        What its workers do.
    """
    parser.add_argument(
        "--cluster", metavar="ADDRESS", help=f"dask scheduler whose workers {what}, such as tcp://10.0.0.1:8786"
    )


def cluster_of(options: argparse.Namespace) -> str | None:
    """Return the cluster that is asked for, once it has answered.

    A run that needs it late would otherwise work long in vain.

    Parameters
    ----------
    options : argparse.Namespace

    Raises
    ------
    InputError
        If it cannot be worked with.
    """
    address: str | None = options.cluster
    if address is not None:
        from idm_sumo.runtime.cluster import check_cluster

        check_cluster(address)
    return address


def output_argument(parser: argparse.ArgumentParser, metavar: str, help_text: str) -> None:
    """Add -o.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    metavar, help_text : str
    """
    parser.add_argument("-o", "--output", type=path, required=True, metavar=metavar, help=help_text)


def window_of(options: argparse.Namespace, every: int | None = None) -> Window:
    """Return the window the options ask for.

    Parameters
    ----------
    options : argparse.Namespace
    every : int, optional
        Frames between windows of the same driver; by default one window each.
    """
    from idm_sumo.scenes.windows import Window

    return Window(options.observed, options.horizon, options.rollout_start == "entry", every)


def recording_path(options: argparse.Namespace) -> Path:
    """Return the path of the RECORDING.

    The built-in one is made now if it is not in the cache.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.sumo.own_recording import kept_on_network

    path = _path(options)
    if options.net_file is None:
        check_alone(options)
        return path
    return kept_on_network(path, **_network(options))


def _path(options: argparse.Namespace) -> Path:
    return path_of(options, options.recording)


def path_of(options: argparse.Namespace, name: str) -> Path:
    """Return the path of a recording by its name; the built-in one is made now if it is not in the cache.

    Parameters
    ----------
    options : argparse.Namespace
    name : str
    """
    if name != SURROGATE:  # what makes it takes longer to load than most files take to read
        return Path(name)
    from idm_sumo.sumo.surrogate.builtin import recording_path

    with progress_bar() as report:
        return recording_path(name, minutes=options.minutes, seed=options.seed, progress=report)


def _network(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the options say of a network."""
    return {"net": options.net_file, "corridor": options.corridor, "route_files": options.route_files,
            "location": options.location}  # fmt: skip


def check_alone(options: argparse.Namespace) -> None:
    """Raise for options that mean nothing without a network.

    Parameters
    ----------
    options : argparse.Namespace

    Raises
    ------
    InputError
    """
    from idm_sumo.runtime.errors import InputError

    for name in ("corridor", "route_files"):
        if getattr(options, name):
            raise InputError(f"--{name.replace('_', '-')} needs the network: give --net-file NET.net.xml")


def read(options: argparse.Namespace) -> Recording:
    """Read the RECORDING, on the network that the options name.

    Parameters
    ----------
    options : argparse.Namespace
    """
    if options.net_file is None:
        from idm_sumo.recordings.reading import read_recording

        return read_recording(recording_path(options), location=options.location)
    from idm_sumo.sumo.own_recording import read_on_network

    return read_on_network(_path(options), **_network(options))


def load(options: argparse.Namespace) -> Recording:
    """Read, clean and smooth the RECORDING.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.recordings.cleaning import clean
    from idm_sumo.recordings.smoothing import smooth

    return smooth(clean(read(options)))


def note_origin(notes: Iterable[str]) -> None:
    """Say beside a result that its recording is not measured.

    Parameters
    ----------
    notes : iterable of str
        Of the recording; nothing is said without the surrogate's notice among them.
    """
    from idm_sumo.recordings.recording import SURROGATE_NOTICE

    if any(SURROGATE_NOTICE in line for line in notes):
        note(SURROGATE_NOTICE)


def note_origin_of(folder: Path) -> None:
    """Say the same of a folder of results.

    Parameters
    ----------
    folder : Path
        With a manifest, whose notes tell.
    """
    from idm_sumo.runtime.files import MANIFEST

    note_origin(json.loads((folder / MANIFEST).read_text(encoding="utf-8")).get("notes", ()))


def whole(bounds: tuple[int, int]) -> Callable[[str], int]:
    """Return what reads a whole number within bounds, both included.

    Parameters
    ----------
    bounds : tuple of int
        One of :mod:`idm_sumo.runtime.limits`.
    """

    def number(text: str) -> int:
        if len(text) > 20 or not bounds[0] <= int(text) <= bounds[1]:
            raise argparse.ArgumentTypeError(f"must be from {bounds[0]} to {bounds[1]}")
        return int(text)

    return number


def real(bounds: tuple[float, float]) -> Callable[[str], float]:
    """Return what reads a finite number within bounds, both included.

    Parameters
    ----------
    bounds : tuple of float
        One of :mod:`idm_sumo.runtime.limits`.
    """

    def number(text: str) -> float:
        if not bounds[0] <= float(text) <= bounds[1]:
            raise argparse.ArgumentTypeError(f"must be from {bounds[0]:g} to {bounds[1]:g}")
        return float(text)

    return number
