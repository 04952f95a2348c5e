"""Paths as SUMO reads them.

What is syntax in its options stands for other files.

A comma parts a list, ``${HOME}`` and ``%41`` are replaced, ``~`` is a home, a colon may begin a
port and a backslash parts folders. Such a path goes to SUMO by another name: a symbolic link.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.siblings import scratch

SYNTAX = frozenset(",;%$~:\\\"'\n\r\t")
WITH_PATH = ("--route-files", "--additional-files", "--fcd-output", "--configuration-file")


def is_plain(path: Path | str) -> bool:
    """Return whether SUMO reads a path as it stands.

    Parameters
    ----------
    path : Path or str
    """
    return not SYNTAX & set(str(path)) and str(path) == str(path).strip()


def check_name(path: Path) -> None:
    """Refuse a file whose name a SUMO configuration cannot hold.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        Names the characters.
    """
    if not is_plain(path.name):
        found = " ".join(sorted(repr(one) for one in SYNTAX & set(path.name))) or "a blank at an end"
        raise InputError(f"{path}: SUMO would read {found} in this name as its own syntax; choose another name")


@contextmanager
def plain(net: Path, options: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield a network and options with plain paths.

    SUMO reads them as they are meant.

    Parameters
    ----------
    net : Path
    options : sequence of str
        Options of ``sumo``; the values of :data:`WITH_PATH` are paths, of files that need not exist yet.

    Yields
    ------
    net : str
    options : list of str

    Raises
    ------
    InputError
        If the folder of temporary files, where links are put, has such a name itself.
    """
    with ExitStack() as stack:
        yield _plain(net, stack), [_plain(Path(one), stack) if path else one for path, one in _marked(options)]


def _marked(options: Sequence[str]) -> list[tuple[bool, str]]:
    """Return whether each option is a path."""
    before = ("", *options)
    return [(name in WITH_PATH, one) for name, one in zip(before, options, strict=False)]


def _plain(path: Path, stack: ExitStack) -> str:
    """Return a path that SUMO reads as it is meant.

    Return a path, or one through a link to its folder, or to itself if its own name is not plain.
    """
    if is_plain(path):
        return str(path)
    folder = stack.enter_context(scratch())
    if not is_plain(folder):
        raise InputError(
            f"{tempfile.gettempdir()}: SUMO would read this name of the folder of temporary files as its own syntax; "
            "set TMPDIR to another folder"
        )
    at = folder / "at"
    if is_plain(path.name):
        os.symlink(os.path.abspath(path.parent), at)
        return str(at / path.name)
    at = at.with_name("at" + "".join(one for one in path.suffixes if is_plain(one)))
    os.symlink(os.path.abspath(path), at)
    return str(at)
