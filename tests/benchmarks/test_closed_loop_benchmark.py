"""Processor time of a closed loop against plain SUMO on the files that it wrote.

``pytest tests/benchmarks/test_closed_loop_benchmark.py --benchmark-only -s`` prints the shares.
"""

from __future__ import annotations

import resource
import subprocess
import time
from pathlib import Path

import numpy as np
import sumolib

from idm_sumo.models.effects import ExtendedModel
from idm_sumo.models.idm import IDMParameters
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.sumo.closed_loop import run as closed_loop
from idm_sumo.sumo.closed_loop.demand import demand_of
from idm_sumo.sumo.closed_loop.extended_loop import ModelDrivers
from idm_sumo.sumo.closed_loop.populations import calibrated_types, lane_change_attributes
from tests.helpers.builders import Car, recording

DRIVER = IDMParameters(1.2, 1.8, 1.0, 2.0, 0.0)
SPEED, HEADWAY, FRAMES = 9.0, 23, 3000  # m/s, frames between two cars of a lane, five minutes


def dense() -> Recording:
    """Return about 150 vehicles at a time on five lanes."""
    enters = [(lane, first) for lane in range(1, 6) for first in range(3 * lane, FRAMES - 100, HEADWAY)]
    return recording(
        *(
            Car(n, 0.5, lane, SPEED, first_frame=first, frames=min(FRAMES - first, int(US101.length / SPEED * 10)))
            for n, (lane, first) in enumerate(enters, 1)
        )
    )


def test_share_of_sumo_in_a_run(benchmark, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    recorded = dense()
    demand = demand_of(recorded, approach=True)
    theta = np.tile(np.array(DRIVER), (len(demand), 1))
    types = calibrated_types(demand, theta, lane_change_attributes("LC2013", {}), US101.speed_limit)
    files = closed_loop.write_run(tmp_path / "simulation", "all", recorded, demand, types)

    def ours() -> ModelDrivers:
        return ModelDrivers(ExtendedModel(DRIVER, US101.speed_limit), demand, theta, US101)

    closed_loop.run(files, tmp_path / "compiled.parquet", ours=ours())  # compiles
    plain = _plain(files.config, tmp_path / "plain.parquet")
    begin = time.process_time()
    benchmark.pedantic(closed_loop.run, args=(files, tmp_path / "types.parquet"), rounds=1)
    by_types = time.process_time() - begin
    begin = time.process_time()
    closed_loop.run(files, tmp_path / "loop.parquet", ours=ours())
    by_loop = time.process_time() - begin
    shares = {"plain sumo (CPU s)": plain, "SUMO's types": by_types / plain, "our loop": by_loop / plain}
    benchmark.extra_info |= shares
    print(f"\n{ {name: round(value, 2) for name, value in shares.items()} }")


def _plain(config: Path, fcd: Path) -> float:
    """Return the CPU seconds of plain SUMO with the same output."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sumolib.checkBinary("sumo"), "-c", str(config), "--fcd-output", str(fcd), *closed_loop.FCD]
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
