"""Fields that belong to no effect: what drivers may do differently, along each covariate, in each place, time and lane."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import numbered
from idm_sumo.diagnosis.regressors import Grid
from idm_sumo.recordings.columns import FRAME_STEP, TRUCK

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

CROWDS = (-0.5, 1.5, 3.5, 5.5, 99.0)  # vehicles
# Covariate, and the edges between which behaviour is free.
EDGES: dict[str, tuple[float, ...]] = {
    "rear_gap": (-5.0, 6.0, 12.0, 25.0),
    "since_change": (0.0, 4.0, 10.0, 20.0),
    "until_own_change": (0.0, 3.0, 8.0),
    "until_cut_in": (0.0, 3.0, 8.0),
    "leader_acceleration": (-20.0, -1.0, -0.3, 0.3, 1.0, 20.0),
    "leader_gap": (-5.0, 5.0, 10.0, 20.0, 40.0),
    "adjacent_difference": (-40.0, -5.0, -2.0, 2.0, 5.0, 40.0),
    "trucks_beside": (0.5, 99.0),
    "braking_beside": (0.5, 99.0),
    "truck_behind": (0.5, 99.0),
    "truck_second": (0.5, 99.0),
    "crowd_left": CROWDS,
    "crowd_right": CROWDS,
    "abreast": (0.5, 1.5, 9.0),
    "faster_difference": (-40.0, -5.0, -2.0, 2.0, 5.0, 40.0),
    "beside_gap": (0.5, 1.5, 9.0),
    "nearest_beside": (-15.0, -8.0, -4.0, 0.0, 4.0, 8.0, 15.0),
    "motorcycles_beside": (0.5, 99.0),
    "leader_length": (0.5, 4.2, 5.2, 7.0, 40.0),
    "since_standing": (0.0, 3.0, 8.0, 20.0),
    "since_braking": (0.0, 5.0, 10.0, 20.0),
    "since_entry": (2.0, 12.0, 22.0, 32.0, 45.0, 60.0, 90.0),
    "unrest": (0.0, 0.4, 0.7, 1.0, 9.0),
    "wanted_acceleration": (0.0, 0.15, 0.3, 0.45, 0.7, 1.1, 20.0),
}
# With another car-following model underneath, or noise in the leader's place, drivers seem to answer these otherwise, a gap that
# jumps among them; and who brakes more than the model has the follower near.
DOUBTFUL = (
    "leader_acceleration", "leader_gap", "adjacent_difference", "faster_difference", "rear_gap", "crowd_left", "crowd_right",
    "since_change",
)  # fmt: skip
# Who is where around a driver: no motion of its own makes these up, and they are few.
AROUND = (
    "trucks_beside", "braking_beside", "motorcycles_beside", "truck_behind", "truck_second", "abreast", "beside_gap", "nearest_beside",
)  # fmt: skip
MOST_BINS, BLOCKS = 40, 10  # of a scan along the road or the time; of each side of the rectangles of both
STRONGEST = 3.0  # m/s² (per s): of the model's own acceleration and its change
# What may be different: some acceleration is added, the time headway is longer, the response is stronger, or later.
ACCELERATION, HEADWAY, RESPONSE, DELAY = "", "headway", "response", "delay"
CHANGES = (RESPONSE, DELAY)
IN_LANE = " in lane "
REGION = "position and time"
TIMED = ("time", REGION)  # how the names of what lies along the time begin
MOVING = f"{REGION}, moving at "
# m/s: of a band that moves along the road. Between two of them it strays by half its width in the minutes it takes to cross; faster is
# the traffic itself, whose vehicles are drivers.
SPEEDS = tuple(sign * speed for sign in (-1.0, 1.0) for speed in (1.0, 1.5, 2.0, 2.75, 3.75, 5.0, 7.0))
BAND_BIN, MOST_BANDS = 30.0, 60  # m; bins, side by side
CROSSES = 0.5  # of the way, or the time, that it could be there: less is a corner
HELD = ("position", "time")  # by the catalogue, as location and time of day
# Whether a place is so at all times, and a time at all places.
WITHIN = {"position": f"{REGION} within the place", "time": f"{REGION} within the time"}
# A driver's own motion of late stands out a little; which lane to take drivers choose themselves, and in one lane for a while there
# are few; of a place or a time the catalogue's own would have said it.
SUSPECT = ("unrest", "lane", "time" + IN_LANE, REGION + IN_LANE, *HELD)
# Along covariates the response and its delay are what another car-following model looks like. The response alone is asked to what the
# model itself wants, whether much or little: who leaves the pedal alone while it is little.
ALONG_COVARIATES, ALONG_REGIONS, ALONG_OWN = (ACCELERATION, HEADWAY), (ACCELERATION, RESPONSE, DELAY), (RESPONSE,)
OWN = "wanted_acceleration"
PEDAL = f"{RESPONSE} over {OWN}"


@dataclass(frozen=True)
class Path:
    """How bands move along the road: a band is named by the place where it is in the middle of the recording.

    Attributes
    ----------
    speed : float
        m/s.
    place, time : tuple of float
        Where and when the recording begins and ends: m, s.
    """

    speed: float
    place: tuple[float, float]
    time: tuple[float, float]

    @property
    def middle(self) -> float:
        """Middle of the recording, s."""
        return 0.5 * (self.time[0] + self.time[1])

    def named(self, x: Floats, t: Floats) -> Floats:
        """Return in which band (m) places (m) are at times (s)."""
        return x - self.speed * (t - self.middle)

    def stay(self, band: Floats) -> tuple[Floats, Floats]:
        """Return from when to when (s) bands are on the road."""
        there = np.sort([self.middle + (end - band) / self.speed for end in self.place], axis=0)
        return np.clip(there[0], *self.time), np.clip(there[1], *self.time)

    def bands(self) -> Floats:
        """Return the edges between bands (m) that cross enough of road or recording, none if there are too few."""
        way = 0.5 * abs(self.speed) * (self.time[1] - self.time[0])
        low, high = self.place[0] - way, self.place[1] + way
        edges = np.linspace(low, high, 1 + int(np.clip((high - low) / BAND_BIN, 1, MOST_BANDS)))
        came, left = self.stay(edges)
        longest = min(self.time[1] - self.time[0], (self.place[1] - self.place[0]) / abs(self.speed))
        return np.asarray(edges[left - came >= CROSSES * longest])

    def swept(self, low: float, high: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the places (m) and the times (s) that bands between two have been at."""
        came, left = self.stay(np.array([low, high]))
        begin, end = float(came.min()), float(left.max())
        at = [band + self.speed * (t - self.middle) for band in (low, high) for t in (begin, end)]
        return (max(min(at), self.place[0]), min(max(at), self.place[1])), (begin, end)


