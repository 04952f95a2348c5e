"""A closed loop whose main lanes an extended model drives.

SUMO changes the lanes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration.departures import DESTINATION, THROUGH
from idm_sumo.calibration.place_speeds import PlaceSpeeds
from idm_sumo.models.effects import ExtendedModel, extended_acceleration
from idm_sumo.models.effects.hysteresis import LATELY
from idm_sumo.models.effects.lane_change_relaxation import headway_after
from idm_sumo.models.effects.reaction_delay import REMEMBERED, acted_on
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads import Road
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.simulation.extended_rollout import meet, note
from idm_sumo.simulation.rollout import perceive
from idm_sumo.simulation.surroundings import TrafficDetails
from idm_sumo.simulation.traffic_around import NOBODY_YET, look
from idm_sumo.sumo.closed_loop.residual_loop import Residuals

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

PAST = REMEMBERED + 1  # moments that a delay can reach back to, and the present
OURS, SUMOS = 0, 31  # SUMO's speed modes: no check of its own; all of them


class Memory(NamedTuple):
    """What vehicles remember; changed as they drive.

    Attributes
    ----------
    past : float64, shape (vehicles, PAST, 3)
        Gap (m), speed and approach rate (m/s), the present last.
    moments : int64, shape (vehicles,)
        How many of them have been.
    leader : int64, shape (vehicles,)
        Number of the leader.
    changed : float64, shape (vehicles, 3)
        By how much the last leader change shortened the gap (m), when (s), and the time headway right after it (s).
    driven : float64, shape (vehicles,)
        Sum of speeds (m/s).
    speed : float64, shape (vehicles, LATELY + 1)
        Of the last steps (m/s), the present last, NaN before the first.
    """

    past: Floats
    moments: Integers
    leader: Integers
    changed: Floats
    driven: Floats
    speed: Floats


class Present(NamedTuple):
    """Vehicles on the main lanes, by lane and position.

    Attributes
    ----------
    place : int64, shape (n,)
        Row of the demand.
    x, speed, length : float64, shape (n,)
        Front bumper (m), m/s, m.
    lane : int64, shape (n,)
        Main lane, 1 leftmost.
    offsets : int64, shape (main lanes + 1,)
        Where the vehicles of each lane begin.
    others : TrafficDetails
        What is seen of them, arrays of shape (n,).
    leader : int64, shape (n,)
        Row of the leader, ``NOBODY`` without one.
    gap : float64, shape (n,)
        Gap (m), infinite without a leader.
    """

    place: Integers
    x: Floats
    speed: Floats
    length: Floats
    lane: Integers
    offsets: Integers
    others: TrafficDetails
    leader: Integers
    gap: Floats


class Models(NamedTuple):
    """Models of the vehicles of the demand.

    Attributes
    ----------
    magnitudes : float64, shape (2, main lanes + 1, slots)
        Magnitudes of the effects in each lane: with and without those that only a share of the drivers has.
    without : int64, shape (vehicles,)
        Which of the two a driver has.
    theta : float64, shape (vehicles, 5)
        ``a, b, T, d0, d1`` (SI units).
    desired_speed : float64, shape (vehicles,)
        m/s.
    """

    magnitudes: Floats
    without: Integers
    theta: Floats
    desired_speed: Floats


class ModelDrivers:
    """Drives all vehicles that stay on the main lanes.

    Vehicles on ramps, on the auxiliary lane, behind the section, and those that leave by the off-ramp are driven by
    SUMO: they must respect ends of lanes, which a car-following model does not know.

    Parameters
    ----------
    model : ExtendedModel
    demand : pandas.DataFrame
        As of :func:`idm_sumo.sumo.closed_loop.demand.demand_of`.
    theta : float64, shape (vehicles, 5)
        ``a, b, T, d0, d1`` of each vehicle of the demand (SI units).
    road : Road
    desired_speed : float or float64, shape (vehicles,), optional
        m/s; by default the model's.
    has : bool, shape (vehicles,), optional
        Which drivers have the effects that only a share has; by default the model's share of them, by their numbers.
    places : PlaceSpeeds, optional
        Speeds that no vehicle wants to exceed at a place.
    residuals : Residuals, optional
        What predicted drivers do beyond the model.

    Attributes
    ----------
    driven_steps : int
        Vehicle-steps that the model drove.

    Notes
    -----
    At each step all vehicles are looked at, then all decide together, then SUMO is told their speeds: Euler with the
    new speed, as in SUMO's own models. Without effects the result is that of SUMO's IDM to the last digit, with two
    exceptions: SUMO overlooks leaders some hundreds of metres ahead (centimetres of difference), and its lane changing
    adjusts the speeds of the drivers that SUMO drives only. In dense traffic compare a model with the same loop without
    its effects. Moments in the future (a cut-in, the own lane change) are unknown here.
    """

    def __init__(
        self,
        model: ExtendedModel,
        demand: pd.DataFrame,
        theta: Floats,
        road: Road,
        desired_speed: float | Floats | None = None,
        has: npt.NDArray[np.bool_] | None = None,
        places: PlaceSpeeds | None = None,
        residuals: Residuals | None = None,
    ) -> None:
        n, self._road, self._places, self._residuals = len(demand), road, places, residuals
        self._place = {str(vehicle): i for i, vehicle in enumerate(demand[c.VEHICLE])}
        has = model.has_partial_causes(demand[c.VEHICLE]) if has is None else has
        self._models = Models(
            np.stack([each.magnitudes_by_lane(road.main_lanes) for each in (model, model.without_partial_causes())]),
            (~has).astype(np.int64),
            np.ascontiguousarray(theta, dtype=np.float64),
            np.full(n, model.desired_speed if desired_speed is None else desired_speed, dtype=np.float64),
        )
        self._length = demand[d.LENGTH].fillna(road.car_length).to_numpy(dtype=np.float64)
        kind = demand[d.CLASS].to_numpy(dtype=np.float64)
        self._class = np.where(kind > 0, kind, np.nan)
        self._through = (demand[DESTINATION] == THROUGH).to_numpy()
        self._memory = Memory(
            np.full((n, PAST, 3), np.nan), np.zeros(n, dtype=np.int64), np.full(n, NOBODY_YET, dtype=np.int64),
            np.full((n, 3), np.nan), np.zeros(n), np.full((n, LATELY + 1), np.nan),
        )  # fmt: skip
        self._ours: set[str] = set()
        self.driven_steps = 0  # vehicle-steps that the model drove

    def drive(self, sumo: Any, step: int) -> None:
        """Look around after a step of SUMO and set speeds.

        Parameters
        ----------
        sumo : module
            As of :func:`idm_sumo.sumo.session.simulation`.
        step : int
            Number of the step.
        """
        names = [name for name in sumo.vehicle.getIDList() if name in self._place]
        if not names:
            return
        place = np.array([self._place[name] for name in names])
        where = np.array([sumo.vehicle.getPosition(name) for name in names])
        speed = np.array([sumo.vehicle.getSpeed(name) for name in names])
        road, lane = self._road, self._road.lane_at(where[:, 1])
        on_main = road.on_main_lanes(where[:, 1]) & (where[:, 0] >= 0.0)
        ours = on_main & self._through[place] & (where[:, 0] <= road.length)
        order = np.flatnonzero(on_main)[np.lexsort((where[on_main, 0], lane[on_main]))]
        acceleration = np.full(len(names), np.nan)
        acceleration[order] = self._decide(place[order], where[order, 0], speed[order], lane[order], step)
        fastest = np.maximum(speed + acceleration * FRAME_STEP, 0.0)
        self._tell(sumo, names, ours, fastest)

    def _decide(self, place: Integers, x: Floats, speed: Floats, lane: Integers, step: int) -> Floats:
        """Return all accelerations (m/s²).

        The vehicles are sorted by lane and position.
        """
        lanes = self._road.main_lanes
        offsets = np.zeros(lanes + 1, dtype=np.int64)
        np.cumsum(np.bincount(lane - 1, minlength=lanes), out=offsets[1:])
        others = TrafficDetails(*self._accelerations(place, speed), self._class[place], place + 1)
        length = self._length[place]
        ahead = leaders(lane, offsets, x, length, others.who)
        present = Present(place, x, speed, length, lane, offsets, others, *ahead)
        models = self._models
        if self._places is not None:
            limited = models.desired_speed.copy()
            limited[place] = np.minimum(limited[place], self._places.at(x, step * FRAME_STEP))
            models = models._replace(desired_speed=limited)
        now = step * FRAME_STEP
        acceleration = np.asarray(_decide_all(present, models, self._memory, now))
        return acceleration if self._residuals is None else self._residuals.add(present, acceleration, now)

    def _accelerations(self, place: Integers, speed: Floats) -> tuple[Floats, Floats]:
        """Return accelerations (m/s²) of the last step and seconds.

        The speeds are remembered.
        """
        before = self._memory.speed[place, 1:]
        self._memory.speed[place] = np.column_stack([before, speed])
        known = np.isfinite(before)
        first = before[np.arange(len(place)), np.argmax(known, axis=1)]
        change = np.nan_to_num((speed - before[:, -1]) / FRAME_STEP)
        return change, np.nan_to_num((speed - first) / (np.maximum(known.sum(axis=1), 1) * FRAME_STEP))

    def _tell(self, sumo: Any, names: list[str], ours: npt.NDArray[np.bool_], speed: Floats) -> None:
        """Set the model's speeds and release vehicles that left it."""
        chosen = {name: value for name, mine, value in zip(names, ours.tolist(), speed.tolist(), strict=True) if mine}
        for name, value in chosen.items():
            if name not in self._ours:
                sumo.vehicle.setSpeedMode(name, OURS)
            sumo.vehicle.setSpeed(name, value)
        for name in (self._ours - chosen.keys()) & set(names):
            sumo.vehicle.setSpeed(name, -1)
            sumo.vehicle.setSpeedMode(name, SUMOS)
        self._ours = set(chosen)
        self.driven_steps += len(chosen)


