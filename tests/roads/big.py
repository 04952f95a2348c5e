"""A day in small: a five-lane road of 6 km with millions of rows through inspect and calibrate, and what it takes.

``python -m tests.roads.big -o FOLDER --rows 1000000 3000000 10000000`` prints a Markdown table: rows, processor seconds
and the highest memory of each command. SUMO simulates a million rows once; larger files repeat them later in time with
new vehicles, as the days of a measurement campaign would.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from tests.roads import networks, traffic

LANES, LENGTH, APART = 5, 6000.0, 2.4  # m, s between departures in a lane
PIECE = 1_000_000  # rows that are simulated
PAUSE = 60.0  # s between repetitions
ROAD = networks.Network(
    "five lanes, 6 km", f'<node id="a" x="0" y="0"/><node id="b" x="{LENGTH}" y="0"/>',
    f'<edge id="road" from="a" to="b" numLanes="{LANES}" speed="25" width="3.66"/>', {"main": "road"},
    {"main": tuple(range(LANES))}, apart=APART,
)  # fmt: skip


class Taken(NamedTuple):
    """What a command takes: processor time (s), highest memory (GiB)."""

    seconds: float
    memory: float


def simulated(folder: Path) -> tuple[Path, Path]:
    """Make about a million rows of floating car data; returns the file and the network."""
    vehicle = LENGTH / 16.0 * 10  # rows of one vehicle, at about 16 m/s
    seconds = max(np.sqrt(2 * PIECE * APART / LANES / 10), PIECE * APART / LANES / vehicle)
    rng = np.random.default_rng(1)
    net, routes, fcd = networks.build(ROAD, folder), folder / "r.rou.xml", folder / "piece.parquet"
    if not fcd.exists():
        traffic.write_routes(ROAD, traffic.draw(200, rng), routes, seconds)
        traffic.drive(ROAD, net, routes, fcd, seconds=float(seconds), rng=rng)
    return fcd, net


def repeated(piece: Path, path: Path, rows: int) -> int:
    """Write at least so many rows, the piece again and again; returns how many."""
    table = pq.read_table(piece)
    time, name = table["timestep_time"], table["vehicle_id"]
    length = float(pc.max(time).as_py()) + PAUSE
    with pq.ParquetWriter(path, table.schema) as writer:
        for again in range(count := -(-rows // len(table))):
            later = pc.add(time, pa.scalar(again * length, time.type))
            other = pc.binary_join_element_wise(name.cast(pa.string()), f"{again}", "/").cast(name.type)
            table = table.set_column(table.schema.get_field_index("timestep_time"), "timestep_time", later)
            table = table.set_column(table.schema.get_field_index("vehicle_id"), "vehicle_id", other)
            writer.write_table(table)
    return count * len(table)


def measured(command: list[str]) -> Taken:
    """Run a command and return what it takes."""
    process = subprocess.Popen([sys.executable, "-m", "idm_sumo", *command], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"idm-sumo {' '.join(command)} failed")
    return Taken(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 2**20)


def main() -> None:
    """Print what each command takes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--rows", type=int, nargs="+", default=[1_000_000, 3_000_000, 10_000_000])
    parser.add_argument("--only", nargs="+", choices=("inspect", "calibrate"), default=("inspect", "calibrate"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    piece, net = simulated(options.output)
    print("| rows | command | processor time (s) | us a row | memory (GiB) |\n|---|---|---|---|---|", flush=True)
    for wanted in options.rows:
        big = options.output / f"{wanted}.parquet"
        rows = repeated(piece, big, wanted)
        for name in options.only:
            more = ["-o", str(options.output / "drivers.parquet")] if name == "calibrate" else []
            taken = measured([name, str(big), "-n", str(net), *more])
            pace = 1e6 * taken.seconds / rows
            print(f"| {rows:,} | `{name}` | {taken.seconds:.0f} | {pace:.1f} | {taken.memory:.2f} |", flush=True)
        big.unlink()


if __name__ == "__main__":
    main()
