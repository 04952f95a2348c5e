"""A Parquet data set that grows by whole recordings: ``recording=NAME/period=LABEL/drivers.parquet``.

What is about the data set and not in it begins with ``_``, so that readers of data sets skip it. Every recording's
folder has a manifest of its own and is exchanged whole; so an interrupted run leaves whole recordings.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import pandas as pd

from idm_sumo.calibration.driver_table import write_drivers
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.files import new_files, new_folder
from idm_sumo.runtime.ownership import FILES, HIDDEN_MANIFEST, is_whole, refuse, sha256, strangers
from idm_sumo.runtime.parquet import read_table, to_frame
from idm_sumo.runtime.siblings import PREFIX, locked

from .result import Result

DRIVERS = "drivers.parquet"
RECORDING, PERIOD = "recording=", "period="
RECORDINGS, SUMMARY, PAGE = "_recordings.csv", "_summary.json", "_report.html"
NUMBER = re.compile(r"p*\d+")  # a label that readers would take for a number; ours gets a p in front


@dataclass(frozen=True)
class Kept:
    """A recording in the data set.

    Attributes
    ----------
    name : str
    key : str
        Of the program and the options that made it.
    sha256 : str
        Of the recording's content.
    row : dict
        What is said of it.
    """

    name: str
    key: str
    sha256: str
    row: dict[str, Any]


@contextmanager
def opened(folder: Path) -> Iterator[DataSet]:
    """Yield a data set that no other run works on; made if need be.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    InputError
        If another run is at work there, or the folder holds anything that no run of ours left there as it is.
    """
    with locked(folder, "run over many recordings"):
        refuse_others(folder)
        yield DataSet(folder)


def refuse_others(folder: Path) -> None:
    """Raise if a folder holds anything but a data set of ours.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    InputError
        Names the first of what is somebody else's.
    """
    if not folder.is_dir():
        return
    others: list[str] = []
    listed = _record(folder).get(FILES, {})
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith(RECORDING) and entry.is_dir() and not entry.is_symlink():
            others += [f"{entry.name}/{name}" for name in strangers(entry)]
        elif entry.name.startswith(PREFIX) or (entry.name == HIDDEN_MANIFEST and listed):
            continue
        elif not (entry.is_file() and not entry.is_symlink() and listed.get(entry.name) == sha256(entry)):
            others.append(entry.name)
    refuse(folder, others)


class DataSet:
    """A folder of recordings' driver tables.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def kept(self) -> list[Kept]:
        """Return the recordings that are there, by name."""
        found = []
        for folder in sorted(self.folder.glob(f"{RECORDING}*")):
            if is_whole(folder):
                told = _record(folder)
                name = folder.name.removeprefix(RECORDING)
                found.append(Kept(name, told["key"], told["sha256"], told["row"]))
        return found

    def keep(self, one: Kept, result: Result) -> None:
        """Put a recording in, in the place of one of that name.

        Parameters
        ----------
        one : Kept
        result : Result
        """
        self._forget_summary()
        with new_folder(self.folder / f"{RECORDING}{one.name}") as part:
            for label, table in result.table.groupby(c.PERIOD, sort=False, observed=True):
                place = part / f"{PERIOD}{as_folder(str(label))}"
                place.mkdir()
                write_drivers(table.drop(columns=c.PERIOD).reset_index(drop=True), place / DRIVERS, result.road)
            for name, content in result.files.items():
                (part / name).write_bytes(content)
            told = {"key": one.key, "sha256": one.sha256, "row": one.row}
            (part / HIDDEN_MANIFEST).write_text(json.dumps(told) + "\n", encoding="utf-8")

    def tables(self, name: str) -> pd.DataFrame:
        """Return the driver table of a recording.

        Parameters
        ----------
        name : str
        """
        parts = sorted((self.folder / f"{RECORDING}{name}").glob(f"{PERIOD}*/{DRIVERS}"))
        tables = [
            to_frame(read_table(part)).assign(**{c.PERIOD: as_label(part.parent.name.removeprefix(PERIOD))})
            for part in parts
        ]
        return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()

    def content(self, name: str, file: str) -> dict[str, Any]:
        """Return what a further file of a recording holds, nothing if there is none.

        Parameters
        ----------
        name, file : str
            Of the recording, and of a JSON file.
        """
        path = self.folder / f"{RECORDING}{name}" / file
        return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}

    def conclude(
        self, rows: pd.DataFrame, summary: dict[str, Any], record: dict[str, Any], pages: Mapping[str, str]
    ) -> None:
        """Write what is about the data set: one row a recording, the summary, pages, the manifest.

        Parameters
        ----------
        rows : pandas.DataFrame
        summary, record : dict
        pages : mapping of str to str
            Texts by name of the file.
        """
        texts = {
            RECORDINGS: rows.to_csv(index=False),
            SUMMARY: json.dumps(summary, indent=2, allow_nan=False) + "\n",
            **pages,
        }
        with new_files([self.folder / name for name in (*texts, HIDDEN_MANIFEST)]) as (*parts, manifest):
            for part, text in zip(parts, texts.values(), strict=True):
                part.write_text(text, encoding="utf-8", newline="")
            files = {name: sha256(part) for name, part in zip(texts, parts, strict=True)}
            manifest.write_text(json.dumps({**record, FILES: files}, indent=2, default=str) + "\n", encoding="utf-8")

    def _forget_summary(self) -> None:
        """Remove what was said of the data set, as it is about to change."""
        for name in (HIDDEN_MANIFEST, RECORDINGS, SUMMARY, PAGE):
            (self.folder / name).unlink(missing_ok=True)


def as_folder(label: str) -> str:
    """Return a label as the name of a folder that every reader takes for a text.

    Parameters
    ----------
    label : str
    """
    return quote(f"p{label}" if NUMBER.fullmatch(label) else label, safe="")


def as_label(folder: str) -> str:
    """Return the label that a folder stands for.

    Parameters
    ----------
    folder : str
        As :func:`as_folder` names it.
    """
    label = unquote(folder)
    return label[1:] if NUMBER.fullmatch(label) else label


def _record(folder: Path) -> dict[str, Any]:
    try:
        told = json.loads((folder / HIDDEN_MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return told if isinstance(told, dict) else {}
