"""Options that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.roads import road

if TYPE_CHECKING:
    from idm_sumo.recordings.recording import Recording
    from idm_sumo.scenes.windows import Scenes, Window


def command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], None], help_text: str, example: str
) -> argparse.ArgumentParser:
    """Add a command with the options that every command has."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=help_text, description=help_text, epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of everything random (default 1)")
    parser.add_argument(
        "--jobs", type=_positive, default=1, metavar="N", help="processes (default 1; kernels use all cores)"
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="say more, and show where an error came from")
    parser.set_defaults(run=run)
    return parser


def recording_argument(parser: argparse.ArgumentParser, nargs: str | None = None) -> None:
    """Add RECORDING."""
    parser.add_argument("recording", type=Path, metavar="RECORDING", nargs=nargs,
                        help="NGSIM text, portal CSV or Parquet, or SUMO FCD")  # fmt: skip
    parser.add_argument("--location", default="us-101", help="of a file that mixes several (default us-101)")


def window_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a driver's window is."""
    parser.add_argument(
        "--period", action="append", metavar="LABEL", help="only this recording period; may be repeated"
    )
    parser.add_argument(
        "--observed", type=_positive, default=10, metavar="FRAMES", help="frames the driving code sees (default 10)"
    )
    parser.add_argument(
        "--horizon", type=_positive, default=100, metavar="FRAMES", help="simulated frames of 0.1 s (default 100)"
    )
    parser.add_argument("--rollout-start", choices=("observed", "entry"), default="observed",
                        help="simulate from the last observed frame (default) or from entry")  # fmt: skip
    parser.add_argument("--desired-speed", type=float, default=road.SPEED_LIMIT, metavar="M_S",
                        help=f"v0 in m/s (default {road.SPEED_LIMIT:.2f}, 55 mph)")  # fmt: skip


def output_argument(parser: argparse.ArgumentParser, metavar: str, help_text: str) -> None:
    """Add -o."""
    parser.add_argument("-o", "--output", type=Path, required=True, metavar=metavar, help=help_text)


def window_of(options: argparse.Namespace, every: int | None = None) -> Window:
    """Return the window the options ask for."""
    from idm_sumo.scenes.windows import Window

    return Window(options.observed, options.horizon, options.rollout_start == "entry", every)


def load(options: argparse.Namespace) -> Recording:
    """Read, clean and smooth the RECORDING."""
    from idm_sumo.recordings.cleaning import clean
    from idm_sumo.recordings.reading import read_recording
    from idm_sumo.recordings.smoothing import smooth

    return smooth(clean(read_recording(options.recording, location=options.location)))


def scenes_of(options: argparse.Namespace, window: Window) -> tuple[list[Scenes], dict[str, int]]:
    """Return the scenes of the wanted periods and how many vehicles were left out, by reason.

    Raises
    ------
    InputError
        If no vehicle has a whole window.
    """
    from idm_sumo.recordings import columns as c
    from idm_sumo.runtime.errors import InputError
    from idm_sumo.scenes.windows import build_scenes

    recording = load(options)
    reasons = dict(recording.accounting.vehicles_dropped)
    found = []
    for period in options.period or recording.periods:
        eligible = recording.eligible
        modelled = eligible.loc[eligible[c.PERIOD] == period, c.VEHICLE]
        scenes, excluded = build_scenes(recording.of_period(period), window, modelled=modelled)
        for reason, count in excluded["reason"].value_counts().items():
            reasons[str(reason)] = reasons.get(str(reason), 0) + int(count)
        if len(scenes):
            found.append(scenes)
    if not found:
        raise InputError(
            f"{options.recording}: no vehicle is recorded for {window.frames} frames in a row; lower --observed or --horizon"
        )
    return found, reasons


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return value
