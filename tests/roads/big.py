"""A day in small: a five-lane road of 6 km with millions of rows through inspect and calibrate, and what it takes.

``python -m tests.roads.big -o FOLDER --rows 2000000`` prints rows, seconds and the highest memory of each command.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from tests.roads import networks, traffic

LANES, LENGTH, APART = 5, 6000.0, 2.4  # m, s between departures in a lane
ROAD = networks.Network(
    "five lanes, 6 km", f'<node id="a" x="0" y="0"/><node id="b" x="{LENGTH}" y="0"/>',
    f'<edge id="road" from="a" to="b" numLanes="{LANES}" speed="25" width="3.66"/>', {"main": "road"},
    {"main": tuple(range(LANES))}, apart=APART,
)  # fmt: skip


def make(folder: Path, rows: int) -> tuple[Path, Path]:
    """Make about so many rows of floating car data; returns the file and the network."""
    vehicle = LENGTH / 16.0 * 10  # rows of one vehicle, at about 16 m/s
    seconds = max(np.sqrt(2 * rows * APART / LANES / 10), rows * APART / LANES / vehicle)
    rng = np.random.default_rng(1)
    net, routes, fcd = networks.build(ROAD, folder), folder / "r.rou.xml", folder / "big.parquet"
    traffic.write_routes(ROAD, traffic.draw(200, rng), routes, seconds)
    traffic.drive(ROAD, net, routes, fcd, seconds=float(seconds), rng=rng)
    return fcd, net


def measured(command: list[str]) -> tuple[float, float]:
    """Run a command and return seconds and the highest memory (GiB) of any child so far."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-m", "idm_sumo", *command], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20


def main() -> None:
    """Print what each command takes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--rows", type=int, default=2_000_000)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    fcd, net = make(options.output, options.rows)
    print(f"rows: {pq.read_metadata(fcd).num_rows:,}", flush=True)
    for name, more in (("inspect", []), ("calibrate", ["-o", str(options.output / "drivers.parquet")])):
        seconds, memory = measured([name, str(fcd), "-n", str(net), *more])
        print(f"{name}: {seconds:.0f} s, {memory:.2f} GiB", flush=True)


if __name__ == "__main__":
    main()
