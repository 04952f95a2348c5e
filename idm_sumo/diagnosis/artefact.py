"""A seam in the measurement: a place at which every vehicle jumps. Tested before any behaviour.

In 4 s of a trajectory a cubic and a step at the middle are fitted together. Nobody drives a step, so its mean over all vehicles at one
place is the measurement's (two cameras that disagree). What many drivers do at one place may look like a step in four seconds, but not
in one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import ORDER, runs

FRAMES, FEW = 41, 21  # of which a step at the middle is told from a cubic: finds it; makes sure
KEPT = 0.5  # of a step, that has to be there in few frames, too
BIN = 2.0  # m
CLEAR = 8.0  # standard errors: no chance maximum over all bins
LEAST = 0.15  # m
ASIDE = 1  # bins to each side of where a long look sees it
FEWEST = 30  # vehicles that must pass

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Seam(NamedTuple):
    """Place (m), by how much positions beyond it are shifted (m) with its standard error, and the p-value."""

    position: float
    shift: float
    error: float
    p_value: float


def step_filter(frames: int) -> Floats:
    """Return weights whose product with ``frames`` positions is the step at their middle, beside a cubic."""
    t = np.linspace(-1.0, 1.0, frames)
    design = np.column_stack([t**k for k in range(ORDER + 1)] + [np.where(t > 0, 0.5, np.where(t < 0, -0.5, 0.0))])
    return np.asarray(np.linalg.pinv(design)[-1])


class Steps(NamedTuple):
    """Mean step (m) at each place, its standard error, and how many vehicles passed it; shapes ``(places,)``."""

    mean: Floats
    error: Floats
    passed: Integers


def find_seam(recording: Recording) -> Seam | None:
    """Return the clearest seam of a recording, if there is one."""
    if recording.is_smooth or not recording.has_leader_rows or not len(recording.table):
        return None
    x = recording.table[c.X].to_numpy(np.float64)
    smooth = np.convolve(x, np.ones(5) / 5.0, mode="same")
    begin = float(smooth.min())
    place = np.floor((smooth - begin) / BIN).astype(np.int64)
    starts, lengths = runs(recording.table)
    steps = _steps(x, place, starts, lengths, FRAMES)
    z = np.where(steps.passed >= FEWEST, steps.mean / steps.error, 0.0)
    best = int(np.argmax(np.abs(steps.mean) * (np.abs(z) > CLEAR)))
    shift = float(steps.mean[best])
    if abs(z[best]) <= CLEAR or abs(shift) < LEAST:
        return None
    # What drivers do at one place, all of them, is a step in a long look only.
    near = _steps(x, place, starts, lengths, FEW)
    centres = begin + (best + 0.5) * BIN + BIN * np.arange(-ASIDE, ASIDE + 1)
    kept = max(
        _size(near, _steps((x > one).astype(float), place, starts, lengths, FEW)) * np.sign(shift) for one in centres
    )
    if kept < KEPT * abs(shift):
        return None
    p = float(min(1.0, 2.0 * len(z) * norm.sf(abs(z[best]))))
    return Seam(begin + (best + 0.5) * BIN, shift, float(steps.error[best]), p)


def _size(seen: Steps, unit: Steps) -> float:
    """Return how large (m) a step is that looks like a unit step at one place does, by weighted least squares over all places."""
    weight = np.where(seen.passed >= FEWEST, unit.mean / np.maximum(seen.error, 1e-9) ** 2, 0.0)
    return float((weight * seen.mean).sum() / max((weight * unit.mean).sum(), 1e-12))


def _steps(x: Floats, place: Integers, starts: Integers, lengths: Integers, frames: int) -> Steps:
    """Return the mean step at each place, every vehicle counted once."""
    step = np.convolve(x, step_filter(frames)[::-1], mode="same")
    inside, half = np.zeros(len(x), dtype=bool), frames // 2
    for start, length in zip(starts[lengths >= frames], lengths[lengths >= frames], strict=True):
        inside[start + half : start + length - half] = True
    run = np.repeat(np.arange(len(starts)), lengths)
    key, where = np.unique(place[inside] * len(starts) + run[inside], return_inverse=True)
    each = np.bincount(where, step[inside]) / np.bincount(where)
    places, bins = int(place.max()) + 1, key // len(starts)
    count = np.bincount(bins, minlength=places)
    mean = np.bincount(bins, each, places) / np.maximum(count, 1)
    spread = np.bincount(bins, each**2, places) / np.maximum(count, 1) - mean**2
    return Steps(mean, np.sqrt(np.maximum(spread, 1e-12) / np.maximum(count - 1, 1)), count)


def repaired(recording: Recording, seam: Seam) -> Recording:
    """Return the recording with the shift beyond the seam taken back."""
    table = recording.table
    beyond = table[c.X] > seam.position
    return recording.with_table(
        table.assign(**{c.X: table[c.X] - seam.shift * beyond}),
        f"positions beyond {seam.position:.0f} m moved back by {seam.shift:.2f} m",
    )
