"""The US-101 network: where it is, its routes, and recorded places as SUMO places.

SUMO's coordinates are the recording's (``network/us101.nod.xml``), so ``x`` and ``y`` need no
conversion; what this module adds is which edge, lane and position along it they belong to.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.roads.road import AUXILIARY_LANE, OFF_RAMP_LANE, ON_RAMP_LANE
from idm_sumo.runtime.errors import InputError

MAINLINE = ("upstream", "entry", "weave", "exit", "downstream", "outflow")
WEAVE = MAINLINE.index("weave")  # the edge that has the auxiliary lane
ON_RAMP = "on_ramp"
OFF_RAMP = "off_ramp"
ORIGINS = ("upstream", ON_RAMP)
DESTINATIONS = ("outflow", OFF_RAMP)


class Place(NamedTuple):
    """Where vehicles are in SUMO's terms, arrays of one shape.

    Attributes
    ----------
    edge : ndarray of str
    lane_index : ndarray of int
        Counted from the right, 0 first, as SUMO does.
    position : ndarray of float
        Distance (m) from the start of the lane.
    """

    edge: npt.NDArray[np.str_]
    lane_index: npt.NDArray[np.int64]
    position: npt.NDArray[np.float64]


def net_file() -> Path:
    """Return the built network: below the package in a wheel, beside it in a clone.

    Raises
    ------
    InputError
        If it is in neither place.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package, package.parent):
        if (path := folder / "network" / "us101.net.xml").is_file():
            return path
    raise InputError("network/us101.net.xml is missing: build it with `python network/build.py`")


@cache
def load() -> Any:
    """Return the network as a :class:`sumolib.net.Net`, read once."""
    from sumolib.net import readNet

    return readNet(str(net_file()), withInternal=False)


@cache
def mainline_ends() -> tuple[float, ...]:
    """Return the ``x`` (m) at which each edge of the main road ends, in the order of `MAINLINE`."""
    return tuple(float(load().getEdge(name).getShape()[-1][0]) for name in MAINLINE)


@cache
def route(origin: str, destination: str) -> tuple[str, ...]:
    """Return the edges from one of `ORIGINS` to one of `DESTINATIONS`, both included.

    Raises
    ------
    InputError
        If an edge does not exist or there is no way.
    """
    net = load()
    for name in (origin, destination):
        if not net.hasEdge(name):
            raise InputError(f"no edge {name!r} in {net_file().name}; routes go from {ORIGINS} to {DESTINATIONS}")
    path, _ = net.getShortestPath(net.getEdge(origin), net.getEdge(destination))
    if not path:
        raise InputError(f"no way from {origin!r} to {destination!r}; routes go from {ORIGINS} to {DESTINATIONS}")
    return tuple(edge.getID() for edge in path)


def place(x: npt.ArrayLike, lane: npt.ArrayLike) -> Place:
    """Return edge, lane and position of recorded places.

    Parameters
    ----------
    x : array_like
        Distance (m) downstream of the section's start.
    lane : array_like of int
        Recorded lane, 1 leftmost to 8. Lanes 6, 7 and 8 are one strip: on-ramp, auxiliary
        lane or off-ramp according to ``x``.

    Raises
    ------
    InputError
        If a place is outside the network.
    """
    x, lane = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(lane, dtype=np.int64))
    starts = np.array([_line(edge, 0)[0, 0] for edge in MAINLINE])
    segment = np.searchsorted(starts, x, side="right") - 1
    edge = np.array(MAINLINE)[np.maximum(segment, 0)]
    right = lane >= AUXILIARY_LANE
    edge = np.where(right & (segment < WEAVE), ON_RAMP, np.where(right & (segment > WEAVE), OFF_RAMP, edge))
    index = np.where(right, 0, [_lane_count(str(name)) for name in edge.ravel()] - lane.ravel()).reshape(lane.shape)
    position = np.full(x.shape, np.nan)
    for name in np.unique(edge):
        line = _line(str(name), 0)  # all lanes of an edge begin and end at the same x
        here = edge == name
        position[here] = np.interp(x[here], line[:, 0], line[:, 2], left=np.nan, right=np.nan)
    if (outside := np.isnan(position) | (lane < 1) | (lane > OFF_RAMP_LANE)).any():
        where = f"x = {x[outside].flat[0]:g} m, lane {lane[outside].flat[0]}"
        raise InputError(
            f"{where} is outside the network; check units (metres) and lane numbers (1 to {OFF_RAMP_LANE})"
        )
    return Place(edge, index, position)


def coordinates(where: Place) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return ``x``, ``y`` (m, lane centre) and recorded lane of places; the inverse of :func:`place`."""
    edge, index, position = np.broadcast_arrays(*where)
    x, y, lane = np.empty(edge.shape), np.empty(edge.shape), np.empty(edge.shape, dtype=np.int64)
    for name in np.unique(edge):
        for number in np.unique(index[edge == name]):
            here = (edge == name) & (index == number)
            line = _line(str(name), int(number))
            x[here] = np.interp(position[here], line[:, 2], line[:, 0])
            y[here] = np.interp(position[here], line[:, 2], line[:, 1])
            lane[here] = recorded_lane(str(name), int(number))
    return x, y, lane


def recorded_lane(edge: str, lane_index: int) -> int:
    """Return the number NGSIM gives to a SUMO lane: 1 leftmost to 5, 6 auxiliary, 7 and 8 ramps."""
    if edge == ON_RAMP:
        return ON_RAMP_LANE
    return OFF_RAMP_LANE if edge == OFF_RAMP else _lane_count(edge) - lane_index


@cache
def _lane_count(edge: str) -> int:
    """Return how many lanes count from the left; 6 on a ramp, which lies in lane 6's line."""
    return AUXILIARY_LANE if edge in (ON_RAMP, OFF_RAMP) else int(load().getEdge(edge).getLaneNumber())


@cache
def _line(edge: str, lane_index: int) -> npt.NDArray[np.float64]:
    """Return the middle of a lane: x (increasing), y and distance from its start, one point a row (m)."""
    points = np.array(load().getEdge(edge).getLane(lane_index).getShape(), dtype=np.float64)[:, :2]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return np.column_stack([points, along])
