"""Between a program and its workers: a value that all read from one file, files that each leaves."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from idm_sumo.runtime.cluster import SEEN
from idm_sumo.runtime.inputs import existing_file
from idm_sumo.runtime.siblings import scratch


@contextmanager
def handed_over(value: object, folder: Path) -> Iterator[Path]:
    """Yield a file with a value, gone when the block ends.

    Parameters
    ----------
    value : object
        That can be pickled.
    folder : Path
        That all workers see under the same path.
    """
    with scratch(folder.resolve()) as place:
        file = place / "value.pickle"
        with file.open("wb") as stream:
            pickle.dump(value, stream, pickle.HIGHEST_PROTOCOL)
        yield file


def received(file: Path) -> Any:
    """Return the value that a file of :func:`handed_over` holds.

    Parameters
    ----------
    file : Path

    Raises
    ------
    InputError
        If this machine does not see it.
    """
    with existing_file(file, SEEN).open("rb") as stream:
        return pickle.load(stream)


@contextmanager
def handed_back(folder: Path, workshop: Path) -> Iterator[Path]:
    """Yield a folder of one's own, whose files move into another when the block succeeds.

    A cluster that loses touch with a worker has another do the same work, while the first may still write. Then
    each writes on its own, and what bears a result's name is whole whoever comes last. A worker that comes when
    the program has ended finds neither folder and fails alone.

    Parameters
    ----------
    folder : Path
        Of the results.
    workshop : Path
        On the same file system; the program removes it when it no longer waits for workers.
    """
    with scratch(workshop) as own:
        yield own
        for file in sorted(own.iterdir()):
            os.replace(file, folder / file.name)
