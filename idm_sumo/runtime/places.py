"""Where a result may go, decided before the work: what is refused, and why."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from idm_sumo.runtime.errors import InputError

OUTPUT_STREAMS = (1, 2)  # standard output and standard error


def file_place(path: Path | str, endings: Sequence[str] = ()) -> Path:
    """Return where a file is to be written, behind symbolic links.

    Parameters
    ----------
    path : path-like
    endings : sequence of str
        What the name may end in; anything if empty.

    Raises
    ------
    InputError
        If there is a folder, a device, a pipe or a read-only file, if the name ends otherwise,
        or if nothing can be written there.
    """
    if endings and not str(path).lower().endswith(tuple(endings)):
        raise InputError(f"{path}: must end in {' or '.join(endings)}; name another output")
    with _told(path):
        target = Path(os.path.realpath(path))
        if (there := _found(target)) is not None:
            _check_file(Path(path), there)
        _check_parent(Path(path), target)
    return target


def folder_place(path: Path | str, *, kept: bool = False) -> Path:
    """Return where a folder is to be written, behind symbolic links.

    Parameters
    ----------
    path : path-like
    kept : bool
        Whether files are added to the folder, in place of replacing it: then it may be anywhere.

    Raises
    ------
    InputError
        If there is a file, the current folder or a mount point, or if nothing can be written there.
    """
    with _told(path):
        target = Path(os.path.realpath(path))
        if (there := _found(target)) is not None:
            _check_folder(Path(path), target, there, kept)
        _check_parent(Path(path), target)
    return target


def refuse_overlap(inputs: Iterable[Path | str], outputs: Iterable[Path | str]) -> None:
    """Refuse outputs that are an input, hold one, or lie in a folder that is one; links are seen through.

    Raises
    ------
    InputError
        Names the output and the input.
    """
    given = [Path(name) for name in inputs if os.path.exists(name)]
    for output in outputs:
        for name in given:
            if _is_same(name, Path(output)):
                raise InputError(f"{output}: is the input {name} itself; name another output")
            if any(_is_same(parent, Path(output)) for parent in Path(os.path.realpath(name)).parents):
                raise InputError(f"{output}: holds the input {name}; name another output")
            if any(_is_same(parent, name) for parent in Path(os.path.realpath(output)).parents):
                raise InputError(f"{output}: lies in the input {name} and would be read with it; name another output")


@contextmanager
def parents_of(target: Path) -> Iterator[None]:
    """Make the folders above ``target``; those that were made go again if the block fails."""
    missing = [parent for parent in target.parents if not parent.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for parent in missing:
            with suppress(OSError):  # it holds something by now
                parent.rmdir()
        raise


def _found(target: Path) -> os.stat_result | None:
    """Return what is there; other errors than that nothing is, such as a name too long, are raised."""
    try:
        return os.stat(target)
    except (FileNotFoundError, NotADirectoryError):
        return None


def _check_file(path: Path, there: os.stat_result) -> None:
    if stat.S_ISDIR(there.st_mode):
        raise InputError(f"{path}: is a folder; name a file")
    if not stat.S_ISREG(there.st_mode) or _is_stream(there):
        raise InputError(f"{path}: is a device, a pipe or an output stream, which results do not go to; name a file")
    if _is_read_only(path, there):
        raise InputError(f"{path}: is read-only; name another output, or make it writable")


def _check_folder(path: Path, target: Path, there: os.stat_result, kept: bool) -> None:
    if not stat.S_ISDIR(there.st_mode):
        raise InputError(f"{path}: is a file; name a folder")
    if _is_read_only(path, there):
        raise InputError(f"{path}: is read-only; name another output, or make it writable")
    if not kept and (os.path.ismount(target) or Path.cwd().is_relative_to(target)):
        raise InputError(f"{path}: is a mount point or the current folder, which is not replaced; name a folder in it")


def _check_parent(path: Path, target: Path) -> None:
    """Raise unless ``target`` can be made: by the nearest folder above it that exists."""
    above = next(parent for parent in target.parents if os.path.lexists(parent))
    if not above.is_dir():
        raise InputError(f"{path}: {above} is a file, not a folder; name another output")
    if not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"{path}: nothing can be written into {above}; name another output")


def _is_read_only(path: Path, there: os.stat_result) -> bool:
    """Whether the permissions forbid writing; the superuser's are not asked, who could do it all the same."""
    return not there.st_mode & 0o222 or not os.access(path, os.W_OK)


def _is_stream(there: os.stat_result) -> bool:
    for stream in OUTPUT_STREAMS:
        with suppress(OSError):
            if os.path.samestat(os.fstat(stream), there):
                return True
    return False


def _is_same(one: Path, other: Path) -> bool:
    """Whether two names are the same file or folder, by device and inode, or the same path."""
    try:
        return os.path.samefile(one, other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


@contextmanager
def _told(path: Path | str) -> Iterator[None]:
    """Turn what the system says of a name into one line of ours."""
    try:
        yield
    except OSError as error:
        reason = "too many symbolic links" if error.errno == errno.ELOOP else error.strerror
        raise InputError(f"{path}: cannot be an output ({reason}); name another") from None
