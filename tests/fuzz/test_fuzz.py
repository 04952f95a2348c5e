"""Malformed inputs of every kind are read or refused in one line."""

from pathlib import Path

import numpy as np
import pytest

from tests.fuzz import seeds
from tests.fuzz.campaign import KINDS, Kind, campaign, judge
from tests.fuzz.mutate import CELLS

RUNS = 10  # of each kind: 20 s of computing in all; `python -m tests.fuzz` makes as many as one likes


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_malformed_input_is_read_or_refused_in_one_line(tmp_path: Path, kind: Kind) -> None:
    faults = [(number, fault) for _, _, fault, number in campaign(tmp_path, RUNS, kinds=(kind,)) if fault]
    assert not faults


def test_the_arrays_of_a_policy_are_sound_before_they_are_changed(tmp_path: Path) -> None:
    np.savez(tmp_path / "policy.npz", **seeds.policy())
    assert judge(KINDS[-1], tmp_path / "policy.npz") == ("sound", "")


def test_the_judge_sees_exceptions_warnings_and_messages_that_are_no_line(tmp_path: Path) -> None:
    path = tmp_path / "any"
    path.write_text(CELLS[2])

    def divide(_: Path) -> None:
        raise ZeroDivisionError

    assert judge(Kind("any", lambda _: b"", divide), path)[0] == "fault"
