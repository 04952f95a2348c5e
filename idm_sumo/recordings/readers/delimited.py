"""Official NGSIM text and the data portal's CSV, read into a table of official names, still in feet."""

from __future__ import annotations

import csv
import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, cast

import pandas as pd

from idm_sumo.recordings.accounting import Ledger
from idm_sumo.runtime.errors import InputError

OFFICIAL = (
    "Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y", "Global_X", "Global_Y",
    "v_Length", "v_Width", "v_Class", "v_Vel", "v_Acc", "Lane_ID", "Preceding", "Following",
    "Space_Headway", "Time_Headway",
)  # fmt: skip
NUMBERS = (
    "Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y", "v_Length", "v_Width", "v_Class",
    "v_Vel", "v_Acc", "Lane_ID", "Preceding", "Space_Headway", "step",
)  # fmt: skip
LABELS = ("Location", "period", "scene")
CHUNK = 1_000_000  # rows
GZIP = b"\x1f\x8b"
BROKEN = (EOFError, OSError, zlib.error)  # what a damaged gzip file raises


def canonical(name: str) -> str:
    """Return the official spelling of a column name, whatever its case; unknown names come back unchanged."""
    bare = name.strip().lstrip("\ufeff").lower()
    return next((known for known in (*OFFICIAL, *LABELS, "step") if known.lower() == bare), name.strip())


def open_plain(path: Path) -> IO[bytes]:
    """Open a file for reading bytes, unpacked if it is gzip."""
    with path.open("rb") as stream:
        packed = stream.read(2) == GZIP
    return cast("IO[bytes]", gzip.open(path)) if packed else path.open("rb")


def read_official(path: Path, ledger: Ledger) -> pd.DataFrame:
    """Read whitespace-separated text without header, 18 columns in official order.

    pandas' own parser splits runs of blanks natively. Arrow's needs single delimiters:
    collapsing them first made it slower (2.0 s against 1.3 s for 1.2 million rows).

    Raises
    ------
    InputError
        If a row has another number of columns or a text that is not a number; names file, row, column.
    """
    try:
        with open_plain(path) as stream:
            table = pd.read_csv(stream, sep=r"\s+", header=None, dtype="float64")
    except (ValueError, *BROKEN) as error:
        raise _located(path, error) from None
    if len(table.columns) != len(OFFICIAL) or table.iloc[:, -1].isna().any():  # pandas fills a short row up
        _locate(path)
    table.columns = pd.Index(OFFICIAL)
    ledger.total += len(table)
    return table[[name for name in OFFICIAL if name in NUMBERS]]


def read_portal(path: Path, ledger: Ledger, *, location: str) -> pd.DataFrame:
    """Read comma-separated text with a header, in any case, keeping one location.

    Raises
    ------
    InputError
        If columns are missing, a row is malformed, or no row is of that location (names those present).
    """
    header = header_of(path)
    names = {name: canonical(name) for name in header}
    wanted = [name for name in header if names[name] in (*NUMBERS, *LABELS)]
    types: dict[str, str] = {name: "str" for name in wanted if names[name] in LABELS}
    types |= {name: "float64" for name in header if names[name] in (*NUMBERS, *OFFICIAL)}
    last = header[-1]
    parts: list[pd.DataFrame] = []
    places: set[str] = set()
    checked = False
    try:
        with open_plain(path) as stream:
            # All columns are read, though not all are kept: with `usecols` pandas overlooks a cell too many.
            for chunk in pd.read_csv(
                stream, thousands=",", dtype=types, chunksize=CHUNK,
                encoding="utf-8-sig", skipinitialspace=True, low_memory=False,
            ):  # fmt: skip
                # A short row leaves the last cell empty; pandas makes an index of a cell too many.
                if not checked and (chunk[last].isna().any() or not isinstance(chunk.index, pd.RangeIndex)):
                    _locate(path)
                    checked = True
                ledger.total += len(chunk)
                part = chunk[wanted].rename(columns=names)
                if "Location" in part:
                    part, seen = keep_location(part, location, ledger)
                    places |= seen
                parts.append(part)
    except (ValueError, *BROKEN) as error:
        if isinstance(error, InputError):
            raise
        raise _located(path, error) from None
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(names.values()))
    check_location(path, table, places, location)
    return table


