"""Progress on standard error, results on standard output."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING

from idm_sumo.cli.guard import say
from idm_sumo.runtime.text import number

if TYPE_CHECKING:
    import pandas as pd
    from rich.progress import TaskID

    from idm_sumo.runtime.progress import Progress as Report


__all__ = ["note", "progress_bar", "say", "study_module", "text_table"]


@contextmanager
def progress_bar(stages: Sequence[str] = ()) -> Iterator[Report]:
    """Yield a callable ``(stage, done, total)`` that shows progress.

    A terminal gets a bar a stage with percentage and remaining time; a log file one line a stage.

    Parameters
    ----------
    stages : sequence of str
        Stages that will come, in order; each is shown with its number. Others are shown without.
    """
    from rich.console import Console  # here: help shows no progress

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _StageLog(stages)
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    bars = Progress(*columns, console=console)
    tasks: dict[str, TaskID] = {}

    def report(stage: str, done: float, total: float) -> None:
        if stage not in tasks:
            tasks[stage] = bars.add_task(numbered(stage, stages), total=total)
        bars.update(tasks[stage], completed=done, total=total)

    with bars:
        yield report


def numbered(stage: str, stages: Sequence[str]) -> str:
    """Return a planned stage's name with its number.

    Parameters
    ----------
    stage : str
    stages : sequence of str
    """
    return f"{stage} {stages.index(stage) + 1} of {len(stages)}" if stage in stages else stage


class _StageLog:
    """One line a stage, for terminals that are files."""

    def __init__(self, stages: Sequence[str]) -> None:
        self._stages = stages
        self._last = ""

    def __call__(self, stage: str, done: float, total: float) -> None:
        if stage != self._last:
            print(f"{numbered(stage, self._stages)} ...", file=sys.stderr, flush=True)
            self._last = stage


def note(line: str) -> None:
    """Print a line to standard error, beside the result.

    Parameters
    ----------
    line : str
    """
    print(f"note: {line}", file=sys.stderr)


def text_table(table: pd.DataFrame) -> str:
    """Return a table as aligned text.

    Parameters
    ----------
    table : pandas.DataFrame
    """
    return str(table.to_string(index=False, float_format=number, na_rep="–"))


def study_module(name: str) -> ModuleType:
    """Return a module of the study.

    It is below this package in a wheel and beside it in a clone.

    Parameters
    ----------
    name : str
        Below `analysis`, such as ``replay.run``.
    """
    package = "idm_sumo.analysis" if find_spec("idm_sumo.analysis") else "analysis"
    return import_module(f"{package}.{name}")
