"""What predicted drivers do beyond the IDM in closed loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.models import idm
from idm_sumo.models.residual import REGRESSORS, followed_acceleration
from idm_sumo.prediction.residual_drive import ROOM, ResidualDrivers, residual_of
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.traffic import NOBODY

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Followed(NamedTuple):
    """What vehicles remember of their leaders; changed as they drive.

    Attributes
    ----------
    since : float64, shape (vehicles,)
        When the vehicle came onto the main lanes (s), NaN before.
    speed : float64, shape (vehicles,)
        The leader's at the last step (m/s).
    acceleration : float64, shape (vehicles,)
        The leader's as the driver knows it (m/s²).
    """

    since: Floats
    speed: Floats
    acceleration: Floats


class Residuals:
    """Adds predicted residuals to the accelerations of a closed loop.

    A residual was predicted from a vehicle's first observed frames, so it begins when a vehicle has been on the main
    lanes for as long; before, the vehicle drives by its IDM alone.

    Parameters
    ----------
    drivers : ResidualDrivers
    row : int64, shape (vehicles,)
        Row of ``drivers`` for each vehicle of the demand, -1 for one without a residual.
    """

    def __init__(self, drivers: ResidualDrivers, row: Integers) -> None:
        n, known = len(row), row >= 0
        self.shared, self.observed = drivers.model.shared, drivers.model.observed
        self.weights, self.own, first = np.zeros((n, REGRESSORS)), np.zeros((n, 3)), np.zeros(n)
        self.weights[known] = drivers.shared_weights()[row[known]]
        self.own[known] = drivers.own[row[known]]
        first[known] = drivers.leader_acceleration[row[known]]
        self.followed = Followed(np.full(n, np.nan), np.full(n, np.nan), first)

    def add(self, present: NamedTuple, acceleration: Floats, now: float) -> Floats:
        """Return accelerations with the residuals.

        Parameters
        ----------
        present : idm_sumo.sumo.closed_loop.extended_loop.Present
            Vehicles on the main lanes, by lane and position.
        acceleration : float64, shape (n,)
            m/s².
        now : float
            s.

        Returns
        -------
        float64, shape (n,)
            m/s², not below emergency braking.
        """
        total = acceleration.copy()
        _add(present, self.followed, self.shared, self.weights, self.own, self.observed, now, total)
        return total


@njit(cache=True, error_model="numpy")
def _add(present, followed, shared, weights, own, observed, now, acceleration):  # type: ignore[no-untyped-def]
    scratch = np.empty((ROOM, REGRESSORS))
    for i in range(len(acceleration)):
        vehicle, speed = present.place[i], present.speed[i]
        row, gap = present.leader[i], present.gap[i]
        leader = present.speed[row] if row != NOBODY else 0.0
        if np.isnan(followed.since[vehicle]):
            followed.since[vehicle] = now
        step = round((now - followed.since[vehicle]) / FRAME_STEP) - observed
        if step > 0:
            followed.acceleration[vehicle] = followed_acceleration(
                followed.acceleration[vehicle], followed.speed[vehicle], leader, FRAME_STEP
            )
        followed.speed[vehicle] = leader
        if step >= 0:
            extra = residual_of(
                speed, speed - leader, gap, followed.acceleration[vehicle], step * FRAME_STEP, shared,
                weights[vehicle], own[vehicle], scratch,
            )  # fmt: skip
            acceleration[i] = max(acceleration[i] + extra, -idm.EMERGENCY_BRAKING)