def check_location(path: Path, table: pd.DataFrame, places: set[str], location: str) -> None:
    """Raise if no row was of the location wanted.

    Raises
    ------
    InputError
        Names the locations that are there.
    """
    if table.empty and places:
        raise InputError(f"{path}: no row is of location {location!r}; the file has {', '.join(sorted(places))}")


def as_numbers(table: pd.DataFrame, path: Path) -> pd.DataFrame:
    """Return a table whose number columns are floats, though they may come as text or decimals.

    Raises
    ------
    InputError
        If a text is not a number; names row and column.
    """
    for name in (name for name in table.columns if name in NUMBERS):
        values = table[name]
        if not pd.api.types.is_numeric_dtype(values):
            values = values.map(lambda cell: cell.replace(",", "") if isinstance(cell, str) else cell)
        numbers = pd.to_numeric(values, errors="coerce").astype("float64")
        wrong = (numbers.isna() & table[name].notna()).to_numpy()
        if wrong.any():
            row = int(wrong.argmax())
            raise InputError(f"{path}: row {row + 1}, column {name}: {table[name].iloc[row]!r} is not a number")
        table[name] = numbers
    return table


def keep_location(part: pd.DataFrame, location: str, ledger: Ledger) -> tuple[pd.DataFrame, set[str]]:
    """Return the rows of one location, the others booked, and the names of all locations seen."""
    place = part["Location"].fillna("(none)").str.strip()
    kept = ledger.drop(part, place.str.lower() != location.lower(), "other location")
    return kept.drop(columns="Location"), set(place.unique())


def header_of(path: Path) -> list[str]:
    """Return the column names of a comma-separated file as they are spelled there."""
    with open_plain(path) as stream:
        line = stream.readline().decode("utf-8-sig", errors="replace")
    return next(csv.reader([line.rstrip("\r\n")], skipinitialspace=True), [])


def _rows(path: Path) -> Iterator[tuple[int, list[str], tuple[str, ...]]]:
    """Yield line number, cells and column names of every row that is not blank."""
    with open_plain(path) as stream, io.TextIOWrapper(stream, "utf-8-sig", errors="replace", newline="") as text:
        first = text.readline()
        if is_official(first):
            yield 1, first.split(), OFFICIAL
            yield from ((n, line.split(), OFFICIAL) for n, line in enumerate(text, 2) if line.strip())
        else:
            names = tuple(canonical(name) for name in next(csv.reader([first], skipinitialspace=True)))
            rows = enumerate(csv.reader(text, skipinitialspace=True), 2)
            yield from ((n, [cell.replace(",", "") for cell in cells], names) for n, cells in rows if cells)


def is_official(line: str) -> bool:
    """Whether a line is made of numbers (most of it, so that a bad one can be named) apart by blanks."""
    cells = line.split()
    numbers = sum(is_number(cell) for cell in cells)
    return bool(cells) and 2 * numbers > len(cells)


def is_number(cell: str) -> bool:
    """Whether a text is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _locate(path: Path) -> None:
    """Go through a file row by row and raise for the first bad one; slow, and only for the message.

    Raises
    ------
    InputError
        For the first row that has too many or too few columns or a text where a number belongs.
    """
    for number, cells, names in _rows(path):
        if len(cells) != len(names):
            raise InputError(
                f"{path}: row {number} has {len(cells)} columns where {len(names)} are needed; "
                "mend or remove the row (a file cut short in transfer ends like this)"
            )
        for name, cell in zip(names, cells, strict=True):
            bare = cell.strip()
            if name in (*NUMBERS, *OFFICIAL) and bare and not is_number(bare):
                raise InputError(f"{path}: row {number}, column {name}: {bare!r} is not a number")


def _located(path: Path, error: Exception) -> InputError:
    """Return the error that names the row, or the parser's own words if every row looks fine."""
    try:
        _locate(path)
    except InputError as located:
        return located
    except BROKEN as broken:
        return InputError(f"{path}: the gzip archive is broken ({broken}); fetch it again")
    return InputError(f"{path}: cannot be read: {str(error).splitlines()[0]}")
