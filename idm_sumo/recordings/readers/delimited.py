"""Text whose columns are apart by blanks or by a delimiter, with a header or without, read into tables."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import pandas as pd

from idm_sumo.recordings.accounting import Ledger
from idm_sumo.recordings.coercion import numbers
from idm_sumo.recordings.readers.header import BLANKS, DELIMITERS, UNNAMED, Header
from idm_sumo.recordings.readers.layouts import LABELS, NUMBERS, OFFICIAL
from idm_sumo.runtime.errors import InputError, shown
from idm_sumo.runtime.inputs import BROKEN, open_plain

CHUNK = 1_000_000  # rows


def numbers_of(path: Path, names: Sequence[str], ledger: Ledger) -> pd.DataFrame:
    """Read a table of numbers without header, apart by blanks or by a delimiter.

    pandas' own parser splits runs of blanks natively. Arrow's needs single delimiters:
    collapsing them first made it slower (2.0 s against 1.3 s for 1.2 million rows).

    Parameters
    ----------
    path : Path
    names : sequence of str
        Names of the columns in their order.
    ledger : Ledger
        Rows read are added to its total.

    Raises
    ------
    InputError
        If a row has another number of columns or a text that is not a number; names file, row, column.
    """
    with open_plain(path) as stream, io.TextIOWrapper(stream, "utf-8-sig", errors="replace") as text:
        first = next((line for line in text if line.strip()), "")  # lines end in LF, CR or both
    mark = next((mark for mark in DELIMITERS if mark in first), None)
    head = Header(tuple(names), tuple(names), mark or BLANKS, ".", has_names=False)
    try:
        if len(head.cells(first)) == len(names):
            with open_plain(path) as stream:
                table = pd.read_csv(stream, sep=mark or r"\s+", header=None, dtype="float64", encoding="utf-8-sig")
        else:
            table = pd.DataFrame()
    except (ValueError, OverflowError, *BROKEN) as error:
        raise _located(path, head, error, names) from None
    if len(table.columns) != len(names) or table.iloc[:, -1].isna().any():  # pandas fills a short row up
        _locate(path, head, names)
    if len(table.columns) != len(names):
        raise InputError(f"{path}: has {len(head.cells(first))} columns in its first row where {len(names)} are needed")
    table.columns = pd.Index(names)
    ledger.total += len(table)
    return table


def read_official(path: Path, ledger: Ledger) -> pd.DataFrame:
    """Read text without header, 18 columns in NGSIM's official order, apart by blanks or a delimiter.

    Raises
    ------
    InputError
        As :func:`numbers_of`.
    """
    return numbers_of(path, OFFICIAL, ledger)[[name for name in OFFICIAL if name in NUMBERS]]


def read_columns(path: Path, header: Header, floats: Collection[str], texts: Collection[str]) -> Iterator[pd.DataFrame]:
    """Yield chunks of the wanted columns of a file with a header, by their official names.

    Parameters
    ----------
    path : Path
    header : Header
    floats, texts : collection of str
        Columns that hold numbers, and those that are kept as the text they are.

    Raises
    ------
    InputError
        If a row has another number of columns than the header or a text where a number belongs; names it.
    """
    wanted = [name for name in header.names if name in floats or name in texts]
    # All columns are read, though not all are kept: with `usecols` pandas overlooks a cell too many.
    types: dict[str, str] = dict.fromkeys(header.names, "str")
    types |= {name: "float64" for name in header.names if name in floats or name in OFFICIAL}
    checked = False
    try:
        with open_plain(path) as stream, pd.read_csv(
            stream, sep=header.separator, skiprows=header.above,
            decimal=header.decimal, thousands="," if header.decimal == "." else None,
            names=list(header.names), header=0, dtype=types, chunksize=CHUNK, encoding="utf-8-sig",
            skipinitialspace=True, low_memory=False,
        ) as chunks:  # fmt: skip
            for chunk in chunks:
                # A short row leaves the last cell empty; pandas makes an index of a cell too many.
                suspect = chunk[header.names[-1]].isna().any() or not isinstance(chunk.index, pd.RangeIndex)
                if suspect and not checked:
                    _locate(path, header, floats)
                    checked = True
                if UNNAMED in chunk and (filled := chunk[UNNAMED].notna()).any():
                    cell = chunk.loc[filled, UNNAMED].iloc[0]
                    raise InputError(f"{path}: the last column has no name and holds {shown(cell)}; name it")
                yield chunk[wanted]
    except (ValueError, OverflowError, *BROKEN) as error:
        if isinstance(error, InputError):
            raise
        raise _located(path, header, error, floats) from None


def read_table(path: Path, header: Header, floats: Collection[str], texts: Collection[str]) -> pd.DataFrame:
    """Return the wanted columns of a whole file; see :func:`read_columns`."""
    parts = list(read_columns(path, header, floats, texts))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(header.names))


def read_portal(path: Path, ledger: Ledger, header: Header, *, location: str) -> pd.DataFrame:
    """Read NGSIM's columns of a file with a header, in any case, keeping one location.

    Raises
    ------
    InputError
        If a row is malformed, or no row is of that location (names those present).
    """
    parts: list[pd.DataFrame] = []
    places: set[str] = set()
    for part in read_columns(path, header, NUMBERS, LABELS):
        ledger.total += len(part)
        if "Location" in part:
            part, seen = keep_location(part, location, ledger)
            places |= seen
        parts.append(part)
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(header.names))
    check_location(path, table, places, location)
    ledger.notes.extend(header.notes)
    return table


def check_location(path: Path, table: pd.DataFrame, places: set[str], location: str) -> None:
    """Raise if no row was of the location wanted.

    Raises
    ------
    InputError
        Names the locations that are there.
    """
    if table.empty and places:
        some = ", ".join(sorted(places)[:8]) + (", ..." if len(places) > 8 else "")
        raise InputError(f"{path}: no row is of location {location!r}; the file has {some}")


def as_numbers(table: pd.DataFrame, path: Path) -> pd.DataFrame:
    """Return a table whose number columns are floats, though they may come as text or decimals.

    Raises
    ------
    InputError
        If a text is not a number; names row and column.
    """
    return table.assign(**{name: numbers(table[name], name, path) for name in table.columns if name in NUMBERS})


def keep_location(part: pd.DataFrame, location: str, ledger: Ledger) -> tuple[pd.DataFrame, set[str]]:
    """Return the rows of one location, the others booked, and the names of all locations seen."""
    place = part["Location"].where(part["Location"].notna(), "(none)").astype(str).str.strip()
    other = (place.str.lower() != location.lower()).to_numpy()
    return ledger.drop(part, other, "other location").drop(columns="Location"), set(place.unique())


def _rows(path: Path, header: Header) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and cells of every row that is not blank, below the header if there is one."""
    skipped = header.above + header.has_names
    with open_plain(path) as stream, io.TextIOWrapper(stream, "utf-8-sig", errors="replace", newline="") as text:
        for _ in range(skipped):
            text.readline()
        if header.delimiter == BLANKS:
            yield from ((n, line.split()) for n, line in enumerate(text, skipped + 1) if line.strip())
            return
        rows = enumerate(csv.reader(text, delimiter=header.delimiter, skipinitialspace=True), skipped + 1)
        mark, point = (",", "") if header.decimal == "." else (",", ".")
        yield from ((n, [cell.replace(mark, point) for cell in cells]) for n, cells in rows if cells)


