"""The observed frames smoothed by the past alone.

A smoother that looks ahead puts a little of the future into the last observed frame. Here speed and acceleration at
that frame are linear in the raw positions up to it. The weights are those with which training drivers come nearest to
what the smoother says that also sees the second after, so that they suit the noise of the recording, whatever it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.prediction import observation as o
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.perception import leader_rows_along, leaders_along
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

MEAN_ACCELERATION, LEADER_MEAN_ACCELERATION = "mean_acceleration_m_s2", "leader_mean_acceleration_m_s2"
MORE = (MEAN_ACCELERATION, LEADER_MEAN_ACCELERATION)
COUNTS = (2, 3, 4, 6, 10)  # frames that the weights are learned for
EXACT = 0.001  # m, no position is known better
HARDEST = 9.0  # m/s^2, a faster change of speed is another leader's


class Raw(NamedTuple):
    """Raw positions up to the last observed frame.

    Attributes
    ----------
    x, y : float64, shape (vehicles, frames)
        Front bumper (m).
    rear : float64, shape (vehicles, frames)
        The leader's rear bumper (m), NaN before a change of leader and without one.
    """

    x: Floats
    y: Floats
    rear: Floats


def raw_paths(scenes: Scenes, frames: int) -> Raw:
    """Return the raw positions of the window's first frames.

    Parameters
    ----------
    scenes : Scenes
    frames : int

    Returns
    -------
    Raw
        The smoothed positions where nothing else is known.
    """
    x, y, _, leader = o.watched(scenes, frames)
    rows, t = leader_rows_along(scenes, x, y, 0), scenes.traffic
    front = t.x if t.raw_x is None else t.raw_x
    known = rows != NOBODY
    rear = np.where(known, front[rows] - t.length[rows], np.nan) if len(front) else np.full(x.shape, np.nan)
    same = o.same_leader(np.where(known, x + leader.gap, np.nan), leader.speed)
    if scenes.raw_x is not None and scenes.raw_y is not None:
        x, y = scenes.raw_x[:, :frames], scenes.raw_y[:, :frames]
    return Raw(x, y, np.where(same, rear, np.nan))


@dataclass(frozen=True)
class PastOnly:
    """Weights from raw positions to speed and acceleration.

    Attributes
    ----------
    own, leader, lateral : dict of int to float64, shape (frames - 1, 2)
        By the number of frames: from the distances travelled since each of them, the latest first, to speed (m/s)
        and acceleration (m/s²).
    """

    own: dict[int, Floats]
    leader: dict[int, Floats]
    lateral: dict[int, Floats]

    @classmethod
    def fit(cls, scenes: Sequence[Scenes]) -> PastOnly:
        """Learn the weights from windows of training drivers.

        Parameters
        ----------
        scenes : sequence of Scenes
            They are recorded for at least one frame more than is observed.

        Returns
        -------
        PastOnly
        """
        found: list[list[tuple[Floats, Floats]]] = [[], [], []]
        for one in scenes:
            last = one.window.observed - 1
            if not 1 <= last < one.window.frames - 1:
                continue
            raw, around = raw_paths(one, last + 1), slice(last - 1, last + 2)
            leader = leaders_along(one, one.x[:, around], one.y[:, around], last - 1)
            lateral = np.gradient(one.y[:, around], FRAME_STEP, axis=1)
            for kind, path, speed in (
                (found[0], raw.x, one.speed[:, around]), (found[1], raw.rear, leader.speed), (found[2], raw.y, lateral),
            ):  # fmt: skip
                kind.append((path, np.column_stack([speed[:, 1], (speed[:, 2] - speed[:, 0]) / (2.0 * FRAME_STEP)])))
        return cls(*(_learned(kind) for kind in found))

    def first_second(self, scenes: Scenes) -> pd.DataFrame:
        """Return what the observed frames show of every driver.

        Parameters
        ----------
        scenes : Scenes

        Returns
        -------
        pandas.DataFrame
            As :func:`~idm_sumo.prediction.observation.first_second`, but by the past alone; own and leader's
            acceleration are those of the last frame, and those over the last second are
            beside them (``mean_acceleration_m_s2, leader_mean_acceleration_m_s2``).
        """
        frames = scenes.window.observed
        code = o.first_second(scenes)
        if frames < min(COUNTS) or not self.own:
            return code.assign(**{MEAN_ACCELERATION: code[o.ACCELERATION], LEADER_MEAN_ACCELERATION: np.nan})
        raw = raw_paths(scenes, frames)
        own, leader, lateral = (
            _estimates(path, weights)
            for path, weights in ((raw.x, self.own), (raw.rear, self.leader), (raw.y, self.lateral))
        )
        road, speed = scenes.road, np.maximum(own[:, 0], 0.0)
        ahead = np.where(np.isfinite(leader[:, 0]), leader[:, 0], speed)  # of a leader seen for one frame
        gap = raw.rear[:, -1] - raw.x[:, -1]
        seen = np.isfinite(gap)
        return code.assign(**{
            o.SPEED: speed, o.GAP: gap, o.APPROACH_RATE: np.where(seen, speed - ahead, np.nan),
            o.ACCELERATION: own[:, 1], o.LEADER_ACCELERATION: np.where(seen, leader[:, 1], np.nan),
            o.POSITION: raw.x[:, -1], o.LATERAL_SPEED: lateral[:, 0],
            o.OFFSET: raw.y[:, -1] - road.lane_center(road.lane_at(raw.y[:, -1])),
            MEAN_ACCELERATION: _over_a_second(raw.x), LEADER_MEAN_ACCELERATION: _over_a_second(raw.rear),
        })  # fmt: skip


def _travelled(path: Floats, frames: int) -> Floats:
    """Return the distances since the last frames, latest first."""
    return np.asarray(path[:, -1:] - path[:, -frames:-1][:, ::-1])


def _learned(parts: list[tuple[Floats, Floats]]) -> dict[int, Floats]:
    weights = {}
    for frames in COUNTS:
        pairs = [(_travelled(path, frames), target) for path, target in parts if path.shape[1] >= frames]
        if not pairs:
            continue
        x, y = (np.concatenate(columns) for columns in zip(*pairs, strict=True))
        use = np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1) & (np.abs(y[:, 1]) < HARDEST)
        x, y = x[use], y[use]
        if len(x):
            noise = EXACT**2 * (len(x) + 1) * np.eye(frames - 1)
            weights[frames] = np.linalg.solve(x.T @ x + noise, x.T @ y)
    return weights


def _estimates(path: Floats, weights: dict[int, Floats]) -> Floats:
    """Return speed and acceleration by all frames that are known."""
    found = np.full((len(path), 2), np.nan)
    for frames, weight in sorted(weights.items()):
        if frames <= path.shape[1]:
            value = _travelled(path, frames) @ weight
            found = np.where(np.isfinite(value), value, found)
    return found


def _over_a_second(path: Floats) -> Floats:
    """Return the acceleration between the ends of the last second."""
    k = (min(path.shape[1], max(COUNTS)) - 1) // 3
    if k == 0:
        return np.full(len(path), np.nan)
    late, early = path[:, -1] - path[:, -1 - k], path[:, -1 - 2 * k] - path[:, -1 - 3 * k]
    return np.asarray((late - early) / (2.0 * (k * FRAME_STEP) ** 2))
