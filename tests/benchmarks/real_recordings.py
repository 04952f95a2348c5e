"""What is diagnosed on real trajectories, whole and by random halves of the drivers.

``python -m tests.benchmarks.real_recordings [NAME ...]``.

Reads the Parquet files in ``../shared/data`` or in the folder that ``IDM_SUMO_DATA`` names, as many as there are.
Prints a Markdown table, one row a half: the verdict, what was named with its size, its own gain on held-out drivers,
the shape that the law lacks, and CPU seconds.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from analysis.diagnosis.outcome import outcome_of
from analysis.diagnosis.shape import lacks
from analysis.diagnosis.words import p_value
from idm_sumo.diagnosis import CauseFound, Diagnosis
from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.models.effects import format_quantity
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording

DATA = Path(os.environ.get("IDM_SUMO_DATA", Path(__file__).parents[2].parent / "shared" / "data"))
NAMES = ("us101_raw_subset", "i80_pairs_reconstructed", "openacc_acc_max", "openacc_human")
HEADER = "| recording | drivers | verdict | named, its size and own gain | shape that the law lacks | CPU s |"


def parts(recording: Recording, rng: np.random.Generator) -> dict[str, list[int] | None]:
    """Return all vehicles, and two random halves of them."""
    vehicles = rng.permutation(recording.table[c.VEHICLE].unique())
    half = len(vehicles) // 2
    return {"all": None, "one half": vehicles[:half].tolist(), "the other": vehicles[half:].tolist()}


def row(name: str, which: str, found: Diagnosis, seconds: float) -> str:
    """Return one row of the table."""
    named = "; ".join(map(_told, found.causes)) or "–"
    misfit = found.law_misfit
    shape = "–" if misfit is None else f"{p_value(misfit.p_value)}; {lacks(outcome_of(found)) or 'chance'}"
    return f"| {name}, {which} | {len(found.drivers)} | `{found.verdict}` | {named} | {shape} | {seconds:.0f} |"


def _told(cause: CauseFound) -> str:
    symbol, size = next(iter(cause.parameters.items()))
    gain = (
        ""
        if cause.gain is None
        else f", {cause.gain.difference:.1%} ({cause.gain.ci95[0]:.1%} to {cause.gain.ci95[1]:.1%})"
    )
    return f"`{cause.name}` {symbol} = {format_quantity(size.value, size.unit)}{gain}"


def main(names: list[str]) -> None:
    """Print the table."""
    print(HEADER, "|" + "---|" * 6, sep="\n", flush=True)
    for name in names:
        file = DATA / f"{name}.parquet"
        if not file.exists():
            print(f"skipped: {name} is not in IDM_SUMO_DATA", file=sys.stderr)
            continue
        recording = clean(read_recording(file, any_length=True))
        for which, vehicles in parts(recording, np.random.default_rng(0)).items():
            begin = time.process_time()
            found = diagnose(recording, only=vehicles)
            print(row(name.replace("_", " "), which, found, time.process_time() - begin), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or list(NAMES))
