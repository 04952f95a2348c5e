"""From simulated steps to recorded frames with measurement noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.units import FOOT
from idm_sumo.sumo.surrogate.traffic import FRAMES_A_STEP, STEP, Trajectories

Floats = npt.NDArray[np.float64]

# Position noise of raw US-101 data: chosen so that accelerations scatter as they do there
# (standard deviation 1.6 m/s^2, uncorrelated after 0.3 s).
NOISE_X = 0.18  # m, median over vehicles of the standard deviation along the road
NOISE_Y = 0.08  # m
NOISE_SPREAD = 0.35  # of the logarithm, between vehicles
CORRELATION_X = 0.45  # s
CORRELATION_Y = 0.8  # s
STEADY_SPEED = 3.0  # m/s; below it noise is smaller, and a standing car has none
LARGEST_ACCELERATION = 11.2 * FOOT  # m/s^2, where NGSIM clips


def between_steps(steps: Trajectories) -> Trajectories:
    """Return one row a vehicle and frame, from steps.

    Ballistic steps have a constant acceleration, so ``x(t) = x0 + v0 t + (v1 - v0) t^2 / (2 h)``
    is what was simulated (to 1e-13 m in 99.8 % of steps; in the others a vehicle stops or changes
    edges). Sideways motion is at constant speed.

    Parameters
    ----------
    steps : dict of ndarray, shape (rows,)
        As of :func:`~idm_sumo.sumo.surrogate.traffic.run`.

    Returns
    -------
    dict of ndarray
        ``vehicle``, ``frame`` (0 at the recording's first instant), ``x``, ``y`` (m).
    """
    same = np.diff(steps["vehicle"]) == 0
    start = np.flatnonzero(same)
    x0, v0, y0 = (steps[name][start] for name in ("x", "speed", "y"))
    dx, dy = steps["x"][start + 1] - x0, steps["y"][start + 1] - y0
    t = np.arange(FRAMES_A_STEP) * FRAME_STEP
    acceleration = 2 * (dx - v0 * STEP) / STEP**2
    moved = v0[:, None] * t + 0.5 * acceleration[:, None] * t**2
    x = x0[:, None] + np.minimum(moved, dx[:, None])  # a vehicle that stops within a step does not roll back
    y = y0[:, None] + dy[:, None] * t / STEP
    frame = steps["step"][start, None] * FRAMES_A_STEP + np.arange(FRAMES_A_STEP, dtype=np.int32)
    vehicle = np.repeat(steps["vehicle"][start], FRAMES_A_STEP)
    return {"vehicle": vehicle, "frame": frame.ravel(), "x": x.ravel(), "y": y.ravel()}


def starts_of(vehicle: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Return where each vehicle's rows begin, and their total.

    Parameters
    ----------
    vehicle : ndarray, shape (rows,)
        Vehicle of each row; the rows of a vehicle lie together.

    Returns
    -------
    ndarray of int64, shape (vehicles + 1,)
        First row of each vehicle, then the number of rows.
    """
    return np.concatenate([[0], np.flatnonzero(np.diff(vehicle)) + 1, [len(vehicle)]])


def add_noise(frames: Trajectories, rng: np.random.Generator) -> Trajectories:
    """Return the frames with measurement noise on ``x`` and ``y``.

    The noise is correlated in time, as a tracker's is, and fades where a vehicle hardly moves.

    Parameters
    ----------
    frames : dict of ndarray, shape (rows,)
        ``vehicle``, ``x`` and ``y`` (m); sorted by vehicle and frame.
    rng : numpy.random.Generator
        Source of the random draws.

    Returns
    -------
    dict of ndarray
        The same with other ``x`` and ``y``.
    """
    starts = starts_of(frames["vehicle"])
    sizes = np.diff(starts)
    level = np.repeat(np.exp(rng.normal(0, NOISE_SPREAD, len(sizes))), sizes)
    steadiness = np.minimum(1.0, np.maximum(derivative(frames["x"], starts), 0) / STEADY_SPEED)
    noise_x = NOISE_X * _correlated(sizes, CORRELATION_X, rng) * level * steadiness
    noise_y = NOISE_Y * _correlated(sizes, CORRELATION_Y, rng) * level * steadiness
    return {**frames, "x": frames["x"] + noise_x, "y": frames["y"] + noise_y}


def _correlated(sizes: npt.NDArray[np.int64], correlation: float, rng: np.random.Generator) -> Floats:
    """Return Gaussian noise of unit variance, correlated within pieces.

    The correlation is ``exp(-t^2 / (2 correlation^2))``: white noise smoothed by a Gaussian of width
    ``correlation / sqrt(2)`` has it. All pieces are smoothed in one line with a pad between, so that they
    stay independent.
    """
    width = correlation / np.sqrt(2) / FRAME_STEP
    pad = int(np.ceil(4 * width)) + 1
    white = rng.normal(size=int(sizes.sum()) + pad * len(sizes))
    smooth = gaussian_filter1d(white, width, mode="wrap") * np.sqrt(2 * np.sqrt(np.pi) * width)
    begin = np.cumsum(sizes + pad) - sizes - pad
    first = np.cumsum(sizes) - sizes
    return np.asarray(smooth[np.arange(int(sizes.sum())) + np.repeat(begin - first, sizes)])


def derivative(values: Floats, starts: npt.NDArray[np.int64]) -> Floats:
    """Return the rate of change (per s) by central differences.

    Parameters
    ----------
    values : float64, shape (rows,)
        One value a frame.
    starts : int64, shape (vehicles + 1,)
        As of :func:`starts_of`; differences are one-sided where a vehicle's rows begin and end.

    Returns
    -------
    float64, shape (rows,)
    """
    rate = np.empty_like(values)
    rate[1:-1] = (values[2:] - values[:-2]) / (2 * FRAME_STEP)
    first, last = starts[:-1], starts[1:] - 1
    after, before = np.minimum(first + 1, last), np.maximum(last - 1, first)
    rate[first] = (values[after] - values[first]) / FRAME_STEP
    rate[last] = (values[last] - values[before]) / FRAME_STEP
    return rate


def speed_and_acceleration(x: Floats, starts: npt.NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return speed (m/s) and acceleration (m/s²) as NGSIM derives them.

    Parameters
    ----------
    x : float64, shape (rows,)
        Noisy positions (m).
    starts : int64, shape (vehicles + 1,)
        As of :func:`starts_of`.

    Returns
    -------
    speed, acceleration : float64, shape (rows,)
        First derivative, at least 0, and second derivative, clipped at 11.2 ft/s² as in NGSIM's files.
    """
    speed = np.maximum(derivative(x, starts), 0)
    return speed, np.clip(derivative(speed, starts), -LARGEST_ACCELERATION, LARGEST_ACCELERATION)
