"""What one observed second tells of a driver.

The state at its end, how it is changing, and where on the road.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.perception import LeadersAlong, leaders_along
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

SPEED, GAP, APPROACH_RATE = "speed_m_s", "gap_m", "closing_m_s"
ACCELERATION, LEADER_ACCELERATION = "acceleration_m_s2", "leader_acceleration_m_s2"
POSITION, LANE, OFFSET, LATERAL_SPEED = "position_m", "first_lane", "lane_offset_m", "lateral_speed_m_s"
SEEN = "leader_share"

COLUMNS = (
    SPEED, GAP, APPROACH_RATE, ACCELERATION, LEADER_ACCELERATION, POSITION, LANE, OFFSET, LATERAL_SPEED, SEEN,
)  # fmt: skip
FEWEST_FRAMES = 2  # for a rate of change
NEW_LEADER = 3.0  # m, a leader's rear that moves by more between two frames, beyond its speed, is another leader


def watched(scenes: Scenes, frames: int) -> tuple[Floats, Floats, Floats, LeadersAlong]:
    """Return positions, speeds and leaders of the window's first frames.

    Parameters
    ----------
    scenes : Scenes
    frames : int

    Returns
    -------
    x, y, speed : float64, shape (vehicles, frames)
        m, m, m/s.
    leader : LeadersAlong

    Raises
    ------
    InputError
        If the window has fewer frames.
    """
    if not 1 <= frames <= scenes.window.frames:
        raise InputError(f"frames = {frames}: must be between 1 and the window's {scenes.window.frames}")
    x, y, speed = (np.asarray(values[:, :frames]) for values in (scenes.x, scenes.y, scenes.speed))
    return x, y, speed, leaders_along(scenes, x, y, 0)


def first_second(scenes: Scenes, frames: int | None = None) -> pd.DataFrame:
    """Return what the window's first frames show of every driver.

    Parameters
    ----------
    scenes : Scenes
    frames : int, optional
        How many are seen; the window's ``observed`` by default.

    Returns
    -------
    pandas.DataFrame
        One row a driver, the columns of :data:`COLUMNS`: own speed (m/s), gap (m) and approach
        rate (m/s) in the last observed frame; own and leader's acceleration (m/s²), least-squares
        slopes of their speeds over the observed frames; position along the section (m), lane, offset to the left of its
        middle (m) and lateral speed (m/s, to the left); share of the frames in which a leader is
        seen. NaN where there is no leader in the last frame, or no rate of change in one frame.

    Raises
    ------
    InputError
        If the window has fewer frames than are to be observed.
    """
    x, y, speed, leader = watched(scenes, scenes.window.observed if frames is None else frames)
    seen = np.isfinite(leader.gap)
    gap = np.where(seen, leader.gap, np.nan)
    lane = scenes.road.lane_at(y[:, -1])
    return pd.DataFrame({
        SPEED: speed[:, -1],
        GAP: gap[:, -1],
        APPROACH_RATE: speed[:, -1] - leader.speed[:, -1],
        ACCELERATION: _slope(speed),
        LEADER_ACCELERATION: _slope(np.where(same_leader(x + gap, leader.speed), leader.speed, np.nan)),
        POSITION: x[:, -1],
        LANE: lane.astype(np.float64),
        OFFSET: y[:, -1] - scenes.road.lane_center(lane),
        LATERAL_SPEED: _slope(y),
        SEEN: seen.mean(axis=1),
    })  # fmt: skip


def same_leader(rear: Floats, speed: Floats) -> npt.NDArray[np.bool_]:
    """Return the frames whose leader is the last frame's.

    Parameters
    ----------
    rear, speed : float64, shape (vehicles, frames)
        The leader's rear bumper (m) and speed (m/s); infinite and NaN without one.

    Returns
    -------
    bool, shape (vehicles, frames)
    """
    jump = np.abs(np.diff(rear, axis=1) - speed[:, :-1] * FRAME_STEP) > NEW_LEADER
    changed_later = np.cumsum(jump[:, ::-1], axis=1)[:, ::-1] > 0
    return np.isfinite(rear) & np.pad(~changed_later, ((0, 0), (0, 1)), constant_values=True)


def _slope(values: Floats) -> Floats:
    """Return each row's least-squares slope (per second).

    Over its finite values; NaN with fewer than two.
    """
    known = np.isfinite(values)
    count = known.sum(axis=1)
    enough = count >= FEWEST_FRAMES
    t = np.broadcast_to(FRAME_STEP * np.arange(values.shape[1]), values.shape)
    share = np.maximum(count, 1)
    off = np.where(known, t - (np.where(known, t, 0.0).sum(axis=1) / share)[:, None], 0.0)
    spread = (off**2).sum(axis=1)
    total = (off * np.where(known, values, 0.0)).sum(axis=1)
    return np.asarray(np.divide(total, spread, out=np.full(len(values), np.nan), where=enough & (spread > 0.0)))
