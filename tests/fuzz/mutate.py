"""Change a sound input: cells, columns, headers, values, bytes."""

from __future__ import annotations

import bz2
import decimal
import gzip
import io
import json
import random
import re
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

CELLS = (
    "", " ", "x", "nan", "inf", "-inf", "1e300", "-1e300", "1e19", "-1", "0", "2.5", "258", "99999999999999999999",
    "0x10", "1_0",
    "1,5", "True", "None", "\u00b2", '"', "'", "\x00", "\r", "a" * 200_000, "9" * 5000, ";", ",", "\t",
    "-0.0", "1e-320", "=1+1", "${HOME}",
)  # fmt: skip
COLUMNS: tuple[Any, ...] = (
    [1.0], {"a": 1}, b"\xff\xfe", "text", None, float("nan"), float("inf"), 1e300, -1e300, 2**63 - 1, -(2**63), 2**62,
    2.5, -1,
    True, decimal.Decimal("1.5"), pd.Timestamp("2020-01-01"), pd.Timedelta("1s"), "1e400", "9" * 400, "", 258, 1e12,
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, [], {}, [[]], "", "x", -1, 0, 10**30, 1e300, float("nan"), float("inf"), 2.5, 99,
    [99], [2.5], "8", ["a"],
)  # fmt: skip
XML_VALUES = ("0.00,0.00", "1,2 3", "0", "-1", "1e9", ":b_0_0", "in", "out")
ELEMENTS = ("net", "edge", "lane", "junction", "connection", "routes", "vType", "fcd-export", "additional", "a:b")


