"""Read a recording, whatever its layout, and keep one as Parquet."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.readers import delimited, fcd, ngsim, pairs
from idm_sumo.recordings.recording import SURROGATE_NOTICE, Recording
from idm_sumo.roads import DEFAULT, Road, road_at
from idm_sumo.runtime.errors import InputError

PARQUET = b"PAR1"
ZIP = b"PK\x03\x04"
METADATA = b"idm_sumo"  # where a Parquet of ours keeps what is not in the table
NOTICE = b"notice"  # metadata of a Parquet that says what kind of recording it is
SURROGATE_COLUMN = "Surrogate"  # the same for a CSV, which has no metadata: a column of that name


def read_recording(
    path: str | os.PathLike[str], *, location: str = DEFAULT.name, road: Road | None = None
) -> Recording:
    """Read trajectories in any layout the study knows, told by the content, not by the name.

    Official 18-column text, the data portal's CSV (both plain or gzip), Parquet with NGSIM's
    names (columns missing or not), SUMO FCD (XML, plain or gzip, or Parquet), leader-follower
    pairs (Parquet or CSV, :mod:`idm_sumo.recordings.readers.pairs`), a Parquet written by :func:`write_parquet`, or a folder of Parquet parts.

    Parameters
    ----------
    path : path-like
        File or folder.
    location : str, keyword-only
        Which location to keep of a file that mixes several; tells the road where it is built in.
    road : Road, keyword-only, optional
        What was recorded; by default the road kept in a Parquet of ours, else that of the location.

    Returns
    -------
    Recording
        With the account of its rows in ``accounting``.

    Raises
    ------
    InputError
        If the file is absent, empty, damaged, of no known layout, or in the wrong units.
    """
    path = Path(path)
    ledger = Ledger(0)
    if path.is_dir():
        return _from_parquet(path, ledger, location, road)
    start = _start_of(path)
    if start.startswith(PARQUET) or path.suffix == ".parquet":
        return _from_parquet(path, ledger, location, road)
    if start.lstrip().startswith(b"<"):
        return _accounted(*fcd.read_xml(path, ledger, road=road or road_at(location), source=path.name))
    return _from_text(path, start, ledger, location, road or road_at(location))


def _accounted(recording: Recording, accounting: Accounting) -> Recording:
    return replace(recording, accounting=accounting)


def _start_of(path: Path) -> bytes:
    """Return the first bytes of a file, unpacked and without byte order mark; raise for what is no file of text."""
    try:
        with delimited.open_plain(path) as stream:
            start = stream.read(65536)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except delimited.BROKEN as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if not start.strip():
        raise InputError(f"{path}: the file is empty")
    if start.startswith(ZIP):
        raise InputError(f"{path}: is a zip archive; unpack it first")
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{path}: is UTF-16 text; save it as UTF-8")
    return start.removeprefix(b"\xef\xbb\xbf")


def _from_text(path: Path, start: bytes, ledger: Ledger, location: str, road: Road) -> Recording:
    line = start.splitlines()[0].decode("utf-8", errors="replace")
    if b"\x00" in start:
        raise InputError(f"{path}: is not a text file; give NGSIM text, CSV, Parquet or SUMO FCD")
    if delimited.is_official(line):
        raw = delimited.read_official(path, ledger)
    elif pairs.is_pairs([name.strip() for name in line.split(",")]):
        return _accounted(*pairs.to_recording(_pairs_of_csv(path), ledger, road=road, source=path.name))
    else:
        _check_header(path, line)
        raw = delimited.read_portal(path, ledger, location=location)
    recording = _accounted(*ngsim.to_recording(raw, ledger, road=road, source=path.name))
    return _noted(recording, SURROGATE_NOTICE if SURROGATE_COLUMN in line.split(",") else "")


def _noted(recording: Recording, notice: str) -> Recording:
    """Return the recording with the file's own notice as first of its notes."""
    known = not notice or notice in recording.notes
    return recording if known else replace(recording, notes=(notice, *recording.notes))


def _pairs_of_csv(path: Path) -> pd.DataFrame:
    """Return pairs from a CSV, the period as the text it is."""
    try:
        raw = pd.read_csv(path, dtype={"period": str}, skipinitialspace=True)
    except (ValueError, *delimited.BROKEN) as error:
        raise InputError(f"{path}: cannot be read ({str(error).splitlines()[0]})") from None
    for name in raw.columns.drop("period", errors="ignore"):
        raw[name] = pd.to_numeric(raw[name], errors="coerce")
    return raw


