"""The writing commands on small inputs, as processes of their own."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Protocol

from idm_sumo.runtime.siblings import PREFIX
from tests.helpers.platoons import platoon_recording

ROOT = Path(__file__).parents[2]
RECORDING, DRIVERS = "inputs/platoons.parquet", "inputs/drivers.parquet"
LONGER = "inputs/longer.parquet"  # what a diagnosis needs to look for causes at all
OUT = "out"
WINDOW = ("--observed", "10", "--horizon", "40")
COMMANDS: dict[str, tuple[str, ...]] = {
    "surrogate": ("surrogate", "--minutes", "0.5", "--seed", "2", "-o", f"{OUT}/s.parquet"),
    "calibrate": ("calibrate", RECORDING, *WINDOW, "-o", f"{OUT}/d.parquet"),
    "predict": ("predict", RECORDING, "--drivers", DRIVERS, "-o", f"{OUT}/p.parquet"),
    "export": ("export", DRIVERS, "-o", f"{OUT}/e.rou.xml"),
    "replay": ("replay", RECORDING, "--vehicle", "3", "--horizon", "10", "-o", f"{OUT}/r"),
    "compare": ("compare", RECORDING, "inputs/again.parquet", "-o", f"{OUT}/c"),
    "interactive": ("interactive", RECORDING, "--drivers", DRIVERS, "--types", "drivers", "--types", "krauss",
                    "--replay-bias", "5", "-o", f"{OUT}/i"),
    "diagnose": ("diagnose", LONGER, "-o", f"{OUT}/g"),
    "reproduce": ("reproduce", RECORDING, "--quick", "--no-agents", "-o", f"{OUT}/q"),
}  # fmt: skip


def prepare(folder: Path) -> None:
    """Write the inputs of all commands below ``folder/inputs``."""
    (folder / "inputs").mkdir(parents=True)
    platoon_recording().to_parquet(folder / RECORDING)
    platoon_recording(frames=700).to_parquet(folder / LONGER)
    platoon_recording(seed=4).to_parquet(folder / "inputs" / "again.parquet")
    ended(start(folder, ("calibrate", RECORDING, *WINDOW, "-o", DRIVERS)))


def prepare_short(folder: Path) -> None:
    """Write the recording alone, of four cars in six seconds: a command ends within seconds."""
    (folder / "inputs").mkdir(parents=True)
    platoon_recording(periods=1, platoons=1, cars=4, frames=60).to_parquet(folder / RECORDING)


def start(folder: Path, arguments: tuple[str, ...], **environment: str) -> subprocess.Popen[bytes]:
    """Start a command in a folder, as the leader of a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "idm_sumo", *arguments], cwd=folder, start_new_session=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ROOT), "IDM_SUMO_CACHE": str(folder.parent / "cache"), **environment},
    )  # fmt: skip


class Running(Protocol):
    """What is needed of a command that runs."""

    pid: int
    returncode: Any  # an int once it has ended

    def communicate(self) -> tuple[bytes, bytes]:
        """Wait for its end; return its standard output and error."""


def ended(process: Running) -> None:
    """Wait for a command that must succeed."""
    _, said = process.communicate()
    assert process.returncode == 0, said.decode(errors="replace")


def fingerprints(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file of a result, those apart that hold times of day."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "manifest.json"
    }


def leftovers(folder: Path) -> list[Path]:
    """Return what temporary files and folders lie about."""
    return [path for path in folder.rglob("*") if PREFIX in path.name]


def processes_of(session: int) -> list[int]:
    """Return the living processes of a session, by the table of processes that Linux keeps."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, its_session = stat.read_text().rpartition(")")[2].split()[:4]
        except (OSError, ValueError):  # it has just ended
            continue
        if int(its_session) == session and state != "Z":
            found.append(int(stat.parent.name))
    return found