@dataclass(frozen=True)
class Interval:
    """A place (m) or a time (s) where something is different in the model.

    Attributes
    ----------
    axis : str
        One of ``HELD``.
    begin, end : float
    content : str
        What is different there: one of the four above.
    sign : float
        Of that.
    """

    axis: str
    begin: float
    end: float
    content: str
    sign: float


@dataclass(frozen=True)
class Family:
    """Bins in which behaviour is free.

    Attributes
    ----------
    covariate : str
    content : str
        What is different in them: one of the four above.
    edges : tuple of float64 arrays
        Of one covariate; of position and time for rectangles; the lanes' numbers (single bins) for lanes.
    path : Path or None
        Of bands that move.
    within : Interval or None
        In which alone it lies, along the other axis.
    """

    covariate: str
    content: str
    edges: tuple[Floats, ...]
    path: Path | None = None
    within: Interval | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of bins along each covariate."""
        return tuple(len(edges) - (self.covariate != "lane") for edges in self.edges)

    @property
    def count(self) -> int:
        """Number of bins."""
        return int(np.prod(self.shape))

    @property
    def is_scanned(self) -> bool:
        """Whether it lies along the road or the time."""
        return self.covariate.startswith(("position", "time"))

    @property
    def is_regional(self) -> bool:
        """Whether it is a question of where or when, so that drivers differ between its bins."""
        return self.covariate not in EDGES

    @property
    def is_around(self) -> bool:
        """Whether it is a question of who is around the driver."""
        return self.covariate in AROUND

    @property
    def is_contrast(self) -> bool:
        """Whether its mean over all bins is projected out: that much of it everywhere would be an effect of the catalogue."""
        return self.content != ACCELERATION


def covariates(windows: w.Windows, state: Floats) -> dict[str, Floats]:
    """Return the covariates by frame, shape ``(windows, horizon)``; SI units, NaN or far away where unknown."""
    seen = windows.seen[:, :, w.LEAD : -1]
    x, v = state[:, :, ro.BASE_X], state[:, :, ro.BASE_V]
    second = np.isfinite(seen[:, w.SECOND])
    return {
        "rear_gap": np.where(np.isfinite(seen[:, w.BEHIND]), seen[:, w.X] - seen[:, w.BEHIND], 1e6),
        "since_change": seen[:, w.SINCE],
        "until_own_change": seen[:, w.UNTIL_OWN],
        "until_cut_in": seen[:, w.UNTIL_CUT_IN],
        "leader_acceleration": seen[:, w.ACCELERATION],
        "leader_gap": np.where(second, seen[:, w.SECOND] - seen[:, w.REAR], 1e6),
        "adjacent_difference": v - seen[:, w.ADJACENT],
        "trucks_beside": seen[:, w.TRUCKS_BESIDE],
        "braking_beside": seen[:, w.BRAKING_BESIDE],
        "truck_behind": (seen[:, w.BEHIND_KIND] == TRUCK).astype(np.float64),
        "truck_second": (seen[:, w.SECOND_KIND] == TRUCK).astype(np.float64),
        "crowd_left": seen[:, w.CROWD_LEFT],
        "crowd_right": seen[:, w.CROWD_RIGHT],
        "abreast": seen[:, w.ABREAST],
        "faster_difference": v - seen[:, w.FASTER],
        "beside_gap": seen[:, w.BESIDE_GAP],
        "nearest_beside": seen[:, w.NEAREST_BESIDE],
        "motorcycles_beside": seen[:, w.MOTORCYCLES],
        "leader_length": seen[:, w.LENGTH],
        "since_standing": seen[:, w.SINCE_STANDING],
        "since_braking": seen[:, w.SINCE_BRAKING],
        "since_entry": seen[:, w.SINCE_ENTRY],
        "unrest": seen[:, w.UNREST],
        "wanted_acceleration": np.abs(state[:, :, ro.BASE_A]),
        "position": x,
        "time": seen[:, w.TIME],
        "lane": seen[:, w.LANE],
    }


def contents(state: Floats) -> dict[str, Floats]:
    """Return the acceleration (m/s²) by frame of a unit of each content: m/s², of log headway, of the response, s of delay."""
    own = state[:, :, ro.BASE_A]
    return {
        ACCELERATION: np.ones_like(own),
        HEADWAY: state[:, :, ro.BY_T],
        RESPONSE: np.clip(own, -STRONGEST, STRONGEST),
        DELAY: -np.clip(np.gradient(own, FRAME_STEP, axis=1), -STRONGEST, STRONGEST),
    }


Families = Callable[[w.Windows, Floats, Grid], Iterator[tuple[Family, Integers]]]


def families(windows: w.Windows, state: Floats, grid: Grid) -> Iterator[tuple[Family, Integers]]:
    """Yield each family, and the number of the bin that each frame is in (-1: none)."""
    timeless = w.several_periods(windows)
    for covariate, edges, number in _partitions(covariates(windows, state), grid):
        if timeless and covariate.startswith(TIMED):
            continue
        for content in _contents_along(covariate):
            yield Family(covariate, content, edges), number
    if not timeless:
        yield from _moving(windows, state, grid)


def inside(intervals: Sequence[Interval]) -> Families:
    """Return what yields, of places and times that are in the model, the families that ask whether they act all the time, and everywhere."""

    def each(windows: w.Windows, state: Floats, grid: Grid) -> Iterator[tuple[Family, Integers]]:
        x, t = state[:, :, ro.BASE_X], windows.seen[:, w.TIME, w.LEAD : -1]
        for interval in intervals:
            held, free, bins = (x, t, grid.time) if interval.axis == HELD[0] else (t, x, grid.place)
            edges, there = _coarser(bins, MOST_BINS), (held >= interval.begin) & (held < interval.end)
            family = Family(WITHIN[interval.axis], interval.content, (edges,), within=interval)
            yield family, np.where(there, numbered(free, edges), -1)

    return each


def _moving(windows: w.Windows, state: Floats, grid: Grid) -> Iterator[tuple[Family, Integers]]:
    """Yield bands that move along the road, for each speed."""
    x, t = state[:, :, ro.BASE_X], windows.seen[:, w.TIME, w.LEAD : -1]
    place, time = (grid.place[0], grid.place[-1]), (grid.time[0], grid.time[-1])
    for speed in SPEEDS:
        path = Path(speed, place, time)
        edges = path.bands()
        if len(edges) > MOST_BINS // BLOCKS:
            yield Family(f"{MOVING}{speed:g} m/s", ACCELERATION, (edges,), path), numbered(path.named(x, t), edges)


def _contents_along(covariate: str) -> tuple[str, ...]:
    if covariate.startswith(REGION + IN_LANE):  # few drivers each
        return (ACCELERATION,)
    if covariate == OWN:
        return ALONG_OWN
    return ALONG_COVARIATES if covariate in EDGES else ALONG_REGIONS


def _partitions(known: dict[str, Floats], grid: Grid) -> Iterator[tuple[str, tuple[Floats, ...], Integers]]:
    for name, edges in EDGES.items():
        yield name, (np.array(edges),), numbered(known[name], np.array(edges))
    places, times = _coarser(grid.place, MOST_BINS), _coarser(grid.time, MOST_BINS)
    x = np.clip(known["position"], places[0], places[-1] - 1e-6)
    i, j = numbered(x, places), numbered(known["time"], times)
    yield "position", (places,), i
    yield "time", (times,), j
    xs, ts = _coarser(grid.place, BLOCKS), _coarser(grid.time, BLOCKS)
    a, b = numbered(x, xs), numbered(known["time"], ts)
    cell = np.where((a >= 0) & (b >= 0), a * (len(ts) - 1) + b, -1)
    yield REGION, (xs, ts), cell
    if len(grid.lanes) > 1:
        yield "lane", (grid.lanes,), np.searchsorted(grid.lanes, known["lane"])
        for lane in grid.lanes:
            inside = known["lane"] == lane
            yield f"position{IN_LANE}{int(lane)}", (places,), np.where(inside, i, -1)
            yield f"time{IN_LANE}{int(lane)}", (times,), np.where(inside, j, -1)
            yield f"{REGION}{IN_LANE}{int(lane)}", (xs, ts), np.where(inside, cell, -1)


def _coarser(edges: Floats, most: int) -> Floats:
    """Return edges over the same range, of ``most`` bins at most."""
    return np.linspace(edges[0], edges[-1], min(most + 1, len(edges)))
