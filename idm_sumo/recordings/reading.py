"""Read a recording, whatever its layout, and keep one as Parquet."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import pyarrow as pa
import pyarrow.parquet

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.coercion import numbers, whole
from idm_sumo.recordings.on_road import check_on_road, road_of_lanes, why_foreign
from idm_sumo.recordings.readers import (
    datasets,
    delimited,
    fcd,
    fcd_on_network,
    header,
    layouts,
    ngsim,
    pair_names,
    pairs,
)
from idm_sumo.recordings.readers.fcd_on_network import VehicleTypes
from idm_sumo.recordings.readers.layout import Opened
from idm_sumo.recordings.recording import DTYPES, SURROGATE_NOTICE, Recording
from idm_sumo.roads import DEFAULT, Road, road_at
from idm_sumo.runtime import inputs, parquet
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.memory import Handed

PARQUET = b"PAR1"
ZIP = b"PK\x03\x04"
BOM = b"\xef\xbb\xbf"
METADATA = b"idm_sumo"  # where a Parquet of ours keeps what is not in the table
NOTICE = b"notice"  # metadata of a Parquet that says what kind of recording it is
SURROGATE_COLUMN = "Surrogate"  # the same for a CSV, which has no metadata: a column of that name
START = 65536  # bytes in which the first line ends
TEXTS = (c.PERIOD,)
PAIR_TEXTS = ("period", "case")
FLOATS = tuple(name for name in DTYPES if name not in TEXTS)


class _Source(NamedTuple):
    """What is read, the rows counted so far, and the road where the file does not tell its own."""

    path: Path
    ledger: Ledger
    location: str
    given: Road | None
    any_length: bool = False
    types: VehicleTypes = fcd.NO_TYPES

    @property
    def road(self) -> Road:
        return self.fitted(self.given or road_at(self.location))

    @property
    def how(self) -> dict[str, Any]:
        """What readers of one layout are told."""
        return {"road": self.road, "source": self.path.name}

    @property
    def any_road(self) -> bool:
        """Whether the road is only assumed, so that lanes may tell another."""
        return self.given is None and not self.any_length

    def opened(self, start: str, head: header.Header | None = None, *, names: tuple[str, ...] = ()) -> Opened:
        """Return the file as layouts of data sets are held against it."""
        spelt = head.spelt if head is not None else names
        return Opened(self.path, self.ledger, self.location, self.given, spelt, start, head)

    def fitted(self, road: Road) -> Road:
        """Return the road, without an end if the recording may be of a longer one."""
        return road.without_end() if self.any_length else road


def read_recording(
    path: str | os.PathLike[str],
    *,
    location: str = DEFAULT.name,
    road: Road | None = None,
    any_length: bool = False,
    route_files: Iterable[str | os.PathLike[str]] = (),
) -> Recording:
    """Read trajectories in any layout the study knows, told by the content, not by the name.

    Official 18-column text, the data portal's CSV (both plain or gzip; columns apart by commas,
    semicolons, tabs or bars), Parquet with NGSIM's names (columns missing or not), SUMO FCD (XML or
    CSV, plain or gzip, or Parquet), leader-follower pairs (Parquet or CSV,
    :mod:`idm_sumo.recordings.readers.pairs`), the columns of a :class:`Recording` (CSV, or the
    Parquet of :func:`write_parquet`), or a folder of Parquet parts.

    Parameters
    ----------
    path : path-like
        File or folder.
    location : str, keyword-only
        Which location to keep of a file that mixes several; tells the road where it is built in.
    road : Road, keyword-only, optional
        What was recorded; by default the road kept in a Parquet of ours, else that of the location.
    any_length : bool, keyword-only
        Whether the section may be longer than the road's, for work that needs positions, lanes and leaders
        but not where the section ends.
    route_files : iterable of path-like, keyword-only
        SUMO's files with the vehicle types of an FCD file, for their lengths, widths and classes.

    Returns
    -------
    Recording
        With the account of its rows in ``accounting``.

    Raises
    ------
    InputError
        If the file is absent, empty, damaged, of no known layout, in the wrong units, or of another road.
    """
    files = [Path(file) for file in route_files]
    source = _Source(Path(path), Ledger(0), location, road, any_length, fcd_on_network.read_types(files))
    recording = _read(source)
    if files and source.ledger.layout != fcd.FCD:
        raise InputError(
            f"{source.path}: is no SUMO floating car data, so that {files[0]} says nothing about its vehicles; leave "
            "out --route-files"
        )
    return recording


def _read(source: _Source) -> Recording:
    """Read a file of any layout, or a folder of Parquet parts."""
    if os.path.isdir(source.path):  # of a name too long, too
        return _from_parquet(source)
    start = _start_of(source.path)
    if start.startswith(PARQUET) or source.path.suffix == ".parquet":
        return _from_parquet(source)
    if start.lstrip().startswith(b"<"):
        return _accounted(*fcd.read_xml(source.path, source.ledger, **source.how, types=source.types))
    return _from_text(source, start)


def _accounted(recording: Recording, accounting: Accounting) -> Recording:
    return replace(recording, accounting=accounting)


def _start_of(path: Path) -> bytes:
    """Return the first bytes of a file, unpacked and without byte order mark; raise for what is no file of text."""
    inputs.existing_file(path, "name a recording")
    try:
        with inputs.open_plain(path) as stream:
            start = stream.read(START).removeprefix(BOM)
    except inputs.BROKEN as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if not start.strip():
        raise InputError(f"{path}: the file is empty")
    if start.startswith(ZIP):
        raise InputError(f"{path}: is a zip archive; unpack it first")
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{path}: is UTF-16 text; save it as UTF-8")
    return start


def _from_text(source: _Source, start: bytes) -> Recording:
    path = source.path
    if b"\x00" in start:
        raise InputError(f"{path}: is not a text file; give NGSIM text, CSV, Parquet or SUMO FCD")
    text = start.decode("utf-8", errors="replace").lstrip("\r\n")
    lines = text.splitlines() or [""]
    if (layout := datasets.layout_of(opened := source.opened(text))) is not None:
        return _accounted(*layout.recording(opened))
    if text.lstrip().startswith(("[", "{")):
        raise _unknown(list(dict.fromkeys(re.findall(r'"(\w+)"\s*:', text))), source)
    if len(lines) == 1 and len(start) >= START - len(BOM):
        raise InputError(f"{path}: the first line has more than {START} characters; rows are not apart by line ends")
    if delimited.is_official(lines[0]):
        raw = delimited.read_official(path, source.ledger)
        return _accounted(*ngsim.to_recording(raw, source.ledger, **source.how, any_road=source.any_road))
    head = header.header_of(text, path)
    if (layout := datasets.layout_of(opened := source.opened(text, head))) is not None:
        return _accounted(*layout.recording(opened))
    return _from_delimited(source, head)


def _from_delimited(source: _Source, head: header.Header) -> Recording:
    path, ledger, names = source.path, source.ledger, head.spelt
    how = source.how
    if layouts.is_own(names):
        return _own(delimited.read_table(path, head.plain, FLOATS, TEXTS), {}, source)
    if layouts.is_fcd(names):
        floats, texts = (
            [n for n in names if layouts.bare(n) in kind] for kind in (layouts.FCD_NUMBERS, layouts.FCD_TEXTS)
        )
        rows = Handed(delimited.read_table(path, head.plain, floats, texts))
        return _accounted(*fcd.from_table(rows, ledger, **how, types=source.types))
    if columns := pair_names.pair_columns(names):
        frame = source.opened("", head).columns(columns, PAIR_TEXTS)
        return _of_pairs(frame, columns, source)
    if not layouts.is_ngsim(head.names):
        raise _unknown(list(names), source)
    raw = delimited.read_portal(path, ledger, head, location=source.location)
    recording = _accounted(*ngsim.to_recording(raw, ledger, **how, any_road=source.any_road))
    return _noted(recording, SURROGATE_NOTICE if SURROGATE_COLUMN in head.spelt else "")


def _of_pairs(frame: pd.DataFrame, columns: Mapping[str, str], source: _Source) -> Recording:
    """Return the recording of pairs, and say which columns were taken for which."""
    source.ledger.total = 0  # counted by the reader of pairs
    taken = [f"{spelt} is read as {name}" for name, spelt in columns.items() if spelt != name]
    source.ledger.notes += ["column " + ", ".join(taken)] if taken else []
    return _accounted(*pairs.to_recording(frame, source.ledger, road=source.road, source=source.path.name))


def _unknown(names: list[str], source: _Source) -> InputError:
    """Return the error for a file of no known layout, held against those of data sets, too."""
    others = {
        one.name: layouts.Lacking(one.missing(names), len(one.columns)) for one in datasets.every() if one.columns
    }
    return layouts.unknown_layout(names, source.path.name, others=others)


def _noted(recording: Recording, notice: str) -> Recording:
    """Return the recording with the file's own notice as first of its notes."""
    known = not notice or notice in recording.notes
    return recording if known else replace(recording, notes=(notice, *recording.notes))


