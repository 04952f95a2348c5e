"""Recorded drivers as demonstrations, with the bicycle model's controls.

A recorded path is not a path of the bicycle model: positions carry noise, and speed and heading
were smoothed separately. So the path is tracked: Gauss-Newton steps, each a backward pass
(Riccati recursion) and a rollout, minimise the sum of squared distances and of squared deviations
from the controls that recorded speed and heading suggest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.irl.dynamics import step_jacobian
from idm_sumo.irl.episodes import Episodes
from idm_sumo.models import bicycle
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

# m/s: below it steering has little effect and the recorded heading is noise; at rest the speed has a kink
SLOWEST = 3.0
POSITION_ERROR = 0.1  # m, of a smoothed recorded position
HEADING_ERROR = 0.02  # rad
SPEED_ERROR = 0.3  # m/s
ACCELERATION_DEPARTURE = 0.5  # m/s^2, deviation of the controls from what speed and heading suggest
STEERING_DEPARTURE = 0.01  # rad
PASSES = 8
WEIGHT = np.array([POSITION_ERROR, POSITION_ERROR, HEADING_ERROR, SPEED_ERROR]) ** -2
EFFORT = np.array([ACCELERATION_DEPARTURE, STEERING_DEPARTURE]) ** -2
CRAWLING = 1.0  # m/s, least speed when changes of heading are converted to steering
SHARPEST = 0.2  # rad, largest slip angle


class Demonstrations(NamedTuple):
    """Paths of the bicycle model, one row a window.

    Attributes
    ----------
    state : float64, shape (windows, steps + 1, 4)
        Centre of mass ``x, y`` (m), heading (rad) and speed (m/s).
    control : float64, shape (windows, steps, 2)
        Acceleration (m/s²) and steering (rad).
    error : float64, shape (windows,)
        Root mean square distance to the recorded path (m).
    """

    state: Floats
    control: Floats
    error: Floats

    def first(self, steps: int) -> Demonstrations:
        """Return the first steps of every window.

        Parameters
        ----------
        steps : int
            Number of steps to keep.

        Returns
        -------
        Demonstrations
            Shortened paths.
        """
        return Demonstrations(self.state[:, : steps + 1], self.control[:, :steps], self.error)

    def rows(self, which: npt.NDArray[np.int64]) -> Demonstrations:
        """Return some of the windows.

        Parameters
        ----------
        which : int64 array
            Rows to keep.

        Returns
        -------
        Demonstrations
            Those windows.
        """
        return Demonstrations(*(column[which] for column in self))

    @property
    def moving(self) -> npt.NDArray[np.bool_]:
        """Whether the vehicle stays faster than ``SLOWEST``, by window."""
        return np.asarray(self.state[:, :, 3].min(axis=1) > SLOWEST)


def demonstrations_of(scenes: Scenes) -> Demonstrations:
    """Track every recorded vehicle over the horizon.

    Parameters
    ----------
    scenes : Scenes
        Windows of the drivers.

    Returns
    -------
    Demonstrations
        From the start of the simulation on.
    """
    span = slice(scenes.start, scenes.start + scenes.window.horizon + 1)
    target = np.stack([scenes.x, scenes.y, scenes.heading, scenes.speed], axis=2)[:, span]
    half = 0.5 * scenes.length[:, None]
    target[:, :, 0] -= half * np.cos(target[:, :, 2])
    target[:, :, 1] -= half * np.sin(target[:, :, 2])
    state, control = _track(target, bicycle.wheelbase(1.0) * scenes.length)
    distance = np.hypot(state[:, :, 0] - target[:, :, 0], state[:, :, 1] - target[:, :, 1])
    return Demonstrations(state, control, np.sqrt(np.mean(distance**2, axis=1)))


def rollout(episodes: Episodes, control: Floats) -> Floats:
    """Return the states to which controls lead.

    Parameters
    ----------
    episodes : Episodes
        Starts of the simulations.
    control : float64, shape (windows, steps, 2)
        Acceleration (m/s²) and steering (rad).

    Returns
    -------
    float64, shape (windows, steps + 1, 4)
        Centre of mass ``x, y`` (m), heading (rad) and speed (m/s).
    """
    start = np.array([start_state(*row) for row in zip(*episodes.start.T, episodes.length, strict=True)])
    about = np.empty((*control.shape[:1], control.shape[1] + 1, 4))
    about[:] = start[:, None]
    axles = bicycle.wheelbase(1.0) * episodes.length
    return _follow(start, control, about, np.zeros((*control.shape, 4)), axles)[0]


@njit(cache=True)
def start_state(front_x, front_y, heading, speed, length):  # type: ignore[no-untyped-def]
    """Convert a start given at the front bumper.

    Parameters
    ----------
    front_x, front_y : float
        Centre of the front bumper (m).
    heading, speed, length : float
        Heading (rad), speed (m/s) and vehicle length (m).

    Returns
    -------
    x, y, heading, speed : float
        State of the centre of mass (m, m, rad, m/s).
    """
    x, y = bicycle.center_of_front(front_x, front_y, heading, length)
    return x, y, heading, speed


def _suggested(target: Floats, axles: Floats) -> Floats:
    """Return the controls that recorded speeds and headings suggest.

    The shape is (windows, steps, 2).
    """
    dt = FRAME_STEP
    speed = np.maximum(target[:, :-1, 3], CRAWLING)
    turn = np.diff(target[:, :, 2], axis=1) * bicycle.REAR_SHARE * axles[:, None] / (speed * dt)
    slip = np.arcsin(np.clip(turn, -SHARPEST, SHARPEST))
    return np.stack([np.diff(target[:, :, 3], axis=1) / dt, np.arctan(np.tan(slip) / bicycle.REAR_SHARE)], axis=2)


def _track(target: Floats, axles: Floats) -> tuple[Floats, Floats]:
    """Return states and controls of least cost."""
    suggested = _suggested(target, axles)
    control, state = suggested.copy(), np.empty_like(target)
    no_feedback = np.zeros((*control.shape, 4))
    state = _follow(target[:, 0], control, target, no_feedback, axles)[0]
    cost = _cost(state, control, target, suggested)
    size = np.ones(len(target))
    for _ in range(PASSES):
        shift, feedback = _improvement(state, control, target, suggested, axles)
        tried_state, tried = _follow(target[:, 0], control + size[:, None, None] * shift, state, feedback, axles)
        new = _cost(tried_state, tried, target, suggested)
        better = new < cost
        state[better], control[better], cost[better] = tried_state[better], tried[better], new[better]
        size = np.where(better, 1.0, 0.5 * size)  # a step that raised the cost is halved and tried again
    return state, control


def _cost(state: Floats, control: Floats, target: Floats, suggested: Floats) -> Floats:
    away, departure = (state - target)[:, 1:], control - suggested
    return np.asarray((WEIGHT * away**2).sum(axis=(1, 2)) + (EFFORT * departure**2).sum(axis=(1, 2)))


def _follow(start: Floats, control: Floats, about: Floats, feedback: Floats, axles: Floats) -> tuple[Floats, Floats]:
    """Drive by controls plus linear feedback.

    ``feedback`` weighs the deviation from the states ``about``. Returns states and controls.
    """
    state, done = np.empty_like(about), np.empty_like(control)
    state[:, 0] = start
    for k in range(control.shape[1]):
        away = (state[:, k] - about[:, k])[:, :, None]
        done[:, k] = control[:, k] + (feedback[:, k] @ away)[:, :, 0]
        _step_all(np.ascontiguousarray(state[:, k]), np.ascontiguousarray(done[:, k]), axles, state, k + 1)
    return state, done


def _improvement(
    state: Floats, control: Floats, target: Floats, suggested: Floats, axles: Floats
) -> tuple[Floats, Floats]:
    """Return the Gauss-Newton step and its feedback, by Riccati's recursion.

    Shapes are (windows, steps, 2) and (windows, steps, 2, 4).
    """
    jacobian = np.empty((*control.shape[:2], 4, 6))
    _jacobians(state, control, axles, jacobian)
    shift, feedback = np.empty_like(control), np.empty((*control.shape, 4))
    away, departure = WEIGHT * (state - target), EFFORT * (control - suggested)
    value, slope = np.broadcast_to(np.diag(WEIGHT), (len(state), 4, 4)), away[:, -1]
    for k in range(control.shape[1] - 1, -1, -1):
        a, b = jacobian[:, k, :, :4], jacobian[:, k, :, 4:]
        bend = b.swapaxes(1, 2) @ value
        solved = np.linalg.inv(np.diag(EFFORT) + bend @ b)
        push = departure[:, k, :, None] + b.swapaxes(1, 2) @ slope[:, :, None]
        shift[:, k] = -(solved @ push)[:, :, 0]
        feedback[:, k] = -solved @ (bend @ a)
        pulled = slope[:, :, None] + value @ (b @ shift[:, k, :, None])
        slope = (a.swapaxes(1, 2) @ pulled)[:, :, 0]
        value = a.swapaxes(1, 2) @ value @ (a + b @ feedback[:, k])
        if k > 0:
            value, slope = value + np.diag(WEIGHT), slope + away[:, k]
    return shift, feedback


@njit(cache=True)
def _jacobians(state, control, axles, out):  # type: ignore[no-untyped-def]
    for i in range(control.shape[0]):
        for k in range(control.shape[1]):
            step_jacobian(state[i, k, 2], state[i, k, 3], control[i, k, 0], control[i, k, 1], axles[i], out[i, k])


@njit(cache=True)
def _step_all(before, control, axles, state, k):  # type: ignore[no-untyped-def]
    """Write the states after one step to ``state[:, k]``."""
    for i in range(before.shape[0]):
        state[i, k, 0], state[i, k, 1], state[i, k, 2], state[i, k, 3] = bicycle.step(
            before[i, 0],
            before[i, 1],
            before[i, 2],
            before[i, 3],
            control[i, 0],
            control[i, 1],
            axles[i],
            FRAME_STEP,
        )
