"""SUMO networks of roads, their routes and places.

SUMO's coordinates are the recording's, so ``x`` and ``y`` need no conversion. What this module adds is
which edge, lane and position along it they belong to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo import straight_network
from idm_sumo.sumo.layouts import LAYOUTS, Layout


class Place(NamedTuple):
    """Places in SUMO's terms, arrays of one shape.

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


def of(road: Road) -> RoadNetwork:
    """Return SUMO's network of a road.

    Parameters
    ----------
    road : Road

    Returns
    -------
    RoadNetwork

    Raises
    ------
    InputError
        If it is a street whose signals are not known.

    Notes
    -----
    US-101 has its own, a road of a user's network that one, any other a straight one of its main lanes.
    """
    if road.pieces:
        from idm_sumo.sumo.corridor_network import CorridorNetwork

        return CorridorNetwork(road, Layout(road.edges, road.edges[0], "", "", ""))
    if road.name in LAYOUTS and road.network:
        return RoadNetwork(road, LAYOUTS[road.name])
    if road.has_signals:
        raise InputError(
            f"road {road.name!r} is a street with traffic lights, and its signals are not recorded: there is no SUMO "
            "network on which its traffic could run; calibrate, predict and diagnose who follows"
        )
    return RoadNetwork(replace(road, network=""), straight_network.layout_of(road))


@dataclass(frozen=True)
class RoadNetwork:
    """The SUMO network of a road.

    Attributes
    ----------
    road : Road
    layout : Layout
    """

    road: Road
    layout: Layout

    @property
    def mainline(self) -> tuple[str, ...]:
        """Edges of the main road in driving order."""
        return self.layout.mainline

    @property
    def origins(self) -> tuple[str, ...]:
        """Edges that vehicles come from.

        Main road and, if there is one, on-ramp.
        """
        return tuple(filter(None, (self.mainline[0], self.layout.on_ramp)))

    @property
    def destinations(self) -> tuple[str, ...]:
        """Edges that vehicles go to.

        Main road and, if there is one, off-ramp.
        """
        return tuple(filter(None, (self.mainline[-1], self.layout.off_ramp)))

    @property
    def fcd_attributes(self) -> str:
        """Attributes of SUMO's output that a recording is made from."""
        return "x,y,angle,speed,acceleration"

    def reach(self, sumo: Any) -> tuple[float, float]:
        """Return the first and last ``x`` (m) of the network.

        It is the one that a simulation has loaded.

        Parameters
        ----------
        sumo : module
            A running simulation.
        """
        (start, _), (end, _) = sumo.simulation.getNetBoundary()
        return float(start), float(end)

    def plane(self, x: Sequence[float], y: Sequence[float], angle: Sequence[float]) -> Any:
        """Return where SUMO puts positions of the straightened road.

        The angles there come with them; here they are the same.

        Parameters
        ----------
        x : float or array_like
            m, along the road.
        y : float or array_like
            m, to the left.
        angle : float or array_like
            Degrees, as SUMO counts them.
        """
        return x, y, angle

    def seen(self, sumo: Any, names: Sequence[str]) -> npt.NDArray[np.float64]:
        """Return where SUMO has vehicles on the straightened road.

        ``x, y`` (m), shape ``(names, 2)``.

        Parameters
        ----------
        sumo : module
            A running simulation.
        names : sequence of str
            Vehicles.
        """
        return np.array([sumo.vehicle.getPosition(name) for name in names]).reshape(-1, 2)

    @property
    def file(self) -> Path:
        """Path of the built network.

        It lies below the package in a wheel, beside it in a clone.

        Raises
        ------
        InputError
            If it is in neither place.
        """
        if not self.road.network:
            return straight_network.network_of(self.road)
        package = Path(__file__).resolve().parents[1]
        for folder in (package, package.parent):
            if (path := folder / "network" / self.road.network).is_file():
                return path
        raise InputError(f"network/{self.road.network} is missing: build it with `python network/build.py`")

    def load(self) -> Any:
        """Return the :class:`sumolib.net.Net`, read once."""
        return _load(self.file)

    def mainline_start(self) -> float:
        """Return where the main road begins, ``x`` (m)."""
        return float(self.load().getEdge(self.mainline[0]).getShape()[0][0])

    def mainline_ends(self) -> tuple[float, ...]:
        """Return where each edge of the main road ends.

        Returns
        -------
        tuple of float
            ``x`` (m), in the order of ``mainline``.
        """
        return tuple(float(self.load().getEdge(name).getShape()[-1][0]) for name in self.mainline)

    def route(self, origin: str, destination: str) -> tuple[str, ...]:
        """Return the edges from an origin to a destination.

        Parameters
        ----------
        origin, destination : str
            Edges, of :attr:`origins` and :attr:`destinations`.

        Returns
        -------
        tuple of str
            Both included.

        Raises
        ------
        InputError
            If an edge does not exist or there is no way.
        """
        return _route(self, origin, destination)

    def place(self, x: npt.ArrayLike, lane: npt.ArrayLike) -> Place:
        """Return edge, lane and position of recorded places.

        Parameters
        ----------
        x : array_like
            Distance (m) downstream of the section's start.
        lane : array_like of int
            Recorded lane. The side lanes are one strip: on-ramp, auxiliary lane or off-ramp according to ``x``.

        Returns
        -------
        Place

        Raises
        ------
        InputError
            If a place is outside the network.
        """
        x, lane = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(lane, dtype=np.int64))
        starts = np.array([_line(self, edge, 0)[0, 0] for edge in self.mainline])
        segment = np.searchsorted(starts, x, side="right") - 1
        edge = np.array(self.mainline)[np.maximum(segment, 0)]
        right, weave = lane > self.road.main_lanes, self.mainline.index(self.layout.weave)
        if self.layout.on_ramp:
            ramp = np.where(segment < weave, self.layout.on_ramp, np.where(segment > weave, self.layout.off_ramp, edge))
            edge = np.where(right, ramp, edge)
        count = [_lane_count(self, str(name)) for name in edge.ravel()]
        index = np.where(right.ravel(), 0, count - lane.ravel()).reshape(lane.shape)
        position = np.full(x.shape, np.nan)
        for name in np.unique(edge):
            line = _line(self, str(name), 0)  # all lanes of an edge begin and end at the same x
            here = edge == name
            position[here] = np.interp(x[here], line[:, 0], line[:, 2], left=np.nan, right=np.nan)
        if (outside := np.isnan(position) | (lane < 1) | (lane > self.road.last_lane)).any():
            where = f"x = {x[outside].flat[0]:g} m, lane {lane[outside].flat[0]}"
            raise InputError(
                f"{where} is outside the network; check units (metres) and lane numbers (1 to {self.road.last_lane})"
            )
        return Place(edge, index, position)

    def coordinates(
        self, where: Place
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.int64]]:
        """Return recorded coordinates of places; inverts :meth:`place`.

        Parameters
        ----------
        where : Place

        Returns
        -------
        x, y : float64
            Lane centre (m).
        lane : int64
            Recorded lane.
        """
        edge, index, position = np.broadcast_arrays(*where)
        x, y, lane = np.empty(edge.shape), np.empty(edge.shape), np.empty(edge.shape, dtype=np.int64)
        for name in np.unique(edge):
            for number in np.unique(index[edge == name]):
                here = (edge == name) & (index == number)
                line = _line(self, str(name), int(number))
                x[here] = np.interp(position[here], line[:, 2], line[:, 0])
                y[here] = np.interp(position[here], line[:, 2], line[:, 1])
                lane[here] = self.recorded_lane(str(name), int(number))
        return x, y, lane

    def recorded_lane(self, edge: str, lane_index: int) -> int:
        """Return the recorded number of a SUMO lane.

        Parameters
        ----------
        edge : str
        lane_index : int
            Counted from the right, 0 first.

        Returns
        -------
        int
        """
        if edge == self.layout.on_ramp:
            return self.road.on_ramps[0].number
        if edge == self.layout.off_ramp:
            return self.road.off_ramps[0].number
        return _lane_count(self, edge) - lane_index

    def main_lane(self, edge: str, lane: int) -> str:
        """Return SUMO's name of a main lane on an edge.

        Parameters
        ----------
        edge : str
            Edge of the main road.
        lane : int
            Main lane, 1 leftmost.

        Returns
        -------
        str
        """
        return f"{edge}_{_lane_count(self, edge) - lane}"

    def strip(self, lane: int) -> tuple[str, ...]:
        """Return SUMO's lanes that make up a main lane.

        Parameters
        ----------
        lane : int
            Main lane, 1 leftmost.

        Returns
        -------
        tuple of str
            Upstream to downstream.
        """
        return tuple(self.main_lane(edge, lane) for edge in self.mainline)


