"""The commands' tables are what they were, number by number."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from tests.reference import pinned_tables as p


def test_calibrate(platoon_drivers: Path) -> None:
    p.compare(p.calibrated(platoon_drivers))


def test_predict(tmp_path: Path, platoons: Path, platoon_drivers: Path) -> None:
    p.compare(p.predicted(tmp_path, platoons, platoon_drivers))


def test_replay_in_both_back_ends(tmp_path: Path, platoons: Path, platoon_drivers: Path) -> None:
    p.compare(p.replayed(tmp_path, platoons, platoon_drivers))


def test_interactive(tmp_path: Path, platoons: Path, platoon_drivers: Path) -> None:
    p.compare(p.driven_in_a_loop(tmp_path, platoons, platoon_drivers))


def test_reproduce(platoon_study: Path) -> None:
    p.compare(p.studied(platoon_study))


def test_diagnose(slow_place: Path) -> None:
    p.compare(p.diagnosed(slow_place / "diagnosis"))


def test_a_changed_number_a_lost_row_and_another_word_are_noticed(platoon_drivers: Path) -> None:
    (table,) = p.calibrated(platoon_drivers).values()
    p.compare({"calibrate": table.assign(new=1.0)})
    worse = [
        table.assign(T=table["T"] * (1 + 1e-4)), table.iloc[1:], table.assign(status="fine"), table.drop(columns="a")
    ]  # fmt: skip
    for changed in worse:
        with pytest.raises((AssertionError, KeyError)):
            p.compare({"calibrate": pd.DataFrame(changed)})
