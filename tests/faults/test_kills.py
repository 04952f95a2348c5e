"""Two kills of one command; `python -m tests.faults.kill_campaign` kills all of them twenty times."""

from __future__ import annotations

from pathlib import Path

from tests.faults.kill_campaign import campaign


def test_a_killed_command_leaves_the_same_bytes_when_it_is_run_again(tmp_path: Path) -> None:
    done = campaign(["replay"], 2, 5, tmp_path / "work")
    assert len(done) == 2
    assert [one for one in done if one.faults] == []
