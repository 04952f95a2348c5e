"""Work on many recordings: what is finished is skipped by content, what fails is a row, the rest goes on."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from idm_sumo.runtime.attempts import Failed, program
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.spread import spread

from ..drivers.source import Source
from ..page.manifest import manifest
from .dataset import PAGE, DataSet, Kept, opened
from .pages import page_of_all
from .plan import digest, key_of, name_of
from .result import Result
from .summary import summary_of
from .warm import compile_kernels
from .work import DIAGNOSIS, Work, work_on

DONE, FAILED = "done", "failed"
COUNTS = ("periods", "drivers", "ok", "left_out", "rows_read", "rows_used")  # columns of whole numbers
NAMED = 3  # recordings that a message names


@dataclass(frozen=True)
class Workers:
    """Who works.

    Attributes
    ----------
    jobs : int
        Processes of this machine.
    cluster : str or None
        Address of a dask scheduler, whose workers work instead.
    """

    jobs: int = 1
    cluster: str | None = None

    @property
    def how(self) -> dict[str, Any]:
        """What :func:`idm_sumo.runtime.spread.spread` is told."""
        return {"jobs": self.jobs, "cluster": self.cluster}


@dataclass(frozen=True)
class Outcome:
    """What many recordings came to.

    Attributes
    ----------
    rows : pandas.DataFrame
        One row a recording: ``recording, file, sha256, status, reason`` and what is said of it.
    summary : dict
        Across recordings.
    computed : int
        Recordings that were not finished before.
    """

    rows: pd.DataFrame
    summary: dict[str, Any]
    computed: int

    @property
    def failed(self) -> pd.DataFrame:
        """The rows of recordings that failed."""
        return self.rows[self.rows["status"] == FAILED]


def run(
    sources: Sequence[Source],
    work: Work,
    out: Path,
    workers: Workers,
    *,
    command: list[str],
    progress: Progress = silent,
) -> Outcome:
    """Work on recordings, and keep each result in a data set as soon as it is there.

    Parameters
    ----------
    sources : sequence of Source
    work : Work
        What is done with each.
    out : Path
        Folder of the data set. Recordings that are in it by the same content, options and program are not worked
        on again; others of the same options and program stay.
    workers : Workers
    command : list of str
        The command line, for the manifest.
    progress : Progress
        Called with the recordings done and their total.

    Raises
    ------
    InputError
        If the folder holds anything of somebody else, or recordings of other options that are not among these.
    """
    begin = time.perf_counter()
    with opened(out) as data:
        read = _digests(sources, workers, progress)
        key = key_of(work, sources[0])
        plan = _plan(data, sources, read, key)
        _compute(data, plan, _Job(work, key, workers), progress)
        kept = data.kept()
        rows = _rows(plan, kept)
        diagnoses = {one.name: found for one in kept if (found := data.content(one.name, DIAGNOSIS))}
        summary = summary_of(rows, diagnoses.values())
        seconds = round(time.perf_counter() - begin, 1)
        record = manifest(command, {"program": program(), **workers.how}, [], seconds=seconds)
        pages = {PAGE: page_of_all(rows, summary, diagnoses)} if diagnoses else {}
        data.conclude(rows, summary, record, pages)
    return Outcome(rows, summary, sum(one.is_new and not one.failure for one in plan))


@dataclass(frozen=True)
class _Task:
    """A recording that was asked for, what it is called, and what is known of it by now."""

    source: Source
    sha256: str
    name: str = ""
    is_new: bool = True
    failure: str = ""


def _digests(sources: Sequence[Source], workers: Workers, progress: Progress) -> list[str | Failed]:
    """Return what names each recording's content."""
    found: list[str | Failed] = [""] * len(sources)
    calls = [(source.path,) for source in sources]
    for done, (number, result) in enumerate(spread(digest, calls, **workers.how), 1):
        found[number] = result
        progress("looking at contents", done, len(sources))
    return found


def _plan(data: DataSet, sources: Sequence[Source], read: Sequence[str | Failed], key: str) -> list[_Task]:
    """Return what is to be done, and what is done already."""
    before = {one.name: one for one in data.kept()}
    free, taken, tasks = dict(before), set(before), []
    for source, content in zip(sources, read, strict=True):
        if isinstance(content, Failed):
            tasks.append(_Task(source, "", failure=content.reason, is_new=False))
            continue
        same = [one for one in free.values() if one.sha256 == content]
        known = next((one for one in same if one.key == key), same[0] if same else None)
        name = name_of(source.path, content, taken) if known is None else known.name
        free.pop(name, None)
        taken.add(name)
        tasks.append(_Task(source, content, name, is_new=known is None or known.key != key))
    if others := [name for name, one in free.items() if one.key != key]:
        names = ", ".join(others[:NAMED]) + (f" and {len(others) - NAMED} more" if len(others) > NAMED else "")
        raise InputError(
            f"{data.folder}: holds recordings of other options or another version ({names}); give them too, to have "
            "them computed again, or choose another folder"
        )
    return tasks


@dataclass(frozen=True)
class _Job:
    """The work, what names it with its options, and who does it."""

    work: Work
    key: str
    workers: Workers


def _compute(data: DataSet, plan: list[_Task], job: _Job, progress: Progress) -> None:
    """Compute what is new, and keep it as it comes; what fails is noted in the plan."""
    new = [number for number, task in enumerate(plan) if task.is_new]
    calls = [(job.work, plan[number].source) for number in new]
    for done, (index, result) in enumerate(spread(work_on, calls, warm=compile_kernels, **job.workers.how), 1):
        task = plan[new[index]]
        if isinstance(result, Failed):
            plan[new[index]] = replace(task, failure=result.reason)
        else:
            data.keep(Kept(task.name, job.key, task.sha256, _said(task, result)), result)
        progress("recordings", done, len(new))


def _said(task: _Task, result: Result) -> dict[str, Any]:
    """Return the row of a recording that is done."""
    periods = int(result.table["period"].nunique())
    return {"file": str(task.source.path), "status": DONE, "reason": "", "periods": periods, **result.row}


def _rows(plan: list[_Task], kept: list[Kept]) -> pd.DataFrame:
    """Return one row a recording: those that were asked for in their order, then what else the data set holds."""
    known = {one.name: one for one in kept}
    rows: list[dict[str, Any]] = []
    for task in plan:
        names = {"recording": task.name, "file": str(task.source.path), "sha256": task.sha256}
        if task.failure:
            rows.append({**names, "status": FAILED, "reason": task.failure})
        else:
            rows.append({**names, **known.pop(task.name).row, "file": str(task.source.path)})
    rows += [{"recording": one.name, "sha256": one.sha256, **one.row} for one in known.values()]
    table = pd.DataFrame(rows)
    table = table.astype({name: "Int64" for name in COUNTS if name in table})
    first = ["recording", "file", "sha256", "status", "reason"]
    return table[[*first, *(name for name in table if name not in first)]]
