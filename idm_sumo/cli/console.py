"""Progress on standard error, results on standard output."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    import pandas as pd

    from idm_sumo.runtime.progress import Progress as Report


@contextmanager
def progress_bar() -> Iterator[Report]:
    """Yield a callable ``(stage, done, total)`` that draws one bar a stage, or prints stages to a log file."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _StageLog()
        return
    bars = Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=console)
    tasks: dict[str, TaskID] = {}

    def report(stage: str, done: float, total: float) -> None:
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=total)
        bars.update(tasks[stage], completed=done, total=total)

    with bars:
        yield report


class _StageLog:
    """One line a stage, for terminals that are files."""

    def __init__(self) -> None:
        self._last = ""

    def __call__(self, stage: str, done: float, total: float) -> None:
        if stage != self._last:
            print(f"{stage} ...", file=sys.stderr, flush=True)
            self._last = stage


def say(*lines: str) -> None:
    """Print lines to standard output."""
    print(*lines, sep="\n")


def note(line: str) -> None:
    """Print a line to standard error, beside the result."""
    print(f"note: {line}", file=sys.stderr)


def text_table(table: pd.DataFrame) -> str:
    """Return a table as aligned text."""
    return str(table.to_string(index=False, float_format=lambda value: f"{value:.3g}"))


def study_module(name: str) -> ModuleType:
    """Return a module of the study: below this package in a wheel, beside it in a clone."""
    package = "idm_sumo.analysis" if find_spec("idm_sumo.analysis") else "analysis"
    return import_module(f"{package}.{name}")
