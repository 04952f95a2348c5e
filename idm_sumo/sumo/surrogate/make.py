"""A surrogate for the US-101 recording, simulated with SUMO.

It is simulated, not measured, and serves people who do not have the files. It is made of several
car-following models with different parameters for every driver, sublane lane changes, ramps, trucks,
motorcycles, waves from a bottleneck downstream and measurement noise. No driver is an IDM driver of
known parameters, so calibrating an IDM to it does not just return what was put in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.reading import NOTICE, SURROGATE_COLUMN
from idm_sumo.recordings.recording import SURROGATE_NOTICE
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.siblings import scratch
from idm_sumo.sumo.surrogate import demand as surrogate_demand
from idm_sumo.sumo.surrogate import layout as surrogate_layout
from idm_sumo.sumo.surrogate import noise as surrogate_noise
from idm_sumo.sumo.surrogate import traffic as surrogate_traffic
from idm_sumo.sumo.surrogate.traffic import STEP, Trajectories

WARM_UP = 180.0  # s, until the road is full
SHORTEST, LONGEST = 0.5, 180.0  # minutes

Progress = Callable[[float, float], None]


def make_surrogate(path: Path | str, *, minutes: float = 45.0, seed: int = 1, progress: Progress | None = None) -> None:
    """Make a surrogate recording and write it in NGSIM's layout.

    Parameters
    ----------
    path : Path or str
        Official whitespace text if it ends in ``.txt``, the data portal's CSV if in ``.csv``,
        otherwise Parquet with the official names. Parquet and CSV say that nothing was measured;
        the official text has no place for that.
    minutes, seed, progress
        As of :func:`surrogate_periods`.

    Raises
    ------
    InputError
        If ``minutes`` makes no sense, the file cannot be written, or SUMO cannot be loaded.
    """
    with new_file(path) as part:
        write_layout(surrogate_periods(minutes=minutes, seed=seed, progress=progress), part, Path(path).suffix.lower())


def surrogate_table(*, minutes: float = 45.0, seed: int = 1, progress: Progress | None = None) -> pd.DataFrame:
    """Simulate a surrogate recording and return it as one table.

    Parameters
    ----------
    minutes, seed, progress
        As of :func:`surrogate_periods`.

    Returns
    -------
    pandas.DataFrame
        The tables of :func:`surrogate_periods`, one after the other.
    """
    return pd.concat(surrogate_periods(minutes=minutes, seed=seed, progress=progress), ignore_index=True)


def surrogate_periods(
    *, minutes: float = 45.0, seed: int = 1, progress: Progress | None = None
) -> Iterator[pd.DataFrame]:
    """Simulate a surrogate recording and yield its periods.

    Parameters
    ----------
    minutes : float
        Length of the recording. It has three periods of equal length, which stand for
        07:50-08:05, 08:05-08:20 and 08:20-08:35 and for the traffic of each.
    seed : int
        The same seed gives the same recording, to the byte.
    progress : callable, optional
        Called with the seconds simulated and their total.

    Yields
    ------
    pandas.DataFrame
        The 18 official columns (feet, ft/s, ft/s^2, ms), sorted by vehicle and frame.
        Vehicle numbers begin anew in each period; a vehicle has all its frames in the period in
        which it is first seen, and ``Global_Time - 100 Frame_ID`` tells the periods apart.

    Raises
    ------
    InputError
        If ``minutes`` or ``seed`` makes no sense, or SUMO cannot be loaded.
    """
    if not SHORTEST <= minutes <= LONGEST:
        raise InputError(
            f"minutes = {minutes:g}: a surrogate lasts {SHORTEST:g} to {LONGEST:g} minutes; choose another length"
        )
    if not 0 <= seed < 2**31:
        raise InputError(f"seed = {seed}: choose a seed from 0 to {2**31 - 1}")
    frames_a_period = round(minutes * 60 / surrogate_demand.PERIODS / STEP) * surrogate_traffic.FRAMES_A_STEP
    schedule = surrogate_demand.Schedule(begin=WARM_UP, period=frames_a_period * FRAME_STEP)
    drivers = surrogate_demand.draw_drivers(schedule, np.random.default_rng([seed, 1]))
    with scratch() as folder:
        routes = folder / "surrogate.rou.xml"
        surrogate_demand.write_routes(drivers, routes)
        steps = surrogate_traffic.run(routes, schedule, seed, progress)
    frames = surrogate_noise.between_steps(steps)
    frames = _chosen(frames, surrogate_layout.in_section(frames, drivers))
    noisy = surrogate_noise.add_noise(frames, np.random.default_rng([seed, 3]))
    del steps
    yield from surrogate_layout.lay_out(frames, noisy, drivers, frames_a_period)


def _chosen(frames: Trajectories, rows: np.ndarray) -> Trajectories:
    """Return some of the rows."""
    return {name: values[rows] for name, values in frames.items()}


def write_layout(tables: Iterable[pd.DataFrame], path: Path, suffix: str) -> None:
    """Write tables of official columns to one file.

    Parameters
    ----------
    tables : iterable of pandas.DataFrame
        Written one after the other.
    path : Path
        File to write.
    suffix : str
        Its format: ``.txt`` (official text), ``.csv`` (data portal), anything else Parquet.
    """
    with ExitStack() as stack:
        writer = None
        for table in tables:
            arrow = pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(
                {NOTICE: SURROGATE_NOTICE}
            )
            if suffix == ".csv":
                arrow = arrow.append_column("Location", pa.array(["us-101"] * len(table)))
                arrow = arrow.append_column(SURROGATE_COLUMN, pa.array(["not measured"] * len(table)))
            writer = writer or stack.enter_context(_writer(path, suffix, arrow.schema))
            writer.write_table(arrow)


def _writer(path: Path, suffix: str, schema: pa.Schema) -> Any:
    """Return Arrow's writer of a format."""
    if suffix == ".txt":
        options = pa.csv.WriteOptions(include_header=False, delimiter=" ", quoting_style="none")
        return pa.csv.CSVWriter(path, schema, write_options=options)
    if suffix == ".csv":
        return pa.csv.CSVWriter(
            path, schema, write_options=pa.csv.WriteOptions(quoting_style="none", quoting_header="none")
        )
    return pq.ParquetWriter(path, schema, compression="zstd", write_page_checksum=True)
