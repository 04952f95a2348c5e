"""Recorded vehicles by lane and frame, sorted by position."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording

NOBODY = -1  # a row that does not exist: nobody ahead


@dataclass(frozen=True)
class Traffic:
    """Recorded vehicles, as sorted cells.

    A *cell* is one lane at one frame of one period; the cells of a lane follow each other frame by frame,
    so the next frame's cell is the next number. The lanes of one period follow those of another.
    The rows of cell ``i`` are ``offsets[i]:offsets[i + 1]``, sorted by ``x``.

    Attributes
    ----------
    offsets : int64, shape (cells + 1,)
    x, y, heading, speed, length, width : float64, shape (rows,)
        Front bumper (m), rad, m/s, m, m. Unknown sizes are those that the road assumes.
    vehicle : int64, shape (rows,)
        Vehicle numbers, 0 for a leader that is known by its headway only.
    first_frame : int
        The frame of every lane's first cell.
    frames : int
        Cells per lane of a period.
    raw_x : float64, shape (rows,), or None
        Front bumper before smoothing (m); None where nothing was smoothed.
    """

    offsets: npt.NDArray[np.int64]
    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    heading: npt.NDArray[np.float64]
    speed: npt.NDArray[np.float64]
    length: npt.NDArray[np.float64]
    width: npt.NDArray[np.float64]
    vehicle: npt.NDArray[np.int64]
    first_frame: int
    frames: int
    raw_x: npt.NDArray[np.float64] | None = None

    def _columns(self, which: slice | npt.NDArray[np.bool_]) -> dict[str, Any]:
        raw = () if self.raw_x is None else ("raw_x",)
        names = ("x", "y", "heading", "speed", "length", "width", "vehicle", *raw)
        return {name: getattr(self, name)[which] for name in names}

    def part(self, first: int, last: int) -> Traffic:
        """Return some of the cells, numbered from 0.

        Parameters
        ----------
        first, last : int
            The first cell, and the one after the last.

        Returns
        -------
        Traffic
        """
        rows = slice(int(self.offsets[first]), int(self.offsets[last]))
        return replace(self, offsets=self.offsets[first : last + 1] - rows.start, **self._columns(rows))

    def without(self, vehicles: npt.ArrayLike) -> Traffic:
        """Return the traffic without some of its vehicles.

        It is as if they had not been recorded.

        Parameters
        ----------
        vehicles : array_like of int
            Their numbers, in every period.

        Returns
        -------
        Traffic
        """
        keep = ~np.isin(self.vehicle, vehicles)
        return replace(self, offsets=np.append(0, np.cumsum(keep))[self.offsets], **self._columns(keep))

    def cell(self, lane: npt.ArrayLike, frame: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Return cells of the first period.

        Parameters
        ----------
        lane : array_like of int
            Main lanes, numbered from 1.
        frame : array_like of int
            Frames, as the recording numbers them.

        Returns
        -------
        int64, shape of the arguments together
        """
        lanes, frames = np.asarray(lane, dtype=np.int64), np.asarray(frame, dtype=np.int64)
        return (lanes - 1) * self.frames + frames - self.first_frame


def build_traffic(recording: Recording) -> Traffic:
    """Sort a recording into cells of the main lanes.

    The lane of a vehicle is the one its front bumper's centre lies in: the definition that
    SUMO applies to a vehicle moved to ``x, y``, and one that needs no lane labels.

    Parameters
    ----------
    recording : Recording
        Of one or several periods, which are kept apart.

    Returns
    -------
    Traffic
    """
    table, road = recording.table, recording.road
    frame = table[c.FRAME].to_numpy()
    first, frames = int(frame.min()), int(frame.max() - frame.min() + 1)
    period, periods = period_numbers(table)
    cell = (period * road.main_lanes + road.lane_at(table[c.Y]) - 1) * frames + frame - first
    columns = {name: table[name].to_numpy(np.float64) for name in (c.X, c.Y, c.HEADING, c.SPEED)}
    if c.RAW_X in table:
        columns[c.RAW_X] = table[c.RAW_X].to_numpy()
    columns[c.LENGTH] = table[c.LENGTH].fillna(road.car_length).to_numpy()
    columns[c.WIDTH] = table[c.WIDTH].fillna(road.car_width).to_numpy()
    vehicle = table[c.VEHICLE].to_numpy()
    return sort_into_cells(cell, periods * road.main_lanes * frames, columns, vehicle, first, frames)


