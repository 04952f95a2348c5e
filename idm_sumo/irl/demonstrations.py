r"""Recorded drivers as demonstrations: the controls with which the bicycle model drives their path.

A recorded path is no path of the bicycle model: positions carry noise, and speed and heading
were smoothed apart from each other. The controls are found by tracking the path: the sum of
squared distances, and of departures from the controls that speed and heading suggest, is made
least by Gauss-Newton steps, each a backward pass (Riccati) and a rollout.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo import bicycle, road
from idm_sumo.irl.dynamics import step_jacobian
from idm_sumo.irl.episodes import Episodes
from idm_sumo.scenes import Scenes

Floats = npt.NDArray[np.float64]

SLOWEST = 1.0  # m/s: steering does nothing to a standing car, and its speed has a kink
POSITION_ERROR = 0.1  # m, of a smoothed recorded position
HEADING_ERROR = 0.02  # rad
SPEED_ERROR = 0.3  # m/s
ACCELERATION_DEPARTURE = 0.5  # m/s^2, of the controls from what speed and heading suggest
STEERING_DEPARTURE = 0.01  # rad
PASSES = 6


class Demonstrations(NamedTuple):
    """Paths of the bicycle model; state ``x, y`` (m) of the middle, heading (rad), speed (m/s).

    Attributes
    ----------
    state : float64, shape (windows, steps + 1, 4)
    control : float64, shape (windows, steps, 2)
        Acceleration (m/s²) and steering (rad).
    error : float64, shape (windows,)
        Root mean square distance (m) to the recorded path.
    """

    state: Floats
    control: Floats
    error: Floats

    def first(self, steps: int) -> Demonstrations:
        """Return the first ``steps`` steps."""
        return Demonstrations(self.state[:, : steps + 1], self.control[:, :steps], self.error)

    def rows(self, which: npt.NDArray[np.int64]) -> Demonstrations:
        """Return some of the windows."""
        return Demonstrations(*(column[which] for column in self))

    @property
    def moving(self) -> npt.NDArray[np.bool_]:
        """Whether the car never gets slower than ``SLOWEST``, by window."""
        return np.asarray(self.state[:, :, 3].min(axis=1) > SLOWEST)


def demonstrations_of(scenes: Scenes) -> Demonstrations:
    """Track every recorded twin over the horizon, from the start of the simulation."""
    span = slice(scenes.start, scenes.start + scenes.window.horizon + 1)
    target = np.stack([scenes.x, scenes.y, scenes.heading, scenes.speed], axis=2)[:, span]
    half = 0.5 * scenes.length[:, None]
    target[:, :, 0] -= half * np.cos(target[:, :, 2])
    target[:, :, 1] -= half * np.sin(target[:, :, 2])
    n, steps = len(scenes), scenes.window.horizon
    state, control = np.empty((n, steps + 1, 4)), np.empty((n, steps, 2))
    _track_all(np.ascontiguousarray(target), scenes.length, state, control)
    distance = np.hypot(state[:, :, 0] - target[:, :, 0], state[:, :, 1] - target[:, :, 1])
    return Demonstrations(state, control, np.sqrt(np.mean(distance**2, axis=1)))


def rollout(episodes: Episodes, control: Floats) -> Floats:
    """Return the states, shape (windows, steps + 1, 4), that controls of shape (windows, steps, 2) lead to."""
    n, steps = control.shape[:2]
    state = np.empty((n, steps + 1, 4))
    for i in range(n):
        state[i, 0] = start_state(episodes.start[i], episodes.length[i])
        drive(control[i], bicycle.wheelbase(episodes.length[i]), state[i])
    return state


@njit(cache=True)
def start_state(start, length):  # type: ignore[no-untyped-def]
    """Return the state of the middle for a start given at the front bumper."""
    x, y = bicycle.center_of_front(start[0], start[1], start[2], length)
    return x, y, start[2], start[3]


@njit(cache=True)
def drive(control, axles, state):  # type: ignore[no-untyped-def]
    """Fill ``state``, shape (steps + 1, 4), whose first row is given."""
    for k in range(control.shape[0]):
        x, y, psi, v = state[k]
        state[k + 1] = bicycle.step(x, y, psi, v, control[k, 0], control[k, 1], axles, road.FRAME_STEP)


@njit(cache=True)
def _suggested(target, axles, control):  # type: ignore[no-untyped-def]
    """Write the controls that recorded speeds and headings suggest."""
    dt = road.FRAME_STEP
    for k in range(control.shape[0]):
        v = max(target[k, 3], SLOWEST)
        control[k, 0] = (target[k + 1, 3] - target[k, 3]) / dt
        turn = (target[k + 1, 2] - target[k, 2]) * bicycle.REAR_SHARE * axles / (v * dt)
        control[k, 1] = np.arctan(np.tan(np.arcsin(min(max(turn, -0.2), 0.2))) / bicycle.REAR_SHARE)


@njit(cache=True)
def _cost(state, control, target, suggested, weight, effort):  # type: ignore[no-untyped-def]
    return np.sum(weight * (state[1:] - target[1:]) ** 2) + np.sum(effort * (control - suggested) ** 2)


@njit(cache=True)
def _improve(state, control, target, suggested, axles, weight, effort, shift, feedback):  # type: ignore[no-untyped-def]
    """Fill the Gauss-Newton step: ``shift`` (steps, 2) and ``feedback`` (steps, 2, 4), backwards."""
    jacobian = np.empty((4, 6))
    last = control.shape[0]
    value, slope = np.diag(weight), weight * (state[last] - target[last])
    for k in range(last - 1, -1, -1):
        step_jacobian(state[k, 2], state[k, 3], control[k, 0], control[k, 1], axles, jacobian)
        a, b = np.ascontiguousarray(jacobian[:, :4]), np.ascontiguousarray(jacobian[:, 4:])
        bend = np.ascontiguousarray(b.T) @ value
        solved = np.linalg.inv(np.diag(effort) + bend @ b)
        shift[k] = -solved @ (effort * (control[k] - suggested[k]) + np.ascontiguousarray(b.T) @ slope)
        feedback[k] = -solved @ (bend @ a)
        back = np.ascontiguousarray(a.T)
        slope = back @ (slope + value @ (b @ shift[k]))
        value = back @ value @ (a + b @ feedback[k])
        value = 0.5 * (value + value.T)
        if k > 0:
            value, slope = value + np.diag(weight), slope + weight * (state[k] - target[k])


@njit(cache=True)
def _track_all(target, length, state, control):  # type: ignore[no-untyped-def]
    weight = np.array([1 / POSITION_ERROR**2, 1 / POSITION_ERROR**2, 1 / HEADING_ERROR**2, 1 / SPEED_ERROR**2])
    effort = np.array([1 / ACCELERATION_DEPARTURE**2, 1 / STEERING_DEPARTURE**2])
    steps = control.shape[1]
    shift, feedback = np.empty((steps, 2)), np.empty((steps, 2, 4))
    suggested, tried, tried_state = np.empty((steps, 2)), np.empty((steps, 2)), np.empty((steps + 1, 4))
    for i in range(target.shape[0]):
        axles = bicycle.wheelbase(length[i])
        _suggested(target[i], axles, suggested)
        control[i], state[i, 0], tried_state[0] = suggested, target[i, 0], target[i, 0]
        drive(control[i], axles, state[i])
        cost = _cost(state[i], control[i], target[i], suggested, weight, effort)
        for _ in range(PASSES):
            _improve(state[i], control[i], target[i], suggested, axles, weight, effort, shift, feedback)
            size = 1.0
            while size > 0.05:
                for k in range(steps):
                    tried[k] = control[i, k] + size * shift[k] + feedback[k] @ (tried_state[k] - state[i, k])
                    x, y, psi, v = tried_state[k]
                    tried_state[k + 1] = bicycle.step(x, y, psi, v, tried[k, 0], tried[k, 1], axles, road.FRAME_STEP)
                new = _cost(tried_state, tried, target[i], suggested, weight, effort)
                if new < cost:
                    break
                size *= 0.5
            if new >= cost:
                break
            gained, cost = cost - new, new
            control[i], state[i] = tried, tried_state
            if gained < 1e-6 * cost:
                break
