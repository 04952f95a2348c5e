"""A dask scheduler and workers as processes on the loopback, and calls that they are given."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from idm_sumo.runtime.handover import handed_back

ROOT = Path(__file__).parents[2]
PATIENCE = 60.0  # s
HALF = "12.5,3.25\n" * 10_000
OLDER = "import idm_sumo\nidm_sumo.__version__ = '0.1.0'\n"


@contextmanager
def process(*arguments: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run one of dask's programs until the block ends."""
    program = subprocess.Popen(
        [sys.executable, "-m", *arguments], cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield program
    finally:
        program.kill()
        program.wait()


def scheduler(address: str, folder: Path) -> ExitStack:
    """Return a running scheduler, to be closed."""
    host, port = address.removeprefix("tcp://").split(":")
    stack = ExitStack()
    stack.enter_context(
        process("distributed.cli.dask_scheduler", "--host", host, "--port", port, "--no-dashboard", folder=folder)
    )
    until(lambda: answers(host, int(port)))
    return stack


def worker(address: str, folder: Path, *, older: bool = False) -> ExitStack:
    """Return a running worker with one thread, to be closed; an older one has another version of the program."""
    stack, options = ExitStack(), ["--no-dashboard", "--no-nanny", "--nthreads", "1"]
    if older:
        (folder / "older.py").write_text(OLDER)
        options += ["--preload", str(folder / "older.py")]
    stack.enter_context(process("distributed.cli.dask_worker", address, *options, folder=folder))
    return stack


def free_address() -> str:
    """Return an address of the loopback where nobody listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{free.getsockname()[1]}"


def answers(host: str, port: int) -> bool:
    """Whether somebody listens."""
    try:
        socket.create_connection((host, port), 1).close()
    except OSError:
        return False
    return True


def until(happens: object) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not happens():  # type: ignore[operator]
        assert time.monotonic() < end, "it never came"
        time.sleep(0.05)


def doubled(number: int) -> int:
    """Return twice the number."""
    return 2 * number


def who(number: int) -> int:
    """Return the process that computes, after a moment in which others can compute, too."""
    time.sleep(0.2)
    return os.getpid()


def lasting(folder: Path, seconds: float | None) -> None:
    """Leave a folder named after the process, and last; without seconds wait for such a folder, and fail."""
    if seconds is None:
        until(lambda: any(folder.iterdir()))
        raise TypeError("no seconds")
    (folder / str(os.getpid())).mkdir()
    time.sleep(seconds)


def leaving(folder: Path, workshop: Path, marks: Path, first: int, second: int) -> None:
    """Leave a table, each half of it written when there are so many marks; the first half leaves one itself."""
    with handed_back(folder, workshop) as own:
        until(lambda: len(list(marks.iterdir())) >= first)
        with (own / "table.csv").open("w") as file:
            file.write(HALF)
            file.flush()
            (marks / str(os.getpid())).touch()
            until(lambda: len(list(marks.iterdir())) >= second)
            file.write(HALF)


def runs(process: int) -> bool:
    """Whether a process of this number runs."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def killed_at_first(folder: Path, number: int, times: int = 1) -> int:
    """Kill the process that computes the number 1, as often as asked, and return the number after that."""
    marks = len(list(folder.glob("killed-*")))
    if number == 1 and marks < times:
        (folder / f"killed-{marks}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number
