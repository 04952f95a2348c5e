"""Which recording period a row belongs to, when only frames and clock times are known."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import numpy.typing as npt
import pandas as pd

FRAME_MS = 100  # ms between frames
PERIOD_MINUTES = 15
CALIFORNIA = timezone(timedelta(hours=-7))  # summer time, as on both recording days
SAME_PERIOD_MS = 60_000  # clocks that differ by less belong to one period
MAIN_SHARE = 0.01  # an offset shared by fewer rows than this is an irregularity, not a period
FOLLOWS = 0.9  # share of rows whose clock must follow their frame number

Integers = npt.NDArray[np.int64]


def split_periods(vehicle: Integers, frame: Integers | None, clock: Integers) -> tuple[pd.Categorical[str], str]:
    """Label the period of each row and say how it was found.

    Within one official period ``Global_Time - 100 ms * Frame_ID`` is a constant. It differs
    between periods and so tells them apart even where vehicle numbers repeat and where the
    periods overlap in time, as they do by a minute and a half.

    Parameters
    ----------
    vehicle, clock : numpy.ndarray, shape (rows,)
        Vehicle number and time in ms since 1970.
    frame : numpy.ndarray, shape (rows,), or None
        Frame number, if recorded.

    Returns
    -------
    labels : pandas.Categorical, shape (rows,)
        Such as ``0750-0805``, categories in order of time.
    note : str
        Empty where the usual way worked.
    """
    if frame is not None:
        offset = clock - FRAME_MS * frame
        starts, follows = _main_offsets(offset)
        if follows >= FOLLOWS:
            codes = _nearest(starts, offset)
            return _labelled(codes, starts), ""
    codes = _restarts(vehicle, clock)
    starts = np.array([clock[codes == code].min() for code in range(codes.max() + 1)], dtype=np.int64)
    note = "periods were told apart by restarting vehicle numbers, because Global_Time does not follow Frame_ID"
    return _labelled(codes, starts), note


def _main_offsets(offset: Integers) -> tuple[Integers, float]:
    """Return the offsets that are periods, sorted, and the share of rows that have exactly one of the main ones."""
    values, counts = np.unique(offset, return_counts=True)
    main = counts >= max(MAIN_SHARE * len(offset), 1)
    order = np.argsort(-counts[main], kind="stable")
    kept: list[int] = []
    for value in values[main][order]:
        if all(abs(int(value) - other) > SAME_PERIOD_MS for other in kept):
            kept.append(int(value))
    return np.array(sorted(kept), dtype=np.int64), float(counts[main].sum() / len(offset))


def _nearest(starts: Integers, offset: Integers) -> Integers:
    middle = (starts[1:] + starts[:-1]) // 2
    return np.searchsorted(middle, offset).astype(np.int64)


def _restarts(vehicle: Integers, clock: Integers) -> Integers:
    """Return a period number per row: a new one begins where the numbers of newly seen vehicles fall back.

    Numbers are given in order of appearance, so within one period they only grow (about).
    """
    rows = pd.DataFrame({"vehicle": vehicle, "clock": clock}).sort_values(["vehicle", "clock"], kind="stable")
    away = rows.groupby("vehicle")["clock"].diff().fillna(np.inf) > SAME_PERIOD_MS
    rows["visit"] = away.cumsum()
    visits = rows.groupby("visit").agg(vehicle=("vehicle", "first"), clock=("clock", "min"))
    visits = visits.sort_values("clock", kind="stable")
    codes, code, highest = [], 0, 0
    for number in visits["vehicle"]:
        if highest > 2 * number + 100:
            code, highest = code + 1, 0
        highest = max(highest, int(number))
        codes.append(code)
    code_of_visit = pd.Series(codes, index=visits.index)
    return np.asarray(rows["visit"].map(code_of_visit).sort_index(), dtype=np.int64)


def _labelled(codes: Integers, starts: Integers) -> pd.Categorical[str]:
    labels: list[str] = []
    for index, start in enumerate(starts):
        label = _label(int(start), index)
        labels.append(f"{label}-{labels.count(label) + 1}" if label in labels else label)
    return pd.Categorical.from_codes(codes, categories=pd.Index(labels))


def _label(start_ms: int, index: int) -> str:
    """Return the local clock of a start, rounded to 5 minutes, and of its end."""
    if start_ms < 10**11:  # not a date: seconds since the start of something
        return f"period-{index + 1}"
    five = 5 * 60
    rounded = five * round(start_ms / 1000 / five)
    start = datetime.fromtimestamp(rounded, UTC).astimezone(CALIFORNIA)
    return f"{start:%H%M}-{start + timedelta(minutes=PERIOD_MINUTES):%H%M}"