def _from_parquet(source: _Source) -> Recording:
    table = parquet.read_table(source.path, lambda names: _wanted(names, source))
    notice = (table.schema.metadata or {}).get(NOTICE, b"").decode("utf-8", errors="replace")
    held = Handed(table)
    del table
    return _noted(_from_arrow(held, source), notice)


def _from_arrow(held: Handed[pa.Table], source: _Source) -> Recording:
    table = held.take()
    names, path, ledger = list(table.column_names), source.path, source.ledger
    how = source.how
    if layouts.is_own(names):
        return _own(parquet.to_frame(table, categories=(c.PERIOD,)), _kept(table, path), source)
    if (layout := datasets.layout_of(opened := source.opened("", names=tuple(names)))) is not None:
        return _accounted(*layout.recording(opened))
    if layouts.is_fcd(names):
        rows = Handed(parquet.to_frame(table))
        del table
        return _accounted(*fcd.from_table(rows, ledger, **how, types=source.types))
    frame = parquet.to_frame(table)
    if columns := pair_names.pair_columns(names):
        return _of_pairs(pd.DataFrame({new: frame[old] for new, old in columns.items()}), columns, source)
    raw = frame.set_axis(header.check_names([header.canonical(name) for name in names], path), axis=1)
    ledger.total += len(raw)
    raw = delimited.as_numbers(raw, path)
    if "Location" in raw:
        raw, seen = delimited.keep_location(raw, source.location, ledger)
        delimited.check_location(path, raw, seen, source.location)
    return _accounted(*ngsim.to_recording(raw, ledger, **how, any_road=source.any_road))


