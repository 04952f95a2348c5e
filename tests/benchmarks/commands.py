"""What commands cost: wall and processor seconds, with nothing compiled and with everything.

``python -m tests.benchmarks.commands RECORDING [--sources CLONE] [--only WORD ...]`` prints a table. Another clone's
sources, of an earlier commit, are measured by the same environment on the same machine, which is named below the table.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from idm_sumo.models.effects import Cause, ExtendedModel
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.roads.us101 import US101

ROOT = Path(__file__).parents[2]
COMMANDS = (
    "--help",
    "inspect {recording}",
    "calibrate {recording} -o {out}/drivers.parquet",
    "predict {recording} --drivers {out}/drivers.parquet -o {out}/predicted.parquet",
    "export {out}/drivers.parquet -o {out}/drivers.rou.xml",
    "replay {recording} --vehicle {vehicle} -o {out}/replay",
    "replay {recording} --vehicle {vehicle} --model {model} -o {out}/extended",
    "interactive {recording} --drivers {out}/drivers.parquet -o {out}/loop",
    "diagnose {recording} -o {out}/diagnosis",
    "reproduce {recording} --quick -o {out}/study",
)  # in an order in which each finds what it needs


def measured(command: str, sources: Path, kernels: Path) -> tuple[float, float]:
    """Run a command; return wall and processor seconds."""
    environment = os.environ | {"PYTHONPATH": str(sources), "NUMBA_CACHE_DIR": str(kernels)}
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "idm_sumo", *command.split()], cwd=sources, env=environment, check=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def row(command: str, sources: Path, out: Path, given: dict[str, object]) -> str:
    """Return a command's line of the table: a first run, then a second one."""
    with tempfile.TemporaryDirectory() as kernels:
        runs = [measured(command.format(out=out, **given), sources, Path(kernels)) for _ in range(2)]
    (first_wall, first_cpu), (wall, cpu) = runs
    shown = command.format(out="out", recording="RECORDING", vehicle=given["vehicle"], model="model.json")
    return f"| `{shown}` | {first_wall:.1f} | {first_cpu:.1f} | {wall:.1f} | {cpu:.1f} |"


def machine() -> str:
    """Return processor, cores and Python."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text(encoding="ascii").splitlines() if told.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"


def write_model(path: Path) -> Path:
    """Write a model with one effect, a reaction delay; return its file."""
    cause = Cause("reaction_delay", {"tau": 0.5})
    ExtendedModel(TEXTBOOK, US101.speed_limit, causes=(cause,)).write(path)
    return path


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--vehicle", default="30", help="of the recording, to be replayed")
    parser.add_argument("--sources", type=Path, default=ROOT, help="a clone; the default is this one")
    parser.add_argument("--only", nargs="+", help="first words of the commands that are measured")
    options = parser.parse_args()
    print("| command | first run: wall (s) | CPU (s) | later: wall (s) | CPU (s) |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as out:
        given = {"recording": options.recording.resolve(), "vehicle": options.vehicle}
        given["model"] = write_model(Path(out, "model.json"))
        for command in COMMANDS:
            if options.only is None or command.split()[0].strip("-") in options.only:
                print(row(command, options.sources.resolve(), Path(out), given), flush=True)
    print(f"\n{machine()}")


if __name__ == "__main__":
    main()
