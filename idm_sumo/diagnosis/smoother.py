r"""Smoothing for the diagnosis: followers by a local cubic, leaders by the mean of what they may have done.

What a follower did is compared with a simulation, so its smoothing must leave it nearly as it was. What its leader did is what it
answers to: there the errors must not look like motion, and what is hidden must be known. With a position
:math:`x = \beta_0 + \beta_1 t + \iint a` of accelerations :math:`a` with the vehicles' spectrum and measurement errors :math:`e`
with theirs, the mean of :math:`x`, its speed and its acceleration given :math:`y = x + e` is linear in :math:`y`, and what is left
is independent of :math:`y`. So a path drawn from the two spectra, less what the filter makes of its measurement, on top of a
smoothed path is one of the paths that the recording allows.

References
----------
Durbin and Koopman (2002), A simple and efficient simulation smoother for state space time series analysis.
Carroll, Ruppert, Stefanski and Crainiceanu (2006), Measurement Error in Nonlinear Models, chapter 4: such a mean as a
covariate does not weaken what is estimated from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.ndimage import correlate1d
from scipy.signal import savgol_filter

from idm_sumo.diagnosis.noise import Noise
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import ORDER, WINDOW, Path, runs, with_ends

FARTHEST = 40  # frames to each side that a posterior mean looks at
LEAST_ERROR = 1e-3  # m, of a measurement
SHORTEST, LONGEST = 3, 41  # frames of a local cubic
QUIET = 0.06  # m/s: speed noise behind the shortest window that needs no longer one
GROWTH = 0.4  # power of the noise with which the window grows

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Smoother:
    """A linear filter of positions.

    Attributes
    ----------
    half : int
        Frames to each side that it looks at.
    made : callable
        From a number of frames to the matrices that make position, speed and acceleration of that many measured positions.
    """

    half: int
    made: Callable[[int], Path]
    _known: dict[int, Path] = field(default_factory=dict, compare=False, repr=False)

    def rows(self, position: Floats) -> Path:
        """Return smoothed position, speed and acceleration along the last axis."""
        one, two, three = (position @ part.T for part in self._matrices(position.shape[-1]))
        return one, two, three

    def within(self, position: Floats, speed: Floats) -> Path:
        """Return the same of parts of longer paths, smoothed at their ends, too, with what is before and after.

        That is not known, and taken to be as the part itself, seen from its end: at both sides of it the vehicle accelerates alike.
        A filter of one side only would make other errors there than the recording has.
        """
        away = FRAME_STEP * np.arange(1, self.half + 1)
        before = position[:, 1 : self.half + 1] - 2.0 * speed[:, :1] * away
        after = position[:, -2 : -2 - self.half : -1] + 2.0 * speed[:, -1:] * away
        whole = self.rows(np.concatenate([before[:, ::-1], position, after], axis=1))
        one, two, three = (part[:, self.half : -self.half] for part in whole)
        return one, two, three

    def along(self, position: Floats, starts: Integers, lengths: Integers) -> Path:
        """Return the same of runs one after the other, each of shape ``(rows,)``."""
        whole = 2 * self.half + 1
        middle = [part[self.half] for part in self._matrices(whole)]
        first, second, third = (correlate1d(position, kernel, mode="nearest") for kernel in middle)
        return with_ends((first, second, third), self.rows, position, starts, lengths, whole)

    def _matrices(self, frames: int) -> Path:
        if frames not in self._known:
            self._known[frames] = self.made(frames)
        return self._known[frames]


def local_cubic(window: int) -> Smoother:
    """Return the house's filter (Savitzky and Golay) over an odd number of frames."""

    def made(frames: int) -> Path:
        if frames < SHORTEST:
            none = np.zeros((frames, frames))
            slope = np.diff(np.eye(frames), axis=0) / FRAME_STEP
            return np.eye(frames), none + (slope if frames > 1 else 0.0), none
        odd = min(window, frames - 1 + frames % 2)
        order = min(ORDER, odd - 1)
        one, two, three = (
            savgol_filter(np.eye(frames), odd, order, deriv=which, delta=FRAME_STEP, axis=0) for which in range(3)
        )
        return one, two, three

    return Smoother(window // 2, made)


def window_for(speed_noise: float) -> int:
    """Return an odd number of frames for a speed noise (m/s, standard deviation behind the shortest window)."""
    wanted = WINDOW * max(speed_noise / QUIET, 1.0) ** GROWTH
    return min(int(wanted) // 2 * 2 + 1, LONGEST)


def posterior_mean(measurement: Noise, motion: Noise) -> Smoother:
    """Return the filter for one measurement noise (m²) and one spectrum of the vehicles' accelerations (m²/s⁴)."""
    return Smoother(FARTHEST, lambda frames: _posterior_mean(measurement, motion, frames))


def _posterior_mean(measurement: Noise, motion: Noise, frames: int) -> Path:
    to_position, to_speed, at_frames = (part.T for part in travelled(np.eye(frames)))
    with_position = motion.covariance(frames) @ to_position.T
    inverse = np.linalg.inv(
        to_position @ with_position + measurement.covariance(frames) + LEAST_ERROR**2 * np.eye(frames)
    )
    time = np.arange(frames) * FRAME_STEP
    line = np.stack([np.ones(frames), time], axis=1)[:, : min(frames, 2)]
    # Where a vehicle began, and how fast, is not known beforehand.
    begin = np.linalg.solve(line.T @ inverse @ line, line.T @ inverse)
    acceleration = with_position @ inverse @ (np.eye(frames) - line @ begin)
    speed = to_speed @ acceleration + (begin[1] if frames > 1 else 0.0)
    return line @ begin + to_position @ acceleration, speed, at_frames @ acceleration


def travelled(acceleration: Floats) -> Path:
    """Return position, speed and acceleration at frames, from rest, of accelerations along the last axis that hold until the next frame."""
    speed = (np.cumsum(acceleration, axis=-1) - acceleration) * FRAME_STEP
    position = (np.cumsum(speed, axis=-1) - 0.5 * speed) * FRAME_STEP
    before = np.concatenate([acceleration[..., :1], acceleration[..., :-1]], axis=-1)
    return position, speed, np.asarray(0.5 * (before + acceleration))


def smooth_along(recording: Recording, smoother: Smoother) -> Recording:
    """Return the recording with positions along the road, speeds and accelerations smoothed; run by run."""
    table = recording.table
    x, v, a = smoother.along(table[c.X].to_numpy(np.float64), *runs(table))
    return recording.with_table(table.assign(**{c.X: x, c.SPEED: np.maximum(v, 0.0), c.ACCELERATION: a}))
