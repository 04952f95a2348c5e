"""What must be settled before numpy and numba load: threads of BLAS, places for compiled code.

This module is loaded with the package and imports nothing that takes time.
"""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from pathlib import Path

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
NUMBA_CACHE, MATPLOTLIB_CACHE = "NUMBA_CACHE_DIR", "MPLCONFIGDIR"


def one_blas_thread() -> None:
    """Give BLAS one thread, here and in processes started from here, unless the user chose.

    Our matrices are small: a second thread of BLAS waits for the first, and beside other work
    inverse optimal control takes ten times as long with two. The command line calls this before
    numpy is loaded. Of a program that imports us numpy is its own: there the functions that
    matter limit BLAS while they run (:func:`idm_sumo.runtime.threads.one_blas_thread`).
    """
    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")


def find_places_for_caches(package: Path) -> None:
    """Let numba and matplotlib keep their caches in a temporary folder if they have no other place.

    Compiled code is kept beside the source or in the user's cache. Where the installation is
    read-only and the home folder cannot be written, as in containers and on clusters, numba
    would refuse to load a kernel.
    """
    if is_writable(_user_cache()):
        return
    os.environ.setdefault(MATPLOTLIB_CACHE, str(temporary_cache() / "matplotlib"))
    if not os.access(package, os.W_OK):
        os.environ.setdefault(NUMBA_CACHE, str(temporary_cache() / "numba"))


def is_writable(folder: Path) -> bool:
    """Whether a folder can be written, or made."""
    above = next(parent for parent in (folder, *folder.parents) if os.path.lexists(parent))
    return above.is_dir() and os.access(above, os.W_OK | os.X_OK)


def temporary_cache() -> Path:
    """Return a cache folder among the temporary files that nobody else can write.

    It is one a user, so that the next run finds what this one compiled. If somebody else took
    its name, it is one of this process, which is removed at its end.
    """
    folder = Path(tempfile.gettempdir(), f"idm-sumo-{_user()}")
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        there = folder.lstat()
        if stat.S_ISDIR(there.st_mode) and there.st_uid == _user() and not there.st_mode & 0o077:
            return folder
    except OSError:
        pass
    return _own_cache()


def _own_cache() -> Path:
    folder = tempfile.mkdtemp(prefix="idm-sumo-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0


def _user_cache() -> Path:
    """Return where programs keep a user's caches; ``~`` without a home is no absolute path and not writable."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()).absolute()
