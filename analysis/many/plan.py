"""Which recordings are meant, and what they are known by."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from idm_sumo.runtime.attempts import program
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import existing_file
from idm_sumo.runtime.ownership import is_whole, sha256

from ..drivers.source import Source

ENDINGS = (".parquet", ".csv", ".txt", ".xml", ".json")  # of recordings in a folder
PACKED = (".gz", ".xz", ".bz2")
OTHERS = re.compile(r"(Meta\.csv|\.(net|rou|add|sumocfg)\.xml|manifest\.json|readme.*|license.*)$", re.IGNORECASE)
PART = re.compile(r"part[-._]?\d", re.IGNORECASE)  # how programs name the parts of one Parquet table


def recordings_of(arguments: Iterable[Path]) -> list[Path]:
    """Return the recordings that files and folders stand for, each once, in order.

    Parameters
    ----------
    arguments : iterable of Path
        A file is a recording. So is a folder of the parts of one Parquet table (``key=value`` folders, or
        files named ``part-0``) or one that this program wrote as a recording; any other folder stands for the
        recordings in it.

    Raises
    ------
    InputError
        If a folder holds none.
    """
    found: list[Path] = []
    for path in arguments:
        inside = list(_inside(path)) if path.is_dir() else [path]
        if not inside:
            raise InputError(f"{path}: is a folder without recordings ({', '.join(ENDINGS)}); name another")
        found += inside
    return list(dict.fromkeys(found))


def is_one(path: Path) -> bool:
    """Whether a path is one recording, not a folder of several.

    Parameters
    ----------
    path : Path
    """
    return not path.is_dir() or list(_inside(path)) == [path]


def _inside(folder: Path) -> Iterator[Path]:
    entries = sorted(entry for entry in folder.iterdir() if not entry.name.startswith((".", "_")))
    names = [entry.name for entry in entries]
    parts = [name for name in names if name.endswith(".parquet")]
    if any("=" in name for name in names) or is_whole(folder) or (parts and all(map(PART.match, parts))):
        yield folder
        return
    for entry in entries:
        if entry.is_dir():
            yield from _inside(entry)
        elif _is_recording(entry.name):
            yield entry


def _is_recording(name: str) -> bool:
    bare = name
    for ending in PACKED:
        bare = bare.removesuffix(ending)
    return bare.lower().endswith(ENDINGS) and not OTHERS.search(bare)


def digest(path: Path) -> str:
    """Return what names a recording's content, wherever it lies.

    Parameters
    ----------
    path : Path
        Of the recording. Of a folder every file counts, and so do tables of a data set that belong beside a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    if path.is_dir():
        files = [file for file in sorted(path.rglob("*")) if file.is_file() and not file.name.startswith(".")]
        told = [[file.relative_to(path).as_posix(), sha256(file)] for file in files]
    else:
        beside = sorted(path.parent.glob(_escaped(path.name.replace("_tracks", "_*Meta")))) if _is_tracks(path) else []
        told = [[file.name if file != path else "", sha256(existing_file(file))] for file in (path, *beside)]
    return told[0][1] if len(told) == 1 else hashlib.sha256(json.dumps(told).encode()).hexdigest()


def _is_tracks(path: Path) -> bool:
    return "_tracks" in path.name


def _escaped(pattern: str) -> str:
    """Return a pattern in which nothing but our ``*`` is one."""
    return re.sub(r"([\[\]?])", r"[\1]", pattern)


def key_of(work: Any, source: Source) -> str:
    """Return what names a program and its options: with other ones results may be others.

    Parameters
    ----------
    work : dataclass
        What is done with each recording; of the paths in it, contents count.
    source : Source
        One of the recordings: all are read alike.
    """
    reading = {name: value for name, value in asdict(source).items() if name not in ("path", "name")}
    options = json.dumps([type(work).__name__, asdict(work), reading], default=_by_content, sort_keys=True)
    return hashlib.sha256(f"{program()} {options}".encode()).hexdigest()


def _by_content(value: object) -> object:
    if isinstance(value, Path):
        return digest(value)
    raise TypeError(f"{value!r} is no option")


def name_of(path: Path, digest: str, taken: Iterable[str]) -> str:
    """Return the name of a recording in a data set: it begins as the file's and goes on as its content's.

    Parameters
    ----------
    path : Path
    digest : str
        Of its content.
    taken : iterable of str
        Names that others have, such as a second copy.
    """
    stem = re.sub(r"[^\w.-]+", "_", path.name.partition(".")[0] if path.is_file() else path.name)[:60]
    taken, name, number = set(taken), f"{stem}-{digest[:8]}", 2
    base = name
    while name in taken:
        name, number = f"{base}-{number}", number + 1
    return name
