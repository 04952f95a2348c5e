"""The agency's data portal: how its rows are counted and asked for, page by page, and what a good page is.

The interface is Socrata's SODA: ``$where`` filters, ``$order=:id`` makes paging stable (without
it rows come in any order), ``$limit`` and ``$offset`` choose a page, ``$select=count(*)`` counts.
Older endpoints cap ``$limit`` at 50,000 rows, which is why a page has no more.
"""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar
from urllib.parse import quote, urlencode

import pooch
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import requests

from idm_sumo.recordings.readers.layouts import OFFICIAL
from idm_sumo.runtime.errors import InputError

DEFAULT_URL = "https://data.transportation.gov/resource/8ect-6jqj.csv"
PAGE_ROWS = 50_000
LOCATIONS = ("us-101", "i-80", "lankershim", "peachtree")

WHOLE = ("Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "v_Class", "Lane_ID", "Preceding", "Following")
# The portal's order: 14 columns as in the official text, six that only city streets have, then the rest.
CITY = ("O_Zone", "D_Zone", "Int_ID", "Section_ID", "Direction", "Movement")
LAYOUT = (*OFFICIAL[:14], *CITY, *OFFICIAL[14:], "Location")
NUMBERS = frozenset(OFFICIAL)

PASSING = frozenset({408, 425, 429})  # HTTP errors below 500 that may pass by themselves
LONGEST_PAUSE = 120.0  # s
CHUNK_BYTES = 1 << 16
T = TypeVar("T")


class BadPageError(ValueError):
    """What came is not the page asked for; asking again may help."""


class ChangedError(InputError):
    """The portal has other rows than before; asking again does not help."""


class Stand(NamedTuple):
    """What the portal says of its own rows."""

    rows: int  # of the location
    modified: str  # when the data changed last, in the portal's words; empty if it does not say


@dataclass(frozen=True)
class Portal:
    """One location of the trajectory data set at the portal.

    Attributes
    ----------
    base_url : str
        The data set's address, ending in ``.csv``.
    location : str
        Such as ``us-101``.
    page_rows : int
        Rows a page.
    retries : int
        How often a request is tried again.
    backoff : float
        Pause before the first retry, s; doubled each time.
    timeout : float
        Longest silence of the portal, s.
    """

    base_url: str
    location: str
    page_rows: int
    retries: int
    backoff: float
    timeout: float

    def __post_init__(self) -> None:
        """Refuse what cannot be asked for."""
        if not re.fullmatch(r"[a-z0-9][a-z0-9-]*", self.location):
            raise InputError(f"location {self.location!r} cannot be one; use {', '.join(LOCATIONS)}")
        if self.page_rows < 1:
            raise InputError(f"page_rows is {self.page_rows}; give at least 1")

    def stand(self) -> Stand:
        """Ask how many rows there are and when they changed last.

        Raises
        ------
        InputError
            If the portal does not answer, or has no row of the location.
        """
        stand = self._persist(self._ask_stand, "the row count")
        if stand.rows == 0:
            raise InputError(f"{self.base_url}: no row is of location {self.location!r}; use {', '.join(LOCATIONS)}")
        return stand

    def pages(self, rows: int) -> int:
        """Return how many pages ``rows`` rows make."""
        return -(-rows // self.page_rows)

    def rows_of(self, number: int, rows: int) -> int:
        """Return how many of ``rows`` rows page ``number`` (from 0) has."""
        return min(self.page_rows, rows - number * self.page_rows)

    def load(self, number: int, rows: int, folder: Path, *, sha256: str | None = None) -> Path:
        """Return the file of page ``number`` of ``rows`` rows in all, downloaded if it is not there yet.

        pooch writes beside, moves into place and leaves a file alone whose ``sha256`` is
        right. It cannot continue half a file: the page is the unit of resuming.

        Raises
        ------
        ChangedError
            If the portal's page is well formed but has another content than ``sha256`` says.
        InputError
            If no good page came however often it was asked for.
        """
        pooch.get_logger().setLevel("WARNING")
        name = f"page-{number:05d}.csv"
        query = {"$order": ":id", "$limit": self.page_rows, "$offset": number * self.page_rows}

        def downloader(url: str, output_file: str, _: object) -> None:
            pooch.HTTPDownloader(chunk_size=CHUNK_BYTES, timeout=self.timeout)(url, output_file, None)
            parse_page(Path(output_file), self.location, self.rows_of(number, rows))
            if sha256 is not None and pooch.file_hash(output_file) != sha256:
                first = number * self.page_rows
                last = first + self.rows_of(number, rows)
                raise ChangedError(f"{self.base_url}: rows {first + 1} to {last} of {self.location} have changed")

        def load() -> str:
            path = pooch.retrieve(self._url(query), sha256, fname=name, path=folder, downloader=downloader)
            return str(path)

        return Path(self._persist(load, f"page {number + 1} of {self.pages(rows)}"))

    def _url(self, query: dict[str, object]) -> str:
        where = {"$where": f"location='{self.location}'"}
        return f"{self.base_url}?{urlencode({**query, **where}, quote_via=quote)}"

    def _ask_stand(self) -> Stand:
        response = requests.get(self._url({"$select": "count(*)"}), timeout=self.timeout)
        response.raise_for_status()
        lines = [row for row in csv.reader(io.StringIO(response.text)) if row]
        if len(lines) != 2 or len(lines[1]) != 1 or not lines[1][0].isdigit():
            raise BadPageError(_instead(response.text, "a row count"))
        known = response.headers
        return Stand(int(lines[1][0]), known.get("X-SODA2-Truth-Last-Modified") or known.get("Last-Modified", ""))

    def _persist(self, action: Callable[[], T], what: str) -> T:
        """Return what ``action`` returns, tried again after growing pauses while its failure may pass."""
        attempt = 0
        while True:
            try:
                return action()
            except (requests.RequestException, BadPageError) as error:
                if attempt >= self.retries or not _may_pass(error):
                    tries = "" if attempt == 0 else f" (tried {attempt + 1} times)"
                    raise InputError(f"{self.base_url}: {what}: {_reason(error, self.timeout)}{tries}") from error
                time.sleep(min(max(self.backoff * 2**attempt, _asked_pause(error)), LONGEST_PAUSE))
                attempt += 1


def parse_page(path: Path, location: str, rows: int) -> pa.Table:
    """Return a page as a table of :data:`LAYOUT`, in feet as the portal has it.

    Parameters
    ----------
    path : pathlib.Path
        Comma-separated text with a header, names in any case.
    location : str
        What every row must be of.
    rows : int
        How many rows there must be.

    Raises
    ------
    BadPageError
        If it is no such text, or is cut short.
    """
    with path.open("rb") as stream:
        start = stream.read(4096)
        stream.seek(max(path.stat().st_size - 1, 0))
        whole = stream.read(1) == b"\n"
    header = next(csv.reader(start.decode("utf-8-sig", "replace").splitlines()), [])
    names = {name: known for name in header for known in LAYOUT if known.lower() == name.strip().lower()}
    if missing := [name for name in (*OFFICIAL, "Location") if name not in names.values()]:
        lacks = f"; column {missing[0]} is missing" if names else ""
        raise BadPageError(_instead(start.decode("utf-8", "replace"), "rows") + lacks)
    convert = pa.csv.ConvertOptions(
        include_columns=list(names), column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=True
    )
    try:
        cells = pa.csv.read_csv(path, convert_options=convert)
    except pa.ArrowInvalid as error:
        raise BadPageError(f"the page is damaged or cut within a row ({str(error).splitlines()[0][:80]})") from None
    if cells.num_rows != rows or not whole:
        raise BadPageError(f"the page was cut short: {cells.num_rows} whole rows came, {rows} were due")
    cells = cells.rename_columns(list(names.values()))
    if not pc.all(pc.equal(cells["Location"].fill_null(""), location)).as_py():
        raise BadPageError("the page has rows of another location")
    return _typed(cells)


def schema() -> pa.Schema:
    """Return the columns of :data:`LAYOUT` with their types."""
    kinds = {name: pa.int64() if name in WHOLE else pa.float64() if name in NUMBERS else pa.string() for name in LAYOUT}
    return pa.schema(list(kinds.items()))


def _typed(cells: pa.Table) -> pa.Table:
    columns = []
    for field in schema():
        column = cells[field.name] if field.name in cells.column_names else pa.nulls(len(cells), pa.string())
        try:
            if field.name in NUMBERS:  # a portal may part thousands by commas
                column = pc.replace_substring(column, ",", "").cast(pa.float64())
            columns.append(column.cast(field.type))
        except pa.ArrowInvalid as error:
            reason = str(error).splitlines()[0][:80]
            raise BadPageError(f"the page is damaged: column {field.name}: {reason}") from None
    return pa.table(columns, schema=schema())


def _instead(text: str, wanted: str) -> str:
    """Say what came where ``wanted`` was due."""
    if text.lstrip().startswith("<"):
        return f"a web page came instead of {wanted}"
    line = next(iter(text.strip().splitlines()), "")
    return f"{line[:60]!r} came instead of {wanted}" if line else f"nothing came instead of {wanted}"


def _may_pass(error: Exception) -> bool:
    response = _response(error)
    if isinstance(error, ValueError) and isinstance(error, requests.RequestException):
        return False  # an address that is none
    return response is None or response.status_code >= 500 or response.status_code in PASSING


def _asked_pause(error: Exception) -> float:
    """Return the seconds that the portal asks to wait, 0 if it does not."""
    response = _response(error)
    with suppress(ValueError):  # it may also be a date, which is not worth the trouble
        return 0.0 if response is None else float(response.headers.get("Retry-After", "0"))
    return 0.0


def _response(error: Exception) -> requests.Response | None:
    return error.response if isinstance(error, requests.HTTPError) else None


def _reason(error: Exception, timeout: float) -> str:
    """Say in a few words, on one line, why a request failed."""
    response = _response(error)
    if response is not None:
        said = ""
        with suppress(requests.RequestException):
            said = " ".join(response.text.split())[:120]
        return f"HTTP {response.status_code}" + (f" {said}" if said and not said.startswith("<") else "")
    if isinstance(error, requests.Timeout) or "timed out" in str(error):
        return f"no answer within {timeout:g} s"
    if isinstance(error, requests.exceptions.ChunkedEncodingError):
        return "the transfer was cut off"
    if isinstance(error, requests.exceptions.SSLError):
        return f"no trusted connection ({' '.join(str(error).split())[-120:]})"
    if isinstance(error, requests.ConnectionError):
        return "the portal cannot be reached"
    return " ".join(str(error).split())[:200]
