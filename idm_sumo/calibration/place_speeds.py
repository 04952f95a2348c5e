r"""Desired speeds by place and time, from free drivers.

The IDM accelerates by :math:`a\,[1-(v/v_0)^4-(d^*/d)^2]`. Where the recorded acceleration, the speed and the gap are
known, the desired speed is what remains:

.. math:: v_0 = v\,\Big/\sqrt[4]{1-(d^*/d)^2-\dot v/a}.

A driver with a leader near says little about it, so only moments count in which the leader takes less than half of the
acceleration. The result is lower than the speed limit where a place holds drivers up: a narrow lane, a curve, a merge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.models.idm import IDMParameters
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.leaders import row_ahead
from idm_sumo.recordings.recording import Recording

Floats = npt.NDArray[np.float64]

INTERVAL = 300.0  # s
SETTING = 10.0  # s between two settings of a sign that goes from one interval's speed to the next's
HELD_UP = 0.5  # share of the acceleration that a leader takes, from which on its follower is not free
SLOWEST = 1.0  # m/s; who is slower stands in a queue
LEAST_MOMENTS = 10  # of a driver at a place, a second
FEWEST = 20  # free drivers that a speed rests on


@dataclass(frozen=True)
class PlaceSpeeds:
    """Desired speeds at each place and time.

    Attributes
    ----------
    ends : float64, shape (places,)
        ``x`` (m) at which each stretch of road ends.
    speeds : float64, shape (intervals, places)
        m/s in each interval of five minutes; infinite where nobody is seen to be held up by the place.
    """

    ends: Floats
    speeds: Floats

    def at(self, x: Floats, seconds: float | Floats) -> Floats:
        """Return the speeds at places and moments.

        Between the middles of two intervals they change gradually, in steps of ``SETTING``: before a sign that falls at
        once everybody would brake hard.

        Parameters
        ----------
        x : float64, shape (n,)
            m.
        seconds : float or float64, shape (n,)
            Since the start.

        Returns
        -------
        float64, shape (n,)
            m/s.
        """
        setting = np.asarray(seconds) // SETTING * SETTING
        middle = np.clip(setting / INTERVAL - 0.5, 0.0, len(self.speeds) - 1)
        before = np.floor(middle).astype(np.int64)
        after = np.minimum(before + 1, len(self.speeds) - 1)
        place = np.minimum(np.searchsorted(self.ends, x, side="right"), len(self.ends) - 1)
        one, other = self.speeds[before, place], self.speeds[after, place]
        with np.errstate(invalid="ignore"):
            between = one + (middle - before) * (other - one)
        nearest = np.where(middle - before < 0.5, one, other)
        return np.asarray(np.where(np.isfinite(one) & np.isfinite(other), between, nearest))


def place_speeds(recording: Recording, parameters: IDMParameters, ends: Floats) -> PlaceSpeeds:
    """Estimate the desired speed of every stretch of road.

    It is the median over drivers, each with the mean over its free moments there. Between intervals with fewer than
    ``FEWEST`` free drivers it is interpolated. What remains of the recording after the last whole interval belongs to
    that one if it is shorter than half of one.

    Parameters
    ----------
    recording : Recording
        One period, smoothed, with all its vehicles.
    parameters : IDMParameters
        One set for all drivers, as of :func:`idm_sumo.calibration.pooled`.
    ends : float64, shape (places,)
        ``x`` (m) at which each stretch ends, in driving order.

    Returns
    -------
    PlaceSpeeds
    """
    seconds = (recording.table[c.FRAME].max() - recording.table[c.FRAME].min()) * FRAME_STEP
    intervals = max(1, round(seconds / INTERVAL))
    moments = _free_moments(recording, parameters, ends, intervals)
    by_driver = moments.groupby(["interval", "place", c.VEHICLE])
    drivers = by_driver.mean()[by_driver.size() >= LEAST_MOMENTS]
    left = drivers["left"].clip(lower=0.0)
    with np.errstate(divide="ignore"):
        own = (drivers["speed4"] / left) ** 0.25  # infinite if a driver accelerates as if nothing held it up
    cells = own.groupby(level=["interval", "place"])
    median = cells.median().where(cells.size() >= FEWEST).unstack()
    wanted = median.reindex(index=range(intervals), columns=range(len(ends)))
    speeds = wanted.interpolate(limit_direction="both").to_numpy()
    return PlaceSpeeds(ends, np.where(speeds < recording.road.speed_limit, speeds, np.inf))


def _free_moments(
    recording: Recording, parameters: IDMParameters, ends: Floats, intervals: int
) -> pd.DataFrame:  # fmt: skip
    """Return the moments of drivers whom no leader holds up."""
    table, road = recording.table, recording.road
    ahead = row_ahead(table)
    x, speed = table[c.X].to_numpy(), table[c.SPEED].to_numpy()
    length = table[c.LENGTH].fillna(road.car_length).to_numpy()
    gap = np.where(ahead >= 0, x[ahead] - length[ahead] - x, np.inf)
    rate = np.where(ahead >= 0, speed - speed[ahead], 0.0)
    a, b, T, d0, d1 = parameters
    wanted = (
        d0 + d1 * np.sqrt(speed / road.speed_limit) + np.maximum(T * speed + 0.5 * speed * rate / np.sqrt(a * b), 0)
    )
    taken = (wanted / np.maximum(gap, 0.1)) ** 2
    inside = (x >= 0.0) & (x <= road.length) & (table[c.LANE].to_numpy() <= road.main_lanes)
    free = np.flatnonzero(inside & (taken < HELD_UP) & (speed > SLOWEST))
    frame = table[c.FRAME].to_numpy()
    return pd.DataFrame({
        "interval": np.minimum((frame[free] - frame.min()) * FRAME_STEP // INTERVAL, intervals - 1).astype(np.int64),
        "place": np.minimum(np.searchsorted(ends, x[free], side="right"), len(ends) - 1),
        c.VEHICLE: table[c.VEHICLE].to_numpy()[free], "speed4": speed[free] ** 4,
        "left": (1.0 - taken - table[c.ACCELERATION].to_numpy() / a)[free],
    })  # fmt: skip
