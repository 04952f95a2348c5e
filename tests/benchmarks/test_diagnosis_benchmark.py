"""What a diagnosis costs: the share of each stage, and how it grows with the drivers, within one run.

``pytest tests/benchmarks/test_diagnosis_benchmark.py --benchmark-only``; figures are in ``extra_info``.
"""

import time
from pathlib import Path

import numpy as np
import pytest

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.diagnosis.fit import TEXTBOOK
from idm_sumo.diagnosis.smoother import local_cubic
from idm_sumo.diagnosis.windows import cut_windows
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from tests.simulators.first import plan, simulate, write

DRIVERS, MINUTES = 600, 7.0


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 600 drivers in seven minutes, with a place that slows."""
    path = tmp_path_factory.mktemp("planted") / "recording.txt"
    write(simulate(plan(5, effect="location", size="mid", drivers=DRIVERS, minutes=MINUTES)), path)
    return path


@pytest.fixture(scope="module")
def recording(planted: Path) -> Recording:
    """The same, read and cleaned; the kernels are compiled on a small part of it."""
    whole = clean(read_recording(planted))
    diagnose(first_of(whole, 0.25), seed=1)
    return whole


def first_of(recording: Recording, share: float) -> Recording:
    """Return the vehicles that entered first."""
    entered = recording.table.groupby("vehicle")["frame"].min().sort_values(kind="stable").index
    chosen = entered[: round(share * len(entered))]
    table = recording.table
    return recording.with_table(table[table["vehicle"].isin(chosen)].reset_index(drop=True))


@pytest.mark.benchmark(group="diagnosis")
def test_stages_of_a_diagnosis(benchmark, recording: Recording) -> None:
    found = benchmark.pedantic(diagnose, args=(recording,), kwargs={"seed": 1, "jobs": 2}, rounds=1)
    whole = sum(found.seconds.values())
    benchmark.extra_info["vehicles"] = recording.vehicle_count
    benchmark.extra_info["drivers"] = len(found.drivers)
    benchmark.extra_info["verdict"] = found.verdict
    benchmark.extra_info["share"] = {name: round(seconds / whole, 3) for name, seconds in found.seconds.items()}
    assert whole > 0


@pytest.mark.benchmark(group="diagnosis")
def test_rollouts_side_by_side(benchmark, recording: Recording) -> None:
    """Eight rollouts of every window in one pass, against one after the other."""
    own = local_cubic(21)
    windows = cut_windows(recording, own, own, np.random.default_rng(0))
    theta = np.repeat(np.tile(np.exp(TEXTBOOK), (windows.drivers, 1))[:, :, None], 8, axis=2)
    start = np.zeros((2, 8))
    one = np.ascontiguousarray(theta[:, :, 0])

    def in_turn() -> list[np.ndarray]:
        return [ro.positions(windows, one, ro.PLAIN) for _ in range(8)]

    in_turn()
    begin = time.perf_counter()
    for _ in range(5):
        in_turn()
    apart = (time.perf_counter() - begin) / 5
    benchmark.pedantic(ro.positions_beside, args=(windows, theta, ro.PLAIN, start), rounds=5, warmup_rounds=1)
    ratio = apart / benchmark.stats.stats.median
    benchmark.extra_info["times faster than in turn"] = round(ratio, 1)
    assert ratio > 1.0


@pytest.mark.benchmark(group="diagnosis")
def test_cost_against_drivers(benchmark, recording: Recording) -> None:
    """Half of the drivers cost about half: the ratio to the whole is well below the square."""
    begin = time.perf_counter()
    diagnose(first_of(recording, 0.5), seed=1, jobs=2)
    half = time.perf_counter() - begin
    benchmark.pedantic(diagnose, args=(recording,), kwargs={"seed": 1, "jobs": 2}, rounds=1)
    ratio = benchmark.stats.stats.max / half
    benchmark.extra_info["cost of twice the drivers"] = round(ratio, 2)
    assert ratio < 4.0
