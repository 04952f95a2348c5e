"""The last line of defence: whatever happens ends in one line and the right exit code.

2: the input, the options or the machine stopped the run, and the user can do something about it.
130: somebody interrupted it. 1: a defect of ours. This module loads fast, so that an interrupt
while the rest loads is caught too.
"""

from __future__ import annotations

import errno
import io
import logging
import os
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType, TracebackType
from typing import Any

import idm_sumo
from idm_sumo.runtime.errors import InputError

DEFECT, BAD_INPUT, INTERRUPTED = 1, 2, 130
LONGEST = 700  # characters of a message
BOUNCE = 1.0  # s: a second interrupt so soon is the same one, sent to the process and to its group
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
REMEDIES = {
    errno.ENOSPC: "free some space", errno.EDQUOT: "free some space",
    errno.EACCES: "check the permissions", errno.EPERM: "check the permissions", errno.EROFS: "name another place",
    errno.EMFILE: "raise the limit (`ulimit -n`) or lower --jobs", errno.ENFILE: "raise the limit or lower --jobs",
    errno.EAGAIN: "raise the limit of processes (`ulimit -u`) or lower --jobs", errno.ENOMEM: "free some memory",
    errno.ENAMETOOLONG: "choose a shorter name",
}  # fmt: skip


class Interrupts:
    """Turns the signals that ask a program to end into KeyboardInterrupt, and remembers that one came."""

    def __init__(self) -> None:
        self.came = 0.0

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Raise, but not again while the first one cleans up."""
        now = time.monotonic()
        if self.came and now - self.came < BOUNCE:
            return
        self.came = now
        raise KeyboardInterrupt

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Listen as long as the block runs, to signals that nobody told us to ignore."""
        before: dict[int, Any] = {}
        try:
            with suppress(ValueError):  # not in the main thread: signals are not ours
                for name in SIGNALS:
                    number = getattr(signal, name, None)
                    if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                        before[number] = signal.signal(number, self)
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


@contextmanager
def defended(*, verbose: bool) -> Iterator[None]:
    """Run a command; whatever stops it ends the program with one line on standard error.

    Raises
    ------
    SystemExit
        With the code this module's docstring tells; none if the command succeeds.
    """
    interrupts = Interrupts()
    with ExitStack() as stack:
        stack.enter_context(interrupts.listening())
        stack.enter_context(_quiet(verbose))
        try:
            _hold_streams()
            yield
        except SystemExit:
            raise
        except BaseException as error:
            if verbose:
                traceback.print_exc()
            code, message = ending(error, interrupted=bool(interrupts.came))
            if code == INTERRUPTED:
                _stop_workers()
            _end(code, message)


def ending(error: BaseException, *, interrupted: bool = False) -> tuple[int, str]:
    """Return the exit code and the message that an exception ends in."""
    if interrupted or isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "interrupted; nothing half-written is left, run the same command again"
    if isinstance(error, InputError):
        return BAD_INPUT, str(error)
    if isinstance(error, MemoryError):
        what = f" ({error})" if str(error) else ""
        return BAD_INPUT, f"not enough memory{what}; give a shorter recording or horizon, or fewer --jobs"
    if isinstance(error, OSError):
        return BAD_INPUT, _of_machine(error)
    if isinstance(error, UnicodeError):
        return BAD_INPUT, f"a name or a text is not in the encoding of this system ({error}); rename or convert it"
    if _is_killed_worker(error):
        return BAD_INPUT, "a worker process was killed, most often for want of memory; run again with fewer --jobs"
    return DEFECT, _of_defect(error)


def one_line(message: str) -> str:
    """Return a message in one line of bounded length, in which no character steers a terminal."""
    line = " ".join(message.split())
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in line)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."


def complain(line: str) -> None:
    """Print a line on standard error, if anybody can hear it."""
    with suppress(OSError, ValueError):
        print(one_line(line), file=sys.stderr, flush=True)


def _of_machine(error: OSError) -> str:
    name = error.filename or error.filename2
    reason = error.strerror or str(error) or type(error).__name__
    remedy = REMEDIES.get(error.errno or 0, "mend it and run the same command again")
    shown = os.fsdecode(name) if isinstance(name, bytes | os.PathLike) else name
    if not shown and error.errno == errno.ENOENT:
        shown, remedy = "the current folder", "change to one that exists"
    return f"{shown}: {reason}; {remedy}" if shown else f"{reason}; {remedy}"


def _of_defect(error: BaseException) -> str:
    text = str(error).strip().splitlines()
    what = type(error).__name__ + (f": {text[0][:300]}" if text else "")
    return (
        f"a defect of idm-sumo {idm_sumo.__version__}, not of your input: {what} ({_where(error.__traceback__)}); "
        "please report it with the output of the same command and -v"
    )


def _where(trace: TracebackType | None) -> str:
    """Return file and line of ours that an exception passed last."""
    frames = traceback.extract_tb(trace)
    ours = [one for one in frames if "idm_sumo" in one.filename or "analysis" in one.filename] or list(frames)
    return f"{os.path.basename(ours[-1].filename)}:{ours[-1].lineno}" if ours else "nowhere"


def _is_killed_worker(error: BaseException) -> bool:
    from concurrent.futures.process import BrokenProcessPool

    return isinstance(error, BrokenProcessPool)


def _stop_workers() -> None:
    with suppress(Exception):
        from idm_sumo.runtime.workers import stop_workers

        stop_workers()


def _hold_streams() -> None:
    """Occupy closed standard streams, so that no result's file gets the number of one; refuse a closed output."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number: this one
    if sys.stderr is None:
        sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False))
    if sys.stdout is None:
        sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False))
        raise InputError("standard output is closed; leave it open, or send it to /dev/null")
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name of a file may be in no encoding


def say(*lines: str) -> None:
    """Print lines to standard output, at once.

    Parameters
    ----------
    *lines : str

    Raises
    ------
    InputError
        If standard output takes no more.
    """
    try:
        print(*lines, sep="\n", flush=True)
    except BrokenPipeError:
        raise InputError("standard output was closed by its reader before everything was said") from None
    except OSError as error:
        raise InputError(f"standard output cannot be written ({error.strerror}); send it elsewhere") from None


def _end(code: int, message: str) -> None:
    """Say a message and exit; what standard output still holds goes nowhere if it cannot go out."""
    complain(f"idm-sumo: {message}")
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    sys.exit(code)


@contextmanager
def _quiet(verbose: bool) -> Iterator[None]:
    """Keep warnings and logs of libraries from standard error, here and in worker processes, unless asked for."""
    if verbose or sys.warnoptions:
        yield
        return
    silent = logging.NullHandler()
    set_here = "PYTHONWARNINGS" not in os.environ
    os.environ.setdefault("PYTHONWARNINGS", "ignore")
    logging.getLogger().addHandler(silent)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.getLogger().removeHandler(silent)
        if set_here:
            os.environ.pop("PYTHONWARNINGS", None)
