"""Measure the true traffic with noise and write it as NGSIM does: official columns, feet, milliseconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from tests.simulators.first.simulation import Planted

FOOT = 0.3048
LANE = 12.0  # ft
KNOWS_NOTHING = 1118846979700  # ms
NOISE_TIME = 0.6  # s, of correlated measurement noise
SMOOTHING = 11  # frames over which errors were smoothed before they were recorded
COLUMNS = ["Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y", "Global_X", "Global_Y",
           "v_Length", "v_Width", "v_Class", "v_Vel", "v_Acc", "Lane_ID", "Preceding", "Following", "Space_Headway",
           "Time_Headway"]  # fmt: skip


def write(planted: Planted, path: Path) -> Path:
    """Write the recording: Parquet for that suffix, else the official text."""
    table = measured(planted)
    if path.suffix == ".parquet":
        table.to_parquet(path, index=False)
    else:
        table.round(3).to_csv(path, sep=" ", header=False, index=False)
    return path


def measured(planted: Planted) -> pd.DataFrame:
    """Return the official table, feet, as cameras would have it."""
    rng = np.random.default_rng([planted.plan.seed, 2])
    vehicle, frame = np.nonzero(np.isfinite(planted.x))
    x = planted.x + position_noise(rng, planted.x.shape, planted.plan.noise, planted.plan.sigma)
    x = x + _seam(planted)
    side = (_path_of_lanes(planted.lane) + 0.5) * LANE + position_noise(rng, x.shape, "correlated", 0.3)
    speeds, accelerations = _rates(x)
    speed = speeds[vehicle, frame]
    ahead, after = _preceding(planted, vehicle, frame)
    headway = np.where(ahead >= 0, x[ahead, frame] - x[vehicle, frame], 0.0)
    counts = np.bincount(vehicle, minlength=len(planted.x))
    kinds = planted.kind[vehicle]
    table = pd.DataFrame({
        "Vehicle_ID": vehicle + 2, "Frame_ID": frame + 13, "Total_Frames": counts[vehicle],
        "Global_Time": KNOWS_NOTHING + 100 * (frame + 13), "Local_X": side[vehicle, frame],
        "Local_Y": x[vehicle, frame] / FOOT, "Global_X": 6451137.641 + side[vehicle, frame],
        "Global_Y": 1873344.962 - x[vehicle, frame] / FOOT, "v_Length": planted.length[vehicle] / FOOT,
        "v_Width": np.select([kinds == 3, kinds == 1], [8.4, 3.0], 6.2), "v_Class": kinds, "v_Vel": speed / FOOT,
        "v_Acc": np.clip(accelerations[vehicle, frame] / FOOT, -11.2, 11.2),
        "Lane_ID": planted.lane[vehicle, frame].astype(int) + 1,
        "Preceding": np.where(ahead >= 0, ahead + 2, 0), "Following": np.where(after >= 0, after + 2, 0),
        "Space_Headway": headway / FOOT,
        "Time_Headway": np.where(speed > 0.1, headway / np.maximum(speed, 0.1), 9999.99),
    })  # fmt: skip
    return table[COLUMNS]


def position_noise(
    rng: np.random.Generator, shape: tuple[int, ...], kind: str, sigma: float
) -> npt.NDArray[np.float64]:
    """Return noise (m) of standard deviation ``sigma``.

    Independent frame by frame, correlated over 0.6 s, or smoothed over 1.1 s.
    """
    if kind == "smoothed":
        weight = np.hanning(SMOOTHING + 2)[1:-1]
        longer = rng.standard_normal((shape[0], shape[1] + SMOOTHING - 1))
        return sigma / np.linalg.norm(weight) * np.apply_along_axis(np.convolve, 1, longer, weight, "valid")
    white = rng.standard_normal(shape)
    if kind == "white":
        return np.asarray(sigma * white)
    keep = np.exp(-0.1 / NOISE_TIME)
    out = np.empty(shape)
    out[:, 0] = white[:, 0]
    for k in range(1, shape[1]):
        out[:, k] = keep * out[:, k - 1] + np.sqrt(1 - keep * keep) * white[:, k]
    return sigma * out


def _rates(x: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return speed (never negative) and acceleration as the measured positions give them, over one second each."""
    speeds, accelerations = np.full(x.shape, np.nan), np.full(x.shape, np.nan)
    for i, row in enumerate(x):
        seen = np.flatnonzero(np.isfinite(row))
        if len(seen) < 3:
            speeds[i, seen] = accelerations[i, seen] = 0.0
            continue
        part = slice(seen[0], seen[-1] + 1)
        slope = _over_a_second(row[part])
        speeds[i, part], accelerations[i, part] = np.maximum(slope, 0.0), _over_a_second(slope)
    return speeds, accelerations


def _over_a_second(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the rate of change between five frames before and five after, fewer at the ends."""
    k = np.arange(len(values))
    low, high = np.maximum(k - 5, 0), np.minimum(k + 5, len(values) - 1)
    return np.asarray((values[high] - values[low]) / (0.1 * (high - low)))


def _seam(planted: Planted) -> npt.NDArray[np.float64]:
    """Return the error (m) of a camera that is out of place: it comes and goes within 15 m at its edges."""
    size = planted.plan.effects.get("measurement_artefact", 0.0)
    low, high = planted.plan.place
    inside = np.clip((planted.x - low) / 15.0, 0, 1) * np.clip((high - planted.x) / 15.0, 0, 1)
    return np.asarray(size * np.nan_to_num(inside))


def _path_of_lanes(lane: npt.NDArray[np.int8]) -> npt.NDArray[np.float64]:
    """Return the lateral place in lanes: a change takes 3 s, half before and half after the label changes."""
    known = lane >= 0
    filled = pd.DataFrame(np.where(known, lane, np.nan).T).ffill().bfill().to_numpy().T
    window = np.hanning(33)[1:-1]
    padded = np.pad(filled, ((0, 0), (15, 15)), mode="edge")
    return np.apply_along_axis(np.convolve, 1, padded, window / window.sum(), "valid")


def _preceding(
    planted: Planted, vehicle: npt.NDArray[np.int64], frame: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return who is ahead of and behind each row in its lane, -1 for nobody."""
    lane = planted.lane[vehicle, frame]
    order = np.lexsort((planted.x[vehicle, frame], lane, frame))
    same = (np.diff(frame[order]) == 0) & (np.diff(lane[order]) == 0)
    ahead, after = np.full(len(vehicle), -1), np.full(len(vehicle), -1)
    ahead[order[:-1][same]] = vehicle[order[1:][same]]
    after[order[1:][same]] = vehicle[order[:-1][same]]
    return ahead, after
