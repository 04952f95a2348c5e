"""A road from any SUMO network.

A corridor of edges, its lanes numbered from the left, its ramps beside them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from idm_sumo.roads import Road, SideLane
from idm_sumo.roads.pieces import Piece
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.corridor import carries_cars, edges_between, only_road, plain_edges
from idm_sumo.sumo.net_check import read_net


class _Part(NamedTuple):
    """An edge of the corridor.

    Where it begins (m), and the number of its leftmost lane before renumbering.
    """

    edge: Any
    start: float
    shift: int

    @property
    def end(self) -> float:
        return self.start + float(self.edge.getLength())

    @property
    def numbers(self) -> range:
        return range(self.shift, self.shift + int(self.edge.getLaneNumber()))

    def lane(self, number: int) -> Any:
        """Return the lane of a number."""
        return self.edge.getLane(int(self.edge.getLaneNumber()) - 1 - (number - self.shift))


def road_of(path: Path | str, corridor: Sequence[str] = ()) -> Road:
    """Return the road that edges of a network make up.

    Parameters
    ----------
    path : path-like
        A ``.net.xml``, plain or gzip.
    corridor : sequence of str
        Edges in driving order; edges between two of them are found. By default the whole network, where it is one road
        with ramps.

    Returns
    -------
    Road
        ``x`` begins where the first edge does. Lanes that are there on every edge are its main lanes; the others,
        and the edges of ramps, are side lanes.

    Raises
    ------
    InputError
        If it is no network, an edge is absent, there is no way along the corridor, or no lane goes all along.
    """
    net = read_net(Path(path), internal=True)
    if not plain_edges(net):
        raise InputError(f"{path}: has no edge that cars drive on; is it a network that netconvert made?")
    try:
        return _road(net, path, corridor)
    except InputError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:  # names that nothing bears
        raise InputError(
            f"{path}: not a sound SUMO network ({type(error).__name__}: {error}); build it again with netconvert"
        ) from None


def _road(net: Any, path: Path | str, corridor: Sequence[str]) -> Road:
    edges = edges_between(net, path, corridor) if corridor else only_road(net, path)
    parts = _parts(net, edges, path)
    common = set(parts[0].numbers).intersection(*(part.numbers for part in parts))
    if not common:
        raise InputError(f"{path}: no lane goes all along {', '.join(edge.getID() for edge in edges)[:200]}")
    main = sorted(common)
    renumbered = {number: place for place, number in enumerate(main, 1)}
    widths = tuple(float(_widest(parts, number)) for number in main)
    side, pieces = _beside(net, parts, renumbered)
    ramps, more = _ramps(net, parts, len(main) + len(side))
    pieces += [piece for number in main for piece in _strip(net, parts, number, renumbered[number])] + more
    last = parts[-1].end
    return Road(
        name=Path(path).name.removesuffix(".gz").removesuffix(".net.xml"), widths=widths, length=last,
        speed_limit=max(float(part.lane(number).getSpeed()) for part in parts for number in main),
        side_lanes=(*side, *ramps), network=str(Path(path).resolve()), edges=tuple(edge.getID() for edge in edges),
        reach=(0.0, last), pieces=tuple(pieces),
        has_signals=any(edge.getToNode().getType() == "traffic_light" for edge in edges[:-1]),
    )  # fmt: skip


def _parts(net: Any, edges: Sequence[Any], path: Path | str) -> list[_Part]:
    """Return the edges with their starts and lanes.

    Lanes keep their numbers along connections.
    """
    parts = [_Part(edges[0], 0.0, 0)]
    for one, following in pairwise(edges):
        links = [link for link in one.getConnections(following) if link.getFromLane().allows("passenger")]
        if not links:
            raise InputError(f"{path}: no connection from edge {one.getID()!r} to {following.getID()!r}")
        before = parts[-1]
        shifts = Counter(
            before.shift + (int(one.getLaneNumber()) - link.getFromLane().getIndex())
            - (int(following.getLaneNumber()) - link.getToLane().getIndex()) for link in links
        )  # fmt: skip
        inside = min((_inside(net, link) for link in links), default=0.0)
        parts.append(_Part(following, before.end + inside, shifts.most_common(1)[0][0]))
    return parts


def _inside(net: Any, link: Any) -> float:
    """Return how long a connection is within its junction (m)."""
    lanes = _via(net, link)
    return sum(float(lane.getLength()) for lane in lanes)


def _via(net: Any, link: Any) -> list[Any]:
    """Return the lanes of a connection within its junction."""
    found, name = [], link.getViaLaneID()
    while name:
        lane = net.getLane(name)
        if lane in found:
            raise ValueError(f"the way through a junction comes back to lane {name!r}")
        found.append(lane)
        onward = [one for one in lane.getOutgoing() if one.getViaLaneID() or one.getToLane()]
        name = onward[0].getViaLaneID() if onward else ""
    return found


def _widest(parts: Sequence[_Part], number: int) -> float:
    return max(float(part.lane(number).getWidth()) for part in parts)


def _strip(net: Any, parts: Sequence[_Part], number: int, renumbered: int) -> list[Piece]:
    """Return the pieces of a lane where it is there.

    With those within junctions.
    """
    pieces = []
    for place, part in enumerate(parts):
        if number not in part.numbers:
            continue
        lane = part.lane(number)
        pieces.append(_piece(lane, renumbered, part.start, part.end))
        if place + 1 < len(parts) and number in parts[place + 1].numbers:
            following = parts[place + 1]
            links = [link for link in lane.getOutgoing() if link.getToLane() == following.lane(number)]
            inner = _via(net, links[0]) if links else []
            whole = sum(float(one.getLength()) for one in inner)
            start = part.end
            for one in inner:
                end = start + float(one.getLength()) / max(whole, 1e-9) * (following.start - part.end)
                pieces.append(_piece(one, renumbered, start, end, internal=True))
                start = end
    return [piece for piece in pieces if piece.end - piece.start > 1e-6]


def _piece(lane: Any, number: int, start: float, end: float, *, internal: bool = False) -> Piece:
    shape = tuple((float(point[0]), float(point[1])) for point in lane.getShape())
    return Piece(lane.getID(), number, start, end, float(lane.getLength()), shape, internal)


def _beside(net: Any, parts: Sequence[_Part], main: dict[int, int]) -> tuple[list[SideLane], list[Piece]]:
    """Return lanes that are on some edges only.

    As auxiliary lanes, and their pieces.
    """
    lanes, pieces = [], []
    extra = sorted({number for part in parts for number in part.numbers} - set(main))
    for place, number in enumerate(extra, len(main) + 1):
        strip = _strip(net, parts, number, place)
        width = max(float(part.lane(number).getWidth()) for part in parts if number in part.numbers)
        ends = min(piece.start for piece in strip), max(piece.end for piece in strip)
        lanes.append(SideLane(place, "auxiliary", *ends, width=width))
        pieces += strip
    return lanes, pieces


def _ramps(net: Any, parts: Sequence[_Part], used: int) -> tuple[list[SideLane], list[Piece]]:
    """Return the edges beside the corridor as ramps.

    They lead onto the corridor or off it; their pieces come with them.
    """
    corridor = {part.edge.getID() for part in parts}
    lanes, pieces = [], []
    for place, part in enumerate(parts):
        joins = [] if not place else [edge for edge in part.edge.getIncoming() if edge.getID() not in corridor]
        leaves = (
            [edge for edge in part.edge.getOutgoing() if edge.getID() not in corridor] if place + 1 < len(parts) else []
        )
        for edge, kind in [(one, "on-ramp") for one in joins] + [(one, "off-ramp") for one in leaves]:
            if edge.getFunction() != "" or not carries_cars(edge):
                continue
            used += 1
            strip = _ramp(net, edge, part, kind, used)
            width = float(edge.getLane(0).getWidth())
            lanes.append(SideLane(used, kind, strip[0].start, strip[-1].end, width=width))  # type: ignore[arg-type]
            pieces += strip
    return lanes, pieces


def _ramp(net: Any, edge: Any, part: _Part, kind: str, number: int) -> list[Piece]:
    """Return a ramp's lane and its way through the junction.

    Upstream first.
    """
    joins = kind == "on-ramp"
    links = edge.getConnections(part.edge) if joins else part.edge.getConnections(edge)
    inner = _via(net, links[0]) if links else []
    own = [edge.getLane(0)]
    order = [*own, *inner] if joins else [*inner, *own]
    start = part.start - sum(float(lane.getLength()) for lane in order) if joins else part.end
    pieces = []
    for lane in order:
        end = start + float(lane.getLength())
        pieces.append(_piece(lane, number, start, end, internal=lane in inner))
        start = end
    return pieces
