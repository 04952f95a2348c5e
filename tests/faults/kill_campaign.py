"""Kill every writing command at random moments; run it again; the bytes must be those of an undisturbed run.

``python -m tests.faults.kill_campaign [--kills 20] [--seed 1] [COMMAND ...]``
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from tests.faults.commands import COMMANDS, OUT, Running, ended, fingerprints, leftovers, prepare, processes_of, start

Begin = Callable[[Path, tuple[str, ...]], Running]
PATIENCE = 60.0  # s, in which a worker of a killed run has to end; it looks twice a second, when its kernel lets it


def undisturbed(folder: Path, command: str, begin: Begin = start) -> tuple[dict[str, str], float]:
    """Return what a command leaves, and how long it takes (s)."""
    then = time.monotonic()
    ended(begin(folder, COMMANDS[command]))
    return fingerprints(folder / OUT), time.monotonic() - then


def kill(folder: Path, command: str, at: float, expected: dict[str, str], begin: Begin = start) -> list[str]:
    """Kill a command after ``at`` seconds, run it again, and return what is wrong then."""
    process = begin(folder, COMMANDS[command])
    time.sleep(at)
    with suppress(ProcessLookupError):  # it took less time than before
        os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    faults = []
    between = {name: one for name, one in fingerprints(folder / OUT).items() if not name.startswith(".")}
    if between and between.keys() == expected.keys() and between != expected:
        faults.append("a mixture of two results stood there")
    end = time.monotonic() + PATIENCE
    while (left := processes_of(process.pid)) and time.monotonic() < end:
        time.sleep(0.2)
    if left:
        faults.append(f"{len(left)} worker processes live on")
        for worker in left:
            os.kill(worker, signal.SIGKILL)
    ended(begin(folder, COMMANDS[command]))
    found = fingerprints(folder / OUT)
    if found != expected:
        names = sorted(name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name))
        faults.append(f"other bytes in {', '.join(names)}")
    return faults + [f"{path.name} is left" for path in leftovers(folder)]


def campaign(commands: list[str], kills: int, seed: int, folder: Path) -> list[list[str]]:
    """Kill each command so many times, every other time over an earlier result; return the faults of each kill."""
    rng = random.Random(seed)
    prepare(folder)
    done = []
    for command in commands:
        expected, duration = undisturbed(folder, command)
        for number in range(kills):
            if number % 2:
                shutil.rmtree(folder / OUT)
            at = rng.uniform(0.0, duration)
            done.append(kill(folder, command, at, expected))
            print(f"{command} killed after {at:.2f} s: {'; '.join(done[-1]) or 'the same bytes'}", flush=True)
        shutil.rmtree(folder / OUT)
    return done


def main() -> None:
    """Run the campaign and exit with 1 if a kill showed a fault."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("commands", nargs="*", default=list(COMMANDS), metavar="COMMAND")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        done = campaign(options.commands, options.kills, options.seed, Path(scratch) / "work")
    wrong = sum(map(bool, done))
    print(f"{len(done)} kills, {wrong} with a fault")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