def of_bytes(data: bytes, draw: random.Random) -> bytes:
    """Return bytes with a few changed, cut, doubled or put in."""
    out = bytearray(data)
    for _ in range(draw.choice((1, 1, 2, 8))):
        place, length = draw.randrange(len(out) + 1), draw.choice((1, 2, 7, 100, len(out) // 2))
        match draw.randrange(6):
            case 0 if out:
                out[place % len(out)] ^= 1 << draw.randrange(8)
            case 1:
                del out[place : place + length]
            case 2:
                out[place:place] = out[place : place + length]
            case 3:
                del out[place:]
            case 4:
                out[place:place] = draw.choice(CELLS).encode("utf-8", "replace")
            case _:
                out[:0] = draw.choice(
                    (b"\xef\xbb\xbf", b"\xff\xfe", b"\r", b"\n\n", b"PK\x03\x04", b"\x1f\x8b", b"<", b"{")
                )
    return bytes(out)


def of_text_table(table: pd.DataFrame, draw: random.Random, separator: str, header: bool = True) -> bytes:
    """Return a table as text with a bad cell, column, row or header, or with bad bytes."""
    rows = [[str(cell) for cell in row] for row in table.astype(object).itertuples(index=False)]
    names = [str(name) for name in table.columns]
    for _ in range(draw.choice((1, 1, 2))):
        row, column, bad = draw.randrange(len(rows)), draw.randrange(len(names)), draw.choice(CELLS)
        match draw.randrange(7):
            case 0:
                rows[row][column % len(rows[row])] = bad
            case 1:
                for each in rows:
                    each[column % len(each)] = bad
            case 2:
                names[column] = draw.choice((names[column - 1], "", bad, names[column].upper()))
            case 3:
                del rows[row][column % len(rows[row]) :]
                rows[row] = rows[row] or [""]
            case 4:
                rows[row] = rows[row] + [bad] * draw.choice((1, 30))
            case 5:
                del rows[draw.randrange(len(rows)) + 1 :]
            case _:
                separator = draw.choice((",", ";", "\t", "|", " ", ",,"))
    lines = [separator.join(row) for row in ([names, *rows] if header else rows)]
    data = draw.choice(("\n", "\n", "\r\n", "\r")).join(lines).encode("utf-8", "replace")
    data = of_bytes(data, draw) if draw.random() < 0.3 else data
    return gzip.compress(data, 1) if draw.random() < 0.1 else data


def of_parquet(table: pd.DataFrame, draw: random.Random) -> bytes:
    """Return a table as Parquet with a column of another type, name or metadata, or with bad bytes."""
    columns = {str(name): pa.array(table[name]) for name in table.columns}
    for _ in range(draw.choice((1, 1, 2))):
        name, bad = draw.choice(list(columns)), draw.choice(COLUMNS)
        match draw.randrange(4):
            case 0:
                columns[name] = _array([bad] * len(table))
            case 1:
                cells = columns[name].to_pylist()
                cells[draw.randrange(len(cells))] = bad
                columns[name] = _array(cells)
            case 2:
                del columns[name]
                columns.setdefault("other", pa.array(range(len(table))))
            case _:
                columns[draw.choice((name.upper(), "", "x", "time", "id", "Location", "period"))] = columns[name]
    arrow = pa.table(list(columns.values()), names=list(columns))
    if draw.random() < 0.2:
        arrow = arrow.append_column(draw.choice(arrow.column_names), arrow.column(0))
    if draw.random() < 0.3:
        kept = draw.choice(
            (b"[", b"null", b"[" * 9999, b"1", b'{"notes": 1}', b'{"leader_lengths": [["a", "b", 1]]}', b'{"road": 1}')
        )
        arrow = arrow.replace_schema_metadata({b"idm_sumo": kept, b"pandas": draw.choice((b"{", b"{}", kept))})
    out = io.BytesIO()
    pq.write_table(arrow, out, write_page_checksum=draw.random() < 0.5)
    return of_bytes(out.getvalue(), draw) if draw.random() < 0.3 else out.getvalue()


def _array(cells: list[Any]) -> pa.Array:
    try:
        return pa.array(cells)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):  # of mixed types: as text
        return pa.array([None if cell is None else str(cell) for cell in cells])


def of_json(values: Any, draw: random.Random) -> bytes:
    """Return values as JSON with one of them replaced, or with bad bytes."""
    values = json.loads(json.dumps(values))
    node = values
    while isinstance(node, dict | list) and node:
        key: Any = draw.choice(list(node) if isinstance(node, dict) else range(len(node)))
        if not isinstance(node[key], dict | list) or draw.random() < 0.3:
            node[key] = draw.choice(VALUES)
            break
        node = node[key]
    data = json.dumps(values).encode()
    if draw.random() < 0.1:
        data = draw.choice((b"[", b'{"a":')) * 20_000
    return of_bytes(data, draw) if draw.random() < 0.3 else data


def of_xml(text: str, draw: random.Random) -> bytes:
    """Return XML with attributes replaced, elements gone, doubled or renamed, or with bad bytes; packed or not."""
    lines = text.splitlines()
    for _ in range(draw.choice((1, 1, 2, 5))):
        whole = [number for number, line in enumerate(lines) if line.endswith("/>")]
        row = draw.choice(whole or [0]) if draw.random() < 0.9 else draw.randrange(len(lines))
        attributes = list(re.finditer(r'([\w:]+)="([^"]*)"', lines[row]))
        bad = re.sub(
            r'[<&"\x00]', "", draw.choice((*CELLS, "0.00,0.00", "1,2 3", "0", "-1", "1e9", ":b_0_0", "in", "out"))
        )
        match draw.randrange(7):
            case 0 | 1 | 2 if attributes:
                one = draw.choice(attributes)
                lines[row] = f'{lines[row][: one.start()]}{one[1]}="{bad}"{lines[row][one.end() :]}'
            case 3 if attributes:
                one = draw.choice(attributes)
                lines[row] = lines[row][: one.start()] + lines[row][one.end() :]
            case 4:
                lines[row] = ""
            case 5:
                lines.insert(draw.randrange(len(lines)), lines[row])
            case _:
                lines[row] = re.sub(r"^(\s*</?)\w+", rf"\1{draw.choice(ELEMENTS)}", lines[row])
    data = draw.choice(("\n", "")).join(lines).encode("utf-8", "replace")
    if draw.random() < 0.1:
        data = data.replace(b">", b">" + draw.choice((b"<a>", b'<a b="', b"<!-- ")) * draw.choice((1, 300_000)), 1)
    data = of_bytes(data, draw) if draw.random() < 0.2 else data
    return draw.choice((gzip.compress, bz2.compress))(data, 1) if draw.random() < 0.1 else data


def of_corridor(names: list[str], draw: random.Random) -> bytes:
    """Return names of edges, one a line, with wrong ones, none, or in another order."""
    more = [*names * 8, "ramp", "in", "-in", ":b_0", ":b_0_0", "nowhere", "", "in out", *CELLS]
    return json.dumps([draw.choice(more) for _ in range(draw.choice((1, 1, 2, 2, 3, 40)))]).encode()


def of_toml(text: str, draw: random.Random) -> bytes:
    """Return a run file with a value replaced, or with bad bytes."""
    lines = text.splitlines()
    row = draw.randrange(len(lines))
    bad = draw.choice(
        (
            *CELLS,
            "[]",
            '[""]',
            "true",
            "[true]",
            "1e12",
            "10" * 30,
            "[" * 5000 + "]" * 5000,
            '"' + "b" * 5000 + '"',
            "{a=1}",
        )
    )
    lines[row] = f"{lines[row].split('=')[0]}= {bad}"
    data = "\n".join(lines).encode("utf-8", "replace")
    return of_bytes(data, draw) if draw.random() < 0.2 else data


def of_arrays(arrays: dict[str, np.ndarray], draw: random.Random) -> bytes:
    """Return arrays as ``.npz`` with one replaced, or with bad bytes."""
    changed = dict(arrays)
    name = draw.choice(list(changed))
    changed[name] = draw.choice((
        np.array(1.0), np.zeros((3, 3)), np.array("x"), np.array("[" * 5000), np.full((16, 2), np.inf), np.zeros(0),
        np.array([1 + 2j]), np.zeros((16, 2), dtype="M8[s]"), np.array(True), np.array('{"seed": 10}'),
    ))  # fmt: skip
    if draw.random() < 0.3:
        changed.pop(draw.choice(list(changed)))
    out = io.BytesIO()
    np.savez(out, **changed)
    return of_bytes(out.getvalue(), draw) if draw.random() < 0.4 else out.getvalue()
