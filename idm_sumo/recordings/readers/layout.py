"""What a data set's layout declares of itself, and a file that is held against it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.coercion import LATEST
from idm_sumo.recordings.coercion import numbers as numbers_of
from idm_sumo.recordings.readers import delimited
from idm_sumo.recordings.readers.header import Header
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.runtime import parquet
from idm_sumo.runtime.errors import InputError

_UNIT = re.compile(r"[(\[][^()\[\]]*[)\]]")  # no bracket within: else a row of brackets takes minutes


def plain(name: str) -> str:
    """Return a column's name in small letters, without its unit in brackets; hyphens and blanks are underscores."""
    return re.sub(r"[\s\-]+", "_", _UNIT.sub("", name.lstrip("\ufeff")).strip().lstrip("#").strip()).lower()


@dataclass(frozen=True)
class Opened:
    """A file whose first bytes are read.

    Attributes
    ----------
    path : Path
    ledger : Ledger
        Counts the rows.
    location : str
        Which location to keep of a file that mixes several.
    road : Road or None
        What was recorded, where the user says so.
    names : tuple of str
        Its columns as it spells them; empty for a file without names.
    start : str
        Its first text; empty for Parquet.
    header : Header or None
        How the columns of a delimited file are set apart.
    needed : frozenset of str
        Columns whose numbers a row cannot do without.
    """

    path: Path
    ledger: Ledger
    location: str
    road: Road | None
    names: tuple[str, ...] = ()
    start: str = ""
    header: Header | None = None
    needed: frozenset[str] = frozenset()

    @property
    def source(self) -> str:
        """What messages call the file."""
        return self.path.name

    @property
    def first_numbers(self) -> list[float]:
        """Numbers of the first line, apart by blanks or a delimiter; none if a cell is something else."""
        line = next(iter(self.start.splitlines()), "")
        cells = re.split(r"\s*[,;\t|]\s*|\s+", line.strip())
        try:
            return [float(cell) for cell in cells]
        except ValueError:
            return []

    def columns(self, wanted: Mapping[str, str], texts: Iterable[str] = ()) -> pd.DataFrame:
        """Return columns of the whole file, every row counted; one without a number it needs is dropped.

        Parameters
        ----------
        wanted : mapping of str to str
            New name of each column to its name in the file.
        texts : iterable of str
            New names of the columns that hold texts; the others hold numbers.
        """
        labels = {wanted[name] for name in texts if name in wanted}
        spelt = list(dict.fromkeys(wanted.values()))
        if self.header is not None:
            floats = [name for name in spelt if name not in labels]
            table = delimited.read_table(self.path, self.header.plain, floats, labels)
        else:
            table = parquet.to_frame(parquet.read_table(self.path, lambda _: spelt))
        self.ledger.total += len(table)
        return self._sound(pd.DataFrame({new: table[old] for new, old in wanted.items()}), set(texts))

    def _sound(self, table: pd.DataFrame, texts: set[str]) -> pd.DataFrame:
        numbers = {name: numbers_of(table[name], name, self.source) for name in table.columns if name not in texts}
        table = table.assign(**numbers)
        needed = table[[name for name in numbers if name in self.needed]].to_numpy(np.float64)
        with np.errstate(invalid="ignore"):
            sound = (np.abs(needed) <= LATEST).all(axis=1)
        table = self.ledger.drop(table, ~sound, "non-finite value").reset_index(drop=True)
        if table.empty:
            raise InputError(f"{self.source}: no rows left of {self.ledger.total} read ({self.ledger.dropped})")
        return table


@dataclass(frozen=True)
class Layout:
    """The layout of a data set.

    Attributes
    ----------
    name : str
        As people call it.
    columns : mapping of str to tuple of str
        The columns it cannot do without, each with the spellings of it (as :func:`plain` makes them).
    read : callable
        From an opened file and the file's names of the columns to a recording and the account of its rows.
    marks : tuple of str
        Columns (as :func:`plain` makes them) by which it is told from others, all of them there.
    optional : mapping of str to tuple of str
        Columns that it uses where they are.
    recognise : callable, optional
        Tells a file without a header of columns.
    """

    name: str
    read: Callable[[Opened, Mapping[str, str]], tuple[Recording, Accounting]]
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    marks: tuple[str, ...] = ()
    optional: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    recognise: Callable[[Opened], bool] = lambda _: False

    def tells(self, opened: Opened) -> bool:
        """Whether a file is of this layout."""
        names = {plain(name) for name in opened.names}
        return (bool(self.marks) and set(self.marks) <= names) or self.recognise(opened)

    def missing(self, names: Iterable[str]) -> list[str]:
        """Return the columns that are needed and not there."""
        there = {plain(name) for name in names}
        return [spellings[0] for spellings in self.columns.values() if not there & set(spellings)]

    def matched(self, opened: Opened) -> dict[str, str]:
        """Return the file's name of each column that is there.

        Raises
        ------
        InputError
            If a needed one is not; names all that are missing.
        """
        if missing := self.missing(opened.names):
            raise InputError(
                f"{opened.source}: is of the layout of {self.name}, but column {', '.join(missing)} is missing; "
                f"give the file as it was published"
            )
        spelt: dict[str, str] = {}
        for name in opened.names:
            spelt.setdefault(plain(name), name)
        return {
            new: next(spelt[one] for one in spellings if one in spelt)
            for new, spellings in {**self.columns, **self.optional}.items()
            if set(spellings) & set(spelt)
        }

    def recording(self, opened: Opened) -> tuple[Recording, Accounting]:
        """Read a file of this layout."""
        return self.read(replace(opened, needed=frozenset(self.columns)), self.matched(opened))
