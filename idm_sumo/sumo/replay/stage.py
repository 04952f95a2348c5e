"""Recorded vehicles on SUMO's road: put where they were recorded, frame by frame."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.sumo.network import RoadNetwork

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ON_ROUTE_AT_EXACT_PLACE = 3  # moveToXY: map to the vehicle's route (1), keep x and y as given (2)
POINT = 0.001  # m, length and width of what has neither
EDGE = 1e-9  # m, how far inside its lane a front that lies on the lane's edge is put


class Stage:
    """The vehicles that SUMO shows at present.

    Parameters
    ----------
    sumo : module
        What :func:`idm_sumo.sumo.session.simulation` yields.
    network : RoadNetwork
        What the vehicles are on.
    as_points : bool
        Tell SUMO that every vehicle is a point, its front bumper's centre. SUMO orders the
        vehicles of a lane by their rears and counts one as present in every lane it reaches
        into; for points that is the order of the fronts and the one lane of the front, which
        is how our perception defines a leader.
    routes : mapping of str to sequence of str, optional
        Edges of the vehicles that do not follow the main road.
    edge_by_edge : bool
        Give the others a route of one edge, and a new one on the next. SUMO looks through all
        lanes of a route for the one a moved vehicle is on, which is most of the time of a move;
        but on such a route it sees no leader beyond the edge.
    """

    def __init__(
        self,
        sumo: Any,
        network: RoadNetwork,
        *,
        as_points: bool,
        routes: Mapping[str, Sequence[str]] | None = None,
        edge_by_edge: bool = False,
    ) -> None:
        self._sumo = sumo
        self._as_points = as_points
        self._routes = {} if routes is None else routes
        self._present: dict[str, float] = {}  # where each vehicle's front is (m)
        self._until: dict[str, float] = {}  # where its route ends (m)
        self._mainline = network.mainline
        self._ends = network.mainline_ends() if edge_by_edge else ()
        self._known_routes, self._known_types = set[str](), set[str]()

    def place(
        self,
        names: Sequence[str],
        x: Sequence[float],
        y: Sequence[float],
        angle: Sequence[float],
        length: Sequence[float],
        width: Sequence[float],
    ) -> None:
        """Put vehicles where they belong at the next step of SUMO, and remove all others.

        A vehicle that is not moved for a step drives itself, so nobody may stay who is not named.

        Parameters
        ----------
        names : sequence of str
        x, y : sequence of float
            Front bumper (m), in recording coordinates, which are SUMO's.
        angle : sequence of float
            Degrees clockwise from north, see :func:`compass`.
        length, width : sequence of float
            m, looked at when a vehicle enters.
        """
        move, present, until = self._sumo.vehicle.moveToXY, self._present, self._until
        for name, front, lateral, turn, long, wide in zip(names, x, y, angle, length, width, strict=True):
            last = present.get(name)
            if last is None or front < last or front >= until[name]:
                # SUMO sorts a lane before it applies a move backwards, so that it would be out of
                # order until the next step. Such a vehicle (a jump to another leader) enters anew.
                if last is not None:
                    self._leave(name)
                self._enter(name, front, long, wide)
            present[name] = front
            move(name, "", -1, front, lateral, turn, ON_ROUTE_AT_EXACT_PLACE)
        for name in present.keys() - names:
            self._leave(name)

    def clear(self) -> None:
        """Remove all vehicles."""
        for name in list(self._present):
            self._leave(name)

    def _enter(self, name: str, front: float, length: float, width: float) -> None:
        """Add a vehicle; where it departs does not matter, since it is moved before SUMO steps."""
        if self._as_points:
            length = width = POINT
        vehicle_type = f"{length!r} x {width!r}"
        if vehicle_type not in self._known_types:  # setLength on a vehicle would copy the type each time
            types = self._sumo.vehicletype
            types.copy("DEFAULT_VEHTYPE", vehicle_type)
            types.setLength(vehicle_type, length)
            types.setWidth(vehicle_type, width)
            types.setMinGap(vehicle_type, 0.0)  # getLeader would subtract it from the gap
            self._known_types.add(vehicle_type)
        number = bisect(self._ends, front) if name not in self._routes else len(self._ends)
        on_one_edge = number < len(self._ends)
        self._until[name] = self._ends[number] if on_one_edge else np.inf
        mainline = self._mainline
        edges = mainline[number : number + 1] if on_one_edge else self._routes.get(name, mainline)
        self._sumo.vehicle.add(name, self._route(edges), vehicle_type)

    def _route(self, edges: Sequence[str]) -> str:
        """Return the name of a route, made known to SUMO."""
        if (route := " ".join(edges)) not in self._known_routes:
            self._sumo.route.add(route, edges)
            self._known_routes.add(route)
        return route

    def _leave(self, name: str) -> None:
        self._sumo.vehicle.remove(name)
        del self._present[name]


class Cast(NamedTuple):
    """The rows of a scenes' traffic as SUMO takes them; arrays of shape (rows,).

    Attributes
    ----------
    label : int64
        Number that names the vehicle in SUMO: its own, or the window's whose leader it is.
    lane : int64
        Main lane it belongs to.
    frame : int64
        Absolute frame; -1 for the leader of a window that is not among the scenes.
    x, y, angle, length, width : float64
        See :meth:`Stage.place`.
    """

    label: Integers
    lane: Integers
    frame: Integers
    x: Floats
    y: Floats
    angle: Floats
    length: Floats
    width: Floats

    def of(self, rows: Integers) -> tuple[list[str], list[float], list[float], list[float], list[float], list[float]]:
        """Return what :meth:`Stage.place` wants to know of some rows."""
        x, y, angle, length, width = (column[rows].tolist() for column in self[3:])
        return list(map(str, self.label[rows].tolist())), x, y, angle, length, width


def cast(scenes: Scenes) -> Cast:
    """Return how the traffic of ``scenes`` appears in SUMO.

    Every vehicle keeps its recorded place, except that a front bumper beyond the outer edges
    of the main lanes is put on that edge, and one exactly on an edge 1e-9 m inside its
    lane: so SUMO assigns to each the lane that :meth:`idm_sumo.roads.Road.lane_at` does. A leader of
    which only the headway is known has no lateral place; it drives in the middle of its
    follower's lane.
    """
    scenes.check_one_period()  # a simulation has one clock
    t = scenes.traffic
    cell = np.repeat(np.arange(len(t.offsets) - 1), np.diff(t.offsets))
    group, frame = np.divmod(cell, t.frames)
    if scenes.leader_source == LEADER_FROM_LANE:
        label, lane, frame = t.vehicle, group + 1, frame + t.first_frame
        y = inside_lane(scenes.road, t.y, lane)
    else:
        window = scenes.cell // t.frames
        lane_of, first_of = np.full(group.max(initial=0) + 1, 1), np.full(group.max(initial=0) + 1, -t.frames)
        in_use = window < len(lane_of)
        lane_of[window[in_use]], first_of[window[in_use]] = scenes.lane[in_use], scenes.first_frame[in_use]
        label, lane, frame = group, lane_of[group], np.maximum(frame + first_of[group], -1)
        y = scenes.road.lane_center(lane)
    return Cast(label, lane, frame, t.x, y, compass(t.heading), t.length, t.width)


def check_on_network(sumo: Any, actors: Cast) -> None:
    """Refuse traffic beyond the ends of the network, which SUMO would take in but show to nobody.

    Raises
    ------
    InputError
        Names the first such vehicle.
    """
    (start, _), (end, _) = sumo.simulation.getNetBoundary()
    if (outside := (actors.x < start) | (actors.x > end)).any():
        row = int(np.argmax(outside))
        raise InputError(
            f"vehicle {actors.label[row]}, frame {actors.frame[row]}: x = {actors.x[row]:.0f} m is off the network, "
            f"which goes from {start:.0f} to {end:.0f} m; check units (metres)"
        )


def inside_lane(road: Road, y: npt.ArrayLike, lane: npt.ArrayLike) -> Floats:
    """Return the lateral position (m) in ``lane`` that is nearest to ``y``."""
    center, half = road.lane_center(lane), 0.5 * road.lane_width(lane) - EDGE
    return np.asarray(np.clip(y, center - half, center + half))


def compass(heading: npt.ArrayLike) -> Floats:
    """Return SUMO's angle (degrees clockwise from north) of a heading (rad)."""
    return np.asarray(90.0 - np.degrees(heading))
