"""What a vehicle-second costs, stage by stage: ``python -m tests.benchmarks.scale [MINUTES] [--diagnose]``.

Prints CPU seconds of one core and bytes for a million vehicle-seconds, of the built-in recording of so many minutes
(by default 4). Kernels are compiled before; those of the diagnosis are not, so run it twice.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ["NUMBA_NUM_THREADS"] = "1"

import numpy as np

from analysis.drivers.calibrated import Calibration, driver_table
from analysis.many.warm import compile_kernels
from idm_sumo.calibration.table import calibrate
from idm_sumo.calibration.without_d1 import refit_table
from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.evaluation.collisions import first_contacts
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording, write_parquet
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.threads import one_blas_thread
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm
from idm_sumo.sumo.surrogate.builtin import surrogate

MILLION = 1e6


class Bill:
    """Lines of the table: what, how much, in which unit."""

    def __init__(self, vehicle_seconds: float) -> None:
        self.lines: list[tuple[str, float, str]] = []
        self._unit = MILLION / vehicle_seconds

    def cpu(self, name: str, work: Callable[[], Any]) -> Any:
        """Add the CPU seconds of some work; return what it returns."""
        begin = time.process_time()
        result = work()
        self.lines.append((name, (time.process_time() - begin) * self._unit, "CPU s"))
        return result

    def size(self, name: str, path: Path) -> None:
        """Add the size of a file."""
        self.lines.append((name, path.stat().st_size * self._unit / 1e6, "MB"))


def write_motion(recording: Recording, path: Path) -> None:
    """Write a recording in the layout of I-24 MOTION: 25 frames a second, feet, one JSON object a vehicle."""
    objects = []
    for _, rows in recording.table.groupby([c.PERIOD, c.VEHICLE], observed=True):
        seconds = np.arange(rows[c.TIME].iloc[0], rows[c.TIME].iloc[-1] + 1e-9, 0.04)
        x, y = (np.interp(seconds, rows[c.TIME], rows[name]) / FOOT for name in (c.X, c.Y))
        series = {"timestamp": seconds, "x_position": x, "y_position": y - 60.0}
        told = {name: [round(float(one), 4) for one in values] for name, values in series.items()}
        objects.append({**told, "length": [15.0], "width": [6.0], "coarse_vehicle_class": 0, "direction": 1})
    path.write_text(json.dumps(objects))


@one_blas_thread
def bill_of(recorded: Path, folder: Path, *, with_diagnosis: bool) -> tuple[Bill, float]:
    """Return what everything costs, and the vehicle-seconds of the recording."""
    compile_kernels()
    raw = read_recording(recorded)
    first_contacts(few := build_scenes(smooth(clean(raw)), Window(every=600)), drive_idm(few, TEXTBOOK))
    vehicle_seconds = len(raw.table) * c.FRAME_STEP
    bill, parquet, motion = Bill(vehicle_seconds), folder / "r.parquet", folder / "r.json"
    write_parquet(raw, parquet)
    write_motion(raw, motion)
    bill.cpu("reading I-24 MOTION's JSON", lambda: read_recording(motion))
    bill.cpu("reading our Parquet", lambda: read_recording(parquet))
    smoothed = bill.cpu("cleaning and smoothing", lambda: smooth(clean(raw)))
    scenes = bill.cpu("cutting one window a driver", lambda: build_scenes(smoothed, Window()))
    fits = bill.cpu("calibrating", lambda: calibrate(scenes))
    bill.cpu("refitting without d1", lambda: refit_table(fits, scenes))
    driven = bill.cpu("driving once", lambda: drive_idm(scenes, TEXTBOOK))
    bill.cpu("judging its contacts", lambda: first_contacts(scenes, driven))
    table = bill.cpu("a whole driver table", lambda: driver_table(scenes, Calibration(Window())))
    if with_diagnosis:
        bill.cpu("diagnosing", lambda: diagnose(clean(raw), seed=1))
    table.to_parquet(folder / "drivers.parquet")
    bill.size("a recording as I-24 MOTION's JSON", motion)
    bill.size("the same as our Parquet", parquet)
    bill.size("its driver table", folder / "drivers.parquet")
    return bill, vehicle_seconds


def main() -> None:
    """Print the table."""
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    recorded = surrogate(minutes=float(words[0]) if words else 4.0)
    with tempfile.TemporaryDirectory() as folder:
        bill, vehicle_seconds = bill_of(recorded, Path(folder), with_diagnosis="--diagnose" in sys.argv)
    print(f"{vehicle_seconds:,.0f} vehicle-seconds; for a million of them, on one core:\n")
    print("| what | how much |\n|---|---|")
    for name, amount, unit in bill.lines:
        print(f"| {name} | {amount:.3g} {unit} |")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"\nlargest memory: {peak:,.0f} MB, {peak * MILLION / vehicle_seconds:,.0f} MB a million vehicle-seconds")


if __name__ == "__main__":
    main()
