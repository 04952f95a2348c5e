"""The first line of a delimited file: its columns, their names and what sets them apart."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, replace

from idm_sumo.recordings.readers.layouts import LABELS, OFFICIAL
from idm_sumo.runtime.errors import InputError, shown

BLANKS = " "  # any number of them between two columns
DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
UNNAMED = "(without a name)"  # an empty last column, left by a delimiter at the end of each line
MOST = 1000  # columns
MISSPELT = {
    "preceeding": "Preceding", "space_hdwy": "Space_Headway", "time_hdwy": "Time_Headway", "v_lenght": "v_Length",
    "veh_id": "Vehicle_ID", "vehicleid": "Vehicle_ID", "frameid": "Frame_ID", "laneid": "Lane_ID",
}  # fmt: skip
_DECIMAL = re.compile(r"[+-]?\d+,\d+")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+")


@dataclass(frozen=True)
class Header:
    """Columns of a delimited file.

    Attributes
    ----------
    names : tuple of str
        In the official spelling where there is one.
    spelt : tuple of str
        As the file spells them.
    delimiter : str
    decimal : str
        What sets the decimals apart, a point or a comma.
    above : int
        Lines before the one with the names.
    has_names : bool
        Whether there is such a line.
    """

    names: tuple[str, ...]
    spelt: tuple[str, ...]
    delimiter: str
    decimal: str
    above: int = 0
    has_names: bool = True

    @property
    def separator(self) -> str:
        """What pandas is told of the delimiter."""
        return r"\s+" if self.delimiter == BLANKS else self.delimiter

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line."""
        return line.split() if self.delimiter == BLANKS else line.rstrip("\r\n").split(self.delimiter)

    @property
    def plain(self) -> Header:
        """The same columns by the file's own names."""
        return replace(self, names=self.spelt)

    @property
    def notes(self) -> list[str]:
        """Which names were taken for others."""
        both = zip(self.spelt, self.names, strict=True)
        return [f"column {spelt} is read as {name}" for spelt, name in both if spelt.lower() in MISSPELT]


def canonical(name: str) -> str:
    """Return the official spelling of a column name, whatever its case; unknown names come back unchanged."""
    bare = name.strip().lstrip("\ufeff").lower()
    bare = MISSPELT.get(bare, bare).lower()
    return next((known for known in (*OFFICIAL, *LABELS, "step") if known.lower() == bare), name.strip())


def header_of(start: str, source: object) -> Header:
    """Return the columns by the first lines of a file.

    Parameters
    ----------
    start : str
        The first line and as many more as tell how decimals are written.
    source : object
        What messages call the file.

    Raises
    ------
    InputError
        If a name is empty or there twice.
    """
    first, *more = start.splitlines()
    delimiter = max(DELIMITERS, key=first.count)
    if delimiter not in first and len(first.split()) > 1:
        delimiter = BLANKS
    spelt = [name.strip().lstrip("\ufeff") for name in _cells(first, delimiter, source)]
    if len(spelt) > MOST:
        raise InputError(f"{source}: row 1 has {len(spelt)} columns; a recording has about 20")
    if len(spelt) > 1 and not spelt[-1]:
        spelt[-1] = UNNAMED
    names = check_names([canonical(name) for name in spelt], source)
    return Header(tuple(names), tuple(spelt), delimiter, _decimal_of(more[:-1], delimiter))


def check_names(names: list[str], source: object) -> list[str]:
    """Return the names of columns if every one is there once and none is empty.

    Raises
    ------
    InputError
        Says which column.
    """
    for place, name in enumerate(names):
        if not name:
            raise InputError(f"{source}: column {place + 1} of {len(names)} has no name; give it one or remove it")
        if name in names[:place]:
            raise InputError(f"{source}: column {shown(name)} is there {names.count(name)} times; keep one of them")
    return names


def _cells(line: str, delimiter: str, source: object) -> list[str]:
    if delimiter == BLANKS:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{source}: row 1: cannot be divided into columns ({error})") from None


def _decimal_of(lines: list[str], delimiter: str) -> str:
    """Return what sets decimals apart: a comma where cells hold one that cannot be of thousands."""
    if delimiter == ",":
        return "."
    cells = [cell.strip() for line in lines[:200] for cell in line.split(delimiter)]
    return "," if any(_DECIMAL.fullmatch(cell) and not _THOUSANDS.fullmatch(cell) for cell in cells) else "."