@cache
def _load(path: Path) -> Any:
    from sumolib.net import readNet

    return readNet(str(path), withInternal=False)


@cache
def _route(network: RoadNetwork, origin: str, destination: str) -> tuple[str, ...]:
    net, ways = network.load(), f"routes go from {network.origins} to {network.destinations}"
    for name in (origin, destination):
        if not net.hasEdge(name):
            raise InputError(f"no edge {name!r} in {network.road.network}; {ways}")
    path, _ = net.getShortestPath(net.getEdge(origin), net.getEdge(destination))
    if not path:
        raise InputError(f"no way from {origin!r} to {destination!r}; {ways}")
    return tuple(edge.getID() for edge in path)


@cache
def _lane_count(network: RoadNetwork, edge: str) -> int:
    """Return how many lanes count from the left.

    On a ramp this is one more than the main lanes, since it lies in line with the auxiliary lane.
    """
    if edge in (network.layout.on_ramp, network.layout.off_ramp):
        return network.road.main_lanes + 1
    return int(network.load().getEdge(edge).getLaneNumber())


@cache
def _line(network: RoadNetwork, edge: str, lane_index: int) -> npt.NDArray[np.float64]:
    """Return the middle of a lane as points.

    One point a row: x (increasing), y and distance from the lane's start (m).
    """
    points = np.array(network.load().getEdge(edge).getLane(lane_index).getShape(), dtype=np.float64)[:, :2]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return np.column_stack([points, along])
