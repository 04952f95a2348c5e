"""One case of a blind campaign: the recording that the finder is shown, and the record that is kept."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Find = Callable[[Path, int], dict[str, Any]]  # from a file and a seed to what ``diagnosis.json`` holds


def kept_case(kept: Path, trial: dict[str, Any]) -> dict[str, Any] | None:
    """Return the record of a finished case, if it is of the same trial."""
    if not kept.exists():
        return None
    before = dict(json.loads(kept.read_text(encoding="utf-8")))
    return before if all(before.get(key) == value for key, value in trial.items()) else None


def shown(find: Find, write: Callable[[Path], object], seed: int) -> dict[str, Any]:
    """Return what is ``found`` in the recording that ``write`` puts into a file, and in how many ``seconds``."""
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "recording.parquet"
        write(file)
        begin = time.perf_counter()
        return {"found": find(file, seed), "seconds": time.perf_counter() - begin}


def keep_case(kept: Path, record: dict[str, Any]) -> dict[str, Any]:
    """Write a record beside its place, move it there, and return it."""
    part = kept.with_suffix(".part")
    part.write_text(json.dumps(record, indent=1, default=plain), encoding="utf-8")
    part.replace(kept)
    return record


def plain(value: Any) -> Any:
    """Return what JSON can hold of a value that it cannot."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
