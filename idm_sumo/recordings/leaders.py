"""Who drives ahead of whom, from the rows of a recording."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c

HEADWAY_TOLERANCE = 0.15  # m, between a front rebuilt from a headway and a recorded one

Integers = npt.NDArray[np.int64]


def frame_code(table: pd.DataFrame) -> Integers:
    """Return one number per row, the same for all rows of one frame of one period; shape ``(rows,)``."""
    period = np.asarray(table[c.PERIOD].cat.codes, dtype=np.int64)
    return (period << 40) + np.asarray(table[c.FRAME], dtype=np.int64)


def row_ahead(table: pd.DataFrame) -> Integers:
    """Return for each row the position of the row next ahead in the same lane and frame, or -1; shape ``(rows,)``."""
    code, lane, x = frame_code(table), table[c.LANE].to_numpy(), table[c.X].to_numpy()
    order = np.lexsort((x, lane, code))
    same = (np.diff(code[order]) == 0) & (np.diff(lane[order]) == 0)
    ahead = np.full(len(table), -1, dtype=np.int64)
    ahead[order[:-1][same]] = order[1:][same]
    return ahead


def row_of(table: pd.DataFrame, vehicle: Integers) -> Integers:
    """Return for each row the position of the row of another vehicle in the same frame, or -1.

    Parameters
    ----------
    table : pandas.DataFrame
        A recording's table.
    vehicle : numpy.ndarray, shape (rows,)
        The vehicle sought for each row; 0 finds none.
    """
    here = pd.MultiIndex.from_arrays([frame_code(table), table[c.VEHICLE].to_numpy(dtype=np.int64)])
    found = np.full(len(table), -1, dtype=np.int64)
    sought = np.flatnonzero(vehicle)
    wanted = pd.MultiIndex.from_arrays([frame_code(table)[sought], vehicle[sought]])
    found[sought] = here.get_indexer(wanted)
    return found


def leader_from_headway(table: pd.DataFrame, *, across: float) -> Integers:
    """Return the number of the vehicle whose front is where the recorded headway puts the leader's, or 0.

    Parameters
    ----------
    table : pandas.DataFrame
        A recording's table.
    across : float, keyword-only
        How far (m) a candidate may be to the side, beside :data:`HEADWAY_TOLERANCE` along the road.
    """
    code, x = frame_code(table), table[c.X].to_numpy()
    y, headway = table[c.Y].to_numpy(), table[c.HEADWAY].to_numpy()
    _, dense = np.unique(code, return_inverse=True)
    stride = 10_000.0  # m between frames on one axis: longer than any section
    place = dense * stride + x
    order = np.argsort(place, kind="stable")
    leader = np.zeros(len(table), dtype=np.int64)
    rows = np.flatnonzero(np.isfinite(headway))
    target = place[rows] + headway[rows]
    first = np.searchsorted(place[order], target - HEADWAY_TOLERANCE)
    for step in range(3):  # at most a few cars abreast fit the tolerance
        candidate = order[np.minimum(first + step, len(order) - 1)]
        near = np.abs(place[candidate] - target) <= HEADWAY_TOLERANCE
        beside = np.abs(y[candidate] - y[rows]) <= across
        hit = near & beside & (leader[rows] == 0) & (candidate != rows)
        leader[rows[hit]] = table[c.VEHICLE].to_numpy()[candidate[hit]]
    return leader
