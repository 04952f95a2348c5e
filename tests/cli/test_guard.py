"""Whatever stops a command ends in one line and the right code, and leaves nothing."""

from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from idm_sumo.cli.guard import BAD_INPUT, DEFECT, INTERRUPTED, LONGEST, defended, ending, one_line
from idm_sumo.runtime.errors import InputError
from tests.helpers.platoons import platoon_recording

ROOT = Path(__file__).parents[2]

CODES = [
    (InputError("file: wrong"), BAD_INPUT, "file: wrong"),
    (OSError(errno.ENOSPC, "No space left on device"), BAD_INPUT, "free some space"),
    (PermissionError(errno.EACCES, "Permission denied", "/x/y"), BAD_INPUT, "/x/y"),
    (OSError(errno.EMFILE, "Too many open files"), BAD_INPUT, "ulimit"),
    (OSError(errno.EROFS, "Read-only file system", b"/x"), BAD_INPUT, "/x"),
    (FileNotFoundError(errno.ENOENT, "No such file or directory"), BAD_INPUT, "the current folder"),
    (MemoryError("Unable to allocate 7 TiB"), BAD_INPUT, "7 TiB"),
    (UnicodeEncodeError("utf-8", "\udcff", 0, 1, "surrogates not allowed"), BAD_INPUT, "encoding"),
    (KeyboardInterrupt(), INTERRUPTED, "interrupted"),
    (KeyError("x"), DEFECT, "defect"),
    (RecursionError("deep"), DEFECT, "-v"),
]


@pytest.mark.parametrize(("error", "code", "hint"), CODES, ids=lambda value: type(value).__name__)
def test_codes(error: BaseException, code: int, hint: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop, defended(verbose=False):
        raise error
    said = capsys.readouterr().err.splitlines()
    assert stop.value.code == code
    assert len(said) == 1
    assert said[0].startswith("idm-sumo: ")
    assert hint in said[0]


def test_what_an_interrupt_turns_into_is_an_interrupt() -> None:
    assert ending(ImportError("numpy failed to import"), interrupted=True)[0] == INTERRUPTED


def test_messages_are_one_bounded_line_that_steers_no_terminal() -> None:
    line = one_line("a\x1b[31m\x07\u202eb\nc\udcff" + "d" * 10_000)
    assert line.isprintable()
    assert len(line) == LONGEST
    assert "\\x1b" in line


def test_warnings_do_not_leak_beside_the_line(capsys: pytest.CaptureFixture[str]) -> None:
    import warnings

    with pytest.raises(SystemExit), defended(verbose=False):
        warnings.warn("look at me", RuntimeWarning, stacklevel=1)
        raise InputError("wrong")
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "r.parquet"
    platoon_recording(periods=1, platoons=1).to_parquet(path)
    return path


def run(*arguments: str, before: str = "", after: str = "") -> subprocess.CompletedProcess[str]:
    """Run a command in a shell that redirects or limits it."""
    command = f"{before} exec {sys.executable} -m idm_sumo {' '.join(arguments)} {after}"
    return subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=ROOT, check=False)


@pytest.mark.parametrize("after", [">/dev/full", ">&-"])
@pytest.mark.parametrize("arguments", [["--help"], ["inspect", "RECORDING"]], ids=" ".join)
def test_standard_output_that_takes_nothing(arguments: list[str], after: str, recording: Path) -> None:
    done = run(*(a.replace("RECORDING", str(recording)) for a in arguments), after=after)
    assert done.returncode == BAD_INPUT
    assert len(done.stderr.splitlines()) == 1
    assert "standard output" in done.stderr


def test_a_reader_that_has_gone(recording: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([sys.executable, "-m", "idm_sumo", "inspect", str(recording)], cwd=ROOT, text=True,
                          stdout=writing, stderr=subprocess.PIPE, check=False)  # fmt: skip
    os.close(writing)
    assert done.returncode == BAD_INPUT
    assert len(done.stderr.splitlines()) == 1


def test_closed_standard_error_does_not_matter(recording: Path) -> None:
    done = run("inspect", str(recording), after="2>&-")
    assert done.returncode == 0


def test_a_limit_on_the_size_of_files_is_told_like_a_full_disk(recording: Path, tmp_path: Path) -> None:
    done = run("surrogate", "--minutes", "0.5", "-o", str(tmp_path / "s.txt"),
               before="trap '' XFSZ; ulimit -f 100;")  # fmt: skip
    assert done.returncode == BAD_INPUT, done.stderr
    assert "s.txt" in done.stderr.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("after", [0.15, 0.4, 1.0])
def test_a_signal_at_any_time_ends_in_one_line(number: signal.Signals, after: float, tmp_path: Path) -> None:
    """Most of the time modules load; how far they are differs from machine to machine, the end does not.

    SUMO still drives when the last signal comes.
    """
    process = subprocess.Popen(
        [sys.executable, "-X", "importtime", "-m", "idm_sumo", "surrogate", "--minutes", "4",
         "-o", str(tmp_path / "s.parquet")],
        cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # a shell's background ignores SIGINT
    )  # fmt: skip
    assert process.stderr is not None
    for line in process.stderr:
        if "idm_sumo.cli" in line:  # its defence stands from here on
            break
    time.sleep(after)
    process.send_signal(number)
    said = [
        line for line in process.stderr.read().splitlines() if not line.startswith("import time:") and "..." not in line
    ]
    # Python ends itself by SIGINT if the interrupt fell into an exec(), as modules do; a shell tells both as 130.
    assert process.wait() in (INTERRUPTED, -signal.SIGINT)
    assert said == ["idm-sumo: interrupted; nothing half-written is left, run the same command again"]
    assert list(tmp_path.iterdir()) == []


def test_a_limit_on_memory_ends_in_one_line(recording: Path, tmp_path: Path) -> None:
    limit = 4 << 30
    done = subprocess.run(
        [sys.executable, "-m", "idm_sumo", "calibrate", str(recording), "--horizon", "99999999999", "-o",
        str(tmp_path / "d.csv")],
        cwd=ROOT, capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )  # fmt: skip
    assert done.returncode == BAD_INPUT, done.stderr
    assert len([line for line in done.stderr.splitlines() if not line.endswith(" ...")]) == 1
    assert list(tmp_path.iterdir()) == []


def test_settings_of_other_programs_stop_none_of_ours(tmp_path: Path) -> None:
    for name in ("one.parquet", "other.parquet"):
        platoon_recording().to_parquet(tmp_path / name)
    command = [sys.executable, "-m", "idm_sumo", "compare", "one.parquet", "other.parquet", "-o", "out"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "no_such_windows", "SUMO_HOME": "/nowhere"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "report.html").is_file()


def test_no_threads_are_refused_in_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "idm_sumo", "inspect", "surrogate"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_NUM_THREADS": "0"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == BAD_INPUT
    assert done.stderr.startswith("idm-sumo: NUMBA_NUM_THREADS: 0")
    assert len(done.stderr.splitlines()) == 1
