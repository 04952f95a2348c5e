"""A few kills of two commands; `python -m tests.faults.kill_campaign` kills all of them twenty times."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.kill_campaign import campaign


@pytest.mark.parametrize("command", ["export", "replay"])
def test_a_killed_command_leaves_the_same_bytes_when_it_is_run_again(tmp_path: Path, command: str) -> None:
    done = campaign([command], 3, 5, tmp_path / "work")
    assert len(done) == 3
    assert [one for one in done if one.faults] == []
