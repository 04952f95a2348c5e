"""Reading official text against the plainest other ways of reading the same bytes, in one run.

``pytest tests/benchmarks/test_reading_benchmark.py --benchmark-only``; the figures are in ``extra_info``.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from idm_sumo.recordings.readers.layouts import OFFICIAL
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.smoothing import smooth
from tests.helpers import ngsim_files

VEHICLES, FRAMES = 400, 600  # a fifth of an official period


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> Path:
    parts = [ngsim_files.table(1, FRAMES, first_frame=4 * n).assign(Vehicle_ID=n) for n in range(1, VEHICLES + 1)]
    path = tmp_path_factory.mktemp("text") / "trajectories.txt"
    np.savetxt(path, pd.concat(parts).to_numpy(), fmt="%8.15g")
    return path


def seconds(work: Callable[[], object]) -> float:
    """CPU seconds, so that other work on the machine does not count."""
    start = time.process_time()
    work()
    return time.process_time() - start


def arrow_after_collapsing_blanks(path: Path) -> pa.Table:
    raw = np.frombuffer(path.read_bytes(), np.uint8)
    blank = raw == ord(" ")
    after = np.concatenate([[True], blank[:-1] | (raw[:-1] == ord("\n"))])
    before = np.concatenate([raw[1:] == ord("\n"), [True]])
    kept = raw[~(blank & (after | before))]
    return pa.csv.read_csv(
        pa.py_buffer(kept), pa.csv.ReadOptions(column_names=OFFICIAL), pa.csv.ParseOptions(delimiter=" ")
    )


def test_reading_a_recording(benchmark: BenchmarkFixture, text: Path) -> None:
    result = benchmark.pedantic(read_recording, (text,), rounds=3, warmup_rounds=1)
    assert result.accounting.used == VEHICLES * FRAMES
    own = seconds(lambda: read_recording(text))
    benchmark.extra_info["rows per CPU second"] = round(VEHICLES * FRAMES / own)
    benchmark.extra_info["time / Arrow alone"] = own / min(
        seconds(lambda: arrow_after_collapsing_blanks(text)) for _ in range(3)
    )
    benchmark.extra_info["time / numpy.loadtxt alone"] = own / seconds(lambda: np.loadtxt(text))
    assert benchmark.extra_info["time / numpy.loadtxt alone"] < 4  # parsing alone, unchecked


def test_smoothing_a_recording(benchmark: BenchmarkFixture, text: Path) -> None:
    recording = read_recording(text)
    benchmark.pedantic(smooth, (recording,), rounds=3, warmup_rounds=1)
    own = seconds(lambda: smooth(recording))
    benchmark.extra_info["time / reading"] = own / seconds(lambda: read_recording(text))
    assert benchmark.extra_info["time / reading"] < 2
