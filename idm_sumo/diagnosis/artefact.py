"""A seam in the measurement: a place at which every vehicle jumps. Tested before any behaviour.

In 4 s of a trajectory a cubic and a step at the middle are fitted together. Nobody drives a step, so its mean over all vehicles at one
place is the measurement's (two cameras that disagree), whatever the drivers do there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from idm_sumo import columns as c
from idm_sumo.recording import Recording
from idm_sumo.smoothing import ORDER, runs

FRAMES = 41  # of which a step at the middle is told from a cubic
BIN = 2.0  # m
CLEAR = 8.0  # standard errors: no chance maximum over all bins
LEAST = 0.15  # m
FEWEST = 30  # vehicles that must pass

Floats = npt.NDArray[np.float64]


class Seam(NamedTuple):
    """Place (m), by how much positions beyond it are shifted (m) with its standard error, and the p-value."""

    position: float
    shift: float
    error: float
    p_value: float


def step_filter(frames: int = FRAMES) -> Floats:
    """Return weights whose product with ``frames`` positions is the step at their middle, beside a cubic."""
    t = np.linspace(-1.0, 1.0, frames)
    design = np.column_stack([t**k for k in range(ORDER + 1)] + [np.where(t > 0, 0.5, np.where(t < 0, -0.5, 0.0))])
    return np.asarray(np.linalg.pinv(design)[-1])


def find_seam(recording: Recording) -> Seam | None:
    """Return the clearest seam of a recording, if there is one."""
    if recording.is_smooth or not recording.has_leader_rows:
        return None
    x = recording.table[c.X].to_numpy(np.float64)
    weights, half = step_filter(), FRAMES // 2
    step = np.convolve(x, weights[::-1], mode="same")
    inside = np.zeros(len(x), dtype=bool)
    number = np.zeros(len(x), dtype=np.int64)
    for run, (start, length) in enumerate(zip(*runs(recording.table), strict=True)):
        if length >= FRAMES:
            inside[start + half : start + length - half] = True
        number[start : start + length] = run
    smooth = np.convolve(x, np.ones(5) / 5.0, mode="same")
    place = np.floor((smooth - smooth[inside].min(initial=0.0)) / BIN).astype(np.int64)
    return _clearest(step[inside], place[inside], number[inside], float(smooth[inside].min(initial=0.0)))


def _clearest(step: Floats, place: npt.NDArray[np.int64], run: npt.NDArray[np.int64], begin: float) -> Seam | None:
    """Return the place with the largest mean step over its standard error, vehicles counted once."""
    if not len(step):
        return None
    key, where = np.unique(place * (run.max() + 1) + run, return_inverse=True)
    each = np.bincount(where, step) / np.bincount(where)
    bins = key // (run.max() + 1)
    count = np.bincount(bins)
    mean = np.bincount(bins, each) / np.maximum(count, 1)
    spread = np.bincount(bins, each**2) / np.maximum(count, 1) - mean**2
    error = np.sqrt(np.maximum(spread, 1e-12) / np.maximum(count - 1, 1))
    z = np.where(count >= FEWEST, mean / error, 0.0)
    best = int(np.argmax(np.abs(mean) * (np.abs(z) > CLEAR)))
    if abs(z[best]) <= CLEAR or abs(mean[best]) < LEAST:
        return None
    p = float(min(1.0, len(z) * 2.0 * norm.sf(abs(z[best]))))
    return Seam(begin + (best + 0.5) * BIN, float(mean[best]), float(error[best]), p)


def repaired(recording: Recording, seam: Seam) -> Recording:
    """Return the recording with the shift beyond the seam taken back."""
    table = recording.table
    beyond = table[c.X] > seam.position
    return recording.with_table(
        table.assign(**{c.X: table[c.X] - seam.shift * beyond}),
        f"positions beyond {seam.position:.0f} m moved back by {seam.shift:.2f} m",
    )
