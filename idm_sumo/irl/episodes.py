"""Windows of recorded drivers and traffic, for compiled kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.irl.ground import Ground
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Surroundings(NamedTuple):
    """Recorded vehicles of one or more periods, as sorted cells.

    See :class:`idm_sumo.scenes.traffic.Traffic` for the cells.

    Attributes
    ----------
    offsets : int64, shape (cells + 1,)
        First row of each cell.
    front : float64, shape (rows,)
        Front bumper (m), sorted within a cell.
    x, y : float64, shape (rows,)
        Middle of the vehicle (m).
    heading, speed, length, width : float64, shape (rows,)
        rad, m/s, m, m.
    vehicle : int64, shape (rows,)
        Vehicle number.
    reach : float
        Length of the longest vehicle (m).
    ground : Ground
        The road they drive on.
    """

    offsets: Integers
    front: Floats
    x: Floats
    y: Floats
    heading: Floats
    speed: Floats
    length: Floats
    width: Floats
    vehicle: Integers
    reach: float
    ground: Ground


class Episodes(NamedTuple):
    """Starts of simulations, one row a window.

    Attributes
    ----------
    start : float64, shape (windows, 4)
        Front bumper ``x, y`` (m), heading (rad) and speed (m/s) of the recorded vehicle.
    length, width : float64, shape (windows,)
        Size of the vehicle (m).
    cell : int64, shape (windows,)
        Cell of the leftmost lane at the start.
    stride : int64, shape (windows,)
        Distance between the cells of adjacent lanes at the same frame.
    lanes : int64, shape (windows,)
        Number of lanes with traffic; 1 where only the recorded vehicle's leader is known.
    own : int64, shape (windows,)
        Number of the recorded vehicle, which is taken out of the traffic.
    """

    start: Floats
    length: Floats
    width: Floats
    cell: Integers
    stride: Integers
    lanes: Integers
    own: Integers

    def rows(self, which: Integers) -> Episodes:
        """Return some of the windows.

        Parameters
        ----------
        which : int64 array
            Rows to keep.

        Returns
        -------
        Episodes
            Those windows.
        """
        columns: list[Any] = [np.ascontiguousarray(column[which]) for column in self]
        return Episodes(*columns)


def episodes_of(scenes: Sequence[Scenes]) -> tuple[Episodes, Surroundings]:
    """Concatenate the windows and the traffic of several periods.

    Parameters
    ----------
    scenes : sequence of Scenes
        One for each period.

    Returns
    -------
    episodes : Episodes
        All windows in their order.
    around : Surroundings
        All traffic.
    """
    cells = np.cumsum([0] + [len(s.traffic.offsets) - 1 for s in scenes])
    episodes = [_episodes(s, shift) for s, shift in zip(scenes, cells, strict=False)]
    whole = Episodes(*(np.concatenate(columns) for columns in zip(*episodes, strict=True)))
    return whole, _surroundings(scenes)


def _episodes(scenes: Scenes, shift: int) -> Episodes:
    n, first = len(scenes), scenes.start
    on_lanes = scenes.leader_source == LEADER_FROM_LANE
    cell = scenes.cells(1, first) if on_lanes else scenes.cell + first
    start = np.stack([getattr(scenes, name)[:, first] for name in ("x", "y", "heading", "speed")], axis=1)
    return Episodes(
        start, scenes.length, scenes.width, cell + shift, np.full(n, scenes.traffic.frames),
        np.full(n, scenes.road.main_lanes if on_lanes else 1), scenes.vehicle,
    )  # fmt: skip


def _surroundings(scenes: Sequence[Scenes]) -> Surroundings:
    """Concatenate the traffic of several periods."""
    traffic = [s.traffic for s in scenes]
    rows = np.cumsum([0] + [len(t.x) for t in traffic])
    offsets = [t.offsets[:-1] + shift for t, shift in zip(traffic, rows, strict=False)]
    front, y, heading, speed, length, width, vehicle = (
        np.concatenate([getattr(t, name) for t in traffic])
        for name in ("x", "y", "heading", "speed", "length", "width", "vehicle")
    )
    return Surroundings(
        np.concatenate([*offsets, rows[-1:]]), front, front - 0.5 * length * np.cos(heading),
        y - 0.5 * length * np.sin(heading), heading, speed, length, width, vehicle, float(length.max(initial=0.0)),
        Ground.of(scenes[0].road),
    )  # fmt: skip
