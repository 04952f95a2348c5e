"""Scenes whose drivers are known: followers that really drive by the IDM, recorded with NGSIM-like noise."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from idm_sumo.models import idm
from idm_sumo.recordings import columns as c
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.traffic import sort_into_cells
from idm_sumo.scenes.windows import LEADER_OF_RECORDED, Scenes, Window

Floats = npt.NDArray[np.float64]

LENGTH, WIDTH, LANE = 4.5, 1.8, 3
WARM_UP = 100  # frames before the window, so that nobody starts from an unnatural gap
SMOOTHED = 21  # frames


def draw_drivers(n: int, rng: np.random.Generator) -> Floats:
    """Return ``n`` ordinary drivers, shape ``(n, 5)``, well inside the bounds."""
    return rng.uniform([0.6, 0.8, 0.7, 1.0, 0.0], [2.5, 3.5, 2.0, 4.0, 2.0], (n, 5))


def stop_and_go(n: int, frames: int, rng: np.random.Generator) -> Floats:
    """Return leader speeds (m/s), shape ``(n, frames)``: waves of 10 to 40 s, down to standstill."""
    t = 0.1 * np.arange(frames)
    speed = rng.uniform(5.0, 13.0, (n, 1))
    for _ in range(3):
        period, phase = rng.uniform(10.0, 40.0, (n, 1)), rng.uniform(0.0, 2 * np.pi, (n, 1))
        speed = speed + rng.uniform(0.5, 3.5, (n, 1)) * np.sin(2 * np.pi * t / period + phase)
    return np.clip(speed, 0.0, 22.0)


def follow(drivers: Floats, leader_x: Floats, leader_speed: Floats, gap: Floats) -> tuple[Floats, Floats]:
    """Drive by the IDM, NumPy's own loop: positions and speeds, shapes ``(n, frames)``."""
    x, v = np.empty_like(leader_x), np.empty_like(leader_x)
    x[:, 0], v[:, 0] = leader_x[:, 0] - LENGTH - gap, leader_speed[:, 0]
    a, b, T, d0, d1 = drivers.T
    for k in range(leader_x.shape[1] - 1):
        dynamic = v[:, k] * T + v[:, k] * (v[:, k] - leader_speed[:, k]) / (2 * np.sqrt(a * b))
        wanted = d0 + d1 * np.sqrt(v[:, k] / US101.speed_limit) + np.maximum(dynamic, 0)
        space = leader_x[:, k] - LENGTH - x[:, k]
        acceleration = a * (1 - (v[:, k] / US101.speed_limit) ** 4 - (wanted / space) ** 2)
        x[:, k + 1] = x[:, k] + 0.1 * v[:, k]
        v[:, k + 1] = np.maximum(v[:, k] + 0.1 * np.maximum(acceleration, -9.0), 0)
    return x, v


def recorded(x: Floats, v: Floats, noise: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return positions and speeds as a camera and the usual smoothing leave them; exact without noise."""
    if noise == 0.0:
        return x, v
    measured = x + rng.normal(0.0, noise, x.shape)
    speed = savgol_filter(measured, SMOOTHED, 3, deriv=1, delta=0.1, axis=1)
    return savgol_filter(measured, SMOOTHED, 3, axis=1), np.maximum(speed, 0.0)


def scenes_of(
    x: Floats, v: Floats, leader_x: Floats, leader_speed: Floats, window: Window, *, y: Floats | None = None
) -> Scenes:
    """Put followers and their leaders (NaN for none) into scenes, each pair on a road of its own."""
    n, frames = x.shape
    known = np.isfinite(leader_x).ravel()
    count, center = int(known.sum()), float(US101.lane_center(LANE))
    columns = {
        c.X: leader_x.ravel()[known], c.Y: np.full(count, center), c.SPEED: leader_speed.ravel()[known],
        c.HEADING: np.zeros(count), c.LENGTH: np.full(count, LENGTH), c.WIDTH: np.full(count, WIDTH),
    }  # fmt: skip
    cells, nobody = np.arange(n * frames), np.zeros(count, dtype=np.int64)
    traffic = sort_into_cells(cells[known], n * frames, columns, nobody, 0, frames)
    return Scenes(
        period=np.full(n, "known"), window=window, road=US101, vehicle=np.arange(1, n + 1),
        first_frame=np.zeros(n, dtype=np.int64),
        lane=np.full(n, LANE), x=x, y=np.full((n, frames), center) if y is None else y, heading=np.zeros((n, frames)),
        speed=v, headway=leader_x - x, length=np.full(n, LENGTH), width=np.full(n, WIDTH),
        vehicle_class=np.full(n, 2), size_known=np.ones(n, dtype=np.bool_), cell=np.arange(n) * frames,
        traffic=traffic, leader_source=LEADER_OF_RECORDED,
    )  # fmt: skip


def known_drivers(
    n: int, *, seconds: float = 10.0, noise: float = 0.0, seed: int = 0, drivers: Floats | None = None
) -> tuple[Scenes, Floats]:
    """Return scenes and the parameters, shape ``(n, 5)``, that their drivers really have."""
    rng = np.random.default_rng(seed)
    window = Window(horizon=round(10 * seconds))
    frames = WARM_UP + window.frames + SMOOTHED
    theta = draw_drivers(n, rng) if drivers is None else drivers
    leader_speed = stop_and_go(n, frames, rng)
    leader_x = 100.0 + 0.1 * np.concatenate([np.zeros((n, 1)), np.cumsum(leader_speed[:, :-1], axis=1)], axis=1)
    start = np.minimum(leader_speed[:, 0], 20.0)
    gap = np.array(
        [idm.equilibrium_gap(s, idm.IDMParameters(*p), US101.speed_limit) for s, p in zip(start, theta, strict=True)]
    )
    x, v = follow(theta, leader_x, leader_speed, gap)
    used = slice(WARM_UP, WARM_UP + window.frames)
    x, v = (values[:, used] for values in recorded(x, v, noise, rng))
    leader_x, leader_speed = (values[:, used] for values in recorded(leader_x, leader_speed, noise, rng))
    return scenes_of(*(np.ascontiguousarray(values) for values in (x, v, leader_x, leader_speed)), window), theta
