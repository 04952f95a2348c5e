"""Which folders are results of ours: those whose manifest lists every file in them as it is."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from idm_sumo.runtime.errors import InputError

MANIFEST = "manifest.json"
HIDDEN_MANIFEST = "_manifest.json"  # the same in a Parquet data set, where readers skip such names
FILES = "files"  # the manifest's key: path below the folder -> SHA-256
NAMED = 3  # files of somebody else that a message names


def manifest_of(folder: Path) -> Path:
    """Return the place of a folder's manifest."""
    hidden = folder / HIDDEN_MANIFEST
    return hidden if hidden.is_file() else folder / MANIFEST


def seal(folder: Path) -> None:
    """Bring every file of a folder to the disk and list it, with its SHA-256, in the folder's manifest."""
    manifest = manifest_of(folder)
    record = json.loads(manifest.read_text(encoding="utf-8")) if manifest.is_file() else {}
    record[FILES] = {name: sha256(folder / name, settle=True) for name in _files(folder) if name != manifest.name}
    manifest.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    sha256(manifest, settle=True)


def strangers(folder: Path) -> list[str]:
    """Return what in a folder is not as its manifest lists it: added or changed by somebody else."""
    listed, own = _listed(folder), manifest_of(folder).name
    return [name for name in _files(folder) if (name != own and not _is_listed(folder / name, listed.get(name)))
            or (name == own and not listed)]  # fmt: skip


def refuse_strangers(path: Path | str, folder: Path) -> None:
    """Raise if a folder holds files that no run of ours left there as they are.

    Parameters
    ----------
    path : path-like
        How the message names the folder.
    folder : Path
        The folder behind it; one that does not exist holds nothing.

    Raises
    ------
    InputError
        Names the first of the files.
    """
    if folder.is_dir():
        refuse(path, strangers(folder))


def refuse(path: Path | str, others: list[str]) -> None:
    """Raise if there are strangers in a folder, naming the first of them."""
    if others:
        names = ", ".join(others[:NAMED]) + (f" and {len(others) - NAMED} more" if len(others) > NAMED else "")
        raise InputError(
            f"{path}: is not empty and no earlier result as it was written ({names}); "
            "move these files away, or choose another folder"
        )


def is_whole(folder: Path) -> bool:
    """Whether a folder holds exactly what its manifest lists."""
    listed = _listed(folder)
    return bool(listed) and set(listed) <= set(_files(folder)) and not strangers(folder)


def sha256(path: Path, *, settle: bool = False) -> str:
    """Return the fingerprint of a file; with ``settle`` it is on the disk then."""
    with path.open("rb") as stream:
        if settle:
            os.fsync(stream.fileno())
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _is_listed(path: Path, expected: Any) -> bool:
    return isinstance(expected, str) and path.is_file() and not path.is_symlink() and sha256(path) == expected


def _listed(folder: Path) -> dict[str, Any]:
    """Return what the manifest lists; nothing if there is none that can be read."""
    try:
        files = json.loads(manifest_of(folder).read_text(encoding="utf-8"))[FILES]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}
    return files if isinstance(files, dict) else {}


def _files(folder: Path, below: str = "") -> Iterator[str]:
    """Yield every entry of a folder that is no folder, as a path with slashes, in order."""
    for entry in sorted(os.scandir(folder / below), key=lambda one: one.name):
        name = f"{below}{entry.name}"
        if entry.is_dir(follow_symlinks=False):
            yield from _files(folder, f"{name}/")
        else:
            yield name
