"""Scenes as the compiled rollout reads them, prepared once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration.objective import ADE, CODES, GAP, LOG_GAP, LOSSES, SPEED, SQUARED
from idm_sumo.models import bicycle
from idm_sumo.models.idm import SMALLEST_GAP
from idm_sumo.models.steering import lookahead_distance, pure_pursuit
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.threads import in_threads
from idm_sumo.scenes.traffic import NOBODY, leader_row
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

LOSS_SCALE = {GAP: 1.0, SPEED: 0.5, LOG_GAP: 0.1}  # m, m/s, -: where the robust losses turn linear


class Problem(NamedTuple):
    """Drivers to calibrate, as compiled code reads them.

    ``n`` drivers over ``h`` simulated frames.

    Attributes
    ----------
    start_x, start_speed, desired_speed : float64, shape (n,)
        Front bumper (m) and speed (m/s) at the start; :math:`v_0` (m/s).
    own, first_cell : int64, shape (n,)
        The recorded vehicle's number; the traffic's cell at the start.
    forward : float64, shape (n, h)
        Metres along the road per metre driven, in each step (1 but for the heading).
    target, lateral : float64, shape (n, h)
        What the objective compares with, at frames 1 to h after the start, and the fixed
        lateral error (m) that belongs to the ADE (0 for other objectives).
    counted : bool, shape (n, h)
        The frames that count.
    behind, ahead, rear, leader_speed : float64, shape (n, h + 1)
        The corridor: while the front is in ``behind <= x < ahead`` (m), the leader is the
        recorded vehicle's, with its rear bumper (m) and speed (m/s). Elsewhere the traffic is searched.
    offsets, x, speed, length, vehicle
        As in :class:`~idm_sumo.scenes.traffic.Traffic`.
    objective, loss : int
        Codes of :mod:`idm_sumo.calibration.objective`.
    scale : float
        Of a robust loss, in the unit of the error.
    share : float
        Of the new speed in what a step travels: 0 in the paper's Euler step, 1 in SUMO's, 1/2 in the ballistic one.
    in_sumo : bool
        Whether SUMO bounds the speeds (:func:`idm_sumo.calibration.integrators.speed_in_sumo`).
    moves_d1 : float
        0 where ``d1`` stays as it starts, else 1.
    """

    start_x: Floats
    start_speed: Floats
    desired_speed: Floats
    own: Integers
    first_cell: Integers
    forward: Floats
    target: Floats
    lateral: Floats
    counted: npt.NDArray[np.bool_]
    behind: Floats
    ahead: Floats
    rear: Floats
    leader_speed: Floats
    offsets: Integers
    x: Floats
    speed: Floats
    length: Floats
    vehicle: Integers
    objective: int
    loss: int
    scale: float
    share: float = 0.0
    in_sumo: bool = False
    moves_d1: float = 1.0


def prepare(
    scenes: Scenes,
    *,
    objective: str = "ade",
    loss: str | None = None,
    desired_speed: npt.ArrayLike | None = None,
    mask: npt.NDArray[np.bool_] | None = None,
) -> Problem:
    """Prepare scenes for the compiled rollout.

    Parameters
    ----------
    scenes : Scenes
    objective : {"ade", "gap", "speed", "log-gap"}
    loss : {"squared", "huber", "soft-l1"}, optional
        Of the error; "squared" by default. The ADE has its own, the Euclidean distance.
    desired_speed : array_like, shape (vehicles,) or (), optional
        m/s; by default the road's speed limit.
    mask : bool, shape (vehicles, frames), optional
        False where a recorded frame is not to count. Frames that are NaN never do.

    Raises
    ------
    InputError
        For an unknown objective or loss, a mask of the wrong shape, or a desired speed that is not positive.
    """
    code, loss_code = _codes(objective, loss)
    n, first, h = len(scenes), scenes.start, scenes.window.horizon
    frames = slice(first, first + h + 1)
    limit = _desired_speeds(scenes.road.desired_speed(desired_speed), n)
    counted = _counted(scenes, mask)
    t = scenes.traffic
    corridor = tuple(np.empty((n, h + 1)) for _ in range(4))
    x = np.ascontiguousarray(scenes.x[:, frames])
    cell = scenes.cell + first
    in_threads(_fill_corridor, n, x, cell, scenes.vehicle, t.offsets, t.x, t.length, t.speed, t.vehicle, *corridor)
    forward, lateral = np.ones((n, h)), np.zeros((n, h))
    start = np.stack([getattr(scenes, name)[:, first] for name in ("x", "y", "heading")], axis=1)
    y, speed = (np.ascontiguousarray(getattr(scenes, name)[:, frames]) for name in ("y", "speed"))
    middle = scenes.road.lane_center(scenes.lane)
    in_threads(_drive_laterally, n, start, y, speed, scenes.length, middle, forward, lateral)
    if code == ADE:
        target = x[:, 1:]
    elif code == SPEED:
        target = speed[:, 1:]
    else:
        gap = corridor[2][:, 1:] - x[:, 1:]
        target = np.log(np.maximum(gap, SMALLEST_GAP)) if code == LOG_GAP else gap
        counted &= np.isfinite(gap)
        if scenes.leader_source == LEADER_FROM_LANE:  # the gap of one that left the lane is not this lane's
            counted &= scenes.road.lane_at(np.nan_to_num(y[:, 1:])) == scenes.lane[:, None]
    counted &= np.isfinite(target)
    if code == ADE:
        counted &= np.isfinite(lateral)
    return Problem(
        start_x=x[:, 0].copy(), start_speed=speed[:, 0].copy(), desired_speed=limit, own=scenes.vehicle,
        first_cell=cell, forward=forward, target=np.where(counted, target, 0.0),
        lateral=np.where(counted, lateral, 0.0) if code == ADE else np.zeros((n, h)), counted=counted,
        behind=corridor[0], ahead=corridor[1], rear=corridor[2], leader_speed=corridor[3],
        offsets=t.offsets, x=t.x, speed=t.speed, length=t.length, vehicle=t.vehicle,
        objective=code, loss=loss_code, scale=LOSS_SCALE.get(code, 1.0),
    )  # fmt: skip


def _codes(objective: str, loss: str | None) -> tuple[int, int]:
    """Return the codes of objective and loss."""
    if objective not in CODES:
        raise InputError(f"objective: {objective!r} is unknown; use one of {', '.join(CODES)}")
    if loss is not None and loss not in LOSSES:
        raise InputError(f"loss: {loss!r} is unknown; use one of {', '.join(LOSSES)}")
    return CODES[objective], SQUARED if loss is None else LOSSES[loss]


def _desired_speeds(desired_speed: npt.ArrayLike, vehicles: int) -> Floats:
    """Return one desired speed (m/s) a vehicle."""
    limit = np.asarray(desired_speed, dtype=np.float64)
    if limit.shape not in ((), (vehicles,)) or not np.all(limit > 0.0):
        raise InputError(f"desired_speed: need one positive speed in m/s, or one for each of the {vehicles} vehicles")
    return np.array(np.broadcast_to(limit, (vehicles,)))  # a copy: a read-only view is another type to numba


def _counted(scenes: Scenes, mask: npt.NDArray[np.bool_] | None) -> npt.NDArray[np.bool_]:
    """Return which simulated frames count: recorded and not masked."""
    if mask is not None and mask.shape != scenes.x.shape:
        raise InputError(f"mask: shape {mask.shape} is not that of the scenes, {scenes.x.shape} (vehicles, frames)")
    simulated = slice(scenes.start + 1, scenes.start + scenes.window.horizon + 1)
    counted = np.isfinite(scenes.x[:, simulated])
    return counted if mask is None else counted & mask[:, simulated]


@njit(cache=True, nogil=True)
def _fill_corridor(  # type: ignore[no-untyped-def]
    first, last, x, first_cell, own, offsets, traffic_x, traffic_length, traffic_speed, traffic_vehicle,
    behind, ahead, rear, leader_speed,
):  # fmt: skip
    """Note between which two vehicles the recorded vehicle drives.

    The corridor is empty where the vehicle is not recorded.
    """
    for i in range(first, last):
        for k in range(x.shape[1]):
            cell = first_cell[i] + k
            row = leader_row(offsets, traffic_x, traffic_vehicle, cell, x[i, k], own[i])
            ahead[i, k], rear[i, k], leader_speed[i, k] = np.inf, np.inf, 0.0
            after = offsets[cell + 1]
            if row != NOBODY:
                ahead[i, k], leader_speed[i, k] = traffic_x[row], traffic_speed[row]
                rear[i, k] = traffic_x[row] - traffic_length[row]
                after = row
            before = after - 1
            while before >= offsets[cell] and traffic_vehicle[before] == own[i]:
                before -= 1
            behind[i, k] = traffic_x[before] if before >= offsets[cell] else -np.inf
            if np.isnan(x[i, k]):
                behind[i, k] = np.inf


@njit(cache=True, nogil=True)
def _drive_laterally(first, last, start, y, speed, length, lane_y, forward, lateral):  # type: ignore[no-untyped-def]
    """Steer along the lane with the recorded speeds.

    What is lateral hardly depends on the IDM's parameters. Fills the metres along the road per metre
    driven, and the lateral error (m) against the recorded vehicle. Where a speed is not recorded the
    last known one is kept.
    """
    for i in range(first, last):
        front_x, front_y, psi = start[i]
        v = speed[i, 0]
        cx, cy = bicycle.center_of_front(front_x, front_y, psi, length[i])
        axles = bicycle.wheelbase(length[i])
        for k in range(forward.shape[1]):
            hx, hy = np.cos(psi), np.sin(psi)
            goal_y = lane_y[i] - (cy - bicycle.REAR_SHARE * axles * hy)
            steering = pure_pursuit(hx, hy, lookahead_distance(v), goal_y, axles)
            cx, cy, psi, _ = bicycle.step(cx, cy, psi, v, 0.0, steering, axles, FRAME_STEP)
            new_x, front_y = bicycle.front_of_center(cx, cy, psi, length[i])
            lateral[i, k] = front_y - y[i, k + 1]
            if v > 0.0:
                forward[i, k] = (new_x - front_x) / (v * FRAME_STEP)
            front_x = new_x
            if speed[i, k + 1] >= 0.0:
                v = speed[i, k + 1]


def only(problem: Problem, drivers: Integers) -> Problem:
    """Return the problem of some of the drivers.

    Parameters
    ----------
    problem : Problem
    drivers : int64, shape (m,)
        Places of the drivers. The traffic stays whole.

    Returns
    -------
    Problem
    """
    return problem._replace(**{name: getattr(problem, name)[drivers] for name in PER_DRIVER})


PER_DRIVER = Problem._fields[: Problem._fields.index("offsets")]
