"""Five SUMO networks, made by netconvert, and who drives on them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from idm_sumo.roads import US101
from idm_sumo.sumo import network

LIMIT, CITY_LIMIT = 25.0, 13.9  # m/s


@dataclass(frozen=True)
class Network:
    """A network and its routes.

    Attributes
    ----------
    name : str
        In the table.
    nodes, edges : str
        Plain XML of SUMO; empty for a network that is there already.
    routes : mapping of str to str
        Name of each route to its edges.
    lanes : mapping of str to tuple of int
        Lanes (SUMO's indices) of each route's first edge on which vehicles enter.
    limit : float
        m/s.
    corridor : tuple of str
        What ``--corridor`` says; empty where the network is one road.
    pattern : bool
        Whether the first vehicle of each lane drives a pattern; else a traffic light makes the waves.
    """

    name: str
    nodes: str
    edges: str
    routes: Mapping[str, str]
    lanes: Mapping[str, tuple[int, ...]]
    limit: float = LIMIT
    corridor: tuple[str, ...] = ()
    pattern: bool = True
    apart: float = 2.4  # s between departures in a lane
    options: tuple[str, ...] = field(default=())


def _node(name: str, x: float, y: float, kind: str = "priority") -> str:
    return f'<node id="{name}" x="{x:.2f}" y="{y:.2f}" type="{kind}"/>'


def _edge(name: str, start: str, end: str, lanes: int, limit: float = LIMIT, shape: str = "") -> str:
    bend = f' shape="{shape}"' if shape else ""
    return f'<edge id="{name}" from="{start}" to="{end}" numLanes="{lanes}" speed="{limit}" width="3.2"{bend}/>'


def _arc(radius: float, angle: float) -> str:
    turn = np.linspace(0.0, angle, 60)
    x, y = 800 + radius * np.sin(turn), radius * (1 - np.cos(turn))
    return " ".join(f"{a:.3f},{b:.3f}" for a, b in zip(x, y, strict=True))


def _curve() -> Network:
    radius, angle = 400.0, 1.5
    end = 800 + radius * np.sin(angle), radius * (1 - np.cos(angle))
    far = end[0] + 1200 * np.cos(angle), end[1] + 1200 * np.sin(angle)
    nodes = _node("a", 0, 0) + _node("b", 800, 0) + _node("c", *end) + _node("d", *far)
    edges = _edge("in", "a", "b", 3) + _edge("bend", "b", "c", 3, shape=_arc(radius, angle)) + _edge("out", "c", "d", 3)
    return Network("curve, radius 400 m", nodes, edges, {"main": "in bend out"}, {"main": (0, 1, 2)})


STRAIGHT = Network(
    "straight, 3 lanes of 3.2 m", _node("a", 0, 0) + _node("b", 3000, 0), _edge("road", "a", "b", 3),
    {"main": "road"}, {"main": (0, 1, 2)},
)  # fmt: skip
RAMP = Network(
    "on-ramp",
    _node("a", 0, 0) + _node("b", 1000, 0) + _node("c", 1300, 0) + _node("d", 2800, 0) + _node("r", 700, -60),
    _edge("before", "a", "b", 2) + _edge("merge", "b", "c", 3) + _edge("after", "c", "d", 2)
    + _edge("ramp", "r", "b", 1),
    {"main": "before merge after", "ramp": "ramp merge after"}, {"main": (0, 1), "ramp": (0,)}, apart=3.0,
)  # fmt: skip
CITY = Network(
    "street with a light",
    _node("w", 0, 0) + _node("x", 700, 0, "traffic_light") + _node("e", 1700, 0) + _node("s", 700, -300)
    + _node("n", 700, 300),
    _edge("west", "w", "x", 2, CITY_LIMIT) + _edge("east", "x", "e", 2, CITY_LIMIT)
    + _edge("south", "s", "x", 1, CITY_LIMIT) + _edge("north", "x", "n", 1, CITY_LIMIT),
    {"main": "west east"}, {"main": (0, 1)}, limit=CITY_LIMIT, corridor=("west", "east"), pattern=False, apart=2.6,
)  # fmt: skip
OWN_US101 = Network(
    "US-101 as a network of one's own", "", "", {"main": "upstream entry weave exit downstream outflow"},
    {"main": (0, 1, 2, 3, 4)}, limit=US101.speed_limit,
    corridor=("upstream", "outflow"),
)  # fmt: skip
EVERY = (STRAIGHT, _curve(), RAMP, CITY, OWN_US101)


def netconvert() -> str:
    """Return the path of netconvert, which comes with the package eclipse-sumo."""
    beside = Path(sys.executable).parent / "netconvert"
    home = Path(os.environ.get("SUMO_HOME", "/usr/share/sumo")) / "bin" / "netconvert"
    return str(next((path for path in (beside, home) if path.is_file()), shutil.which("netconvert") or "netconvert"))


def build(one: Network, folder: Path) -> Path:
    """Build a network in a folder."""
    net = folder / "road.net.xml"
    if not one.nodes:
        shutil.copyfile(network.of(US101).file, net)
        return net
    (folder / "n.nod.xml").write_text(f"<nodes>{one.nodes}</nodes>")
    (folder / "e.edg.xml").write_text(f"<edges>{one.edges}</edges>")
    command = [netconvert(), "-n", str(folder / "n.nod.xml"), "-e", str(folder / "e.edg.xml"), "-o", str(net),
               "--no-turnarounds", "true", "--tls.default-type", "static", *one.options]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    return net
