"""The built-in surrogate recording, kept in the user's cache."""

from __future__ import annotations

import hashlib
from pathlib import Path

from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.cache import cache_folder
from idm_sumo.runtime.files import new_folder
from idm_sumo.runtime.ownership import is_whole
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.siblings import remove
from idm_sumo.sumo import network
from idm_sumo.sumo.surrogate import SURROGATE, make

LABELS = ("0750-0805", "0805-0820", "0820-0835")  # of its periods, in the order they are made


def recording_path(name: str | Path, *, minutes: float = 45.0, seed: int = 1, progress: Progress = silent) -> Path:
    """Return the path of a recording, or of ``surrogate``.

    Parameters
    ----------
    name : str or Path
        A file or folder, or the word ``surrogate``. A file of that name is given as ``./surrogate``.
    minutes, seed, progress
        As of :func:`surrogate`; of no effect for a file.

    Returns
    -------
    Path
        ``name``, or the built-in recording, which is made if the cache lacks it.

    Raises
    ------
    InputError
        As of :func:`surrogate`.
    """
    return surrogate(minutes=minutes, seed=seed, progress=progress) if str(name) == SURROGATE else Path(name)


def surrogate_folder(minutes: float, seed: int) -> Path:
    """Return where a surrogate recording is kept, made or not.

    Parameters
    ----------
    minutes : float
        Length of the recording (min).
    seed : int
        Seed of the recording.

    Returns
    -------
    Path
        A folder of the cache; its name also holds a fingerprint of the code that makes the recording.
    """
    return cache_folder() / f"surrogate-{minutes:g}min-seed{seed}-{_fingerprint()}"


def surrogate(*, minutes: float = 45.0, seed: int = 1, progress: Progress = silent) -> Path:
    """Return the built-in recording, made if the cache lacks it.

    Parameters
    ----------
    minutes : float
        Length of the recording (min), in three periods of equal length.
    seed : int
        Seed of everything random in it.
    progress : Progress
        Called with a stage's name, what is done of it and its total.

    Returns
    -------
    Path
        A folder of Parquet files, one a period. :func:`idm_sumo.recordings.reading.read_recording`
        reads the folder as well as each file.

    Raises
    ------
    InputError
        If SUMO cannot make a recording of that length and seed, or the cache cannot be written.
    """
    folder = surrogate_folder(minutes, seed)
    if is_whole(folder):
        return folder
    remove(folder)  # the cache is ours: what is damaged there is made again
    with new_folder(folder) as part:
        tables = make.surrogate_periods(
            minutes=minutes,
            seed=seed,
            progress=lambda done, total: progress("making the surrogate recording", done, total),
        )
        for label, table in zip(LABELS, tables, strict=True):
            make.write_layout([table], part / f"{label}.parquet", ".parquet")
    return folder


def _fingerprint() -> str:
    """Return a fingerprint of what makes the recording.

    It covers the code of this room and the network. As part of the folder's name it keeps changed code from
    serving old files.
    """
    sources = [*sorted(Path(__file__).parent.glob("*.py")), network.of(US101).file]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:8]
