"""Kills of one command; `python -m tests.faults.kill_campaign` kills all of them twenty times, from their start."""

from __future__ import annotations

import random
from pathlib import Path

from tests.faults.commands import prepare_short
from tests.faults.forked import Forked
from tests.faults.kill_campaign import kill, undisturbed


def test_a_killed_command_leaves_the_same_bytes_when_it_is_run_again(tmp_path: Path) -> None:
    folder, draw = tmp_path / "work", random.Random(5)
    prepare_short(folder)
    undisturbed(folder, "replay", Forked)  # the first waits for the modules
    expected, duration = undisturbed(folder, "replay", Forked)
    for _ in range(2):
        assert kill(folder, "replay", draw.uniform(0.0, duration), expected, Forked) == []
