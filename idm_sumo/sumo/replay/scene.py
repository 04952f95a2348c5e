"""Vehicles in SUMO, put at given places step by step."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from idm_sumo.sumo.network import RoadNetwork

Floats = npt.NDArray[np.float64]

ON_ROUTE_AT_EXACT_PLACE = 3  # moveToXY: map to the vehicle's route (1), keep x and y as given (2)
POINT = 0.001  # m, length and width of a point


class SumoScene:
    """Vehicles that SUMO shows at present.

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
        self._network = network
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
        """Put vehicles where they belong at SUMO's next step.

        All others are removed: a vehicle that is not moved for a step drives itself.

        Parameters
        ----------
        names : sequence of str
            Names of the vehicles in SUMO.
        x, y : sequence of float
            Front bumpers (m), in recording coordinates, which are SUMO's.
        angle : sequence of float
            Degrees clockwise from north, see :func:`compass`.
        length, width : sequence of float
            Sizes (m), used when a vehicle enters.
        """
        move, present, until = self._sumo.vehicle.moveToXY, self._present, self._until
        plane = self._network.plane(x, y, angle)
        for name, front, *where, long, wide in zip(names, x, *plane, length, width, strict=True):
            last = present.get(name)
            if last is None or front < last or front >= until[name]:
                # SUMO sorts a lane before it applies a move backwards, so that it would be out of
                # order until the next step. Such a vehicle (a jump to another leader) enters again.
                if last is not None:
                    self._leave(name)
                self._enter(name, front, long, wide)
            present[name] = front
            move(name, "", -1, *where, ON_ROUTE_AT_EXACT_PLACE)
        for name in present.keys() - names:
            self._leave(name)

    def clear(self) -> None:
        """Remove all vehicles."""
        for name in list(self._present):
            self._leave(name)

    def _enter(self, name: str, front: float, length: float, width: float) -> None:
        """Add a vehicle.

        Its place of departure does not matter: it is moved before SUMO steps.
        """
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
        """Return the name of a route that SUMO knows."""
        if (route := " ".join(edges)) not in self._known_routes:
            self._sumo.route.add(route, edges)
            self._known_routes.add(route)
        return route

    def _leave(self, name: str) -> None:
        self._sumo.vehicle.remove(name)
        del self._present[name]


def compass(heading: npt.ArrayLike) -> Floats:
    """Return SUMO's angle of a heading.

    Parameters
    ----------
    heading : array_like
        rad, counterclockwise from the road's direction.

    Returns
    -------
    float64
        Degrees clockwise from north.
    """
    return np.asarray(90.0 - np.degrees(heading))
