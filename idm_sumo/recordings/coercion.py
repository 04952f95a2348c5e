"""What a cell may hold: one rule for the numbers of every reader.

A key that is no whole number is refused, because its row could be anyone's. A measurement that is
absent costs its row, and one beyond physics as well; the ledger says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Ledger
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError, shown

LARGEST = 2**53 - 1  # the largest whole number that every layout can hold exactly
FRAMES = 2**39  # frame numbers lie within plus and minus this: 1,700 years
EARTH = 1e7  # m; no coordinate of a road is farther from its origin
HIGHEST_SPEED = 70.0  # m/s; nothing recorded on a motorway is faster
STRONGEST = 1000.0  # m/s^2: from 70 m/s to rest within a frame is 700
LATEST = 1e10  # s, the year 2286
LONGEST = (0.0, 40.0)  # m, of a vehicle
WIDEST = (0.0, 5.0)  # m, of a vehicle
FARTHEST_LEADER = 10_000.0  # m
IMPOSSIBLE_SHARE = 0.01  # more impossible values than this are a wrong unit or column, not noise

BOUNDS: Mapping[str, tuple[float, float]] = {
    c.TIME: (-LATEST, LATEST), c.X: (-EARTH, EARTH), c.Y: (-EARTH, EARTH), c.ACCELERATION: (-STRONGEST, STRONGEST),
    c.HEADING: (-7.0, 7.0),
}  # fmt: skip
IMPOSSIBLE = "impossible time, position or acceleration"

Floats = npt.NDArray[np.float64]


def numbers(values: pd.Series, name: str, source: object) -> Floats:
    """Return the cells of a column as floats, NaN where there is none; shape ``(rows,)``.

    Parameters
    ----------
    values : pandas.Series
        Numbers, decimals, or texts of numbers, with thousands apart by commas or not.
    name, source : str
        What messages call column and file.

    Raises
    ------
    InputError
        If a cell is no number; names its row, counted from 1.
    """
    if pd.api.types.is_numeric_dtype(values) and not pd.api.types.is_bool_dtype(values):
        return np.asarray(values.to_numpy(dtype="float64", na_value=np.nan))
    return np.array([_number(cell, row, name, source) for row, cell in enumerate(values.tolist(), 1)], dtype=np.float64)


def _number(cell: Any, row: int, name: str, source: object) -> float:
    if cell is None or cell is pd.NA or cell is pd.NaT:
        return np.nan
    if isinstance(cell, str):
        cell = cell.strip().replace(",", "")
        if not cell:
            return np.nan
    try:
        if isinstance(cell, bool | np.bool_ | bytes):
            raise TypeError
        return float(cell)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{source}: row {row}, column {name}: {shown(cell)} is not a number") from None


def whole(
    values: pd.Series | npt.NDArray[Any],
    name: str,
    source: object,
    *,
    low: int = -LARGEST,
    high: int = LARGEST,
    missing: int | None = None,
) -> npt.NDArray[np.int64]:
    """Return a column of whole numbers, shape ``(rows,)``.

    Parameters
    ----------
    values : pandas.Series
    name, source : str
        What messages call column and file.
    low, high : int, keyword-only
        Bounds, included.
    missing : int, keyword-only
        What stands for a cell without a number; by default there must be none.

    Raises
    ------
    InputError
        If a cell is no whole number within the bounds; names its row, counted from 1.
    """
    series = pd.Series(values)
    exact = series.dtype.kind in "iu"
    cells: npt.NDArray[Any] = series.to_numpy() if exact else numbers(series, name, source)
    if missing is not None and not exact:
        cells = np.where(np.isnan(cells), missing, cells)
    with np.errstate(invalid="ignore"):
        bad = (
            (cells < low) | (cells > high) if exact else ~((cells >= low) & (cells <= high) & (cells == np.rint(cells)))
        )
    if bad.any():
        row = int(bad.argmax())
        raise InputError(
            f"{source}: row {row + 1}, column {name}: {shown(series.iloc[row])} is impossible; "
            f"give a whole number from {low} to {high}"
        )
    return cells.astype(np.int64)


def drop_impossible(table: pd.DataFrame, ledger: Ledger, road: Road, source: str) -> pd.DataFrame:
    """Drop the rows of a table in SI units whose time, position or motion is beyond physics.

    Raises
    ------
    InputError
        If more than one and :data:`IMPOSSIBLE_SHARE` of the rows are: that is a wrong unit or column.
    """
    moving = ~table[c.SPEED].between(0, HIGHEST_SPEED) | ~table[c.LANE].between(1, road.last_lane)
    beyond = np.zeros(len(table), dtype=bool)
    for name, (low, high) in BOUNDS.items():
        beyond |= ~table[name].between(low, high).to_numpy()
    for bad in (moving.to_numpy(), beyond):
        if bad.sum() > max(1, IMPOSSIBLE_SHARE * len(table)):
            row = table[bad].iloc[0]
            raise InputError(
                f"{source}: {bad.sum()} of {len(table)} rows are impossible, first vehicle {row[c.VEHICLE]}, frame "
                f"{row[c.FRAME]}: {_values(row)}; check units and columns"
            )
    table = ledger.drop(table, moving, "impossible speed or lane")
    return ledger.drop(table, beyond[~moving.to_numpy()], IMPOSSIBLE)


def _values(row: pd.Series) -> str:
    values = f"speed {row[c.SPEED]:.1f} m/s, lane {row[c.LANE]}"
    wrong = [f"{name} {row[name]:g}" for name, (low, high) in BOUNDS.items() if not low <= row[name] <= high]
    return ", ".join([values, *wrong])


def sizes(values: Floats, name: str, bounds: tuple[float, float], notes: list[str]) -> Floats:
    """Return sizes (m), NaN where there is none or no vehicle has it; counts of the latter go to the notes."""
    low, high = bounds
    with np.errstate(invalid="ignore"):
        good = (values > low) & (values <= high)
    wrong = int((~good & ~np.isnan(values)).sum())
    if wrong:
        notes.append(
            f"{wrong} of {len(values)} rows have a {name} that no vehicle has (0 or less, or above "
            f"{high:g} m); they count as not recorded"
        )
    return np.where(good, values, np.nan)
