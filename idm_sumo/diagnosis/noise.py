r"""Noise, estimated from the data: of the measurement by its spectrum, of the drivers by the residuals' covariance.

Above 0.3 Hz what a recorded position does is not the driver's. The periodogram of its second difference is fitted by a sum of
white noise and first-order autoregressive noises of several memories (non-negative least squares).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls
from scipy.signal import lfilter

from idm_sumo import columns as c
from idm_sumo.diagnosis.smoother import LONGEST, derivatives
from idm_sumo.recording import Recording
from idm_sumo.road import FRAME_STEP
from idm_sumo.smoothing import WINDOW, runs

Floats = npt.NDArray[np.float64]

SEGMENT = 128  # frames of a periodogram
LOWEST = 0.35  # Hz
MEMORIES = np.array([0.15, 0.4, 1.0, 2.5])  # s, of the autoregressive parts
DRIVER_MEMORIES = np.array([0.7, 2.0, 5.0, 12.0])  # s
MARGIN = LONGEST // 2


@dataclass(frozen=True)
class Noise:
    """Variances of white noise and of autoregressive noises with memories ``memory`` (s)."""

    white: float
    variance: Floats
    memory: Floats

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return noise of shape ``(rows, steps)``, stationary from the first step."""
        total = np.sqrt(self.white) * rng.standard_normal((rows, steps)) if self.white > 0 else np.zeros((rows, steps))
        for variance, memory in zip(self.variance, self.memory, strict=True):
            if variance <= 0.0:
                continue
            kept = np.exp(-FRAME_STEP / memory)
            normal = rng.standard_normal((rows, steps)) * np.sqrt(variance * (1.0 - kept * kept))
            normal[:, 0] /= np.sqrt(1.0 - kept * kept)
            total += lfilter([1.0], [1.0, -kept], normal, axis=1)
        return total

    def scaled(self, factor: float) -> Noise:
        """Return noise of ``factor`` times the variance."""
        return Noise(self.white * factor, self.variance * factor, self.memory)


def smoothed(noise: Floats, window: int = WINDOW) -> tuple[Floats, Floats, Floats]:
    """Return position, speed and acceleration noise after the smoother; ``MARGIN`` frames are lost at both ends."""
    inner = slice(MARGIN, noise.shape[1] - MARGIN)
    one, two, three = (part[:, inner] for part in derivatives(noise, window))
    return one, two, three


def measurement_noise(recording: Recording, *, most: int = 3000) -> Noise:
    """Return the noise of the recorded positions along the road (m²); none if the recording is smooth already."""
    quiet = Noise(1e-6, np.zeros(len(MEMORIES)), MEMORIES)
    if recording.is_smooth:
        return quiet
    table = recording.table
    starts, lengths = runs(table)
    count = lengths // SEGMENT
    first = np.repeat(starts, count) + SEGMENT * (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count))
    if not len(first):
        return quiet
    first = first[:: max(1, len(first) // most)]
    second = np.diff(table[c.X].to_numpy(np.float64)[first[:, None] + np.arange(SEGMENT)], n=2, axis=1)
    window = np.hanning(second.shape[1])
    power = np.abs(np.fft.rfft(second * window, axis=1)) ** 2 / (window**2).sum()
    return _fitted(np.median(power, axis=0) / np.log(2.0), second.shape[1])


def _fitted(power: Floats, length: int) -> Noise:
    """Fit white and autoregressive noise to a periodogram of second differences."""
    frequency = np.fft.rfftfreq(length, FRAME_STEP)
    used = frequency >= LOWEST
    omega = 2.0 * np.pi * frequency[used] * FRAME_STEP
    gain = (2.0 - 2.0 * np.cos(omega)) ** 2
    kept = np.exp(-FRAME_STEP / MEMORIES)
    shapes = [gain] + [gain * (1.0 - k * k) / (1.0 - 2.0 * k * np.cos(omega) + k * k) for k in kept]
    shapes.append(FRAME_STEP**4 / (frequency[used] / LOWEST) ** 4)  # what drivers do, falling off
    design, wanted = np.stack(shapes, 1), power[used]
    weight = 1.0 / np.maximum(wanted, 1e-12)
    scale = (design * weight[:, None]).max(axis=0)
    solved, _ = nnls(design * weight[:, None] / scale, wanted * weight)
    solved = solved / scale
    return Noise(float(solved[0]), solved[1:-1], MEMORIES)
