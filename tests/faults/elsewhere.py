"""The same command with other processes, threads, hash seed, locale and time zone: the same bytes.

``python -m tests.faults.elsewhere [COMMAND ...]``
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from tests.faults.commands import COMMANDS, OUT, ended, fingerprints, prepare, start

HERE = {"NUMBA_NUM_THREADS": "2", "PYTHONHASHSEED": "1", "LC_ALL": "C.UTF-8", "TZ": "UTC"}
CHANGES: dict[str, tuple[tuple[str, ...], dict[str, str]]] = {
    "two processes": (("--jobs", "2"), {}),
    "one thread": ((), {"NUMBA_NUM_THREADS": "1"}),
    "another hash seed": ((), {"PYTHONHASHSEED": "77"}),
    "another locale and time zone": ((), {"LC_ALL": "POSIX", "TZ": "Asia/Kathmandu"}),
}
ALL_AT_ONCE = "all of it at once"
CHANGES[ALL_AT_ONCE] = (
    tuple(option for options, _ in CHANGES.values() for option in options),
    {name: value for _, environment in CHANGES.values() for name, value in environment.items()},
)


def differences(folder: Path, command: str, changes: list[str]) -> dict[str, list[str]]:
    """Return the files of a command's result whose bytes change, by what was changed."""
    ended(start(folder, (*COMMANDS[command], "--jobs", "1"), **HERE))
    expected = fingerprints(folder / OUT)
    found = {}
    for change in changes:
        shutil.rmtree(folder / OUT)
        options, environment = CHANGES[change]
        ended(start(folder, (*COMMANDS[command], "--jobs", "1", *options), **{**HERE, **environment}))
        now = fingerprints(folder / OUT)
        found[change] = sorted(name for name in now.keys() | expected.keys() if now.get(name) != expected.get(name))
    shutil.rmtree(folder / OUT)
    return found


def main() -> None:
    """Compare every command and exit with 1 if bytes differ."""
    wrong = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "work"
        prepare(folder)
        for command in sys.argv[1:] or COMMANDS:
            for change, names in differences(folder, command, list(CHANGES)).items():
                print(f"{command}, {change}: {', '.join(names) or 'the same bytes'}", flush=True)
                wrong += bool(names)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
