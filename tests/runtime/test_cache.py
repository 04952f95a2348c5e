"""The folder of reusable results."""

from __future__ import annotations

from pathlib import Path

import pytest

from idm_sumo.runtime.cache import VARIABLE, cache_folder, kept
from idm_sumo.runtime.errors import InputError


def test_a_file_is_no_folder_for_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "drivers.parquet"
    file.write_text("mine")
    for named in (file, file / "below"):
        monkeypatch.setenv(VARIABLE, str(named))
        with pytest.raises(InputError, match=f"{VARIABLE}: .*drivers.parquet is not a folder"):
            cache_folder()
    assert file.read_text() == "mine"


def test_what_is_kept_is_written_once_and_again_when_it_is_made_of_something_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "new" / "cache"))
    written: list[Path] = []

    def write(path: Path) -> None:
        written.append(path)
        path.write_text("whole")

    first = kept("net", ".txt", {"lanes": 3}, write)
    assert kept("net", ".txt", {"lanes": 3}, write) == first
    assert kept("net", ".txt", {"lanes": 4}, write) != first
    assert len(written) == 2
    assert first.read_text() == "whole"
