"""Lanes of a road as pieces of a SUMO network, and positions told by them.

``x`` of a road with pieces is the distance along its corridor of edges as SUMO counts it: all lanes of an edge have
the same length there, whatever their shapes. Within a junction ``x`` runs evenly from one edge to the next. ``y`` is
the middle of the lane on the straightened road plus the distance to the left of the lane's own centre line.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.roads.frenet import Line, line_through

if TYPE_CHECKING:
    from idm_sumo.roads.road import Road

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
MARGIN = 1.0  # m beside a lane within which a position without a lane's name may be of it
FAR = 1e9


@dataclass(frozen=True)
class Piece:
    """A lane of a SUMO network that is part of a road.

    Attributes
    ----------
    lane : str
        SUMO's name of it.
    number : int
        Lane of the road, 1 leftmost.
    start, end : float
        ``x`` of its ends (m).
    length : float
        As SUMO counts it (m).
    shape : tuple of (float, float)
        Points of its centre line in the network's plane (m).
    internal : bool
        Whether it is within a junction, where no vehicle can depart.
    """

    lane: str
    number: int
    start: float
    end: float
    length: float
    shape: tuple[tuple[float, float], ...]
    internal: bool = False


class Located(NamedTuple):
    """Positions on a road, arrays of shape ``(rows,)``.

    Attributes
    ----------
    x : ndarray of float64
        m; NaN off the road.
    number : ndarray of int64
        Lane; 0 off the road.
    offset : ndarray of float64
        m, left of the lane's centre line.
    heading : ndarray of float64
        Direction of the lane (rad, counterclockwise from the plane's first axis).
    """

    x: Floats
    number: Integers
    offset: Floats
    heading: Floats


class Shown(NamedTuple):
    """Positions in a network's plane: ``x, y`` (m) and the lane's direction (rad), arrays of shape ``(rows,)``."""

    x: Floats
    y: Floats
    heading: Floats


@cache
def _line(piece: Piece) -> Line:
    return line_through(piece.shape)


@cache
def by_lane(road: Road) -> dict[str, Piece]:
    """Return the pieces of a road by SUMO's name of the lane."""
    return {piece.lane: piece for piece in road.pieces}


@cache
def strip_of(road: Road, number: int) -> tuple[Piece, ...]:
    """Return the pieces that make up a lane, upstream first."""
    return tuple(sorted((piece for piece in road.pieces if piece.number == number), key=lambda piece: piece.start))


def locate(
    road: Road, lanes: npt.NDArray[np.object_], position: Floats | None, x: Floats | None, y: Floats | None
) -> Located:
    """Return where on a road positions are that name their lanes.

    Parameters
    ----------
    road : Road
        With pieces.
    lanes : ndarray of str, shape (rows,)
        SUMO's lanes.
    position : ndarray, shape (rows,), optional
        Distance from the lane's start (m), as SUMO counts it.
    x, y : ndarray, shape (rows,), optional
        Position in the network's plane (m). Without it everybody is on the centre line; without ``position`` it tells
        that, too.
    """
    rows = len(lanes)
    out = Located(np.full(rows, np.nan), np.zeros(rows, dtype=np.int64), np.zeros(rows), np.zeros(rows))
    known = by_lane(road)
    codes, names = pd.factorize(lanes)
    for code, name in enumerate(names.tolist()):
        if (piece := known.get(name)) is None:
            continue
        here = np.flatnonzero(codes == code)
        line = _line(piece)
        along = None if x is None or y is None else line.project(x[here], y[here])
        if position is not None:
            share = position[here] / piece.length
        elif along is not None:
            share = along.s / line.length
        else:
            continue
        out.x[here] = piece.start + share * (piece.end - piece.start)
        out.number[here] = piece.number
        out.heading[here] = line.heading(share * line.length)
        if along is not None:
            out.offset[here] = along.offset
    return out


def nearest(road: Road, x: Floats, y: Floats) -> Located:
    """Return where on a road positions are that do not name their lanes: on the lane whose centre line is nearest.

    Parameters
    ----------
    road : Road
        With pieces.
    x, y : ndarray, shape (rows,)
        m, in the network's plane.
    """
    rows = len(x)
    away = np.full(rows, FAR)
    out = Located(np.full(rows, np.nan), np.zeros(rows, dtype=np.int64), np.zeros(rows), np.zeros(rows))
    for piece in sorted(road.pieces, key=lambda piece: piece.internal):  # an edge before a junction's lane
        line = _line(piece)
        along = line.project(x, y)
        inside = (along.s >= -1e-6) & (along.s <= line.length + 1e-6)
        near = np.abs(along.offset) <= 0.5 * float(road.lane_width(piece.number)) + MARGIN
        better = inside & near & (np.abs(along.offset) < away - 1e-6)
        share = along.s[better] / line.length
        away[better], out.number[better] = np.abs(along.offset[better]), piece.number
        out.x[better] = piece.start + share * (piece.end - piece.start)
        out.offset[better], out.heading[better] = along.offset[better], line.heading(along.s[better])
    return out


def shown(road: Road, x: npt.ArrayLike, y: npt.ArrayLike) -> Shown:
    """Return where positions on the straightened road are in the network's plane.

    Parameters
    ----------
    road : Road
        With pieces.
    x, y : array_like, shape (rows,)
        m; ``x`` beyond the ends of a lane is put on its end.
    """
    x, y = (np.asarray(values, dtype=np.float64) for values in (x, y))
    number = road.lane_of(x, y)
    plane, heading = np.full((len(x), 2), np.nan), np.zeros(len(x))
    for lane in np.unique(number).tolist():
        pieces = strip_of(road, lane)
        if not pieces:
            continue
        here = np.flatnonzero(number == lane)
        starts = np.array([piece.start for piece in pieces])
        which = np.maximum(np.searchsorted(starts, x[here], side="right") - 1, 0)
        offset = y[here] - float(road.lane_center(lane))
        for place in np.unique(which).tolist():
            piece, some = pieces[place], which == place
            share = np.clip((x[here][some] - piece.start) / (piece.end - piece.start), 0.0, 1.0)
            line = _line(piece)
            plane[here[some]] = line.at(share * line.length, offset[some])
            heading[here[some]] = line.heading(share * line.length)
    return Shown(plane[:, 0], plane[:, 1], heading)
