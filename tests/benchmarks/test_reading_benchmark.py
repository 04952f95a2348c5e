"""Reading official text against the plainest other ways of reading the same bytes, in one run.

``pytest tests/benchmarks/test_reading_benchmark.py --benchmark-only``; the figures are in ``extra_info``.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
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


def with_single_blanks(path: Path) -> npt.NDArray[np.uint8]:
    """Return the bytes with one blank between values, for readers that want one."""
    raw = np.frombuffer(path.read_bytes(), np.uint8)
    blank = raw == ord(" ")
    after = np.concatenate([[True], blank[:-1] | (raw[:-1] == ord("\n"))])
    before = np.concatenate([raw[1:] == ord("\n"), [True]])
    return raw[~(blank & (after | before))]


def by_arrow(path: Path) -> pa.Table:
    source = pa.py_buffer(with_single_blanks(path))
    return pa.csv.read_csv(source, pa.csv.ReadOptions(column_names=OFFICIAL), pa.csv.ParseOptions(delimiter=" "))


def by_polars(path: Path) -> object:
    polars = pytest.importorskip("polars")
    return polars.read_csv(with_single_blanks(path).tobytes(), has_header=False, separator=" ", new_columns=OFFICIAL)


def by_pandas(path: Path) -> pd.DataFrame:
    return pd.read_csv(path, sep=r"\s+", header=None, names=OFFICIAL)


OTHERS = {"Arrow": by_arrow, "polars": by_polars, "pandas": by_pandas, "numpy.loadtxt": np.loadtxt}


def test_reading_a_recording(benchmark: BenchmarkFixture, text: Path) -> None:
    result = benchmark.pedantic(read_recording, (text,), rounds=3, warmup_rounds=1)
    assert result.accounting.used == VEHICLES * FRAMES
    benchmark.extra_info["rows per CPU second"] = round(VEHICLES * FRAMES / seconds(lambda: read_recording(text)))


@pytest.mark.parametrize("name", OTHERS)
def test_reading_against_parsing_alone(benchmark: BenchmarkFixture, text: Path, name: str) -> None:
    """Others turn the text into numbers; ours also checks, converts and names what it leaves out."""
    benchmark.pedantic(OTHERS[name], (text,), rounds=1, warmup_rounds=1)
    own = min(seconds(lambda: read_recording(text)) for _ in range(3))
    ratio = own / min(seconds(lambda: OTHERS[name](text)) for _ in range(3))
    benchmark.extra_info["our reading / parsing alone"] = ratio
    assert ratio < 8  # checks and conversion cost a few times the fastest parser, not tens of times


def test_smoothing_a_recording(benchmark: BenchmarkFixture, text: Path) -> None:
    recording = read_recording(text)
    benchmark.pedantic(smooth, (recording,), rounds=3, warmup_rounds=1)
    own = seconds(lambda: smooth(recording))
    benchmark.extra_info["time / reading"] = own / seconds(lambda: read_recording(text))
    assert benchmark.extra_info["time / reading"] < 2
