"""Memory: a program that keeps it takes pages from the system once, not for every array."""

from __future__ import annotations

import subprocess
import sys

import pytest

MEBIBYTES, ARRAYS = 64, 20
PROGRAM = f"""
import resource, numpy as np
from idm_sumo.runtime.memory import keep_freed_memory
if {{keep}} and not keep_freed_memory():
    raise SystemExit(3)
def fill():
    np.full({MEBIBYTES} << 17, 1.0)
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
fill()
before = faults()
for _ in range({ARRAYS}):
    fill()
print(faults() - before)
"""


def faults(keep: bool) -> int:
    done = subprocess.run([sys.executable, "-c", PROGRAM.format(keep=keep)], capture_output=True, text=True)
    if done.returncode == 3:
        pytest.skip("the C library has no mallopt")
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


def test_arrays_that_come_and_go_take_no_new_pages() -> None:
    assert faults(keep=True) < faults(keep=False)
