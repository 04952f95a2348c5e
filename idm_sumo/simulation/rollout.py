"""The ``kernel`` back end of replay.

Many modelled vehicles, each in its own recorded traffic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.models import bicycle, idm
from idm_sumo.models.steering import lookahead_distance, pure_pursuit
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.threads import in_threads
from idm_sumo.scenes.traffic import NOBODY, leader_row
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import as_driven

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Trajectories:
    """Simulated vehicles, ``T`` steps from their start.

    Attributes
    ----------
    x, y, heading, speed : float64, shape (vehicles, T + 1)
        Front bumper (m), rad, m/s; column 0 is the recorded start.
    acceleration, steering : float64, shape (vehicles, T)
        Controls of each step (m/s², rad).
    gap : float64, shape (vehicles, T + 1)
        Bumper to bumper to the perceived leader (m), infinite without one.
    leader : int64, shape (vehicles, T + 1)
        Row of the perceived leader in the scenes' traffic, -1 without one.
    period : str, shape (vehicles,)
    vehicle, first_frame, start_frame : int64, shape (vehicles,)
        Number, and frames of the window's beginning and of column 0.
    """

    x: Floats
    y: Floats
    heading: Floats
    speed: Floats
    acceleration: Floats
    steering: Floats
    gap: Floats
    leader: npt.NDArray[np.int64]
    period: npt.NDArray[np.str_]
    vehicle: npt.NDArray[np.int64]
    first_frame: npt.NDArray[np.int64]
    start_frame: npt.NDArray[np.int64]

    def __repr__(self) -> str:
        """Return one line: how many vehicles and steps."""
        return f"<Trajectories: {len(self.x):,} vehicles, {self.acceleration.shape[1]} steps of {FRAME_STEP} s>"

    def to_pandas(self) -> pd.DataFrame:
        """Return one row a vehicle and frame.

        Returns
        -------
        pandas.DataFrame
            ``period, vehicle, first_frame, frame, time_s`` (since the start), ``x, y, heading, speed, gap``
            (m, rad, m/s), ``acceleration, steering`` of the step that begins there (NaN in the last frame).
        """
        vehicles, frames = self.x.shape
        steps = np.arange(frames)
        table = pd.DataFrame({
            "period": np.repeat(self.period, frames), "vehicle": np.repeat(self.vehicle, frames),
            "first_frame": np.repeat(self.first_frame, frames), "frame": (self.start_frame[:, None] + steps).ravel(),
            "time_s": np.tile(steps * FRAME_STEP, vehicles),
        })  # fmt: skip
        for name in ("x", "y", "heading", "speed", "gap"):
            table[name] = getattr(self, name).ravel()
        for name in ("acceleration", "steering"):
            table[name] = np.column_stack([getattr(self, name), np.full(vehicles, np.nan)]).ravel()
        return table

    @classmethod
    def of(cls, scenes: Scenes) -> Trajectories:
        """Return storage for the windows of scenes.

        Parameters
        ----------
        scenes : Scenes

        Returns
        -------
        Trajectories
            Over their horizon.
        """
        return replace(
            cls.empty(len(scenes), scenes.window.horizon), period=scenes.period, vehicle=scenes.vehicle,
            first_frame=scenes.first_frame, start_frame=scenes.first_frame + scenes.start,
        )  # fmt: skip

    @classmethod
    def empty(cls, vehicles: int, steps: int) -> Trajectories:
        """Return storage for vehicles that are numbered from 0.

        Parameters
        ----------
        vehicles, steps : int

        Returns
        -------
        Trajectories
        """
        state, control = (vehicles, steps + 1), (vehicles, steps)
        return cls(
            x=np.empty(state), y=np.empty(state), heading=np.empty(state), speed=np.empty(state),
            acceleration=np.empty(control), steering=np.empty(control),
            gap=np.empty(state), leader=np.empty(state, dtype=np.int64),
            period=np.full(vehicles, ""), vehicle=np.arange(vehicles), first_frame=np.zeros(vehicles, dtype=np.int64),
            start_frame=np.zeros(vehicles, dtype=np.int64),
        )  # fmt: skip

    @classmethod
    def joined(cls, parts: Sequence[Trajectories]) -> Trajectories:
        """Join trajectories of the same length.

        Parameters
        ----------
        parts : sequence of Trajectories

        Returns
        -------
        Trajectories
            The vehicles of all parts, in order.
        """
        return cls(
            **{field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)}
        )

    def rows(self, which: slice | npt.NDArray[np.int64]) -> Trajectories:
        """Return some of the vehicles.

        Parameters
        ----------
        which : slice or int64 array
            Places of the vehicles.

        Returns
        -------
        Trajectories
        """
        return Trajectories(**{field.name: getattr(self, field.name)[which] for field in fields(self)})


def drive_idm(
    scenes: Scenes,
    drivers: pd.DataFrame | npt.ArrayLike,
    *,
    desired_speed: npt.ArrayLike | None = None,
) -> Trajectories:
    """Drive every vehicle by IDM and pure pursuit.

    From its start over the horizon.

    Parameters
    ----------
    scenes : Scenes
    drivers : pandas.DataFrame, or array_like of shape (windows, 5) or (5,)
        A driver table, as ``calibrate`` returns it, or ``a, b, T, d0, d1`` in SI units.
    desired_speed : array_like, shape (windows,) or (), optional
        m/s; by default the table's, else the road's speed limit.

    Returns
    -------
    Trajectories
        By the paper's transition model: Euler with the old speed.

    Raises
    ------
    InputError
        If a window has no driver in the table, or one without parameters.
    """
    n = len(scenes)
    theta, limit = as_driven(scenes, drivers, desired_speed)
    out = Trajectories.of(scenes)
    first, t = scenes.start, scenes.traffic
    start = np.stack([getattr(scenes, name)[:, first] for name in ("x", "y", "heading", "speed")], axis=1)
    in_threads(
        _drive_all, n, theta, limit, start, scenes.length, scenes.road.lane_center(scenes.lane), scenes.cell + first,
        scenes.vehicle,
        t.offsets, t.x, t.speed, t.length, t.vehicle,
        out.x, out.y, out.heading, out.speed, out.acceleration, out.steering, out.gap, out.leader,
    )  # fmt: skip
    return out


def drive_constant_velocity(scenes: Scenes) -> Trajectories:
    """Keep speed and heading of the start.

    Zero acceleration, zero steering; no leader is perceived.

    Parameters
    ----------
    scenes : Scenes

    Returns
    -------
    Trajectories
    """
    n, steps = len(scenes), scenes.window.horizon
    first = scenes.start
    heading, speed = scenes.heading[:, first, None], scenes.speed[:, first, None]
    travelled = speed * FRAME_STEP * np.arange(steps + 1)
    whole = np.ones((1, steps + 1))
    return Trajectories(
        x=scenes.x[:, first, None] + travelled * np.cos(heading),
        y=scenes.y[:, first, None] + travelled * np.sin(heading),
        heading=heading * whole, speed=speed * whole,
        acceleration=np.zeros((n, steps)), steering=np.zeros((n, steps)),
        gap=np.full((n, steps + 1), np.inf), leader=np.full((n, steps + 1), NOBODY),
        period=scenes.period, vehicle=scenes.vehicle,
        first_frame=scenes.first_frame, start_frame=scenes.first_frame + first,
    )  # fmt: skip


@njit(cache=True)
def perceive(cell, front, own, offsets, x, length, vehicle):  # type: ignore[no-untyped-def]
    """Return the leader's row and the gap to it.

    Parameters
    ----------
    cell : int
        Of the traffic.
    front : float
        Front bumper (m).
    own : int
        Number of the modelled vehicle.
    offsets, x, length, vehicle
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.

    Returns
    -------
    row : int
        ``NOBODY`` without a leader.
    gap : float
        Bumper to bumper (m), infinite without a leader.
    """
    row = leader_row(offsets, x, vehicle, cell, front, own)
    if row == NOBODY:
        return row, np.inf
    return row, x[row] - length[row] - front


@njit(cache=True)
def control(x, y, heading, speed, gap, leader_speed, theta, desired_speed, length, lane_y):  # type: ignore[no-untyped-def]
    """Return acceleration and steering of a modelled driver.

    Parameters
    ----------
    x, y : float
        Centre of mass (m).
    heading, speed : float
        rad, m/s.
    gap, leader_speed : float
        m, m/s.
    theta : float64, shape (5,)
        ``a, b, T, d0, d1`` in SI units.
    desired_speed : float
        m/s.
    length : float
        Of the vehicle (m).
    lane_y : float
        The lane's middle (m).

    Returns
    -------
    acceleration, steering : float
        m/s², rad.
    """
    approach_rate = speed - leader_speed
    acceleration = idm.acceleration(
        speed, approach_rate, gap, theta[0], theta[1], theta[2], theta[3], theta[4], desired_speed
    )
    return acceleration, steer(y, heading, speed, length, lane_y)


@njit(cache=True)
def steer(y, heading, speed, length, lane_y):  # type: ignore[no-untyped-def]
    """Return the steering (rad) towards the lane's middle.

    Pure pursuit, see :mod:`idm_sumo.models.steering`.

    Parameters
    ----------
    y : float
        Centre of mass (m).
    heading, speed : float
        rad, m/s.
    length : float
        Of the vehicle (m).
    lane_y : float
        The lane's middle (m).

    Returns
    -------
    float
    """
    axles = bicycle.wheelbase(length)
    heading_x, heading_y = np.cos(heading), np.sin(heading)
    rear_y = y - bicycle.REAR_SHARE * axles * heading_y
    return pure_pursuit(heading_x, heading_y, lookahead_distance(speed), lane_y - rear_y, axles)


@njit(cache=True, nogil=True)
def _drive_all(  # type: ignore[no-untyped-def]
    begin, end, theta, limit, start, length, lane_y, first_cell, own,
    offsets, traffic_x, traffic_speed, traffic_length, traffic_vehicle,
    x, y, heading, speed, acceleration, steering, gap, leader,
):  # fmt: skip
    steps = acceleration.shape[1]
    for i in range(begin, end):
        x[i, 0], y[i, 0], psi, v = start[i]
        heading[i, 0], speed[i, 0] = psi, v
        cx, cy = bicycle.center_of_front(x[i, 0], y[i, 0], psi, length[i])
        axles = bicycle.wheelbase(length[i])
        for k in range(steps + 1):
            row, d = perceive(first_cell[i] + k, x[i, k], own[i], offsets, traffic_x, traffic_length, traffic_vehicle)
            leader[i, k], gap[i, k] = row, d
            if k == steps:
                break
            leader_speed = traffic_speed[row] if row != NOBODY else v
            acc, delta = control(cx, cy, psi, v, d, leader_speed, theta[i], limit[i], length[i], lane_y[i])
            acceleration[i, k], steering[i, k] = acc, delta
            cx, cy, psi, v = bicycle.step(cx, cy, psi, v, acc, delta, axles, FRAME_STEP)
            x[i, k + 1], y[i, k + 1] = bicycle.front_of_center(cx, cy, psi, length[i])
            heading[i, k + 1], speed[i, k + 1] = psi, v
