"""Noisy positions to position, speed, acceleration and heading that belong together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording

WINDOW = 21  # frames
ORDER = 3  # of the local polynomial
SHORTEST = 5  # frames; below, a cubic has nothing to smooth
SMOOTH = 0.005  # m: the filter's median shift of raw video tracks is 26 mm, of reconstructed ones 0.3 mm
STEERING_SPEED = 5.0  # m/s; a slower car is turned less: at a crawl the lateral noise is faster than the car

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Path = tuple[Floats, Floats, Floats]  # positions (m), their rate (m/s) and second rate (m/s²)


def smooth(recording: Recording, *, already_smooth: bool = False) -> Recording:
    """Return the recording with positions smoothed and speed, acceleration, heading derived from them.

    A Savitzky-Golay filter (21 frames, third order: a least-squares cubic through the
    frames around each frame) over each unbroken run of frames of a vehicle; its first and
    second derivative at the same frame are speed and acceleration, so the three agree.
    Runs shorter than 21 frames use the longest odd window they hold, runs shorter than 5
    plain differences. Speed is cut off below at 0. Heading is the direction of motion, with
    a longitudinal speed of at least 5 m/s so that noise at standstill does not turn a car.

    ``headway`` stays as recorded, and the positions before smoothing as ``raw_x, raw_y``.

    Parameters
    ----------
    recording : Recording
        As read or cleaned.
    already_smooth : bool, keyword-only
        Return the recording unchanged (simulated trajectories, whose speed is exact), as is done with one that says
        of itself that it is smooth.

    References
    ----------
    A. Savitzky, M. J. E. Golay: Smoothing and differentiation of data by simplified least
    squares procedures. Analytical Chemistry 36(8), 1964.
    """
    if already_smooth or recording.is_smooth:
        return recording
    table = recording.table
    starts, lengths = runs(table)
    x, speed, acceleration = filter_runs(table[c.X].to_numpy(), starts, lengths)
    y, lateral, _ = filter_runs(table[c.Y].to_numpy(), starts, lengths)
    motion = {
        c.X: x,
        c.Y: y,
        c.SPEED: np.maximum(speed, 0.0),
        c.ACCELERATION: acceleration,
        c.HEADING: np.arctan2(lateral, np.maximum(speed, STEERING_SPEED)),
        c.RAW_X: table[c.X].to_numpy(),
        c.RAW_Y: table[c.Y].to_numpy(),
    }
    return recording.with_table(table.assign(**motion), "positions smoothed (Savitzky-Golay, 21 frames, order 3)")


def smoothness(recording: Recording) -> Recording:
    """Return a recording that says of itself whether its positions are smooth: whether our filter hardly moves them."""
    x = recording.table[c.X].to_numpy()
    shift = float(np.median(np.abs(filter_runs(x, *runs(recording.table))[0] - x)))
    if shift > SMOOTH:
        note = f"positions are noisy (our filter moves them by {1000 * shift:.0f} mm) and are smoothed"
    else:
        note = (
            f"positions are smooth already (our filter would move them by {1000 * shift:.2g} mm, raw ones by 26) and "
            "not smoothed again; whoever reconstructed them may have leaked a leader's future into its past"
        )
    return replace(recording, is_smooth=shift <= SMOOTH, notes=(*recording.notes, note))


def runs(table: pd.DataFrame) -> tuple[Integers, Integers]:
    """Return the first row and the number of rows of each unbroken run of frames of one vehicle.

    Parameters
    ----------
    table : pandas.DataFrame
        Sorted by period, vehicle and frame.

    Returns
    -------
    starts, lengths : numpy.ndarray, shape (runs,)
    """
    starts = np.flatnonzero(~same_run(table))
    return starts, np.diff(np.append(starts, len(table)))


def same_run(table: pd.DataFrame) -> npt.NDArray[np.bool_]:
    """Return whether each row follows its predecessor: same period, same vehicle, next frame; shape ``(rows,)``."""
    same = np.zeros(len(table), dtype=bool)
    same[1:] = np.diff(table[c.FRAME].to_numpy()) == 1
    same[1:] &= np.diff(table[c.VEHICLE].to_numpy()) == 0
    same[1:] &= np.diff(table[c.PERIOD].cat.codes.to_numpy()) == 0
    return same


def running_mean(values: Floats, same: npt.NDArray[np.bool_], most: int | None = None) -> Floats:
    """Return the mean of each run up to each row, of the last ``most`` rows if given; ``same`` of :func:`same_run`."""
    row, total = np.arange(len(values)), np.concatenate([[0.0], np.cumsum(values)])
    begin = np.maximum.accumulate(np.where(~same, row, 0))
    begin = begin if most is None else np.maximum(begin, row + 1 - most)
    return np.asarray((total[row + 1] - total[begin]) / (row + 1 - begin))


def filter_runs(position: Floats, starts: Integers, lengths: Integers) -> Path:
    """Return position, its rate and its second rate, each of shape ``(rows,)``, run by run; see :func:`smooth`."""
    value, rate, second = (_savgol(position, WINDOW, deriv) for deriv in range(3))
    return with_ends((value, rate, second), _filtered, position, starts, lengths, WINDOW)


def with_ends(
    out: Path, filtered: Callable[[Floats], Path], position: Floats, starts: Integers, lengths: Integers, window: int
) -> Path:
    """Return what was filtered as if all rows were one run, redone where that is wrong: near the ends of the runs.

    Parameters
    ----------
    out : tuple of three arrays, shape (rows,)
        Changed in place.
    filtered : callable
        From positions, shape (stretches, frames), to the same three, filtered along the last axis.
    position : array, shape (rows,)
    starts, lengths : arrays, shape (runs,)
    window : int
        Frames of the filter; half a window at each end is redone from the first and last windows of the runs.
    """
    long, half = lengths >= window, window // 2
    _fill(out, filtered, position, starts[long], window, slice(None, half))
    _fill(out, filtered, position, starts[long] + lengths[long] - window, window, slice(half + 1, None))
    for length in np.unique(lengths[~long]):
        _fill(out, filtered, position, starts[lengths == length], int(length), slice(None))
    return out


def _fill(
    out: Path, filtered: Callable[[Floats], Path], position: Floats, starts: Integers, length: int, part: slice
) -> None:
    """Filter equally long stretches together and put the chosen part of each in place."""
    if not len(starts):
        return
    rows = starts[:, None] + np.arange(length)
    for values, stretches in zip(out, filtered(position[rows]), strict=True):
        values[rows[:, part]] = stretches[:, part]


def _filtered(stretches: Floats) -> Path:
    length = stretches.shape[-1]
    one, two, three = (
        _savgol(stretches, length, deriv) if length >= SHORTEST else _differences(stretches, deriv)
        for deriv in range(3)
    )
    return one, two, three


def _savgol(values: Floats, length: int, deriv: int) -> Floats:
    window = min(WINDOW, length - 1 + length % 2, values.shape[-1] - 1 + values.shape[-1] % 2)
    if window < SHORTEST:
        return np.zeros_like(values)  # redone by differences
    from scipy.signal import savgol_filter  # here: it takes longer to load than all else that reads a recording

    filtered: Floats = savgol_filter(values, window, ORDER, deriv=deriv, delta=FRAME_STEP, mode="interp")
    return filtered


def _differences(stretches: Floats, deriv: int) -> Floats:
    """Return the ``deriv``-th central difference along the last axis; zero for a single frame."""
    values = stretches
    for _ in range(deriv):
        values = np.gradient(values, FRAME_STEP, axis=-1) if values.shape[-1] > 1 else np.zeros_like(values)
    return values
