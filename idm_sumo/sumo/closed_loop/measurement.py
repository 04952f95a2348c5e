"""A closed-loop run as a recording, and its traffic measures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.evaluation.traffic_measures import TrafficMeasures, measure_traffic
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.sumo.closed_loop.ego import Ego
from idm_sumo.sumo.closed_loop.extended_loop import ModelDrivers
from idm_sumo.sumo.closed_loop.run import Outcome, RunFiles, run

LANES_BY_PLACE = "lane is taken from the lateral position"
SHOWN_EVERY = 5  # frames, of what is kept for figures


def as_recording(outcome: Outcome, recorded: Recording, demand: pd.DataFrame, name: str) -> Recording:
    """Return a run as a recording of the section.

    Its clock is the recorded one, sizes and classes are the demand's.

    Parameters
    ----------
    outcome : Outcome
    recorded : Recording
        The period that the demand is of.
    demand : pandas.DataFrame
        As of :func:`idm_sumo.sumo.closed_loop.demand.demand_of`.
    name : str
        Source that the recording names.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If no vehicle was inside the section.
    """
    read = read_recording(outcome.fcd, road=recorded.road)
    table = read.table
    table = table[table[c.X].between(0.0, recorded.road.length)]
    if table.empty:
        raise InputError(f"{outcome.fcd.name}: no vehicle entered the section; see the delays of departures")
    of = demand.set_index(c.VEHICLE)
    vehicle = table[c.VEHICLE].to_numpy()
    first = int(recorded.table[c.FRAME].min())
    columns: dict[str, Any] = {
        c.PERIOD: pd.Categorical.from_codes(np.zeros(len(table), dtype=np.int64), pd.Index(recorded.periods)),
        c.FRAME: table[c.FRAME] + first, c.TIME: table[c.TIME] + float(recorded.table[c.TIME].min()),
        c.LENGTH: of[d.LENGTH].reindex(vehicle).to_numpy(), c.WIDTH: of[d.WIDTH].reindex(vehicle).to_numpy(),
        c.CLASS: of[d.CLASS].reindex(vehicle).fillna(0).to_numpy().astype("int8"),
    }  # fmt: skip
    table = table.assign(**columns)
    return Recording(table.reset_index(drop=True), recorded.road, name, (LANES_BY_PLACE,))


@dataclass(frozen=True)
class Measured:
    """A run and its traffic measures.

    Attributes
    ----------
    outcome : Outcome
    measured : TrafficMeasures
    glimpse : Recording or None
        Every fifth frame, for figures, of a run that is shown.
    """

    outcome: Outcome
    measured: TrafficMeasures
    glimpse: Recording | None


def run_and_measure(
    files: RunFiles, fcd: Path, recorded: Recording, *, name: str, seed: int, ego: Ego | None = None,
    ours: ModelDrivers | None = None, gui: bool = False, shown: bool = True, progress: Progress = silent,
) -> Measured:  # fmt: skip
    """Run a population and measure its traffic.

    For a process of its own, since libsumo holds one simulation.

    Parameters
    ----------
    files, fcd, seed, ego, ours, gui, progress
        As of :func:`idm_sumo.sumo.closed_loop.run.run`.
    recorded : Recording
        The period that the demand is of.
    name : str
        Source that the run's recording names.
    shown : bool
        Whether figures show it.

    Returns
    -------
    Measured

    Raises
    ------
    InputError
        As of :func:`idm_sumo.sumo.closed_loop.run.run`, or if no vehicle was inside the section.
    """
    outcome = run(files, fcd, seed=seed, ego=ego, ours=ours, gui=gui, progress=progress)
    recording = as_recording(outcome, recorded, files.demand, name)
    return Measured(outcome, measure_traffic(recording), glimpse_of(recording) if shown else None)


def glimpse_of(recording: Recording) -> Recording:
    """Return every fifth frame of a recording.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    Recording
    """
    table = recording.table
    return recording.with_table(table[table[c.FRAME] % SHOWN_EVERY == 0].reset_index(drop=True))
