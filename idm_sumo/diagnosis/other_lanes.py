"""Who is in the other lanes at the same moment, row by row."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.models.effects.adjacent_lane_friction import AHEAD, BESIDE
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import MOTORCYCLE, TRUCK
from idm_sumo.recordings.leaders import frame_code

HARD = 1.0  # m/s²: who brakes harder shows brake lights
ALONGSIDE, LOOK_AHEAD = 20.0, 40.0  # m, ahead of the own front
CROWD = 40.0  # m, to either side of it
CAR = 5.0  # m: fronts that are no further apart overlap
NEAR = 15.0  # m, to either side of the own front

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class OtherLanes:
    """The vehicles of a smoothed table, laid out once along one coordinate that orders them by frame, lane and position.

    All methods return arrays of shape ``(rows,)``; lanes are counted from the left, so a side is -1 (left) or 1.
    """

    def __init__(self, table: pd.DataFrame) -> None:
        self._table = table
        self._lane, x = table[c.LANE].to_numpy(np.int64), table[c.X].to_numpy(np.float64)
        self._stride = float(np.ptp(x)) + 4.0 * BESIDE  # what one lane takes of the coordinate, m
        _, dense = np.unique(frame_code(table), return_inverse=True)
        self._place = (dense * 16.0 + self._lane) * self._stride + (x - x.min())
        self._order = np.argsort(self._place, kind="stable")
        self._ordered = self._place[self._order]
        self._rank = np.empty(len(x), dtype=np.int64)
        self._rank[self._order] = np.arange(len(x))

    def slower_speed(self) -> Floats:
        """Return the mean speed (m/s) within ``BESIDE`` m in the slower adjacent lane, NaN beside empty lanes."""
        return np.asarray(np.fmin(*self._speeds))

    def faster_speed(self) -> Floats:
        """Return the same of the faster one."""
        return np.asarray(np.fmax(*self._speeds))

    def slower_next_speed(self) -> Floats:
        """Return the speed (m/s) of the slower one of the next vehicles in the adjacent lanes, up to ``AHEAD`` m ahead; NaN for none."""
        speed = np.append(self._table[c.SPEED].to_numpy(np.float64)[self._order], np.nan)
        sides = (self._between(side, 0.0, AHEAD) for side in (-1, 1))
        return np.asarray(np.fmin(*(np.where(last > first, speed[first], np.nan) for first, last in sides)))

    @cached_property
    def _speeds(self) -> tuple[Floats, Floats]:
        """Mean speeds (m/s) within ``BESIDE`` m in the left and in the right lane, NaN beside an empty one."""
        before = self._before(self._table[c.SPEED].to_numpy(np.float64))
        sides = (self._between(side, BESIDE, BESIDE) for side in (-1, 1))
        with np.errstate(invalid="ignore", divide="ignore"):
            left, right = ((before[last] - before[first]) / (last - first) for first, last in sides)
        return left, right

    def trucks(self) -> Floats:
        """Return how many trucks in the adjacent lanes have their front between the own and ``ALONGSIDE`` m ahead."""
        return self._count((self._table[c.CLASS] == TRUCK).to_numpy(), (1, -1), ALONGSIDE)

    def braking(self) -> Floats:
        """Return how many vehicles brake hard in other lanes within ``LOOK_AHEAD`` m ahead."""
        return self._count((self._table[c.ACCELERATION] < -HARD).to_numpy(), (2, 1, -1, -2), LOOK_AHEAD)

    def crowd(self, side: int) -> Floats:
        """Return how many vehicles of one adjacent lane are within ``CROWD`` m; NaN without such a lane."""
        first, last = self._between(side, CROWD, CROWD)
        return np.where(np.isin(self._lane + side, np.unique(self._lane)), last - first, np.nan)

    def abreast(self) -> Floats:
        """Return in how many adjacent lanes, none to two, a vehicle is alongside."""
        return self._lanes_taken(CAR, CAR)

    def nearest(self) -> Floats:
        """Return how far ahead (m) the front of the nearest vehicle of the adjacent lanes is, negative behind; NaN beyond ``NEAR`` m."""
        sides = [ahead for side in (-1, 1) for ahead in self._next_to(side)]
        nearest = np.take_along_axis(np.array(sides), np.argmin(np.abs(sides), axis=0)[None], axis=0)[0]
        return np.where(np.abs(nearest) <= NEAR, nearest, np.nan)

    def beside_gap(self, gap: Floats) -> Floats:
        """Return in how many adjacent lanes a vehicle drives beside the own gap (m): wholly ahead, its rear before the leader's."""
        return self._lanes_taken(-CAR, np.nan_to_num(gap) + CAR)

    def motorcycles(self) -> Floats:
        """Return how many motorcycles in the adjacent lanes are within ``NEAR`` m."""
        return self._count((self._table[c.CLASS] == MOTORCYCLE).to_numpy(), (1, -1), NEAR, NEAR)

    def _next_to(self, side: int) -> tuple[Floats, Floats]:
        """Return how far ahead (m) the next fronts of another lane are: of the last one behind (negative), of the first one not behind."""
        here = self._ordered + side * self._stride
        first = np.searchsorted(self._ordered, here)
        fronts = np.concatenate([[-np.inf], self._ordered, [np.inf]])
        return (fronts[first] - here)[self._rank], (fronts[first + 1] - here)[self._rank]

    def _lanes_taken(self, back: float, reach: Floats | float) -> Floats:
        """Return in how many adjacent lanes somebody is from ``back`` m behind to ``reach`` m ahead."""
        each = (self._between(side, back, reach) for side in (-1, 1))
        return np.asarray(sum((last > first).astype(np.float64) for first, last in each))

    def _count(self, counted: npt.NDArray[np.bool_], sides: tuple[int, ...], reach: float, back: float = 0.0) -> Floats:
        """Return how many that are counted are in other lanes, from ``back`` m behind to ``reach`` m ahead."""
        before = self._before(counted.astype(np.float64))
        rows = (self._between(side, back, reach) for side in sides)
        return np.asarray(sum(before[last] - before[first] for first, last in rows), dtype=np.float64)

    def _before(self, values: Floats) -> Floats:
        """Return the sums of values before each place in the order."""
        return np.concatenate([[0.0], np.cumsum(values[self._order])])

    def _between(self, side: int, back: float, reach: Floats | float) -> tuple[Integers, Integers]:
        """Return the places in the order of those from ``back`` m behind to ``reach`` m ahead in another lane, the last exclusive."""
        begin = self._ordered + side * self._stride  # asked in order, several times faster than row by row
        end = begin + np.broadcast_to(reach, begin.shape)[self._order]
        return np.searchsorted(self._ordered, begin - back)[self._rank], np.searchsorted(self._ordered, end)[self._rank]
