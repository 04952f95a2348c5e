"""A SUMO network of a straight road, written without netconvert."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np

from idm_sumo.roads import Road
from idm_sumo.roads.straight import BEFORE, BEHIND
from idm_sumo.runtime.cache import kept
from idm_sumo.sumo.layouts import Layout

EDGE = 100.0  # m, about: of a section's edges, by which places are told apart


def edges_of(road: Road) -> dict[str, tuple[float, float]]:
    """Return the edges of a straight road with their ends.

    Parameters
    ----------
    road : Road

    Returns
    -------
    dict of str to (float, float)
        ``x`` (m), in driving order: one before the section, about one every 100 m of it, one behind it.
    """
    ends = np.round(np.linspace(0.0, road.length, max(round(road.length / EDGE), 1) + 1), 2).tolist()
    section = {f"section.{number}": pair for number, pair in enumerate(pairwise(ends), 1)}
    return {"upstream": (-BEFORE, 0.0), **section, "downstream": (ends[-1], ends[-1] + BEHIND)}


def layout_of(road: Road) -> Layout:
    """Return how a straight road's edges make it up.

    Parameters
    ----------
    road : Road
    """
    edges = tuple(edges_of(road))
    return Layout(mainline=edges, weave=edges[1], downstream=edges[-1], on_ramp="", off_ramp="")


def network_of(road: Road) -> Path:
    """Return the network of a straight road's main lanes.

    It is in the recording's coordinates and kept in the cache, one file a geometry.

    Parameters
    ----------
    road : Road
        Its side lanes are not part of the network.
    """
    geometry = [road.widths, road.length, road.speed_limit, EDGE]
    return kept("networks/straight", ".net.xml", geometry, partial(write_network, road))


def write_network(road: Road, path: Path) -> None:
    """Write the network of a straight road.

    Parameters
    ----------
    road : Road
    path : Path
    """
    edges = edges_of(road)
    ends = (-BEFORE, *(end for _, end in edges.values()))
    lanes = range(road.main_lanes)  # SUMO's index, from the right
    box = f"{ends[0]:.2f},{-road.width:.2f},{ends[-1]:.2f},0.00"
    net = Element("net", version="1.20", junctionCornerDetail="5", limitTurnSpeed="5.50")
    SubElement(net, "location", netOffset="0.00,0.00", convBoundary=box, origBoundary=box, projParameter="!")
    for number, (edge, (start, end)) in enumerate(edges.items()):
        one = SubElement(net, "edge", {"id": edge, "from": f"n{number}", "to": f"n{number + 1}", "priority": "1"})
        for index in lanes:
            lane = road.main_lanes - index
            y = float(road.lane_center(lane))
            SubElement(one, "lane", id=f"{edge}_{index}", index=str(index), speed=f"{road.speed_limit:.4f}",
                       length=f"{end - start:.2f}", width=f"{road.widths[lane - 1]:.4f}",
                       shape=f"{start:.2f},{y:.4f} {end:.2f},{y:.4f}")  # fmt: skip
    for number, x in enumerate(ends):
        _junction(net, road, tuple(edges), number, x)
    for before, after in pairwise(edges):
        for index in lanes:
            SubElement(net, "connection", {"from": before, "to": after, "fromLane": str(index), "toLane": str(index),
                                           "dir": "s", "state": "M"})  # fmt: skip
    ElementTree(net).write(path, encoding="utf-8", xml_declaration=True)


def _junction(net: Element, road: Road, edges: tuple[str, ...], number: int, x: float) -> None:
    outer = number in (0, len(edges))
    incoming = " ".join(f"{edges[number - 1]}_{index}" for index in range(road.main_lanes)) if number else ""
    junction = SubElement(net, "junction", id=f"n{number}", type="dead_end" if outer else "priority", x=f"{x:.2f}",
                          y=f"{-road.width:.2f}", incLanes=incoming, intLanes="",
                          shape=f"{x:.2f},0.00 {x:.2f},{-road.width:.2f}")  # fmt: skip
    if not outer:
        for index in range(road.main_lanes):
            none = "0" * road.main_lanes
            SubElement(junction, "request", index=str(index), response=none, foes=none, cont="0")
