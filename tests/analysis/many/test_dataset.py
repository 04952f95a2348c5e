"""What is said of a data set: written together, forgotten when it changes, known as ours."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from analysis.many.dataset import PAGE, RECORDINGS, SUMMARY, Kept, opened
from analysis.many.result import Result
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError

ROWS = pd.DataFrame({"recording": ["r-1"], "status": ["done"]})


def conclude(folder: Path, pages: dict[str, str]) -> None:
    """Keep one recording of one driver, and say what there is."""
    drivers = {"period": ["750"], "vehicle": [1], "a": [1.0], "b": [1.5], "T": [1.2], "d0": [2.0], "d1": [0.0]}
    with opened(folder) as data:
        data.keep(Kept("r-1", "key", "content", {"drivers": 1}), Result(pd.DataFrame(drivers), US101, {"drivers": 1}))
        assert not any((folder / name).exists() for name in (PAGE, RECORDINGS, SUMMARY))
        data.conclude(ROWS, {"drivers": 1}, {}, pages)


def test_a_page_comes_and_goes_with_what_it_tells_of(tmp_path: Path) -> None:
    conclude(tmp_path, {PAGE: "<p>é</p>\n"})
    assert (tmp_path / PAGE).read_bytes() == "<p>é</p>\n".encode()
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / RECORDINGS), ROWS)
    conclude(tmp_path, {})
    assert not (tmp_path / PAGE).exists()


def test_a_changed_page_is_somebodys(tmp_path: Path) -> None:
    conclude(tmp_path, {PAGE: "<p>ours</p>"})
    (tmp_path / PAGE).write_text("<p>mine</p>")
    with pytest.raises(InputError, match=PAGE):
        conclude(tmp_path, {})
    assert (tmp_path / PAGE).read_text() == "<p>mine</p>"
