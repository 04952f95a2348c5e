"""Tracks of any frame rate, brought to a frame every 0.1 s.

The rule: where the recorded times hold every multiple of 0.1 s, those rows are taken as they are. Otherwise
positions are read off the interpolating cubic spline through a vehicle's unbroken run, speeds and accelerations
between their neighbours linearly; lane and leader are those of the row before. A run is unbroken as long as its
rows are at most one and a half steps apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Ledger
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError

ON_FRAME = 0.001  # s; a row whose time is nearer to a frame's is that frame's
GAP = 1.5  # steps; rows farther apart are of two runs
SLOWEST = 1.0  # s between rows; what a driver does within a longer step is not recorded
FASTEST = 0.005  # s, 200 frames a second
CUBIC = 3
POSITIONS = (c.X, c.Y)
RATES = (c.SPEED, c.ACCELERATION, c.HEADING)
BETWEEN = "between frames of 0.1 s"
MADE = "interpolated to frames of 0.1 s"

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class _Runs:
    """Unbroken runs of rows of one vehicle: first row and row after the last, shape ``(runs,)``."""

    first: Integers
    end: Integers


def resample(
    table: pd.DataFrame,
    ledger: Ledger,
    source: str,
    *,
    positions: Sequence[str] = POSITIONS,
    rates: Sequence[str] = RATES,
    run_of: str = "",
) -> pd.DataFrame:
    """Return tracks with a row every 0.1 s and their frame numbers.

    Parameters
    ----------
    table : pandas.DataFrame
        ``period`` and ``vehicle`` (numbers), ``time`` (s), ``x``, ``y`` and further columns of a recording.
    ledger : Ledger
        Rows between frames are booked as dropped, rows that had to be made as added.
    source : str
        Name for messages.
    positions, rates : sequence of str, keyword-only
        Columns that are read off a spline (who never drove backwards in the first of them does not do so in
        between), and those that are interpolated linearly.
    run_of : str, keyword-only
        A column whose change ends a run.

    Raises
    ------
    InputError
        If rows of a vehicle are more than a second apart.
    """
    table = table.sort_values([c.PERIOD, c.VEHICLE, c.TIME], kind="stable", ignore_index=True)
    table = ledger.drop(table, table.duplicated([c.PERIOD, c.VEHICLE, c.TIME]), "duplicate frame of a vehicle")
    table = table.reset_index(drop=True)
    step = _step(table, source)
    start = table.groupby(c.PERIOD, observed=True)[c.TIME].transform("min").to_numpy()
    since = table[c.TIME].to_numpy() - start
    frame = np.round(since / FRAME_STEP).astype(np.int64)
    on_frame = np.abs(since - frame * FRAME_STEP) <= ON_FRAME
    runs = _runs(table, step, run_of)
    if _holds_every_frame(frame, on_frame, runs):
        return ledger.drop(table.assign(**{c.FRAME: frame}), ~on_frame, BETWEEN).reset_index(drop=True)
    columns = [[name for name in names if name in table] for names in (positions, rates)]
    out = _interpolated(table, since, start, runs, *columns)
    ledger.count(BETWEEN, max(len(table) - len(out), 0))
    ledger.add(MADE, max(len(out) - len(table), 0))
    ledger.notes.append(
        f"recorded every {step:g} s; positions at frames of {FRAME_STEP:g} s are from a cubic spline through the "
        "recorded ones"
    )
    return out


def _step(table: pd.DataFrame, source: str) -> float:
    """Return the time (s) between rows of a vehicle."""
    steps = np.diff(table[c.TIME].to_numpy())
    same = (np.diff(table[c.VEHICLE].to_numpy()) == 0) & (np.diff(_codes(table)) == 0)
    step = float(np.median(steps[same])) if same.any() else FRAME_STEP
    if not FASTEST <= step <= SLOWEST * (1 + ON_FRAME):
        raise InputError(
            f"{source}: rows of a vehicle are {step:g} s apart; a recording needs one every {SLOWEST:g} s at least, "
            f"and not more than one every {FASTEST:g} s (is the time in seconds?)"
        )
    return step


def _codes(table: pd.DataFrame) -> Integers:
    return np.asarray(table[c.PERIOD].cat.codes, dtype=np.int64)


def _runs(table: pd.DataFrame, step: float, run_of: str) -> _Runs:
    breaks = (np.diff(table[c.VEHICLE].to_numpy()) != 0) | (np.diff(_codes(table)) != 0)
    breaks |= np.diff(table[c.TIME].to_numpy()) > GAP * step
    if run_of:
        breaks |= np.diff(table[run_of].to_numpy()) != 0
    first = np.concatenate([[0], np.flatnonzero(breaks) + 1])
    return _Runs(first, np.append(first[1:], len(table)))


def _holds_every_frame(frame: Integers, on_frame: npt.NDArray[np.bool_], runs: _Runs) -> bool:
    """Whether every run has a row at each frame from its first to its last such row."""
    rows = np.flatnonzero(on_frame)
    if not len(rows):
        return False
    run = np.searchsorted(runs.first, rows, side="right")
    apart = np.diff(frame[rows])[np.diff(run) == 0]
    return bool((apart == 1).all()) and len(np.unique(run)) == len(runs.first)


def _interpolated(
    table: pd.DataFrame, since: Floats, start: Floats, runs: _Runs, positions: list[str], rates: list[str]
) -> pd.DataFrame:
    place, rate = table[positions].to_numpy(np.float64), table[rates].to_numpy(np.float64)
    frames, before, places, values = [], [], [], []
    for first, end in zip(runs.first.tolist(), runs.end.tolist(), strict=True):
        times = since[first:end]
        wanted = np.arange(
            np.ceil((times[0] - ON_FRAME) / FRAME_STEP), np.floor((times[-1] + ON_FRAME) / FRAME_STEP) + 1
        )
        at = np.clip(wanted * FRAME_STEP, times[0], times[-1])
        frames.append(wanted.astype(np.int64))
        before.append(first + np.maximum(np.searchsorted(times, at + ON_FRAME, side="right") - 1, 0))
        places.append(_spline(times, place[first:end], at))
        values.append(np.column_stack([np.interp(at, times, rate[first:end, k]) for k in range(len(rates))] or [at]))
    out = table.iloc[np.concatenate(before)].reset_index(drop=True)
    frame = np.concatenate(frames)
    out = out.assign(**{c.FRAME: frame, c.TIME: start[np.concatenate(before)] + frame * FRAME_STEP})
    out[positions] = np.concatenate(places)
    if rates:
        out[rates] = np.concatenate(values)
    return out


def _spline(times: Floats, values: Floats, at: Floats) -> Floats:
    """Return values on the cubic spline through a run; who never drove backwards does not do so in between."""
    if len(times) == 1:
        return np.repeat(values, len(at), axis=0)
    from scipy.interpolate import make_interp_spline  # here: slow to load, and seldom needed

    found = np.asarray(make_interp_spline(times, values, k=min(CUBIC, len(times) - 1))(at))
    if (np.diff(values[:, 0]) >= 0).all():
        found[:, 0] = np.maximum.accumulate(found[:, 0])
    return found
