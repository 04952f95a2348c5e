"""Malformed inputs through the real command line: ``python -m tests.fuzz.through_command -o DIR --runs N``."""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
from collections import Counter
from pathlib import Path

from idm_sumo.runtime.siblings import PREFIX
from tests.fuzz import seeds
from tests.fuzz.campaign import KINDS, LONGEST, Kind

ROOT = Path(__file__).parents[2]
PROGRESS = " ..."  # a line of progress ends so
PATIENCE = 300.0  # s
NET = str(seeds.NETWORK)
INSPECT = ("inspect", "INPUT")
ON_NETWORK = ("inspect", "sound_fcd.csv", "--net-file")
COMMANDS = {
    **dict.fromkeys(("network_fcd.xml", "network_fcd.csv", "network_fcd.parquet"), (*INSPECT, "--net-file", NET)),
    "own.net.xml": (*ON_NETWORK, "INPUT"),
    "types.rou.xml": (*ON_NETWORK, NET, "--route-files", "INPUT"),
    "corridor.json": (*ON_NETWORK, NET, "--corridor", "INPUT"),
    "drivers.csv": ("export", "INPUT", "--distribution", "-o", "OUT/x.add.xml"),
    "drivers.parquet": ("export", "INPUT", "--distribution", "-o", "OUT/x.add.xml"),
    "model.json": ("export", "sound.csv", "--model", "INPUT", "--no-check", "-o", "OUT/x.rou.xml"),
    "run.toml": ("reproduce", "missing.csv", "--run", "INPUT", "--quick", "-o", "OUT/q"),
    "reward.json": ("irl", "evaluate", "missing.csv", "--agents", "FOLDER", "-o", "OUT/s.csv"),
    "irl_rl-seed1.csv": ("irl", "evaluate", "missing.csv", "--agents", "FOLDER", "-o", "OUT/s.csv"),
    "policy.npz": ("irl", "evaluate", "missing.csv", "--agents", "FOLDER", "-o", "OUT/s.csv"),
}
NAMES = {"policy.npz": "irl_rl-seed1.npz"}  # under which a folder of agents is read


def run(kind: Kind, number: int, folder: Path) -> str:
    """Return how a command ends with the ``number``-th input of a kind: sound, refused, or what is wrong."""
    given = folder / "given"
    given.mkdir(parents=True)
    (folder / "out").mkdir()
    seeds.drivers().to_csv(folder / "sound.csv", index=False)
    seeds.fcd_on_network().to_csv(folder / "sound_fcd.csv", sep=";", index=False)
    path = given / NAMES.get(kind.name, kind.name)
    path.write_bytes(kind.make(random.Random(f"command {kind.name} {number}")))
    before = path.read_bytes()
    words = {"INPUT": str(path), "FOLDER": str(given)}
    command = [words.get(one, one.replace("OUT", "out")) for one in COMMANDS.get(kind.name, INSPECT)]
    done = subprocess.run(
        [sys.executable, "-m", "idm_sumo", *command], cwd=folder, capture_output=True, stdin=subprocess.DEVNULL,
        timeout=PATIENCE, check=False, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    said = [line for line in done.stderr.decode("utf-8", "replace").splitlines() if not line.endswith(PROGRESS)]
    if done.returncode not in (0, 2):
        return f"exit {done.returncode}: {said[-1] if said else ''}"
    if path.read_bytes() != before or any(PREFIX in one.name for one in folder.rglob("*")):
        return "the input was changed, or something half-written is left"
    if done.returncode == 0:
        return "sound" if not any("Warning" in line for line in said) else f"a warning shows: {said[0]}"
    said = [line for line in said if not line.startswith("note: ")]
    if any((folder / "out").iterdir()):
        return "refused, but something is left"
    good = len(said) == 1 and len(said[0]) <= LONGEST and said[0].isprintable()
    return "refused" if good else f"{len(said)} lines: {said[:2]}"


def main() -> None:
    """Run some inputs of each kind and print the counts; exit with 1 if one ends badly."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True, help="where inputs and results are kept")
    parser.add_argument("--runs", type=int, default=4, help="inputs of each kind (default 4)")
    options = parser.parse_args()
    bad = 0
    for kind in KINDS:
        ends = [run(kind, number, options.output / f"{kind.name}-{number}") for number in range(options.runs)]
        count = Counter(end if end in ("sound", "refused") else "fault" for end in ends)
        print(f"{kind.name:<22}{len(ends):>8}{count['sound']:>8}{count['refused']:>9}{count['fault']:>8}", flush=True)
        for end in ends:
            if end not in ("sound", "refused"):
                print(f"    {end}", flush=True)
        bad += count["fault"]
    sys.exit(bool(bad))


if __name__ == "__main__":
    main()
