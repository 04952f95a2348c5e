"""The driving code that the paper predicts from.

What is observed of a driver to predict its IDM parameters: three means over the observed frames.

``nu``
    speed. Where the paper says what was computed it says "velocity", where it motivates
    the code "relative velocity". Own speed is the default: it needs no leader, so it is
    never missing. The mean approach rate is there beside it (``speed="relative"``).
``omega``
    time headway, "the time to travel from the expert vehicle to the preceding vehicle":
    bumper-to-bumper gap by own speed, as the IDM's :math:`T` counts it, not front to front.
``tau``
    offset to the left of the middle of the lane the vehicle is in *at each frame*; against
    the middle of its first lane a lane change of the training window would be an offset
    of metres, which one observed second never shows.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.prediction.observation import watched
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

SPEED = "mean_speed_m_s"  # not the speed at departure, which a driver table holds too
APPROACH_RATE = "approach_rate_m_s"
OFFSET = "offset_m"
TIME_HEADWAY = "time_headway_s"
LEADER_FRAMES = "leader_frames"

FEATURES = {"nu": SPEED, "omega": TIME_HEADWAY, "tau": OFFSET}  # the paper's symbols

SLOWEST = 1.0  # m/s, at walking pace a time headway would grow beyond all bounds


def features_of(symbols: Iterable[str], *, speed: str = "own") -> tuple[str, ...]:
    """Return the columns that the paper's symbols stand for.

    Parameters
    ----------
    symbols : iterable of {"nu", "omega", "tau"}
    speed : {"own", "relative"}
        What ``nu`` stands for: mean speed or mean approach rate.

    Returns
    -------
    tuple of str
        Columns of a driving code.

    Raises
    ------
    InputError
        On another symbol or speed.
    """
    if speed not in ("own", "relative"):
        raise InputError(f"speed = {speed!r}: must be 'own' or 'relative'")
    columns = FEATURES | ({"nu": APPROACH_RATE} if speed == "relative" else {})
    chosen = tuple(symbols)
    if unknown := [s for s in chosen if s not in columns]:
        raise InputError(f"feature {unknown[0]!r}: must be one of {', '.join(columns)}")
    return tuple(columns[s] for s in chosen)


def driving_code(scenes: Scenes, frames: int | None = None) -> pd.DataFrame:
    """Return the driving code of every recorded driver.

    Parameters
    ----------
    scenes : Scenes
    frames : int, optional
        Observe the window's first so many frames (test drivers); by default all (training).

    Returns
    -------
    pandas.DataFrame
        One row a driver, in the order of ``scenes``: ``mean_speed_m_s``, ``approach_rate_m_s``,
        ``offset_m``, ``time_headway_s`` and ``leader_frames``, the number of frames in which
        a leader is seen. Time headway and approach rate are means over these frames, NaN
        where there is none. Below ``SLOWEST`` the time headway is the gap by ``SLOWEST``,
        and a gap below zero (assumed lengths, measurement errors) counts as zero.

    Raises
    ------
    InputError
        If the window has fewer frames than are to be observed.
    """
    _, y, speed, leader = watched(scenes, scenes.window.frames if frames is None else frames)
    seen = np.isfinite(leader.gap)
    headway = np.maximum(leader.gap, 0.0) / np.maximum(speed, SLOWEST)
    return pd.DataFrame({
        SPEED: speed.mean(axis=1),
        APPROACH_RATE: _mean_where(seen, speed - leader.speed),
        OFFSET: (y - scenes.road.lane_center(scenes.road.lane_at(y))).mean(axis=1),
        TIME_HEADWAY: _mean_where(seen, headway),
        LEADER_FRAMES: seen.sum(axis=1),
    })  # fmt: skip


def _mean_where(which: npt.NDArray[np.bool_], values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return each row's mean over some of its values.

    NaN where there are none.
    """
    count = which.sum(axis=1)
    total = np.where(which, values, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0))
