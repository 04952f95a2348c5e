"""A result is complete or absent: write beside, move into place, leave nothing behind."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from idm_sumo.runtime.errors import InputError

MANIFEST = "manifest.json"  # what marks a folder as a result of ours, which a new run may replace


@contextmanager
def new_file(path: Path | str) -> Iterator[Path]:
    """Yield a temporary file beside ``path`` that takes its place when the block succeeds.

    Raises
    ------
    InputError
        If the folder does not exist or cannot be written.
    """
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix="".join(target.suffixes), dir=target.parent)
    except OSError as error:
        raise InputError(f"{target}: cannot write there ({error.strerror}); choose another output") from None
    os.close(handle)
    part = Path(name)
    try:
        yield part
        part.chmod(0o644)
        if target.is_dir():
            raise InputError(f"{target}: is a folder; name a file")
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def new_folder(path: Path | str) -> Iterator[Path]:
    """Yield a temporary folder beside ``path`` that takes its place when the block succeeds.

    An earlier result of ours (a folder with ``manifest.json``) is replaced, an empty folder
    too; any other folder is refused before work starts. Files of other names that lie in an
    earlier result stay there.

    Raises
    ------
    InputError
        If ``path`` holds something else, or cannot be written.
    """
    target = Path(path)
    if target.exists() and not target.is_dir():
        raise InputError(f"{target}: is a file; name a folder")
    if target.is_dir() and any(target.iterdir()) and not (target / MANIFEST).is_file():
        raise InputError(f"{target}: is not empty and no earlier result; choose another folder")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise InputError(f"{target}: cannot write there ({error.strerror}); choose another output") from None
    try:
        yield part
        part.chmod(0o755)
        _take_place(part, target)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _take_place(part: Path, target: Path) -> None:
    """Move ``part`` to ``target``; what else the user keeps there stays, what it replaces goes after the move."""
    if not target.exists():
        os.replace(part, target)
        return
    old = part.with_name(part.name + ".old")
    os.replace(target, old)
    os.replace(part, target)
    for entry in old.iterdir():
        if not (target / entry.name).exists():
            os.replace(entry, target / entry.name)
    shutil.rmtree(old)
