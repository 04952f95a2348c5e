"""A straight road from what a data set tells of its lanes: markings, or where vehicles of each lane drive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.roads.road import Road, SideLane
from idm_sumo.runtime.errors import InputError

WIDTHS = (2.5, 5.5)  # m; lanes are not narrower or wider
USUAL_WIDTH = 3.5  # m, of a lane without neighbours
FEW = 0.01  # share of rows below which a label is no lane of the main road
BEFORE, BEHIND = 300.0, 500.0  # m of a network upstream and downstream of the section
FREE = 0.98  # quantile of the speeds that is taken for a limit nobody told

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Lanes(NamedTuple):
    """Where vehicles are across a road.

    Attributes
    ----------
    number : ndarray of int64, shape (rows,)
        Lane, 1 leftmost; 0 beside the main lanes.
    offset : ndarray of float64, shape (rows,)
        m, left of the lane's middle.
    widths : tuple of float
        m, leftmost lane first.
    """

    number: Integers
    offset: Floats
    widths: tuple[float, ...]


def lanes_between(y: npt.ArrayLike, markings: Sequence[float]) -> Lanes:
    """Return the lanes of lateral positions between markings.

    Parameters
    ----------
    y : array_like, shape (rows,)
        m, to the left.
    markings : sequence of float
        m, leftmost first, two at least.
    """
    place, edges = np.asarray(y, dtype=np.float64), np.asarray(markings, dtype=np.float64)
    number = np.searchsorted(-edges, -place, side="right")
    number = np.where(number > len(edges) - 1, 0, number).astype(np.int64)
    middle = 0.5 * (edges[1:] + edges[:-1])
    offset = np.where(number > 0, place - middle[np.maximum(number, 1) - 1], 0.0)
    return Lanes(number, offset, tuple(float(width) for width in edges[:-1] - edges[1:]))


def lanes_of_labels(y: npt.ArrayLike, labels: npt.ArrayLike, source: str) -> Lanes:
    """Return the lanes of rows that name their lane by a whole number.

    Lanes lie where their vehicles drive in the median; a marking is halfway between two of them. Lanes without
    vehicles between others are where their neighbours leave room for them.

    Parameters
    ----------
    y : array_like, shape (rows,)
        m, to the left.
    labels : array_like of int, shape (rows,)
        Lane of each row in any order of numbers; less than 1 where there is none.
    source : str
        Name for messages.

    Raises
    ------
    InputError
        If no row has a lane, or lanes have no possible width.
    """
    place, label = np.asarray(y, dtype=np.float64), np.asarray(labels, dtype=np.int64)
    found, counts = np.unique(label[label > 0], return_counts=True)
    found = found[counts >= FEW * counts.sum()] if len(found) else found
    if not len(found):
        raise InputError(f"{source}: no row has a lane; give lane numbers from 1")
    middles = np.array([np.median(place[label == one]) for one in found])
    if len(found) > 1 and middles[0] < middles[-1]:  # numbered from the right
        found, middles, label = -found[::-1], middles[::-1], -label
    numbers = found - found[0] + 1
    apart = -np.diff(middles) / np.diff(numbers)
    if len(apart) and not ((apart >= WIDTHS[0]) & (apart <= WIDTHS[1])).all():
        raise InputError(
            f"{source}: the middles of neighbouring lanes are {apart.min():.2f} to {apart.max():.2f} m apart; lanes "
            f"are {WIDTHS[0]:g} to {WIDTHS[1]:g} m wide: check units and lane numbers"
        )
    every = np.interp(np.arange(1, numbers[-1] + 1), numbers, middles)
    number = np.where(np.isin(label, found), label - found[0] + 1, 0)
    offset = np.where(number > 0, place - every[np.maximum(number, 1) - 1], 0.0)
    return Lanes(number.astype(np.int64), offset, widths_of(every))


def widths_of(middles: Floats) -> tuple[float, ...]:
    """Return widths (m) of lanes whose middles (m) are known, leftmost first; markings are halfway between."""
    if len(middles) == 1:
        return (USUAL_WIDTH,)
    apart = -np.diff(middles)
    between = 0.5 * (apart[1:] + apart[:-1])
    return tuple(float(width) for width in np.concatenate([[apart[0]], between, [apart[-1]]]))


def straight_road(
    name: str, widths: Sequence[float], *, length: float, speed_limit: float, beside: bool = False
) -> Road:
    """Return a straight road.

    Parameters
    ----------
    name : str
    widths : sequence of float
        m, leftmost lane first.
    length : float
        m.
    speed_limit : float
        m/s.
    beside : bool
        Whether vehicles were recorded beside the main lanes: they get a side lane, where nobody is modelled.

    Examples
    --------
    >>> straight_road("test", (3.5, 3.5), length=400.0, speed_limit=33.3)
    <Road test: 2 lanes, 400 m>
    """
    side = (SideLane(len(widths) + 1, "auxiliary", width=widths[-1]),) if beside else ()
    length = max(length, 1.0)
    return Road(name, tuple(widths), length, speed_limit, side, reach=(-BEFORE, length + BEHIND))
