"""A result is complete or absent: write beside, verify, move into place, leave nothing behind."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.exchange import put_in_place
from idm_sumo.runtime.ownership import MANIFEST, refuse_strangers, seal, sha256
from idm_sumo.runtime.places import file_place, folder_place, parents_of
from idm_sumo.runtime.siblings import PREFIX, bring_back, remove, sibling

__all__ = ["MANIFEST", "new_file", "new_files", "new_folder"]

# What goes wrong with a disk while a result is written, whoever writes it.
DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)


@contextmanager
def new_file(path: Path | str) -> Iterator[Path]:
    """Yield a temporary file beside ``path`` that takes its place when the block succeeds.

    The folders above are made if need be. A symbolic link stays one: the file it leads to is
    replaced. Permissions are those of the file that is replaced, or follow the umask.

    Raises
    ------
    InputError
        If ``path`` is a folder, a device, a pipe or a read-only file, or cannot be written.
    """
    with new_files([path]) as (part,):
        yield part


@contextmanager
def new_files(paths: Sequence[Path | str]) -> Iterator[list[Path]]:
    """Yield temporary files that take the places of ``paths`` together: all of them or none.

    Raises
    ------
    InputError
        As :func:`new_file` does.
    """
    targets = [file_place(path) for path in paths]
    with ExitStack() as stack, _told(paths[0]):
        for target in targets:
            stack.enter_context(parents_of(target))
        parts = [stack.enter_context(sibling(target)) for target in targets]
        yield parts
        for part, target in zip(parts, targets, strict=True):
            if target.exists():
                part.chmod(target.stat().st_mode & 0o777)
            sha256(part, settle=True)
        _replace_all(parts, [file_place(target) for target in targets], stack)


@contextmanager
def new_folder(path: Path | str) -> Iterator[Path]:
    """Yield a temporary folder beside ``path`` that takes its place when the block succeeds.

    Every file of it is listed, with its SHA-256, in ``manifest.json``. An earlier result is
    replaced if it holds nothing but what its own manifest lists, unchanged; an empty folder too.
    Any other folder is refused before work starts.

    Raises
    ------
    InputError
        If ``path`` holds anything else, or cannot be written.
    """
    target = folder_place(path)
    with _told(path), parents_of(target):
        bring_back(target)
        refuse_strangers(path, target)
        with sibling(target, folder=True) as part:
            yield part
            seal(part)
            if target.exists():
                part.chmod(target.stat().st_mode & 0o777)
                refuse_strangers(path, target)  # that came while we worked
            put_in_place(part, target)


def _replace_all(parts: Sequence[Path], targets: Sequence[Path], stack: ExitStack) -> None:
    """Move files into place; if one cannot be, those before it are as they were."""
    backups = [stack.enter_context(sibling(target)) if target.exists() else None for target in targets[:-1]]
    for backup, target in zip(backups, targets, strict=False):
        if backup is not None:
            shutil.copy2(target, backup)
    last = os.stat(parts[-1]).st_ino
    try:
        for part, target in zip(parts, targets, strict=True):
            os.replace(part, target)
    except BaseException:
        if not (os.path.exists(targets[-1]) and os.stat(targets[-1]).st_ino == last):  # then all are in place
            for backup, target, part in zip(backups, targets, parts, strict=False):
                if not os.path.lexists(part):
                    os.replace(backup, target) if backup is not None else remove(target)
        raise


@contextmanager
def _told(path: Path | str) -> Iterator[None]:
    """Say which result it was that the disk did not take."""
    try:
        yield
    except OSError as error:
        if error.errno not in DISK and not _is_part(error.filename):
            raise
        raise InputError(f"{path}: cannot be written ({os.strerror(error.errno or errno.EIO)})") from None


def _is_part(name: object) -> bool:
    """Whether a name is that of a temporary file or folder of ours."""
    return isinstance(name, str | Path) and PREFIX in str(name)