def period_numbers(table: pd.DataFrame) -> tuple[npt.NDArray[np.int64], int]:
    """Return the numbered periods of a table's rows.

    Parameters
    ----------
    table : pandas.DataFrame
        Rows with a ``period``.

    Returns
    -------
    number : int64, shape (rows,)
        From 0, in the order of the rows.
    periods : int
        How many there are.
    """
    number, labels = pd.factorize(table[c.PERIOD])
    return number.astype(np.int64), len(labels)


def sort_into_cells(
    cell: npt.NDArray[np.int64],
    cells: int,
    columns: dict[str, npt.NDArray[np.float64]],
    vehicle: npt.NDArray[np.int64],
    first_frame: int,
    frames: int,
) -> Traffic:
    """Sort rows by cell, then position.

    Parameters
    ----------
    cell : int64, shape (rows,)
    cells : int
        How many cells there are, empty ones included.
    columns : dict of float64 arrays, shape (rows,)
        ``x, y, heading, speed, length, width`` by name (m, rad, m/s), and ``raw_x`` if there is one.
    vehicle : int64, shape (rows,)
    first_frame : int
        The frame of every lane's first cell.
    frames : int
        Cells per lane of a period.

    Returns
    -------
    Traffic
    """
    order = np.lexsort((columns[c.X], cell))
    offsets = np.zeros(cells + 1, dtype=np.int64)
    np.cumsum(np.bincount(cell, minlength=cells), out=offsets[1:])
    sorted_columns = {name: np.ascontiguousarray(values[order]) for name, values in columns.items()}
    return Traffic(offsets=offsets, vehicle=vehicle[order], first_frame=first_frame, frames=frames, **sorted_columns)


@njit(cache=True)
def first_ahead(offsets: npt.NDArray[np.int64], x: npt.NDArray[np.float64], cell: int, front: float) -> int:
    """Return a cell's first row ahead of ``front``.

    Parameters
    ----------
    offsets : int64, shape (cells + 1,)
    x : float64, shape (rows,)
        Front bumpers (m), sorted within each cell.
    cell : int
    front : float
        m.

    Returns
    -------
    int
        The cell's end if nobody is ahead.
    """
    low, high = offsets[cell], offsets[cell + 1]
    while low < high:
        middle = (low + high) >> 1
        if x[middle] > front:
            high = middle
        else:
            low = middle + 1
    return int(low)


@njit(cache=True)
def leader_row(
    offsets: npt.NDArray[np.int64],
    x: npt.NDArray[np.float64],
    vehicle: npt.NDArray[np.int64],
    cell: int,
    front: float,
    own: int,
) -> int:
    """Return the row of the leader of one vehicle.

    Parameters
    ----------
    offsets : int64, shape (cells + 1,)
    x : float64, shape (rows,)
        Front bumpers (m), sorted within each cell.
    vehicle : int64, shape (rows,)
    cell : int
    front : float
        Front bumper of the vehicle (m).
    own : int
        Number of the modelled vehicle. Its recorded vehicle is passed over.

    Returns
    -------
    int
        First row of the cell ahead of ``front``, or ``NOBODY``.
    """
    row: int = first_ahead(offsets, x, cell, front)
    end = offsets[cell + 1]
    while row < end and vehicle[row] == own:
        row += 1
    return row if row < end else NOBODY
