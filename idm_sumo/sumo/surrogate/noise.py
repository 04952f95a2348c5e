"""From simulated steps to recorded frames: what happens between steps, and a camera's noise."""

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
STEADY_SPEED = 3.0  # m/s; slower cars are tracked better, a standing car does not seem to move
LARGEST_ACCELERATION = 11.2 * FOOT  # m/s^2, where NGSIM clips


def between_steps(steps: Trajectories) -> Trajectories:
    """Return one row a vehicle and frame, from one a vehicle and step.

    Ballistic steps have a constant acceleration, so ``x(t) = x0 + v0 t + (v1 - v0) t^2 / (2 h)``
    is what was simulated (measured: to 1e-13 m in 99.8 % of steps, the rest
    stop or change edges within one). Sideways motion is at constant speed.

    Parameters
    ----------
    steps : dict of ndarray, shape (rows,)
        See :func:`~idm_sumo.sumo.surrogate.traffic.run`.

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
    x = x0[:, None] + np.minimum(moved, dx[:, None])  # who stops within a step does not roll back
    y = y0[:, None] + dy[:, None] * t / STEP
    frame = steps["step"][start, None] * FRAMES_A_STEP + np.arange(FRAMES_A_STEP, dtype=np.int32)
    vehicle = np.repeat(steps["vehicle"][start], FRAMES_A_STEP)
    return {"vehicle": vehicle, "frame": frame.ravel(), "x": x.ravel(), "y": y.ravel()}


def starts_of(vehicle: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Return where each vehicle's rows begin, and the number of rows at the end."""
    return np.concatenate([[0], np.flatnonzero(np.diff(vehicle)) + 1, [len(vehicle)]])


def add_noise(frames: Trajectories, rng: np.random.Generator) -> Trajectories:
    """Return the frames with noise on ``x`` and ``y``, correlated in time as a tracker's is."""
    starts = starts_of(frames["vehicle"])
    sizes = np.diff(starts)
    level = np.repeat(np.exp(rng.normal(0, NOISE_SPREAD, len(sizes))), sizes)
    steadiness = np.minimum(1.0, np.maximum(derivative(frames["x"], starts), 0) / STEADY_SPEED)
    noise_x = NOISE_X * _correlated(sizes, CORRELATION_X, rng) * level * steadiness
    noise_y = NOISE_Y * _correlated(sizes, CORRELATION_Y, rng) * level * steadiness
    return {**frames, "x": frames["x"] + noise_x, "y": frames["y"] + noise_y}


def _correlated(sizes: npt.NDArray[np.int64], correlation: float, rng: np.random.Generator) -> Floats:
    """Return Gaussian noise of unit variance, correlation ``exp(-t^2 / (2 correlation^2))``, in pieces.

    White noise smoothed by a Gaussian of width ``correlation / sqrt(2)`` has this correlation.
    Vehicles are smoothed in one line with a pad between, so that they stay independent.
    """
    width = correlation / np.sqrt(2) / FRAME_STEP
    pad = int(np.ceil(4 * width)) + 1
    white = rng.normal(size=int(sizes.sum()) + pad * len(sizes))
    smooth = gaussian_filter1d(white, width, mode="wrap") * np.sqrt(2 * np.sqrt(np.pi) * width)
    begin = np.cumsum(sizes + pad) - sizes - pad
    first = np.cumsum(sizes) - sizes
    return np.asarray(smooth[np.arange(int(sizes.sum())) + np.repeat(begin - first, sizes)])


def derivative(values: Floats, starts: npt.NDArray[np.int64]) -> Floats:
    """Return the rate of change (per s) by central differences, one-sided where a vehicle's rows begin and end."""
    rate = np.empty_like(values)
    rate[1:-1] = (values[2:] - values[:-2]) / (2 * FRAME_STEP)
    first, last = starts[:-1], starts[1:] - 1
    after, before = np.minimum(first + 1, last), np.maximum(last - 1, first)
    rate[first] = (values[after] - values[first]) / FRAME_STEP
    rate[last] = (values[last] - values[before]) / FRAME_STEP
    return rate


def speed_and_acceleration(x: Floats, starts: npt.NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return what NGSIM's columns hold: derivatives of noisy positions, the second one clipped."""
    speed = np.maximum(derivative(x, starts), 0)
    return speed, np.clip(derivative(speed, starts), -LARGEST_ACCELERATION, LARGEST_ACCELERATION)
