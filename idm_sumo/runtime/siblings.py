"""Temporary files and folders beside a result, which a later run recognises when their writer is gone.

Their names begin with :data:`PREFIX`. The writer holds a lock on what it writes as long as it
lives, and the system drops a lock with its holder: what bears such a name and is not locked is
the leftover of a killed run. This needs no process numbers, which begin anew after a restart and
in every container.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.places import parents_of

try:
    import fcntl

    HAS_LOCKS = True
except ImportError:  # no such locks there: nothing is swept either
    HAS_LOCKS = False

WITHOUT_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL, errno.EBADF)  # of a file system
PREFIX, OLD = ".idm-sumo.", ".old"
OURS = re.compile(r"\.idm-sumo\.[0-9a-f]{12}\.[0-9a-f]{8}(\.|$)")  # other names with that prefix may be a user's
LONGEST_ENDING = 40  # characters of a target's endings that a temporary name keeps, for writers that go by them


@contextmanager
def sibling(target: Path, *, folder: bool = False, mode: int | None = None) -> Iterator[Path]:
    """Yield a new empty file or folder beside ``target``, gone when the block ends unless it was moved."""
    sweep(target.parent)
    part, lock = target.with_name(_name(target)), None
    try:
        while lock is None:  # again if another run's sweep came between making and locking
            with suppress(FileNotFoundError):
                _make(part, folder, mode)
                lock = lock_of(part)
        yield part
    finally:
        try:
            remove(part)
        finally:
            if lock is not None:
                os.close(lock)


@contextmanager
def scratch(parent: Path | None = None) -> Iterator[Path]:
    """Yield a temporary folder, by default where temporary files go; those of killed runs are swept."""
    with sibling((parent or Path(tempfile.gettempdir())) / "scratch", folder=True, mode=0o700) as part:
        yield part


def _make(part: Path, folder: bool, mode: int | None) -> None:
    """Make an empty file or folder with the permissions of the umask, or with ``mode``."""
    if folder:
        os.mkdir(part, 0o777 if mode is None else mode)
    else:
        os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666 if mode is None else mode))


def lock_of(path: Path) -> int | None:
    """Lock a file or folder for this process; return the lock, to be closed, or None if another holds it.

    Where there are no such locks a descriptor is returned that locks nothing.
    """
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    try:
        if HAS_LOCKS:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return None
    except OSError as error:
        if error.errno not in WITHOUT_LOCKS:
            os.close(handle)
            raise
    except BaseException:
        os.close(handle)
        raise
    return handle


@contextmanager
def locked(folder: Path, what: str) -> Iterator[None]:
    """Keep other runs out of a folder that grows, such as a download's.

    Parameters
    ----------
    folder : Path
        Made if need be; gone again if the block fails and leaves it empty.
    what : str
        How a message calls the other run.

    Raises
    ------
    InputError
        If another run is at work there.
    """
    with parents_of(folder / PREFIX):
        sweep(folder)
        lock = lock_of(folder)
        if lock is None:
            raise InputError(f"{folder}: another {what} is at work there; wait for it, or give another folder")
        try:
            yield
        finally:
            os.close(lock)


def sweep(folder: Path) -> None:
    """Remove the leftovers of killed runs in a folder, as far as that is possible."""
    if not HAS_LOCKS:
        return
    with suppress(OSError):
        for name in os.listdir(folder):
            if OURS.match(name) and not name.endswith(OLD):
                _remove_if_dead(folder / name)


def bring_back(target: Path) -> None:
    """Put an old result back that a killed run had moved aside, or remove it if the new one took its place."""
    for name in os.listdir(target.parent):
        if name.startswith(_stem(target)) and name.endswith(OLD):
            aside = target.with_name(name)
            remove(aside) if os.path.lexists(target) else os.rename(aside, target)


def old_name(part: Path) -> Path:
    """Return where the old folder waits while ``part`` takes its place."""
    return part.with_name(part.name + OLD)


def remove(path: Path) -> None:
    """Remove a file or a folder, if it is there; what cannot be removed is left to a later run."""
    with suppress(FileNotFoundError, OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            os.unlink(path)


def _remove_if_dead(path: Path) -> None:
    """Remove what no living process holds."""
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            remove(path)
        finally:
            os.close(handle)


def _stem(target: Path) -> str:
    """Return how all temporary names of one target begin; it does not grow with the target's name."""
    return f"{PREFIX}{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:12]}."


def _name(target: Path) -> str:
    endings = "".join(target.suffixes[-2:])
    return _stem(target) + secrets.token_hex(4) + (endings if len(os.fsencode(endings)) <= LONGEST_ENDING else "")
