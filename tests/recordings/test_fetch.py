"""The download against a real HTTP server on loopback that misbehaves on purpose."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

from idm_sumo.recordings.fetch import FetchResult, fetch
from idm_sumo.recordings.inspection import inspect_recording
from idm_sumo.recordings.portal import DEFAULT_URL, LAYOUT
from idm_sumo.recordings.reading import read_recording
from idm_sumo.runtime.errors import InputError
from tests.helpers.portal_server import COUNT, Portal, mixed_rows

PAGE = 70  # 320 rows of US-101: four pages of 70 and one of 40
OFFSETS = [0, 70, 140, 210, 280]


@pytest.fixture
def portal() -> Iterator[Portal]:
    with Portal() as running:
        yield running


def load(portal: Portal, dest: Path, **options: object) -> FetchResult:
    chosen = {"page_rows": PAGE, "retries": 2, "backoff": 0.001, "timeout": 5.0} | options
    return fetch(dest, base_url=portal.url, **chosen)  # type: ignore[arg-type]


def refused(portal: Portal, dest: Path, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        load(portal, dest, **options)
    line = str(caught.value)
    assert "\n" not in line
    return line


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def assert_whole(portal: Portal, result: FetchResult) -> None:
    """Compare the file, cell by cell and in order, with the rows the server was given."""
    table = pq.read_table(result.path)
    assert table.column_names == list(LAYOUT)
    want = pd.DataFrame(portal.of(result.location))
    assert result.rows == table.num_rows == len(want)
    for name in LAYOUT:
        got, told = table[name].to_pylist(), want[name.lower()].tolist()
        assert got == [type(cell)(text) if text else None for cell, text in zip(got, told, strict=True)], name
    assert hashlib.sha256(result.path.read_bytes()).hexdigest() == result.sha256
    assert names(result.path.parent) == [result.manifest.name, result.path.name]


def test_the_file_holds_the_location_and_nothing_else(portal: Portal, tmp_path: Path) -> None:
    seen: list[tuple[float, float]] = []
    result = load(portal, tmp_path / "new" / "folder", progress=lambda _, done, total: seen.append((done, total)))
    assert_whole(portal, result)
    assert portal.requests == [COUNT, *OFFSETS, COUNT]
    assert (result.pages, result.loaded) == (5, 5)
    assert seen == [(70, 320), (140, 320), (210, 320), (280, 320), (320, 320)]
    kept = json.loads(result.manifest.read_text())
    assert [page["rows"] for page in kept["pages"]] == [70, 70, 70, 70, 40]
    assert kept["modified"] == portal.modified == result.modified


def test_last_page_may_be_full(portal: Portal, tmp_path: Path) -> None:
    assert_whole(portal, load(portal, tmp_path, page_rows=160))
    assert portal.page_requests == [0, 160]


def test_compressed_transfer(portal: Portal, tmp_path: Path) -> None:
    portal.compress = True
    assert_whole(portal, load(portal, tmp_path))


def test_other_location(portal: Portal, tmp_path: Path) -> None:
    load(portal, tmp_path)
    result = load(portal, tmp_path, location="lankershim")
    table = pq.read_table(result.path)
    assert table["O_Zone"].unique().to_pylist() == ["101"]
    assert names(tmp_path) == [
        "lankershim.manifest.json",
        "lankershim.parquet",
        "us-101.manifest.json",
        "us-101.parquet",
    ]


def test_same_account_as_inspect(tmp_path: Path) -> None:
    rows = mixed_rows()
    rows.append(next(row for row in rows if row["location"] == "us-101"))  # the portal repeats rows, too
    with Portal(rows) as portal:
        result = load(portal, tmp_path)
    account = result.inspect()
    assert account.rows.total == result.rows == 321
    assert account.rows.dropped["exact duplicate row"] == 1
    assert account == inspect_recording(result.path)
    assert [(period.period, period.vehicles) for period in account.periods] == [("0750-0805", 4), ("0805-0820", 4)]
    assert len(read_recording(result.path).table) == 320


@pytest.mark.parametrize(
    "fault",
    [
        "500", "502", "429", "202", "html", "empty", "cut off", "cut off in chunk", "cut in last row", "row less",
        "length too small", "length too great", "garbled", "unfiltered", "no column",
    ],
)  # fmt: skip
def test_trouble_that_passes_costs_one_more_request(portal: Portal, tmp_path: Path, fault: str) -> None:
    portal.faults[160] = [fault]
    assert_whole(portal, load(portal, tmp_path, page_rows=160))
    assert portal.page_requests == [0, 160, 160]


def test_stalled_transfer_is_begun_again(portal: Portal, tmp_path: Path) -> None:
    portal.faults[70] = ["stall"]
    assert_whole(portal, load(portal, tmp_path, timeout=0.2))
    assert portal.page_requests == [0, 70, 70, 140, 210, 280]


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("500", "HTTP 500"),
        ("html", "a web page came instead of rows"),
        ("empty", "nothing came instead of rows"),
        ("cut off", "the transfer was cut off"),
        ("row less", "69 whole rows came, 70 were due"),
        ("length too small", "cut within a row"),
        ("length too great", "the transfer was cut off"),
        ("garbled", "the page is damaged"),
        ("unfiltered", "another location"),
        ("no column", "column Local_Y is missing"),
    ],
)
def test_trouble_that_stays_is_refused_and_whole_pages_stay(
    portal: Portal, tmp_path: Path, fault: str, told: str
) -> None:
    portal.faults[140] = [fault] * 3
    line = refused(portal, tmp_path)
    for part in (portal.url, "page 3 of 5", told, "tried 3 times", "2 of 5 pages are whole", "fetch again to go on"):
        assert part in line
    assert portal.page_requests == [0, 70, 140, 140, 140]
    assert names(tmp_path) == ["us-101.manifest.json", "us-101.pages"]
    assert names(tmp_path / "us-101.pages") == ["page-00000.csv", "page-00001.csv"]


@pytest.mark.parametrize("status", ["400", "403", "404"])
def test_refusal_by_the_portal_is_not_repeated(portal: Portal, tmp_path: Path, status: str) -> None:
    portal.faults[COUNT] = [status]
    assert f"HTTP {status}" in refused(portal, tmp_path)
    assert portal.requests == [COUNT]
    assert names(tmp_path) == []


@pytest.mark.parametrize("fault", ["html", "empty", "500"])
def test_count_is_asked_again(portal: Portal, tmp_path: Path, fault: str) -> None:
    portal.faults[COUNT] = [fault]
    assert_whole(portal, load(portal, tmp_path))
    portal.faults[COUNT] = [fault] * 3
    assert "the row count" in refused(portal, tmp_path)


def test_dead_portal_then_resumed(portal: Portal, tmp_path: Path) -> None:
    portal.faults[210] = ["die"]
    line = refused(portal, tmp_path)
    assert "the portal cannot be reached" in line
    assert "3 of 5 pages are whole" in line
    assert "the portal cannot be reached" in refused(portal, tmp_path)
    portal.requests.clear()
    portal.start()
    result = load(portal, tmp_path)
    assert_whole(portal, result)
    assert portal.requests == [COUNT, 210, 280, COUNT]
    assert result.loaded == 2


def test_killed_between_page_and_manifest(portal: Portal, tmp_path: Path) -> None:
    portal.faults[140] = ["404"]
    refused(portal, tmp_path)
    (tmp_path / "us-101.pages" / "page-00002.csv").write_text("came, but was never booked")
    (tmp_path / "us-101.pages" / "tmp1234").write_text("half")
    portal.requests.clear()
    assert_whole(portal, load(portal, tmp_path))
    assert portal.page_requests == [140, 210, 280]


def test_interrupted_by_the_user(portal: Portal, tmp_path: Path) -> None:
    def interrupt(_: str, done: float, total: float) -> None:
        if done > total / 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        load(portal, tmp_path, progress=interrupt)
    portal.requests.clear()
    assert_whole(portal, load(portal, tmp_path))
    assert portal.page_requests == [210, 280]


def test_finished_file_is_not_loaded_again(portal: Portal, tmp_path: Path) -> None:
    first = load(portal, tmp_path)
    portal.requests.clear()
    second = load(portal, tmp_path)
    assert portal.requests == [COUNT]
    assert (second.loaded, second.sha256) == (0, first.sha256)


def test_damaged_page_on_disk_is_loaded_again(portal: Portal, tmp_path: Path) -> None:
    portal.faults[140] = ["404"]
    refused(portal, tmp_path)
    page = tmp_path / "us-101.pages" / "page-00001.csv"
    page.write_bytes(page.read_bytes()[:-1000])
    portal.requests.clear()
    assert_whole(portal, load(portal, tmp_path))
    assert portal.page_requests == [70, 140, 210, 280]


def test_damaged_result_is_refused(portal: Portal, tmp_path: Path) -> None:
    result = load(portal, tmp_path)
    whole = result.path.read_bytes()
    for damaged in (whole[:-100], whole[:500] + bytes([whole[500] ^ 1]) + whole[501:]):
        result.path.write_bytes(damaged)
        line = refused(portal, tmp_path)
        assert str(result.path) in line
        assert "is not what was downloaded; remove it" in line
    result.path.unlink()
    assert_whole(portal, load(portal, tmp_path))


def change(portal: Portal, offset: int) -> None:
    portal.of("us-101")[offset]["local_y"] = "1234.500"


@pytest.mark.parametrize("begun", ["finished", "interrupted"])
def test_changed_page_is_refused(portal: Portal, tmp_path: Path, begun: str) -> None:
    if begun == "finished":
        load(portal, tmp_path)
    else:
        portal.faults[280] = ["404"]
        refused(portal, tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    portal.requests.clear()
    portal.modified = "Tue, 17 Sep 2019 00:00:00 GMT"
    change(portal, 150)
    line = refused(portal, tmp_path)
    assert "rows 141 to 210 of us-101 have changed since" in line
    assert f"remove {tmp_path / 'us-101'}.* to fetch it anew, or give another folder" in line
    assert portal.requests == [COUNT, 0, 70, 140]  # asked once: it is no fault of the transfer
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_new_date_with_the_same_rows_is_accepted(portal: Portal, tmp_path: Path) -> None:
    load(portal, tmp_path)
    portal.requests.clear()
    portal.modified = "Tue, 17 Sep 2019 00:00:00 GMT"
    result = load(portal, tmp_path)
    assert portal.requests == [COUNT, *OFFSETS]
    assert result.modified == portal.modified
    assert_whole(portal, result)
    portal.requests.clear()
    load(portal, tmp_path)
    assert portal.requests == [COUNT]


def test_verify_finds_a_change_that_the_portal_does_not_tell(portal: Portal, tmp_path: Path) -> None:
    portal.modified = None
    load(portal, tmp_path)
    assert load(portal, tmp_path, verify=True).loaded == 5
    change(portal, 300)
    assert "rows 281 to 320 of us-101 have changed" in refused(portal, tmp_path, verify=True)


def test_removed_result_must_come_back_the_same(portal: Portal, tmp_path: Path) -> None:
    result = load(portal, tmp_path)
    result.path.unlink()
    change(portal, 0)
    assert "rows 1 to 70 of us-101 have changed" in refused(portal, tmp_path)
    assert not result.path.exists()


def test_rows_added_since_are_refused(portal: Portal, tmp_path: Path) -> None:
    load(portal, tmp_path)
    portal.rows.append(portal.of("us-101")[0])
    line = refused(portal, tmp_path)
    assert "has 321 rows of us-101 now, 320 when the download began" in line
    assert "to fetch it anew" in line


def test_change_during_the_download_is_refused(portal: Portal, tmp_path: Path) -> None:
    def later(stage: str, done: float, _: float) -> None:
        if (stage, done) == ("loading", 140):
            portal.modified = "Tue, 17 Sep 2019 00:00:00 GMT"
            change(portal, 80)

    assert "rows 71 to 140 of us-101 have changed" in refused(portal, tmp_path, progress=later)
    assert "rows 71 to 140 of us-101 have changed" in refused(portal, tmp_path)
    assert not (tmp_path / "us-101.parquet").exists()


def test_rows_added_during_the_download_are_refused(portal: Portal, tmp_path: Path) -> None:
    def later(_: str, done: float, total: float) -> None:
        if done == total:
            portal.rows.append(portal.of("us-101")[0])

    assert "has 321 rows of us-101 now, 320 when" in refused(portal, tmp_path, progress=later)
    assert not (tmp_path / "us-101.parquet").exists()


def test_new_date_during_the_download_with_the_same_rows_is_accepted(portal: Portal, tmp_path: Path) -> None:
    def later(*_: object) -> None:
        portal.modified = "Tue, 17 Sep 2019 00:00:00 GMT"

    result = load(portal, tmp_path, progress=later)
    assert portal.requests == [COUNT, *OFFSETS, COUNT, *OFFSETS]
    assert result.modified == portal.modified
    assert_whole(portal, result)


def test_no_rows_of_that_location(portal: Portal, tmp_path: Path) -> None:
    line = refused(portal, tmp_path, location="us-1O1".lower())
    assert "no row is of location 'us-1o1'; use us-101, i-80" in line
    assert names(tmp_path) == []


@pytest.mark.parametrize("location", ["", "../us-101", "us'101", "US-101"])
def test_location_that_cannot_be_one(tmp_path: Path, location: str) -> None:
    with pytest.raises(InputError, match="cannot be one; use us-101"):
        fetch(tmp_path, base_url="http://127.0.0.1:9/", location=location)


def test_other_page_size_or_address(portal: Portal, tmp_path: Path) -> None:
    load(portal, tmp_path)
    assert "page_rows was 70, not 71" in refused(portal, tmp_path, page_rows=71)
    assert "give at least 1" in refused(portal, tmp_path, page_rows=0)
    with pytest.raises(InputError, match="base_url was http://127"):
        fetch(tmp_path, page_rows=PAGE)


def test_what_is_on_disk_already(portal: Portal, tmp_path: Path) -> None:
    own = tmp_path / "us-101.parquet"
    own.write_bytes(b"mine")
    assert "was not fetched; move it away" in refused(portal, tmp_path)
    assert own.read_bytes() == b"mine"
    own.unlink()
    (tmp_path / "us-101.manifest.json").write_text("{")
    assert "is damaged; remove" in refused(portal, tmp_path)
    assert portal.requests == []


def test_folder_that_cannot_be_made(portal: Portal, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert "file: cannot be read or written" in refused(portal, tmp_path / "file")


def test_address_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the row count"):
        fetch(tmp_path, base_url="data.example", retries=50, backoff=60)


def test_pauses_grow_and_heed_the_portal(portal: Portal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []
    monkeypatch.setattr("idm_sumo.recordings.portal.time.sleep", pauses.append)
    portal.faults[0] = ["500", "500", "500", "429"]
    call = partial(load, portal, tmp_path, retries=4, backoff=0.001)
    assert_whole(portal, call())
    assert pauses == [0.001, 0.002, 0.004, 0.05]


def test_default_address_is_the_agency() -> None:
    assert DEFAULT_URL == "https://data.transportation.gov/resource/8ect-6jqj.csv"


FETCH = """
import sys
from pathlib import Path
from idm_sumo.cli.guard import defended
from idm_sumo.recordings.fetch import fetch

with defended(verbose=False):
    fetch(Path(sys.argv[1]), base_url=sys.argv[2], page_rows=70, retries=3, backoff=0.001, timeout=120.0)
"""


def test_two_programs_that_fetch_into_one_folder_do_not_meet(portal: Portal, tmp_path: Path) -> None:
    portal.faults[OFFSETS[1]].append("stall")
    command = [sys.executable, "-c", FETCH, str(tmp_path / "data"), portal.url]
    first = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while OFFSETS[1] not in portal.requests and first.poll() is None:
        time.sleep(0.01)
    second = subprocess.run(command, capture_output=True, text=True, check=False)
    asked = len(portal.requests)
    portal.released.set()
    _, said = first.communicate()
    assert (second.returncode, len(second.stderr.splitlines())) == (2, 1)
    assert "another fetch is at work there" in second.stderr
    assert portal.requests[:asked] == [COUNT, *OFFSETS[:2]]
    assert (first.returncode, said) == (0, "")
    assert_whole(portal, load(portal, tmp_path / "data"))