@njit(cache=True)
def leaders(lane, offsets, x, length, who):  # type: ignore[no-untyped-def]
    """Return every vehicle's leader and gap.

    Parameters
    ----------
    lane, offsets, x, length
        As in :class:`Present`.
    who : int64, shape (n,)
        Numbers of the vehicles.

    Returns
    -------
    leader : int64, shape (n,)
        Row, ``NOBODY`` without one.
    gap : float64, shape (n,)
        m, infinite without a leader.
    """
    leader, gap = np.empty(len(x), dtype=np.int64), np.empty(len(x))
    for i in range(len(x)):
        leader[i], gap[i] = perceive(lane[i] - 1, x[i], who[i], offsets, x, length, who)
    return leader, gap


@njit(cache=True)
def _decide_all(present, models, memory, now):  # type: ignore[no-untyped-def]
    """Return the accelerations (m/s²) at ``now`` (s); ``memory`` is updated."""
    offsets, x, speed, length, others = present.offsets, present.x, present.speed, present.length, present.others
    acceleration = np.empty(len(x))
    for i in range(len(x)):
        lane, vehicle = present.lane[i], present.place[i]
        row, gap = present.leader[i], present.gap[i]
        leader_speed = speed[row] if row != NOBODY else speed[i]
        m, past = models.magnitudes[models.without[vehicle], lane], memory.past[vehicle]
        who = others.who[row] if row != NOBODY else 0
        _remember(vehicle, gap, speed[i], speed[i] - leader_speed, who, now, memory, m)
        see = look(
            offsets, x, speed, length, others.who, others, lane - 1, 1, lane, False, others.who[i], length[i], x[i],
            row, gap, now, others.vehicle_class[i], memory.changed[vehicle, 0], now - memory.changed[vehicle, 1],
            memory.changed[vehicle, 2], np.nan, np.nan, memory.driven[vehicle] / memory.moments[vehicle],
        )  # fmt: skip
        then_gap, then_speed, then_rate = acted_on(past, PAST - 1, m, FRAME_STEP)
        acceleration[i] = extended_acceleration(
            then_speed, then_rate, then_gap, see, models.theta[vehicle], models.desired_speed[vehicle], m
        )
    return acceleration


@njit(cache=True)
def _remember(vehicle, gap, speed, approach_rate, who, now, memory, m):  # type: ignore[no-untyped-def]
    """Push the present into a vehicle's past.

    A change of its leader is noted.
    """
    past = memory.past[vehicle]
    gap_before = past[PAST - 1, 0]
    if memory.moments[vehicle] == 0:
        for k in range(PAST):
            note(past[k], gap, speed, approach_rate)  # before its first step it saw the same
    for k in range(PAST - 1):
        note(past[k], past[k + 1, 0], past[k + 1, 1], past[k + 1, 2])
    note(past[PAST - 1], gap, speed, approach_rate)
    if meet(past, PAST - 1, memory.leader[vehicle], who, m):
        note(memory.changed[vehicle], gap_before - gap, now, headway_after(gap, speed))
    memory.leader[vehicle] = who
    memory.moments[vehicle] += 1
    memory.driven[vehicle] += speed