def _check_header(path: Path, line: str) -> None:
    """Raise for a first line that is neither numbers apart by blanks nor names apart by commas."""
    for mark, name in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
        if line.count(mark) > line.count(","):
            raise InputError(f"{path}: row 1: columns are apart by {name}; give blanks (18 columns) or commas (header)")
    cells = line.split(",")
    if len(cells) > 2 and all(delimited.is_number(cell) for cell in cells):
        raise InputError(
            f"{path}: row 1: numbers apart by commas, without a header; the official text has blanks, the CSV a header"
        )
    ngsim.need([delimited.canonical(name) for name in delimited.header_of(path)], path.name)


def _from_parquet(path: Path, ledger: Ledger, location: str, road: Road | None) -> Recording:
    table = _load_parquet(path)
    notice = (table.schema.metadata or {}).get(NOTICE, b"").decode("utf-8", errors="replace")
    return _noted(_from_arrow(table, path, ledger, location, road), notice)


def _from_arrow(table: pa.Table, path: Path, ledger: Ledger, location: str, road: Road | None) -> Recording:
    names = list(table.column_names)
    if {*c.KEYS, c.X, c.Y} <= set(names):
        return _own(table, ledger, path, location, road)
    road = road or road_at(location)
    if fcd.is_fcd(names):
        return _accounted(*fcd.from_parquet(table.to_pandas(), ledger, road=road, source=path.name))
    if pairs.is_pairs(names):
        return _accounted(*pairs.to_recording(table.to_pandas(), ledger, road=road, source=path.name))
    raw = table.rename_columns([delimited.canonical(name) for name in names])
    ngsim.need(raw.column_names, path.name)
    known = [name for name in raw.column_names if name in (*delimited.NUMBERS, *delimited.LABELS)]
    ledger.total += raw.num_rows
    frame = delimited.as_numbers(raw.select(known).to_pandas(), path)
    if "Location" in frame:
        frame, seen = delimited.keep_location(frame, location, ledger)
        delimited.check_location(path, frame, seen, location)
    return _accounted(*ngsim.to_recording(frame, ledger, road=road, source=path.name))


def _load_parquet(path: Path) -> pa.Table:
    try:
        if path.is_dir():
            parts = [str(part) for part in sorted(path.rglob("*.parquet"))]
            if not parts:
                raise InputError(f"{path}: is a folder without Parquet files; give a file")
            return pa.dataset.dataset(
                parts, format="parquet", partitioning="hive", partition_base_dir=str(path)
            ).to_table()
        return pa.parquet.read_table(path)
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"{path}: is no whole Parquet file ({reason}); fetch or write it again") from None


def _own(table: pa.Table, ledger: Ledger, path: Path, location: str, road: Road | None) -> Recording:
    kept = json.loads((table.schema.metadata or {}).get(METADATA, b"{}"))
    frame = table.to_pandas()
    ledger.total += len(frame)
    if road is None:
        road = Road.from_dict(kept["road"]) if "road" in kept else road_at(location)
    recording = Recording.from_table(
        frame,
        road=road,
        source=kept.get("source") or path.name,
        notes=tuple(kept.get("notes", ())),
        has_leader_rows=bool(kept.get("has_leader_rows", True)),
    )
    lengths = {(str(period), int(leader)): float(length) for period, leader, length in kept.get("leader_lengths", ())}
    recording = replace(recording, is_smooth=bool(kept.get("is_smooth", False)), leader_lengths=lengths)
    return _accounted(recording, ledger.close(len(recording.table), vehicles=recording.vehicle_count))


def write_parquet(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Keep a recording as one Parquet file that :func:`read_recording` gives back as it was.

    Written beside, then moved into place, so that no half file is ever seen.

    Raises
    ------
    InputError
        If the file cannot be written there.
    """
    path = Path(path)
    kept = {
        "source": recording.source, "notes": recording.notes, "has_leader_rows": recording.has_leader_rows,
        "is_smooth": recording.is_smooth, "road": recording.road.to_dict(),
        "leader_lengths": [[*leader, length] for leader, length in recording.leader_lengths.items()],
    }  # fmt: skip
    table = pa.Table.from_pandas(recording.table, preserve_index=False)
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), METADATA: json.dumps(kept).encode()})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    os.close(handle)
    try:
        pa.parquet.write_table(table, beside, compression="zstd")
        if pa.parquet.read_metadata(beside).num_rows != len(recording.table):
            raise InputError(f"{path}: was not written whole; is the disk full?")
        os.replace(beside, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        Path(beside).unlink(missing_ok=True)
