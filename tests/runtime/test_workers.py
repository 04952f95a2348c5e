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
import sys, time
from idm_sumo.runtime.workers import beside, in_processes
def sleep(seconds):
    print("at work", flush=True)
    time.sleep(seconds)
if __name__ == "__main__":
    list(in_processes(2, [(100.0,), (100.0,)], sleep))
"""


def test_results_come_in_the_order_of_the_calls() -> None:
    assert list(in_processes(2, [(number,) for number in range(7)], abs)) == list(range(7))


def test_beside() -> None:
    assert beside(os.getpid).result() != os.getpid()


@pytest.mark.skipif(sys.platform != "linux", reason="the table of processes is Linux's")
def test_workers_of_a_killed_program_end(tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM)
    program = subprocess.Popen([sys.executable, str(script)], cwd=ROOT, stdout=subprocess.PIPE, start_new_session=True,
                               env={**os.environ, "PYTHONPATH": str(ROOT)})  # fmt: skip
    assert program.stdout is not None
    assert program.stdout.readline() == b"at work\n"
    assert program.stdout.readline() == b"at work\n"
    assert len(processes_of(program.pid)) >= 3
    os.kill(program.pid, signal.SIGKILL)
    program.wait()
    end = time.monotonic() + PATIENCE
    while processes_of(program.pid) and time.monotonic() < end:
        time.sleep(0.1)
    assert processes_of(program.pid) == []
