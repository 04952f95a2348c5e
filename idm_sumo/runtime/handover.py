"""A value that many workers read from one file, where it is too large to go with every call."""

from __future__ import annotations

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
