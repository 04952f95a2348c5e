"""Worker processes: results in order, and an end when the program that they work for has gone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from idm_sumo.runtime.workers import beside, in_processes
from tests.faults.commands import processes_of

ROOT = Path(__file__).parents[2]
PATIENCE = 60.0  # s

PROGRAM = """
import os, time
from idm_sumo.runtime.workers import in_processes
def sleep(seconds):
    os.write(1, b"at work\\n")  # in one piece, as two write at once
    time.sleep(seconds)
if __name__ == "__main__":
    list(in_processes(2, [(100.0,), (100.0,)], sleep))
"""
LATE = """
import multiprocessing, os, time
from idm_sumo.runtime.workers import end_with
def first_task_after_the_kill(parent):
    os.write(1, b"at work\\n")
    while os.getppid() == parent:
        time.sleep(0.05)
    end_with(parent)
    time.sleep(100.0)
if __name__ == "__main__":
    for _ in range(2):
        multiprocessing.get_context("spawn").Process(target=first_task_after_the_kill, args=(os.getpid(),)).start()
    time.sleep(100.0)
"""


def test_results_come_in_the_order_of_the_calls() -> None:
    assert list(in_processes(2, [(number,) for number in range(7)], abs)) == list(range(7))


def test_beside() -> None:
    assert beside(os.getpid).result() != os.getpid()


@pytest.mark.skipif(sys.platform != "linux", reason="the table of processes is Linux's")
@pytest.mark.parametrize("source", [PROGRAM, LATE], ids=["at work", "before their first task"])
def test_workers_of_a_killed_program_end(source: str, tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(source)
    program = subprocess.Popen([sys.executable, str(script)], cwd=ROOT, stdout=subprocess.PIPE, start_new_session=True,
                               env={**os.environ, "PYTHONPATH": str(ROOT)})  # fmt: skip
    assert program.stdout is not None
    assert program.stdout.readline() == b"at work\n"
    assert program.stdout.readline() == b"at work\n"
    assert len(processes_of(program.pid)) >= 3
    os.kill(program.pid, signal.SIGKILL)  # nobody asks how it ended yet: its number stays taken
    end = time.monotonic() + PATIENCE
    while processes_of(program.pid) and time.monotonic() < end:
        time.sleep(0.1)
    assert processes_of(program.pid) == []
    program.communicate()
