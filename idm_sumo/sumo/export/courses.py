"""Courses on which SUMO's and our drivers are compared."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np

from idm_sumo.sumo.network import Place, RoadNetwork

LANE_WIDTH = 3.6576  # m; without effect on the results
ROADS_APART = 10.0  # m, beyond the width of their lanes
GARAGE_POSITION = 500.0  # m
AMID_WEAVE = 120.0  # m


class StraightRoads:
    """Straight roads side by side, each with a garage lane.

    The garage lane is the rightmost. One simulation holds all drivers of a run: SUMO's step costs microseconds a
    vehicle, its start milliseconds.

    Parameters
    ----------
    drivers : int
        How many drivers.
    span : (float, float)
        The smallest and largest position (m) that a vehicle can have.
    limit : float
        Speed limit (m/s).
    lanes : int
        Driving lanes a road, each with a driver.
    """

    def __init__(self, drivers: int, span: tuple[float, float], limit: float, *, lanes: int = 1) -> None:
        self.drivers, self.lanes, self.limit = drivers, lanes, limit
        self.first_x = span[0] - 2.0 * GARAGE_POSITION
        self.length = span[1] - span[0] + 4.0 * GARAGE_POSITION

    def write_net(self, folder: Path) -> Path:
        """Write the network.

        SUMO needs no netconvert for roads without junctions.

        Parameters
        ----------
        folder : Path
            Where the file is written.

        Returns
        -------
        Path
            The file.
        """
        net = Element("net", version="1.20")
        roads = -(-self.drivers // self.lanes)
        spacing = (self.lanes + 1) * LANE_WIDTH + ROADS_APART
        box = f"0,0,{self.length:.2f},{roads * spacing:.2f}"
        SubElement(net, "location", netOffset="0,0", convBoundary=box, origBoundary=box, projParameter="!")
        for number in range(roads):
            edge = SubElement(
                net, "edge", {"id": f"road{number}", "from": f"a{number}", "to": f"b{number}", "priority": "1"}
            )
            for lane in range(self.lanes + 1):
                y = number * spacing + lane * LANE_WIDTH
                SubElement(edge, "lane", id=f"road{number}_{lane}", index=str(lane), speed=repr(self.limit),
                           length=f"{self.length:.2f}", shape=f"0,{y:.4f} {self.length:.2f},{y:.4f}")  # fmt: skip
        for number in range(roads):
            lanes = " ".join(f"road{number}_{lane}" for lane in range(self.lanes + 1))
            low, high = number * spacing, (number + 1) * spacing - ROADS_APART
            for name, x, incoming in (("a", 0.0, ""), ("b", self.length, lanes)):
                SubElement(net, "junction", id=f"{name}{number}", type="dead_end", x=f"{x:.2f}", y=f"{low:.2f}",
                           incLanes=incoming, intLanes="", shape=f"{x:.2f},{low:.2f} {x:.2f},{high:.2f}")  # fmt: skip
        path = folder / "roads.net.xml"
        ElementTree(net).write(path, encoding="utf-8", xml_declaration=True)
        return path

    def route(self, driver: int) -> str:
        """Return the edge of a driver and its leader.

        Parameters
        ----------
        driver : int
            Number of the driver.

        Returns
        -------
        str
        """
        return f"road{driver // self.lanes}"

    def lane_at(self, driver: int, x: float) -> tuple[str, float]:
        """Return lane and position on it of a place.

        Parameters
        ----------
        driver : int
            Number of the driver.
        x : float
            Front bumper (m).

        Returns
        -------
        lane : str
        position : float
            m from the lane's start.
        """
        return f"road{driver // self.lanes}_{driver % self.lanes + 1}", x - self.first_x

    def garage(self, driver: int) -> tuple[str, float]:
        """Return where an absent leader waits.

        Parameters
        ----------
        driver : int
            Number of the driver.

        Returns
        -------
        lane : str
        position : float
            m from the lane's start.
        """
        return f"road{driver // self.lanes}_0", GARAGE_POSITION

    def x_of(self, lane: str, position: float) -> float:
        """Return ``x`` (m) of a position on a lane.

        Parameters
        ----------
        lane : str
        position : float
            m from the lane's start.

        Returns
        -------
        float
        """
        return position + self.first_x


@dataclass(frozen=True)
class StudySection:
    """A road's network with one driver in each main lane.

    Attributes
    ----------
    main_lanes : sequence of int
        Recorded lane of each driver; all different.
    network : RoadNetwork
    net : Path, optional
        Another build of the network.
    """

    main_lanes: Sequence[int]
    network: RoadNetwork
    net: Path | None = None
    _starts: list[float] = field(init=False, repr=False)
    _lanes: dict[int, list[str]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Note the edges' starts and SUMO's names of their lanes."""
        network = self.network
        lanes = range(1, network.road.main_lanes + 1)
        edges = np.array(network.mainline)
        beginnings = Place(edges, np.zeros(len(edges), dtype=np.int64), np.zeros(len(edges)))
        starts = network.coordinates(beginnings)[0]
        inside = starts + 1e-3  # m: clearly on the edge that begins there
        names = {lane: network.place(inside, np.full(len(edges), lane)) for lane in lanes}
        pairs = {lane: [f"{e}_{i}" for e, i in zip(p.edge, p.lane_index, strict=True)] for lane, p in names.items()}
        object.__setattr__(self, "_starts", starts.tolist())
        object.__setattr__(self, "_lanes", pairs)

    def write_net(self, folder: Path) -> Path:
        """Return the network's file; nothing is written.

        Parameters
        ----------
        folder : Path
            Not used.

        Returns
        -------
        Path
        """
        return self.net or self.network.file

    def route(self, driver: int) -> str:
        """Return the edges of the main road.

        Parameters
        ----------
        driver : int
            Not used: all drivers have the same.

        Returns
        -------
        str
            Separated by spaces.
        """
        return " ".join(self.network.mainline)

    def lane_at(self, driver: int, x: float) -> tuple[str, float]:
        """Return lane and position on it of a place.

        The main lanes are straight.

        Parameters
        ----------
        driver : int
            Number of the driver.
        x : float
            Front bumper (m).

        Returns
        -------
        lane : str
        position : float
            m from the lane's start.
        """
        segment = max(bisect_right(self._starts, x) - 1, 0)
        return self._lanes[self.main_lanes[driver]][segment], x - self._starts[segment]

    def garage(self, driver: int) -> tuple[str, float]:
        """Return where an absent leader waits.

        It is the auxiliary lane, where no driver is compared.

        Parameters
        ----------
        driver : int
            Not used: all share it.

        Returns
        -------
        lane : str
        position : float
            m from the lane's start.
        """
        return f"{self.network.layout.weave}_0", AMID_WEAVE

    def x_of(self, lane: str, position: float) -> float:
        """Return ``x`` (m) of a position on a lane.

        Parameters
        ----------
        lane : str
        position : float
            m from the lane's start.

        Returns
        -------
        float
        """
        return position + self._starts[self.network.mainline.index(lane.rpartition("_")[0])]


Course = StraightRoads | StudySection