def _wanted(names: list[str], source: _Source) -> list[str]:
    """Return which columns of a Parquet file to read, by its layout."""
    if layouts.is_own(names):
        return [name for name in names if name in c.ALL]
    if datasets.layout_of(source.opened("", names=tuple(names))) is not None:
        return names  # its reader takes what it needs
    if layouts.is_fcd(names):
        return [name for name in names if layouts.bare(name) in (*layouts.FCD_NUMBERS, *layouts.FCD_TEXTS)]
    if columns := pair_names.pair_columns(names):
        return list(columns.values())
    if not layouts.is_ngsim([header.canonical(name) for name in names]):
        raise _unknown(names, source)
    return [name for name in names if header.canonical(name) in (*layouts.NUMBERS, *layouts.LABELS)]


def _own(frame: pd.DataFrame, kept: dict[str, Any], source: _Source) -> Recording:
    source.ledger.total += len(frame)
    notes, road = list(kept.get("notes", ())), source.fitted(source.given or kept.get("road") or source.road)
    if source.any_road and "road" not in kept and kept.get("has_leader_rows", True):
        road, frame = _on_own_road(frame, road, source, notes)
    recording = Recording.from_table(
        frame,
        road=road,
        source=kept.get("source") or source.path.name,
        notes=tuple(notes),
        has_leader_rows=bool(kept.get("has_leader_rows", True)),
    )
    recording = replace(
        recording, is_smooth=bool(kept.get("is_smooth", False)), leader_lengths=kept.get("leader_lengths", {})
    )
    if recording.has_leader_rows:  # pairs lie on no road: their lateral positions are unknown
        check_on_road(recording.table[c.X], recording.table[c.Y], recording.road, source.path.name, network=True)
    return _accounted(recording, source.ledger.close(len(recording.table), vehicles=recording.vehicle_count))


def _on_own_road(frame: pd.DataFrame, road: Road, source: _Source, notes: list[str]) -> tuple[Road, pd.DataFrame]:
    """Return a road of the table's own lanes where they are not the assumed road's, and the table on it."""
    name, columns = source.path.name, (c.X, c.Y, c.SPEED)
    if not {*columns, c.LANE} <= set(frame) or frame.empty:
        return road, frame  # refused, with the column's name, where the table is checked
    told = frame.assign(**{column: numbers(frame[column], column, name) for column in columns})
    told[c.LANE] = whole(frame[c.LANE], c.LANE, name)
    why = why_foreign(told, road, network=True)
    return road_of_lanes(told, source.path.stem, why, name, notes) if why else (road, frame)


def _kept(table: pa.Table, path: Path) -> dict[str, Any]:
    """Return what :func:`write_parquet` kept beside the table.

    Raises
    ------
    InputError
        If it is not what that writes.
    """
    name = f"{path}: what we keep beside the table"
    kept = inputs.parse_json((table.schema.metadata or {}).get(METADATA, b"{}"), name, finite=False)
    try:
        told = {(str(p), int(leader)): float(length) for p, leader, length in kept.get("leader_lengths", ())}
        notes, label = kept.get("notes", []), kept.get("source", "")
        if not (isinstance(label, str) and isinstance(notes, list) and all(isinstance(note, str) for note in notes)):
            raise ValueError("source or notes are no text")
        if not all(0 < length < float("inf") for length in told.values()):
            raise ValueError("a leader's length is not positive")
        road = {"road": Road.from_dict(kept["road"])} if "road" in kept else {}
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} is damaged ({error}); write the file again") from None
    return {**kept, "leader_lengths": told, **road}


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
    with new_file(path) as part:
        parquet.write_table(table, part, compression="zstd")
        if pa.parquet.read_metadata(part).num_rows != len(recording.table):
            raise InputError(f"{path}: was not written whole; is the disk full?")
