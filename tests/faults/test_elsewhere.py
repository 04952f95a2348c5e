"""The same bytes elsewhere; `python -m tests.faults.elsewhere` compares every command in every way."""

from __future__ import annotations

from pathlib import Path

from tests.faults.commands import prepare_short
from tests.faults.elsewhere import ALL_AT_ONCE, differences


def test_calibration_does_not_depend_on_where_it_runs(tmp_path: Path) -> None:
    prepare_short(tmp_path / "work")
    assert differences(tmp_path / "work", "calibrate", [ALL_AT_ONCE]) == {ALL_AT_ONCE: []}
