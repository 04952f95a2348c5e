"""`Road`: the geometry that traffic was recorded on, as one value.

Coordinates are those of the straightened road: ``x`` (m) runs downstream from the start of the section,
``y`` (m) to the left, and the left edge of lane 1 is ``y = 0``. Lanes are numbered from the left, 1 first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from idm_sumo.roads.pieces import Piece
from idm_sumo.runtime.errors import InputError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ENDLESS = 1e6  # m, longer than any recorded section
SideKind = Literal["on-ramp", "auxiliary", "off-ramp"]


@dataclass(frozen=True)
class SideLane:
    """A lane right of the main lanes, along part of the road.

    Attributes
    ----------
    number : int
        Its number in recordings; larger than that of every main lane.
    kind : str
        ``on-ramp`` (its traffic joins the road where it ends), ``auxiliary`` (connects ramps) or
        ``off-ramp`` (its traffic has left the road where it begins).
    start, end : float
        Stretch of the road that it lies beside (m); without a bound as far as the recording goes.
    width : float
        m.
    """

    number: int
    kind: SideKind
    start: float = -math.inf
    end: float = math.inf
    width: float = 3.5


@dataclass(frozen=True, repr=False)
class Road:
    """Lanes, section and speed limit of one road; hashable, and passed along with what was recorded on it.

    Attributes
    ----------
    name : str
        For titles, and to find what belongs to the road (its SUMO network).
    widths : tuple of float
        Width of each main lane (m), leftmost first.
    length : float
        Length of the section (m), which begins at ``x = 0``.
    speed_limit : float
        m/s.
    side_lanes : tuple of SideLane
        Auxiliary lanes and ramps. Where two stretches meet, the lane that is listed first holds the place.
    car_length, car_width : float
        What is assumed of a vehicle whose size was not recorded (m); by default SUMO's passenger car.
    network : str
        File name of the road's SUMO network, empty if there is none.
    edges : tuple of str
        Names of the network's edges; empty if unknown.
    reach : tuple of float
        First and last ``x`` (m) of the network; empty if it ends with the section.
    has_signals : bool
        Whether traffic lights stop vehicles: there, whoever stands without a leader near does not follow.
    pieces : tuple of Piece
        Lanes of a SUMO network that make up the road, if it is one of a user's own network.

    Raises
    ------
    InputError
        If there is no main lane, a size is not positive, or lane numbers clash.

    Examples
    --------
    >>> road = Road("test track", widths=(3.5, 3.5, 3.0), length=1000.0, speed_limit=33.3)
    >>> road.lane_center([1, 3])
    array([-1.75, -8.5 ])
    >>> road.lane_at([-1.0, -7.5])
    array([1, 3])
    """

    name: str
    widths: tuple[float, ...]
    length: float
    speed_limit: float
    side_lanes: tuple[SideLane, ...] = ()
    car_length: float = 5.0
    car_width: float = 1.8
    network: str = ""
    edges: tuple[str, ...] = ()
    reach: tuple[float, ...] = ()
    has_signals: bool = False
    pieces: tuple[Piece, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what cannot be a road."""
        sizes = {
            "length": self.length, "speed_limit": self.speed_limit, "car_length": self.car_length,
            "car_width": self.car_width, **{f"width of lane {k}": w for k, w in enumerate(self.widths, 1)},
            **{f"width of lane {lane.number}": lane.width for lane in self.side_lanes},
        }  # fmt: skip
        for name, value in sizes.items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"road {self.name!r}: {name} = {value:g} must be positive")
        if not self.widths:
            raise InputError(f"road {self.name!r}: no main lane; give the width of each in `widths`")
        numbers = [lane.number for lane in self.side_lanes]
        if len(set(numbers)) < len(numbers) or min(numbers, default=math.inf) <= self.main_lanes:
            raise InputError(
                f"road {self.name!r}: side lanes {numbers} need different numbers above {self.main_lanes}, "
                "the last main lane's"
            )

    def __repr__(self) -> str:
        """Return name and size in a few words."""
        side = f" + {len(self.side_lanes)} side lanes" if self.side_lanes else ""
        return f"<Road {self.name}: {self.main_lanes} lanes{side}, {self.length:.0f} m>"

    @property
    def main_lanes(self) -> int:
        """Number of main lanes."""
        return len(self.widths)

    @property
    def last_lane(self) -> int:
        """Largest lane number that a recording of this road may have."""
        return max((lane.number for lane in self.side_lanes), default=self.main_lanes)

    @property
    def width(self) -> float:
        """Width of all main lanes together (m)."""
        return -float(self.markings[-1])

    @cached_property
    def markings(self) -> Floats:
        """``y`` (m) of the main lanes' edges from left to right, shape ``(main_lanes + 1,)``, 0 first."""
        # fsum rounds once, so that lanes of equal width w have exactly the edges k * w.
        return _constant([-math.fsum(self.widths[:k]) for k in range(self.main_lanes + 1)])

    @cached_property
    def _lane_widths(self) -> Floats:
        """Width (m) by lane number, shape ``(last_lane + 1,)``, NaN where there is no such lane."""
        out = np.full(self.last_lane + 1, np.nan)
        out[1 : self.main_lanes + 1] = self.widths
        for lane in self.side_lanes:
            out[lane.number] = lane.width
        return _constant(out)

    @cached_property
    def _lane_centers(self) -> Floats:
        """``y`` (m) of each lane's middle by lane number, shape ``(last_lane + 1,)``."""
        out = np.full(self.last_lane + 1, np.nan)
        for k, width in enumerate(self.widths):
            out[k + 1] = -math.fsum((*self.widths[:k], 0.5 * width))
        for lane in self.side_lanes:
            out[lane.number] = -math.fsum((*self.widths, 0.5 * lane.width))
        return _constant(out)

    @property
    def auxiliary_lanes(self) -> tuple[SideLane, ...]:
        """Side lanes that connect ramps."""
        return tuple(lane for lane in self.side_lanes if lane.kind == "auxiliary")

    @property
    def on_ramps(self) -> tuple[SideLane, ...]:
        """Side lanes whose traffic joins the road where they end."""
        return tuple(lane for lane in self.side_lanes if lane.kind == "on-ramp")

    @property
    def off_ramps(self) -> tuple[SideLane, ...]:
        """Side lanes whose traffic has left the road where they begin."""
        return tuple(lane for lane in self.side_lanes if lane.kind == "off-ramp")

    @property
    def ramp_places(self) -> tuple[float, ...]:
        """``x`` (m) at which on-ramps join and off-ramps leave."""
        return (*(lane.end for lane in self.on_ramps), *(lane.start for lane in self.off_ramps))

    def without_end(self) -> Road:
        """Return the road as if its section went on along the same lanes."""
        return replace(self, length=ENDLESS)

    def lane_width(self, lane: npt.ArrayLike) -> Floats:
        """Return the width (m) of each lane, main or beside; NaN for numbers that no lane has."""
        return np.asarray(self._lane_widths[np.asarray(lane, dtype=np.int64)])

    def lane_center(self, lane: npt.ArrayLike) -> Floats:
        """Return the ``y`` (m) of the middle of each lane, main or beside; NaN for numbers that no lane has."""
        return np.asarray(self._lane_centers[np.asarray(lane, dtype=np.int64)])

    def lane_at(self, y: npt.ArrayLike) -> Integers:
        """Return the main lane that holds lateral positions.

        Parameters
        ----------
        y : array_like
            m. A position on a marking belongs to the lane right of it.

        Returns
        -------
        numpy.ndarray of int64
            1 to ``main_lanes``; the outermost lane for positions beyond the main lanes.
        """
        between = self.markings[-2:0:-1]
        return np.asarray(self.main_lanes - np.searchsorted(between, np.asarray(y, dtype=np.float64)), dtype=np.int64)

    def on_main_lanes(self, y: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether lateral positions (m) lie within the main lanes."""
        y = np.asarray(y, dtype=np.float64)
        return np.asarray((y <= 0.0) & (y > self.markings[-1]))

    def lane_of(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Integers:
        """Return the lane that holds places, side lanes included.

        Parameters
        ----------
        x, y : array_like
            m. Right of the main lanes the side lane counts whose stretch holds ``x``.

        Returns
        -------
        numpy.ndarray of int64
            Lane numbers; the outermost main lane where no lane is.
        """
        x, y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        lane, beside = self.lane_at(y), y <= self.markings[-1]
        for side in reversed(self.side_lanes):
            lane = np.where(beside & (x >= side.start) & (x <= side.end), side.number, lane)
        return lane

    def desired_speed(self, given: npt.ArrayLike | None = None) -> Any:
        """Return the desired speed that was given, or the speed limit (m/s) where none was."""
        return self.speed_limit if given is None else given

    def to_dict(self) -> dict[str, Any]:
        """Return plain values that :meth:`from_dict` makes the same road of."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Road:
        """Return the road that :meth:`to_dict` wrote down."""
        side_lanes = tuple(SideLane(**lane) for lane in values["side_lanes"])
        pieces = tuple(
            Piece(**{**piece, "shape": tuple(map(tuple, piece["shape"]))}) for piece in values.get("pieces", ())
        )
        tuples = {name: tuple(values.get(name, ())) for name in ("widths", "edges", "reach")}
        return cls(**{**values, **tuples, "side_lanes": side_lanes, "pieces": pieces})


def _constant(values: npt.ArrayLike) -> Floats:
    """Return an array that nobody can change."""
    out = np.array(values, dtype=np.float64) + 0.0  # turns -0.0 into 0.0
    out.setflags(write=False)
    return out
