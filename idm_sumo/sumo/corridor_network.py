"""The SUMO network of a road.

The road is a corridor of a user's own network.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from idm_sumo.roads.pieces import Piece, by_lane, locate, shown, strip_of
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.network import Place, RoadNetwork

Floats = npt.NDArray[np.float64]
CENTIMETRE = 0.01  # m


@dataclass(frozen=True)
class CorridorNetwork(RoadNetwork):
    """As :class:`RoadNetwork`, with places told by the road's pieces.

    Roads bend, and edges are anybody's.
    """

    @property
    def file(self) -> Path:
        """Path of the network.

        Raises
        ------
        InputError
            If it is not where it was.
        """
        path = Path(self.road.network)
        if not path.is_file():
            raise InputError(f"{path}: the network that this recording was read on is gone; read it again")
        return path

    @property
    def fcd_attributes(self) -> str:
        """Attributes of SUMO's output that a recording is made from."""
        return "x,y,angle,speed,acceleration,lane,pos,type"

    def reach(self, sumo: Any) -> tuple[float, float]:
        """Return the first and last ``x`` (m) of the network.

        Parameters
        ----------
        sumo : module
            A running simulation.
        """
        return self.road.reach[0], self.road.reach[1]

    def mainline_start(self) -> float:
        """Return where the main road begins, ``x`` (m)."""
        return self.road.reach[0]

    def mainline_ends(self) -> tuple[float, ...]:
        """Return where each edge of the main road ends.

        ``x`` (m), in the order of ``mainline``.
        """
        return tuple(max(piece.end for piece in self._outside() if _edge(piece) == edge) for edge in self.mainline)

    def _outside(self) -> list[Piece]:
        return [piece for piece in self.road.pieces if not piece.internal]

    def place(self, x: npt.ArrayLike, lane: npt.ArrayLike) -> Place:
        """Return edge, lane and position of recorded places.

        Within a junction, the end of the edge before it.

        Parameters
        ----------
        x : float or array_like
            m, along the road.
        lane : int or array_like of int
            Main lanes, 1 leftmost.


        Raises
        ------
        InputError
            If a place is on no lane of the road.
        """
        x, lane = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(lane, dtype=np.int64))
        found = [self._place(float(one), int(number)) for one, number in zip(x.ravel(), lane.ravel(), strict=True)]
        edge, index, position = (np.array(values).reshape(x.shape) for values in zip(*found, strict=True))
        return Place(edge, index.astype(np.int64), position.astype(np.float64))

    def _place(self, x: float, lane: int) -> tuple[str, int, float]:
        before = [piece for piece in strip_of(self.road, lane) if not piece.internal and piece.start <= x + CENTIMETRE]
        if not before or x > strip_of(self.road, lane)[-1].end + CENTIMETRE:
            raise InputError(f"x = {x:g} m, lane {lane} is outside the network; lanes are 1 to {self.road.last_lane}")
        piece = before[-1]
        share = min(max((x - piece.start) / (piece.end - piece.start), 0.0), 1.0)
        return _edge(piece), _index(piece), share * piece.length

    def coordinates(self, where: Place) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
        """Return recorded coordinates of places; inverts :meth:`place`.

        Parameters
        ----------
        where : Sequence
            Positions of lanes.
        """
        edge, index, position = np.broadcast_arrays(*where)
        lanes = [f"{one}_{number}" for one, number in zip(edge.ravel(), index.ravel(), strict=True)]
        found = locate(self.road, np.array(lanes, dtype=object), position.ravel().astype(np.float64), None, None)
        lane = found.number.reshape(edge.shape)
        return found.x.reshape(edge.shape), self.road.lane_center(lane), lane

    def recorded_lane(self, edge: str, lane_index: int) -> int:
        """Return the recorded number of a SUMO lane.

        Parameters
        ----------
        edge : str
            Of the network.
        lane_index : int
            As SUMO counts lanes.
        """
        return by_lane(self.road)[f"{edge}_{lane_index}"].number

    def main_lane(self, edge: str, lane: int) -> str:
        """Return SUMO's name of a main lane on an edge.

        Parameters
        ----------
        edge : str
            Of the network.
        lane : int or array_like of int
            Main lanes, 1 leftmost.
        """
        return next(piece.lane for piece in strip_of(self.road, lane) if _edge(piece) == edge)

    def strip(self, lane: int) -> tuple[str, ...]:
        """Return SUMO's lanes that make up a main lane.

        Those within junctions too.

        Parameters
        ----------
        lane : int or array_like of int
            Main lanes, 1 leftmost.
        """
        return tuple(piece.lane for piece in strip_of(self.road, lane))

    def plane(self, x: Sequence[float], y: Sequence[float], angle: Sequence[float]) -> Any:
        """Return where SUMO puts positions of the straightened road.

        The angles there come with them.

        Parameters
        ----------
        x : float or array_like
            m, along the road.
        y : float or array_like
            m, to the left.
        angle : float or array_like
            Degrees, as SUMO counts them.
        """
        place = shown(self.road, x, y)
        turned = np.asarray(angle, dtype=np.float64) - np.degrees(place.heading)
        return place.x.tolist(), place.y.tolist(), turned.tolist()

    def seen(self, sumo: Any, names: Sequence[str]) -> Floats:
        """Return where SUMO has vehicles on the straightened road.

        ``x, y`` (m), shape ``(names, 2)``.

        Parameters
        ----------
        sumo : module
            A running simulation.
        names : sequence of str
            Vehicles.
        """
        lanes = np.array([sumo.vehicle.getLaneID(name) for name in names], dtype=object)
        position = np.array([sumo.vehicle.getLanePosition(name) for name in names], dtype=np.float64)
        aside = [sumo.vehicle.getLateralLanePosition(name) for name in names]
        where = locate(self.road, lanes, position, None, None)
        return np.column_stack([where.x, self.road.lane_center(where.number) + aside]).reshape(-1, 2)


def _edge(piece: Piece) -> str:
    return piece.lane.rpartition("_")[0]


def _index(piece: Piece) -> int:
    return int(piece.lane.rpartition("_")[2])
