"""Smoothing for the diagnosis: the house's filter with a window that suits the noise.

Speeds of leaders are what drivers answer to, and noise in them looks like anticipation. The window grows with the noise; the
null twins are smoothed alike, so that what the filter blurs is blurred in them, too.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from idm_sumo import columns as c
from idm_sumo.recording import Recording
from idm_sumo.road import FRAME_STEP
from idm_sumo.smoothing import ORDER, WINDOW, filter_runs, runs

LONGEST = 41  # frames
QUIET = 0.06  # m/s: speed noise behind the shortest window that needs no longer one
GROWTH = 0.4  # power of the noise with which the window grows

Floats = npt.NDArray[np.float64]


def window_for(speed_noise: float) -> int:
    """Return an odd number of frames for a speed noise (m/s, standard deviation behind the shortest window)."""
    wanted = WINDOW * max(speed_noise / QUIET, 1.0) ** GROWTH
    return min(int(wanted) // 2 * 2 + 1, LONGEST)


def smooth_along(recording: Recording, window: int) -> Recording:
    """Return the recording with positions along the road, speeds and accelerations smoothed; run by run."""
    table = recording.table
    x, v, a = filter_runs(table[c.X].to_numpy(np.float64), *runs(table), window)
    return recording.with_table(table.assign(**{c.X: x, c.SPEED: np.maximum(v, 0.0), c.ACCELERATION: a}))


def derivatives(position: Floats, window: int) -> tuple[Floats, Floats, Floats]:
    """Return smoothed position, speed and acceleration along the last axis."""
    one, two, three = (position @ _filter(position.shape[-1], window, which) for which in range(3))
    return one, two, three


@lru_cache(maxsize=64)
def _filter(frames: int, window: int, which: int) -> Floats:
    """Return the filter, ends included, as a matrix: rows of thousands of windows are filtered faster so than one by one."""
    return np.ascontiguousarray(savgol_filter(np.eye(frames), window, ORDER, deriv=which, delta=FRAME_STEP, axis=0).T)
