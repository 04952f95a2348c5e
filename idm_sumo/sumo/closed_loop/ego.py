"""A vehicle driven by our own model among SUMO's."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.models import bicycle
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads import Road
from idm_sumo.simulation.rollout import control
from idm_sumo.sumo.replay.perception import leader_by_getleader
from idm_sumo.sumo.replay.scene import ON_ROUTE_AT_EXACT_PLACE, compass

COLUMNS = ("time_s", "x", "y", "heading", "speed", "acceleration", "steering", "gap_m", "leader")
KEEP_LANE = 0  # SUMO's lane change mode: none of its own


class Ego:
    """A vehicle that drives by IDM, pure pursuit and bicycle.

    SUMO inserts it. Python moves it as long as it is in the section; behind the section SUMO drives it on. It keeps
    to the middle of the lane it enters in.

    Parameters
    ----------
    vehicle : int
        Number of a vehicle of the demand that enters on a main lane.
    road : Road
    lane : int
        Main lane that it keeps, 1 leftmost.
    parameters : array_like, shape (5,)
        ``a, b, T, d0, d1`` (SI units).
    length : float
        m.
    desired_speed : float, optional
        m/s; by default the road's speed limit.
    """

    def __init__(
        self,
        vehicle: int,
        road: Road,
        lane: int,
        parameters: npt.ArrayLike,
        length: float,
        desired_speed: float | None = None,
    ) -> None:
        self.name = str(vehicle)
        self._lane_y = float(road.lane_center(lane))
        self._theta = np.ascontiguousarray(parameters, dtype=np.float64)
        self._length, self._desired_speed = length, float(road.desired_speed(desired_speed))
        self._end = road.length
        self._state: tuple[float, float, float, float] | None = None
        self._rows: list[tuple[float, ...]] = []
        self._done = False

    def drive(self, sumo: Any, step: int) -> None:
        """Perceive after a step of SUMO and move on.

        Parameters
        ----------
        sumo : module
            As of :func:`idm_sumo.sumo.session.simulation`.
        step : int
            Number of the step.
        """
        if self._done:
            return
        if self._state is None:
            if self.name not in sumo.simulation.getDepartedIDList():
                return
            self._enter(sumo)
        x, y, heading, speed = self._state or (np.nan,) * 4
        front_x, front_y = bicycle.front_of_center(x, y, heading, self._length)
        name, gap = leader_by_getleader(sumo, self.name)
        leader_speed = speed if name is None else sumo.vehicle.getSpeed(name)
        acceleration, steering = control(
            x, y, heading, speed, gap, leader_speed, self._theta, self._desired_speed, self._length, self._lane_y
        )
        leader = np.nan if name is None else float(name)
        self._rows.append((step * FRAME_STEP, front_x, front_y, heading, speed, acceleration, steering, gap, leader))
        axles = bicycle.wheelbase(self._length)
        self._state = bicycle.step(x, y, heading, speed, acceleration, steering, axles, FRAME_STEP)
        self._move(sumo)

    def _enter(self, sumo: Any) -> None:
        sumo.vehicle.setLaneChangeMode(self.name, KEEP_LANE)
        front_x, front_y = sumo.vehicle.getPosition(self.name)
        self._state = (
            *bicycle.center_of_front(front_x, front_y, 0.0, self._length),
            0.0,
            sumo.vehicle.getSpeed(self.name),
        )

    def _move(self, sumo: Any) -> None:
        if self._state is None:
            return
        x, y, heading, _ = self._state
        front_x, front_y = bicycle.front_of_center(x, y, heading, self._length)
        if front_x > self._end:
            self._done = True  # a vehicle that is not moved drives itself
            return
        sumo.vehicle.moveToXY(self.name, "", -1, front_x, front_y, float(compass(heading)), ON_ROUTE_AT_EXACT_PLACE)

    def table(self) -> pd.DataFrame:
        """Return the path that it drove.

        Returns
        -------
        pandas.DataFrame
            ``time_s, x, y`` (front bumper, m), ``heading`` (rad), ``speed`` (m/s), ``acceleration`` (m/s²),
            ``steering`` (rad), ``gap_m``, ``leader`` (NaN without one), one row a step.
        """
        return pd.DataFrame(self._rows, columns=list(COLUMNS))
