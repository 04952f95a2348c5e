"""Where a command's results may go, checked before its work: one hook for all commands."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from idm_sumo.cli import many as recordings
from idm_sumo.runtime.ownership import refuse_strangers
from idm_sumo.runtime.places import file_place, folder_place, refuse_overlap


@dataclass(frozen=True)
class Places:
    """Which options of a command name what it reads and what it writes.

    Attributes
    ----------
    inputs : tuple of str
        Options (as attributes of the parsed ones) with a path or several.
    endings : tuple of str
        What the name of an output file ends in; none if the output is a folder.
    output : str
        The option that names the output.
    kept : bool
        Whether the output folder goes on growing, as that of `fetch` and `irl train`.
    many : bool
        Whether there may be many recordings, whose results go into a data set.
    """

    inputs: tuple[str, ...]
    endings: tuple[str, ...] = ()
    output: str = "output"
    kept: bool = False
    many: bool = False


def declare(
    parser: argparse.ArgumentParser, *inputs: str, endings: tuple[str, ...] = (), output: str = "output",
    kept: bool = False, many: bool = False,
) -> None:  # fmt: skip
    """Declare which options of a command are inputs, and what its output must be; see :class:`Places`."""
    parser.set_defaults(places=Places(inputs, endings, output, kept, many))


def check(options: argparse.Namespace) -> None:
    """Refuse an output that cannot be written, or whose writing would destroy an input.

    Raises
    ------
    InputError
        Names the path and what to do.
    """
    places: Places | None = getattr(options, "places", None)
    if places is None:
        return
    output: Path = getattr(options, places.output)
    if not places.kept:
        refuse_overlap([path for name in places.inputs for path in _paths(getattr(options, name, None))], [output])
    if places.many and recordings.are_meant(options):
        recordings.check(output)
    elif places.endings:
        file_place(output, places.endings)
    else:
        target = folder_place(output, kept=places.kept)
        if not places.kept:
            refuse_strangers(output, target)


def _paths(value: Path | str | list[Path | str] | None) -> Iterator[Path]:
    """Yield the paths of an option; the word `surrogate` is not one, and nothing of that name is harmed."""
    if isinstance(value, list | tuple):
        for one in value:
            yield from _paths(one)
    elif value is not None:
        yield Path(value)