def is_official(line: str) -> bool:
    """Whether a line is made of numbers: most of it, so that a bad one can be named."""
    mark = next((mark for mark in DELIMITERS if mark in line), None)
    cells = [cell.strip() for cell in line.split(mark)]
    return bool(cells) and 2 * sum(is_number(cell) for cell in cells) > len(cells)


def is_number(cell: str) -> bool:
    """Whether a text is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _locate(path: Path, header: Header, floats: Collection[str] = ()) -> None:
    """Go through a file row by row and raise for the first bad one; slow, and only for the message.

    Raises
    ------
    InputError
        For the first row that has too many or too few columns or a text where a number belongs.
    """
    names = header.names
    try:
        for number, cells in _rows(path, header):
            if len(cells) != len(names):
                raise InputError(
                    f"{path}: row {number} has {len(cells)} columns where {len(names)} are needed; "
                    "mend or remove the row (a file cut short in transfer ends like this)"
                )
            for name, cell in zip(names, cells, strict=True):
                bare = cell.strip()
                if (name in floats or name in OFFICIAL) and bare and not is_number(bare):
                    raise InputError(f"{path}: row {number}, column {name}: {shown(bare)} is not a number")
    except csv.Error as error:
        raise InputError(f"{path}: cannot be divided into cells ({error}); is a quotation mark left open?") from None


def _located(path: Path, header: Header, error: Exception, floats: Collection[str] = ()) -> InputError:
    """Return the error that names the row, or the parser's own words if every row looks fine."""
    try:
        _locate(path, header, floats)
    except InputError as located:
        return located
    except BROKEN as broken:
        return InputError(f"{path}: the archive is broken ({broken}); fetch it again")
    return InputError(f"{path}: cannot be read: {(str(error).splitlines() or [type(error).__name__])[0]}")
