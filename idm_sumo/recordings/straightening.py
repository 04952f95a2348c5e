"""Positions on a plan of a bent road, told along the way of one of its vehicles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from idm_sumo.roads.frenet import Along, line_through

POINTS_APART = 10.0  # m; a nearer bend is a camera's noise
STRAIGHT = 0.2  # m from the chord that noise explains: the road is straight

Floats = npt.NDArray[np.float64]


def along_longest(x: Floats, y: Floats, vehicle: npt.NDArray[np.int64], time: Floats) -> Along:
    """Return positions along and beside the way of the vehicle that was recorded farthest.

    Parameters
    ----------
    x, y : ndarray, shape (rows,)
        m, in a plane.
    vehicle : ndarray of int, shape (rows,)
    time : ndarray, shape (rows,)
        s.
    """
    order = np.lexsort((time, vehicle))
    first = np.flatnonzero(np.concatenate([[True], np.diff(vehicle[order]) != 0]))
    last = np.append(first[1:], len(order)) - 1
    ends = np.hypot(x[order][last] - x[order][first], y[order][last] - y[order][first])
    longest = int(np.argmax(ends))
    rows = order[first[longest] : last[longest] + 1]
    way = np.column_stack([x[rows], y[rows]])
    chord = way[[0, -1]]
    direction = (chord[1] - chord[0]) / max(float(ends[longest]), 1e-9)
    beside = (way - chord[0]) @ np.array([-direction[1], direction[0]])
    if float(np.abs(beside).max()) < STRAIGHT:
        return line_through(chord).project(x, y) if ends[longest] > 0 else Along(np.zeros(len(x)), np.zeros(len(x)))
    return line_through(way, apart=POINTS_APART).project(x, y)
