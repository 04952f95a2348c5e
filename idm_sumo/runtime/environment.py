"""What must be settled before numpy and numba load: threads of BLAS, places for compiled code.

This module is loaded with the package and imports nothing that takes time.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import re
import shutil
import stat
import sys
import tempfile
from pathlib import Path

from idm_sumo.runtime.errors import InputError

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
NUMBA_THREADS = "NUMBA_NUM_THREADS"
NUMBA_CACHE, MATPLOTLIB_CACHE = "NUMBA_CACHE_DIR", "MPLCONFIGDIR"
SHIPPED = ("analysis", "network", "runs")
KERNEL = re.compile(rb"^\s*@njit\b", re.MULTILINE)
IMPORT = re.compile(rb"^\s*from (idm_sumo[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
SOURCES = "sources.json"  # beside compiled kernels: what they were compiled from


def one_blas_thread() -> None:
    """Give BLAS one thread, here and in processes started from here, unless the user chose.

    Our matrices are small: a second thread of BLAS waits for the first, and beside other work
    inverse optimal control takes ten times as long with two. The command line calls this before
    numpy is loaded. Of a program that imports us numpy is its own: there the functions that
    matter limit BLAS while they run (:func:`idm_sumo.runtime.threads.one_blas_thread`).
    """
    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")


def draw_into_files() -> None:
    """Let matplotlib draw into files, whatever windows the user has chosen for other programs.

    The command line shows none, and a backend that is not installed would stop it.
    """
    os.environ["MPLBACKEND"] = "agg"


def check_threads() -> None:
    """Refuse numbers of threads that numba refuses with a traceback.

    Raises
    ------
    InputError
        If ``NUMBA_NUM_THREADS`` is a whole number below 1.
    """
    text = os.environ.get(NUMBA_THREADS, "").strip()
    if re.fullmatch(r"[+-]?\d+", text) and int(text) < 1:
        raise InputError(f"{NUMBA_THREADS}: {text} is no number of threads; give 1 or more, or unset it")


def find_places_for_caches(package: Path) -> None:
    """Give numba and matplotlib places for what they keep.

    Compiled kernels stand beside their source where that can be written. Where it cannot, as in containers and
    on clusters, numba would refuse to load a kernel: then they stand in the user's cache, or among the temporary
    files. Kernels of another version of the package are never used, see :func:`forget_older_kernels`.

    Parameters
    ----------
    package : Path
        Folder of the installed package.
    """
    users = _user_cache()
    home = users / "idm-sumo" if is_writable(users) else None
    if home is None:
        os.environ.setdefault(MATPLOTLIB_CACHE, str(temporary_cache() / "matplotlib"))
    if os.access(package, os.W_OK):
        forget_older_kernels(package)
    elif NUMBA_CACHE not in os.environ:
        os.environ[NUMBA_CACHE] = str((home or temporary_cache()) / f"kernels-{fingerprint(package)}")
        if "numba" in sys.modules:  # it has read its environment already
            sys.modules["numba"].config.CACHE_DIR = os.environ[NUMBA_CACHE]


def fingerprint(package: Path) -> str:
    """Return what names the sources of a package: equal for equal files, wherever they stand.

    Parameters
    ----------
    package : Path
        Its folder; what a wheel ships below it beside the rooms has no kernels and does not count.
    """
    return _digest(_sources(package), package)


def forget_older_kernels(package: Path) -> None:
    """Delete kernels that were compiled from other sources.

    Machine code holds what it calls in other modules, and the constants that it reads, but numba looks only at
    a kernel's own file: an old kernel would call new ones with the wrong arguments, and crash. So a module's
    kernels go when the module has changed, or anything that it imports, directly or not.

    Parameters
    ----------
    package : Path
        Folder that can be written.
    """
    mark, sources = package / "__pycache__" / SOURCES, _sources(package)
    try:
        known = json.loads(mark.read_bytes()) if mark.is_file() else {}
        now = {"": _digest(sources, package)}
        if known.get("") == now[""]:
            return
        imports = {source: _imports(text, sources, package) for source, text in sources.items()}
        for source, text in sources.items():
            if KERNEL.search(text):
                name = str(source.relative_to(package))
                now[name] = _digest({one: sources[one] for one in _reached(source, imports)}, package)
                if now[name] != known.get(name):
                    _delete_kernels(source)
        mark.parent.mkdir(exist_ok=True)
        mark.write_text(json.dumps(now), encoding="ascii")
    except (OSError, ValueError, AttributeError):  # somebody else is at it, the disk is full, the mark is no mark
        mark.unlink(missing_ok=True)


def _sources(package: Path) -> dict[Path, bytes]:
    rooms = (room for room in package.iterdir() if room.is_dir() and room.name not in SHIPPED)
    return {source: source.read_bytes() for room in rooms for source in room.rglob("*.py")}


def _digest(sources: dict[Path, bytes], package: Path) -> str:
    digest = hashlib.sha256()
    for source in sorted(sources):
        digest.update(str(source.relative_to(package)).encode())
        digest.update(sources[source])
    return digest.hexdigest()[:16]


def _imports(text: bytes, sources: dict[Path, bytes], package: Path) -> set[Path]:
    """Return the modules of the package that a source imports."""
    found = set()
    for origin, names in IMPORT.findall(text):
        at = package.joinpath(*origin.decode().split(".")[1:])
        found |= {at.with_suffix(".py"), at / "__init__.py"}
        found |= {at / f"{name}.py" for name in re.findall(r"\w+", names.decode())}
    return found & sources.keys()


def _reached(source: Path, imports: dict[Path, set[Path]]) -> set[Path]:
    """Return a module and what it imports, directly or not."""
    reached, new = {source}, [source]
    while new:
        further = imports[new.pop()] - reached
        reached |= further
        new += further
    return reached


def _delete_kernels(source: Path) -> None:
    for kernel in source.parent.glob(f"__pycache__/{source.stem}.*.nb[ic]"):
        kernel.unlink(missing_ok=True)


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
