"""Which edges of a SUMO network make up the road."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Any

from idm_sumo.runtime.errors import InputError, shown

SHOWN = 12  # names of edges in a message
MOST_WAYS = 1000  # through a network; a road with ramps has fewer, a town more than anybody can count


def edges_between(net: Any, path: Path | str, corridor: Sequence[str]) -> list[Any]:
    """Return the edges of a corridor and those between.

    Parameters
    ----------
    net : sumolib.net.Net
    path : path-like
        What messages call the network.
    corridor : sequence of str
        Edges in driving order.

    Raises
    ------
    InputError
        If an edge is absent, or there is no way that meets none twice.
    """
    names = sorted(edge.getID() for edge in plain_edges(net))
    for name in corridor:
        if name not in names:
            more = ", ..." if len(names) > SHOWN else ""
            raise InputError(f"{path}: has no edge {shown(name)} for cars; it has {', '.join(names[:SHOWN])}{more}")
    edges = [net.getEdge(corridor[0])]
    for one, following in pairwise(corridor):
        way, _ = net.getShortestPath(net.getEdge(one), net.getEdge(following))
        if not way:
            raise InputError(f"{path}: no way from edge {one!r} to {following!r}; give --corridor in driving order")
        edges += way[1:]
    twice = [edge.getID() for edge, count in Counter(edges).items() if count > 1]
    if twice or len(set(corridor)) < len(corridor):
        which = (twice or [name for name, count in Counter(corridor).items() if count > 1])[0]
        raise InputError(f"{path}: the corridor meets edge {which!r} twice; give --corridor in driving order")
    return edges


def only_road(net: Any, path: Path | str) -> list[Any]:
    """Return the edges of the network's one road.

    It is the way with most lane length; all others are its ramps.

    Parameters
    ----------
    net : sumolib.net.Net
    path : path-like
        What messages call the network.

    Raises
    ------
    InputError
        If it is more than one road.
    """
    edges = plain_edges(net)
    begins = (edge for edge in edges if not _neighbours(edge.getIncoming()))
    ways = list(islice(chain.from_iterable(map(_ways, begins)), MOST_WAYS))
    best = max(ways, key=_lane_length, default=[])
    off = [edge for edge in edges if edge not in best]
    nodes = {node.getID() for edge in best for node in (edge.getFromNode(), edge.getToNode())}
    loose = [edge for edge in off if {edge.getFromNode().getID(), edge.getToNode().getID()}.isdisjoint(nodes)]
    lights = any(edge.getToNode().getType() == "traffic_light" for edge in best)
    if len(ways) == MOST_WAYS or not best or loose or (lights and off) or _lane_length(best) < _lane_length(off):
        names = ", ".join(edge.getID() for edge in sorted(edges, key=lambda edge: -edge.getLength())[:SHOWN])
        raise InputError(
            f"{path}: is more than one road ({len(edges)} edges, longest {names}); name the road's with "
            "--corridor EDGE..."
        )
    return list(best)


def _ways(first: Any) -> Iterator[list[Any]]:
    """Yield ways to an end that meet no edge twice."""
    way, at_end = {first: iter(_neighbours(first.getOutgoing()))}, True
    while way:
        edge, onward = next(reversed(way.items()))
        if (one := next((one for one in onward if one not in way), None)) is not None:
            way[one], at_end = iter(_neighbours(one.getOutgoing())), True
            continue
        if at_end:
            yield list(way)
        at_end = False
        del way[edge]


def plain_edges(net: Any) -> list[Any]:
    """Return the edges outside junctions that cars drive on.

    Parameters
    ----------
    net : sumolib.net.Net
    """
    return [edge for edge in net.getEdges(withInternal=False) if edge.getFunction() == "" and carries_cars(edge)]


def carries_cars(edge: Any) -> bool:
    """Tell whether cars may drive on an edge.

    Parameters
    ----------
    edge : sumolib.net.edge.Edge
    """
    return any(lane.allows("passenger") for lane in edge.getLanes())


def _neighbours(edges: Any) -> list[Any]:
    return [edge for edge in edges if edge.getFunction() == "" and carries_cars(edge)]


def _lane_length(edges: Sequence[Any]) -> float:
    return sum(float(edge.getLength()) * int(edge.getLaneNumber()) for edge in edges)
