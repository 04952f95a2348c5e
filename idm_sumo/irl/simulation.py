r"""Compiled simulation of many vehicles, each in its recorded traffic.

Controls are given. Observation (float32, ``OBSERVATIONS`` numbers, all of size about 1):

=====  ========================================================  ======================
no.    what                                                      unit
=====  ========================================================  ======================
0      own speed                                                 speed limit
1      offset from the middle of the lane, positive to the left  lane width
2      heading, positive to the left                             0.1 rad
3      distance of the road's left edge                          road width
4-5    leader in the own lane: gap, its speed less the own       see below, 10 m/s
6-7    follower in the own lane                                  the same
8-11   leader and follower in the lane to the left               the same
12-15  leader and follower in the lane to the right              the same
=====  ========================================================  ======================

A gap :math:`d` (m, bumper to bumper, negative beside) enters as :math:`d/(|d| + 20)`, so that
short gaps are resolved better than long ones; 1 and speed difference 0 stand for no vehicle, and for
a lane that is not there.

Action (float32, 2 numbers in -1 ... 1): acceleration in ``ACCELERATION_LIMIT`` and steering
angle in ``STEERING_LIMIT``, positive to the left; values beyond are clipped.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.evaluation.collisions import first_row_from
from idm_sumo.evaluation.rectangles import overlap, rectangle
from idm_sumo.irl import features
from idm_sumo.irl.demonstrations import start_state
from idm_sumo.irl.episodes import Episodes, Surroundings
from idm_sumo.models import bicycle
from idm_sumo.recordings.columns import FRAME_STEP

Floats = npt.NDArray[np.float64]
Observations = npt.NDArray[np.float32]

OBSERVATIONS = 16
ACTIONS = 2
ACCELERATION_LIMIT = 5.0  # m/s^2
STEERING_LIMIT = 0.05  # rad; sharper steering was recorded at walking pace only
GAP_SCALE = 20.0  # m
SPEED_SCALE = 10.0  # m/s
HEADING_UNIT = 0.1  # rad

RUNNING, COLLIDED, OFF_ROAD = range(3)


class Simulation:
    """Vehicles that are simulated side by side, one row each.

    All arrays are updated in place.

    Parameters
    ----------
    episodes : Episodes
        Starts of the windows.
    around : Surroundings
        Traffic.
    row : int64, shape (vehicles,)
        Window of each vehicle.

    Attributes
    ----------
    row : int64, shape (vehicles,)
        Window in which each vehicle drives.
    step : int64, shape (vehicles,)
        Steps since the start.
    state : float64, shape (vehicles, 4)
        ``x, y`` (m) of the middle, heading (rad), speed (m/s).
    observation : float32, shape (vehicles, 16)
        See the text of the module.
    features : float64, shape (vehicles, features)
        Of the last step.
    status : int64, shape (vehicles,)
        ``RUNNING``, ``COLLIDED`` (its rectangle overlaps that of another vehicle, which it did not at the start)
        or ``OFF_ROAD`` (its middle has left the main lanes).
    """

    def __init__(self, episodes: Episodes, around: Surroundings, row: npt.NDArray[np.int64]) -> None:
        self.episodes, self.around = episodes, around
        n = len(row)
        self.row, self.step = row.astype(np.int64), np.zeros(n, dtype=np.int64)
        self.state, self.control = np.empty((n, 4)), np.zeros((n, 2))
        self.observation = np.empty((n, OBSERVATIONS), dtype=np.float32)
        self.features = np.zeros((n, features.COUNT))
        self.status = np.zeros(n, dtype=np.int64)
        self.overlapping = np.zeros(n, dtype=np.bool_)
        self.restart(np.arange(n), self.row)

    def restart(self, which: npt.NDArray[np.int64], row: npt.NDArray[np.int64]) -> None:
        """Put vehicles at the starts of windows.

        Parameters
        ----------
        which : int64 array
            Vehicles.
        row : int64 array, shape of ``which``
            Their windows.
        """
        self.row[which], self.step[which] = row, 0
        _start(which, self.row, self.state, self.observation, self.status, self.overlapping, self.episodes, self.around)

    def advance(self, action: npt.NDArray[np.floating]) -> None:
        """Drive every vehicle one step by its action.

        Parameters
        ----------
        action : float array, shape (vehicles, 2)
            Acceleration and steering from -1 to 1, see the text of the module.
        """
        self.control[:, 0] = np.clip(action[:, 0], -1.0, 1.0) * ACCELERATION_LIMIT
        self.control[:, 1] = np.clip(action[:, 1], -1.0, 1.0) * STEERING_LIMIT
        self.advance_by(self.control)

    def advance_by(self, control: Floats) -> None:
        """Drive every vehicle one step by its controls.

        Parameters
        ----------
        control : float64, shape (vehicles, 2)
            Acceleration (m/s²) and steering (rad).
        """
        self.control[:] = control
        _advance(
            self.control, self.row, self.step, self.state, self.observation, self.features, self.status,
            self.overlapping, self.episodes, self.around,
        )  # fmt: skip


def actions_of(control: npt.ArrayLike) -> Floats:
    """Return the actions of controls.

    Parameters
    ----------
    control : array_like, shape (..., 2)
        Acceleration (m/s²) and steering (rad).

    Returns
    -------
    float64, shape (..., 2)
        Actions, clipped to -1 ... 1.
    """
    return np.clip(np.asarray(control) / (ACCELERATION_LIMIT, STEERING_LIMIT), -1.0, 1.0)


def observe_along(state: Floats, episodes: Episodes, around: Surroundings) -> Observations:
    """Return the observations along given paths.

    Parameters
    ----------
    state : float64, shape (windows, steps, 4)
        ``x, y`` (m) of the middle, heading (rad), speed (m/s).
    episodes : Episodes
        The same windows.
    around : Surroundings
        Traffic.

    Returns
    -------
    float32, shape (windows, steps, 16)
        Observations.
    """
    out = np.empty((*state.shape[:2], OBSERVATIONS), dtype=np.float32)
    _observe_along(np.ascontiguousarray(state), episodes, around, out)
    return out


@njit(cache=True)
def squashed(gap: float) -> float:
    """Return a gap as it enters the observation.

    Parameters
    ----------
    gap : float
        Gap (m).

    Returns
    -------
    float
        :math:`d/(|d| + 20)`.
    """
    return gap / (abs(gap) + GAP_SCALE)


@njit(cache=True)
def _neighbours(cell, x, length, v, own, around, out):  # type: ignore[no-untyped-def]
    """Write gaps and speed differences of a lane's neighbours.

    ``out``, shape (4,), gets those of the vehicle ahead, then those of the one behind.
    """
    front = x + 0.5 * length
    low, high = around.offsets[cell], around.offsets[cell + 1]
    out[0], out[1], out[2], out[3] = 1.0, 0.0, 1.0, 0.0
    ahead = first_row_from(around.front, low, high, front)
    behind = ahead - 1
    if ahead < high and around.vehicle[ahead] == own:
        ahead += 1
    if behind >= low and around.vehicle[behind] == own:
        behind -= 1
    if ahead < high:
        out[0] = squashed(around.front[ahead] - around.length[ahead] - front)
        out[1] = (around.speed[ahead] - v) / SPEED_SCALE
    if behind >= low:
        out[2] = squashed(front - length - around.front[behind])
        out[3] = (around.speed[behind] - v) / SPEED_SCALE


@njit(cache=True)
def _observe(x, y, psi, v, length, cell, stride, lanes, own, around, out):  # type: ignore[no-untyped-def]
    ground, lane = around.ground, 0
    while lane + 1 < len(ground.middles) and y <= ground.markings[lane + 1]:
        lane += 1
    out[0] = v / ground.speed_limit
    out[1] = (y - ground.middles[lane]) / ground.widths[lane]
    out[2] = psi / HEADING_UNIT
    out[3] = -y / ground.width
    here = lane if lanes > 1 else 0
    _neighbours(cell + here * stride, x, length, v, own, around, out[4:8])
    for side in range(2):
        beside = here - 1 + 2 * side
        part = out[8 + 4 * side : 12 + 4 * side]
        if 0 <= beside < lanes:
            _neighbours(cell + beside * stride, x, length, v, own, around, part)
        else:
            part[0], part[1], part[2], part[3] = 1.0, 0.0, 1.0, 0.0


@njit(cache=True)
def _touches(x, y, psi, length, width, cell, stride, lanes, own, around):  # type: ignore[no-untyped-def]
    """Return whether the vehicle's rectangle overlaps another's."""
    front_x, front_y = bicycle.front_of_center(x, y, psi, length)
    ego = rectangle(front_x, front_y, psi, length, width)
    for lane in range(lanes):
        here = cell + lane * stride
        row, end = around.offsets[here], around.offsets[here + 1]
        row = first_row_from(around.front, row, end, x - length)
        while row < end and around.front[row] < x + length + around.reach:
            if around.vehicle[row] != own:
                psi_o, long = around.heading[row], around.length[row]
                other_x, other_y = bicycle.front_of_center(around.x[row], around.y[row], psi_o, long)
                if overlap(ego, rectangle(other_x, other_y, psi_o, long, around.width[row])):
                    return True
            row += 1
    return False


@njit(cache=True)
def _start(which, row, state, observation, status, overlapping, episodes, around):  # type: ignore[no-untyped-def]
    for i in which:
        r = row[i]
        e = episodes.start[r]
        x, y, psi, v = start_state(e[0], e[1], e[2], e[3], episodes.length[r])
        state[i, 0], state[i, 1], state[i, 2], state[i, 3] = x, y, psi, v
        length, cell, stride = episodes.length[r], episodes.cell[r], episodes.stride[r]
        lanes, own = episodes.lanes[r], episodes.own[r]
        _observe(x, y, psi, v, length, cell, stride, lanes, own, around, observation[i])
        overlapping[i] = _touches(x, y, psi, length, episodes.width[r], cell, stride, lanes, own, around)
        status[i] = RUNNING


@njit(cache=True)
def _advance(control, row, step, state, observation, out, status, overlapping, episodes, around):  # type: ignore[no-untyped-def]
    for i in range(len(row)):
        r = row[i]
        length, width, stride = episodes.length[r], episodes.width[r], episodes.stride[r]
        lanes, own = episodes.lanes[r], episodes.own[r]
        x, y, psi, v = bicycle.step(
            state[i, 0], state[i, 1], state[i, 2], state[i, 3], control[i, 0], control[i, 1], bicycle.wheelbase(length),
            FRAME_STEP,
        )  # fmt: skip
        state[i, 0], state[i, 1], state[i, 2], state[i, 3] = x, y, psi, v
        step[i] += 1
        cell = episodes.cell[r] + step[i]
        features.values(
            x, y, psi, v, control[i, 0], control[i, 1], length, width, cell, stride, lanes, own, around, out[i]
        )
        _observe(x, y, psi, v, length, cell, stride, lanes, own, around, observation[i])
        touching = _touches(x, y, psi, length, width, cell, stride, lanes, own, around)
        overlapping[i] = overlapping[i] and touching  # measured positions may overlap from the start
        if not -around.ground.width <= y <= 0.0:
            status[i] = OFF_ROAD
        elif touching and not overlapping[i]:
            status[i] = COLLIDED


@njit(cache=True)
def _observe_along(state, episodes, around, out):  # type: ignore[no-untyped-def]
    for i in range(state.shape[0]):
        for k in range(state.shape[1]):
            x, y, psi, v = state[i, k, 0], state[i, k, 1], state[i, k, 2], state[i, k, 3]
            _observe(
                x, y, psi, v, episodes.length[i], episodes.cell[i] + k, episodes.stride[i], episodes.lanes[i],
                episodes.own[i], around, out[i, k],
            )  # fmt: skip
