"""Functions of the first second that predict parameters linearly."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.models import idm

Floats = npt.NDArray[np.float64]

NAMES = (
    "speed", "log gap", "time gap", "approach rate", "acceleration", "leader's acceleration", "imbalance", "position",
    "lane", "offset", "lateral speed", "lateral motion", "distance from middle",
)  # fmt: skip
(V, LOG_GAP, HEADWAY, RATE, ACC, LEADER_ACC, IMBALANCE, AT) = range(8)
SQUARED = (HEADWAY, V, LOG_GAP, RATE, IMBALANCE)
TOGETHER = (
    (HEADWAY, V), (HEADWAY, RATE), (HEADWAY, IMBALANCE), (V, RATE), (V, AT), (HEADWAY, AT), (IMBALANCE, RATE),
    (HEADWAY, LEADER_ACC), (V, LEADER_ACC), (IMBALANCE, ACC),
)  # fmt: skip
SLOWEST = 3.0  # m/s, below it a time gap is the gap by this
MOST_IMBALANCE = 4.0  # m/s^2
MOST_HEADWAY = 6.0  # s
LEAST_GAP = 0.5  # m


@njit(cache=True, error_model="numpy")
def _pooled_acceleration(v, rate, gap, theta, desired_speed, out):  # type: ignore[no-untyped-def]
    for i in range(len(v)):
        out[i] = idm.acceleration(
            v[i], rate[i], gap[i], theta[0], theta[1], theta[2], theta[3], theta[4], desired_speed
        )


def pooled_acceleration(
    speed: Floats, rate: Floats, gap: Floats, pooled: idm.IDMParameters, desired_speed: float
) -> Floats:
    """Return what the pooled IDM would do in each state.

    Parameters
    ----------
    speed, rate, gap : float64, any equal shape
        m/s, own speed less the leader's (m/s), m.
    pooled : IDMParameters
    desired_speed : float
        m/s.

    Returns
    -------
    float64, same shape
        m/s².
    """
    out = np.empty(speed.size)
    v, dv, d = (np.ascontiguousarray(values).ravel() for values in (speed, rate, gap))
    _pooled_acceleration(v, dv, d, np.asarray(pooled, dtype=np.float64), float(desired_speed), out)
    return out.reshape(speed.shape)


def plain(codes: Floats, pooled: idm.IDMParameters, desired_speed: float) -> Floats:
    r"""Return what is told apart in a first second.

    Parameters
    ----------
    codes : float64, shape (drivers, 10)
        :func:`~idm_sumo.prediction.observation.first_second`; a driver without leader gets nonsense here and
        the population elsewhere.
    pooled : IDMParameters
    desired_speed : float
        m/s.

    Returns
    -------
    float64, shape (drivers, 13)
        In the order of :data:`NAMES`, SI units.

    Notes
    -----
    Two tell how the driver differs from the pooled one: the time gap that would make the observed gap its
    equilibrium, :math:`(d - d_0 - d_1\sqrt{v/v_0})/v`, and the imbalance, its acceleration less the pooled
    IDM's in the same situation.
    """
    v, gap, rate, acc, leader_acc, at, lane, offset, lateral, _ = np.nan_to_num(codes).T
    d = np.maximum(gap, LEAST_GAP)
    root = np.sqrt(np.clip(v / desired_speed, 0.0, None))
    headway = np.clip((d - pooled.d0 - pooled.d1 * root) / np.maximum(v, SLOWEST), -1.0, MOST_HEADWAY)
    imbalance = np.clip(acc - pooled_acceleration(v, rate, d, pooled, desired_speed), -MOST_IMBALANCE, MOST_IMBALANCE)
    return np.column_stack([
        v, np.log(d), headway, rate, acc, leader_acc, imbalance, at, lane, offset, lateral,
        np.abs(lateral), np.abs(offset),
    ])  # fmt: skip


def expand(standard: Floats) -> Floats:
    """Return standardised values with their squares and products.

    Parameters
    ----------
    standard : float64, shape (drivers, 13)

    Returns
    -------
    float64, shape (drivers, 28)
    """
    more = [standard[:, j] ** 2 for j in SQUARED] + [standard[:, j] * standard[:, k] for j, k in TOGETHER]
    return np.column_stack([standard, *more])
