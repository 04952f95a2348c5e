"""The built-in surrogate recording, made once and kept in the user's cache."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from platformdirs import user_cache_path

from idm_sumo.runtime.files import new_folder
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.sumo import network

from .warm import compile_beside

LABELS = ("0750-0805", "0805-0820", "0820-0835")  # of its periods, in the order they are made


def cache_folder() -> Path:
    """Return where built-in recordings are kept: ``IDM_SUMO_CACHE``, or the user's cache folder."""
    folder = os.environ.get("IDM_SUMO_CACHE")
    return Path(folder) if folder else user_cache_path("idm-sumo")


def cached_surrogate(minutes: float, seed: int, progress: Progress = silent) -> Path:
    """Return the surrogate of that length and seed, a folder of Parquet parts, one a period.

    It is made if it is not in the cache, and while SUMO works on it on one core the kernels
    are compiled on another. :func:`idm_sumo.recordings.reading.read_recording` reads the folder
    as well as each part.
    """
    from idm_sumo.sumo.surrogate import make as surrogate

    folder = cache_folder() / f"surrogate-{minutes:g}min-seed{seed}-{_maker()}"
    if folder.is_dir():
        return folder
    compiling = compile_beside()
    with new_folder(folder) as part:
        tables = surrogate.surrogate_periods(
            minutes=minutes,
            seed=seed,
            progress=lambda done, total: progress("making the surrogate recording", done, total),
        )
        for label, table in zip(LABELS, tables, strict=True):
            surrogate.write_layout([table], part / f"{label}.parquet", ".parquet")
    progress("compiling", 0, 1)
    compiling.result()
    progress("compiling", 1, 1)
    return folder


def _maker() -> str:
    """Return a fingerprint of what makes the recording, so that a changed maker does not serve old files."""
    folder = Path(network.__file__).parent
    sources = [*sorted((folder / "surrogate").glob("*.py")), network.net_file()]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:8]
