"""What a driver's residual is predicted from."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import basis
from idm_sumo.prediction.observation import COLUMNS
from idm_sumo.prediction.past_only import LEADER_MEAN_ACCELERATION, MEAN_ACCELERATION, Raw, raw_paths
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

SPANS = (20, 50, 100, 200)  # frames of a longer past
STRIDE = 5  # frames, over which speeds of the longer past are taken
MOST = 4.0  # m/s^2


def facts(scenes: Scenes, code: pd.DataFrame, pooled: IDMParameters, desired_speed: float) -> Floats:
    """Return the facts of every driver, not standardised.

    Parameters
    ----------
    scenes : Scenes
    code : pandas.DataFrame
        Of :meth:`~idm_sumo.prediction.past_only.PastOnly.first_second`.
    pooled : IDMParameters
    desired_speed : float
        m/s.

    Returns
    -------
    float64, shape (drivers, facts)
        :func:`~idm_sumo.prediction.basis.plain`, own and leader's acceleration over the last second, and for every
        span of a longer past the mean imbalance (m/s²) and time gap (s).
    """
    plain = basis.plain(code[list(COLUMNS)].to_numpy(np.float64), pooled, desired_speed)
    means = np.nan_to_num(code[[MEAN_ACCELERATION, LEADER_MEAN_ACCELERATION]].to_numpy(np.float64))
    found = [plain, np.clip(means, -MOST, MOST)]
    spans = [span for span in SPANS if span <= scenes.window.observed]
    if spans:
        imbalance, headway = _along(raw_paths(scenes, scenes.window.observed), pooled, desired_speed)
        for span in spans:
            found += [_mean(values[:, -(span // STRIDE - 2) :])[:, None] for values in (imbalance, headway)]
    return np.concatenate(found, axis=1)


def expanded(standard: Floats) -> Floats:
    """Return standardised facts with a constant, squares and products.

    Parameters
    ----------
    standard : float64, shape (drivers, facts)

    Returns
    -------
    float64, shape (drivers, more)
        The constant first.
    """
    plain = len(basis.NAMES)
    more = basis.expand(standard[:, :plain])
    return np.column_stack([np.ones(len(standard)), more, standard[:, plain:]])


def _along(raw: Raw, pooled: IDMParameters, desired_speed: float) -> tuple[Floats, Floats]:
    """Return imbalance (m/s²) and time gap (s) along the past."""
    x, rear = (path[:, ::-1][:, ::STRIDE][:, ::-1] for path in (raw.x, raw.rear))
    step = STRIDE * FRAME_STEP
    speed, ahead = np.diff(x, axis=1) / step, np.diff(rear, axis=1) / step
    acceleration, v, u = np.diff(speed, axis=1) / step, 0.5 * (speed[:, 1:] + speed[:, :-1]), ahead[:, :-1]
    gap = (rear - x)[:, 1:-1]
    known = np.isfinite(gap) & np.isfinite(u)
    d = np.where(known, np.maximum(gap, basis.LEAST_GAP), 1.0)
    rate = np.where(known, v - u, 0.0)
    expected = basis.pooled_acceleration(v, rate, d, pooled, desired_speed)
    imbalance = np.clip(acceleration - expected, -MOST, MOST)
    headway = np.minimum(d / np.maximum(v, basis.SLOWEST), basis.MOST_HEADWAY)
    return np.where(known, imbalance, np.nan), np.where(known, headway, np.nan)


def _mean(values: Floats) -> Floats:
    """Return each row's mean over its finite values.

    0 without any.
    """
    known = np.isfinite(values)
    return np.asarray(np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))
