"""What a page may look like, without a server."""

from __future__ import annotations

import csv
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from idm_sumo.recordings.portal import LAYOUT, BadPageError, Portal, parse_page, schema
from tests.helpers.portal_server import COLUMNS, motorway_rows

ROWS = list(motorway_rows())[:6]


def page(path: Path, rows: list[dict[str, str]], columns: tuple[str, ...] = COLUMNS, quoting: int = 1) -> Path:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, quoting=quoting, lineterminator="\n")  # type: ignore[arg-type]
        writer.writerow(columns)
        writer.writerows([row[name.lower()] for name in columns] for row in rows)
    return path


def test_any_case_any_order_and_thousands_separators(tmp_path: Path) -> None:
    want = parse_page(page(tmp_path / "plain.csv", ROWS), "us-101", 6)
    assert want.schema == schema()
    spelled = tuple(name.title().replace("V_", "v_") for name in reversed(COLUMNS))
    parted = [row | {"global_time": f"{int(row['global_time']):,}", "global_x": "6,451,137.641"} for row in ROWS]
    got = parse_page(page(tmp_path / "spelled.csv", parted, spelled, csv.QUOTE_MINIMAL), "us-101", 6)
    plain = want.set_column(6, "Global_X", pa.array([6451137.641] * 6))
    assert got == plain


def test_columns_of_city_streets_may_be_absent_and_unknown_ones_are_left_out(tmp_path: Path) -> None:
    columns = (*(name for name in COLUMNS if name not in ("o_zone", "movement")), "extra")
    got = parse_page(page(tmp_path / "p.csv", [row | {"extra": "x"} for row in ROWS], columns), "us-101", 6)
    assert got.column_names == list(LAYOUT)
    assert got["O_Zone"].null_count == 6


def test_whole_number_columns_take_no_fractions(tmp_path: Path) -> None:
    with pytest.raises(BadPageError, match="column Vehicle_ID"):
        parse_page(page(tmp_path / "p.csv", [ROWS[0] | {"vehicle_id": "1.5"}]), "us-101", 1)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True))
def test_no_cut_goes_unnoticed(tmp_path: Path, share: float) -> None:
    whole = page(tmp_path / "whole.csv", ROWS).read_bytes()
    cut = tmp_path / "cut.csv"
    cut.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(BadPageError):
        parse_page(cut, "us-101", 6)


@given(rows=st.integers(1, 10**7), size=st.integers(1, 10**5))
def test_pages_hold_all_rows_once(rows: int, size: int) -> None:
    portal = Portal("http://127.0.0.1:9/", "us-101", size, 0, 0, 1)
    pages = portal.pages(rows)
    assert (pages - 1) * size + portal.rows_of(pages - 1, rows) == rows
    assert 1 <= portal.rows_of(pages - 1, rows) <= size
