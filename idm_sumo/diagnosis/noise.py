r"""Noise, estimated from the data: of the measurement by its spectrum, of the drivers by the residuals' covariance.

Above 0.3 Hz what a recorded position does is not the driver's. The periodogram of its second difference is fitted by a sum of
white noise and first-order autoregressive noises of several memories (non-negative least squares).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls
from scipy.signal import lfilter

from idm_sumo import columns as c
from idm_sumo.recording import Recording
from idm_sumo.road import FRAME_STEP
from idm_sumo.smoothing import runs

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]

SEGMENT = 128  # frames of a periodogram
LOWEST = 0.35  # Hz
# s, of the autoregressive parts. With fewer, two stand in for one between them, and longer ones look alike above `LOWEST`: either
# says far too much of slow errors.
MEMORIES = np.array([0.1, 0.15, 0.25, 0.4, 0.6, 1.0])
USUAL = 0.95  # of the segments at each frequency: the others are jumps of the tracking and hard braking
DRIVER_MEMORIES = np.array([0.7, 2.0, 5.0, 12.0])  # s
# Of vehicles' own accelerations: who follows smooths what the leader does, so that most of it has no jumps.
MOTION_MEMORIES = np.array([1.4, 12.0, 0.7, 1.5, 3.0])  # s
MOTION_TWICE = np.array([False, False, True, True, True])
TYPICAL_MOTION = np.array([0.05, 0.25, 0.0, 0.0, 0.2])  # m²/s⁴, of recordings too short to tell


@dataclass(frozen=True)
class Noise:
    """Variances of white noise and of autoregressive noises with memories ``memory`` (s).

    Those that are ``twice`` filtered have no jumps: a first-order autoregressive noise drives another one of the same memory.
    """

    white: float
    variance: Floats
    memory: Floats
    twice: Booleans | None = None

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return noise of shape ``(rows, steps)``, stationary from the first step."""
        total = np.sqrt(self.white) * rng.standard_normal((rows, steps)) if self.white > 0 else np.zeros((rows, steps))
        for variance, memory, twice in self._parts():
            if variance > 0.0:
                total += np.sqrt(variance) * (_drawn_twice if twice else _drawn)(memory, rows, steps, rng)
        return total

    def covariance(self, steps: int) -> Floats:
        """Return the covariance of ``steps`` frames in a row, shape ``(steps, steps)``."""
        lag = np.abs(np.subtract.outer(np.arange(steps), np.arange(steps)))
        parts = (variance * _correlation(memory, lag, twice) for variance, memory, twice in self._parts())
        return self.white * np.eye(steps) + sum(parts, np.zeros(lag.shape))

    def spectrum(self, omega: Floats) -> Floats:
        """Return the power at angular frequencies per frame."""
        parts = (variance * _spectrum(memory, omega, twice) for variance, memory, twice in self._parts())
        return self.white + sum(parts, np.zeros(omega.shape))

    def _parts(self) -> Iterator[tuple[float, float, bool]]:
        twice = np.zeros(len(self.memory), dtype=bool) if self.twice is None else self.twice
        yield from zip(self.variance.tolist(), self.memory.tolist(), twice.tolist(), strict=True)


def _drawn(memory: float, rows: int, steps: int, rng: np.random.Generator) -> Floats:
    """Return autoregressive noise of variance one."""
    kept = np.exp(-FRAME_STEP / memory)
    normal = rng.standard_normal((rows, steps)) * np.sqrt(1.0 - kept * kept)
    normal[:, 0] /= np.sqrt(1.0 - kept * kept)
    return np.asarray(lfilter([1.0], [1.0, -kept], normal, axis=1))


def _drawn_twice(memory: float, rows: int, steps: int, rng: np.random.Generator) -> Floats:
    """Return noise of variance one that is filtered twice."""
    kept = np.exp(-FRAME_STEP / memory)
    next_to = _correlation(memory, np.array(1), twice=True)
    before = rng.standard_normal((rows, 2)) @ np.array([[1.0, next_to], [0.0, np.sqrt(1.0 - next_to**2)]])
    state = np.stack([2.0 * kept * before[:, 0] - kept**2 * before[:, 1], -(kept**2) * before[:, 0]], axis=1)
    normal = rng.standard_normal((rows, steps)) * np.sqrt((1.0 - kept**2) ** 3 / (1.0 + kept**2))
    return np.asarray(lfilter([1.0], [1.0, -2.0 * kept, kept**2], normal, axis=1, zi=state)[0])


def _correlation(memory: float, lag: npt.NDArray[np.int64], twice: bool) -> Floats:
    """Return how noise of variance one goes with itself so many frames later."""
    kept = np.exp(-FRAME_STEP / memory)
    more = lag * (1.0 - kept**2) / (1.0 + kept**2) if twice else 0.0
    return np.asarray((1.0 + more) * kept**lag)


QUIET = Noise(0.0, np.zeros(len(DRIVER_MEMORIES)), DRIVER_MEMORIES)


def measurement_noise(recording: Recording, *, most: int = 3000) -> Noise:
    """Return the noise of the recorded positions along the road (m²); none if the recording is smooth already."""
    found = None if recording.is_smooth else _periodogram(recording, most)
    if found is None:
        return Noise(1e-6, np.zeros(len(MEMORIES)), MEMORIES)
    frequency, power = found
    return _fitted(frequency, _usual(power))


def motion_noise(recording: Recording, measurement: Noise, *, most: int = 3000) -> Noise:
    """Return the spectrum of the vehicles' own accelerations (m²/s⁴): what the measurement noise leaves of the recorded ones."""
    found = _periodogram(recording, most)
    if found is None:
        return Noise(0.0, TYPICAL_MOTION, MOTION_MEMORIES, MOTION_TWICE)
    frequency, power = found
    omega = 2.0 * np.pi * frequency * FRAME_STEP
    noise = (2.0 - 2.0 * np.cos(omega)) ** 2 * measurement.spectrum(omega)
    shapes = [_spectrum(m, omega, t) for m, t in zip(MOTION_MEMORIES, MOTION_TWICE, strict=True)]
    # A second difference is the mean of the accelerations before and after, each of which holds for a frame.
    motion = FRAME_STEP**4 * 0.5 * (1.0 + np.cos(omega)) * np.stack(shapes)
    smeared, wanted = _smeared(np.vstack([noise, motion]).T)[1:], power.mean(axis=0)[1:]
    solved, _ = nnls(smeared[:, 1:] / wanted[:, None], 1.0 - smeared[:, 0] / wanted)
    return Noise(0.0, solved, MOTION_MEMORIES, MOTION_TWICE)


def _spectrum(memory: float, omega: Floats, twice: bool = False) -> Floats:
    """Return the spectrum of an autoregressive noise of variance one."""
    kept = np.exp(-FRAME_STEP / memory)
    once = 1.0 - 2.0 * kept * np.cos(omega) + kept * kept
    return np.asarray((1.0 - kept**2) ** 3 / (1.0 + kept**2) / once**2 if twice else (1.0 - kept * kept) / once)


def _periodogram(recording: Recording, most: int) -> tuple[Floats, Floats] | None:
    """Return frequencies (Hz) and power of second differences of positions, shape ``(segments, frequencies)``."""
    table = recording.table
    starts, lengths = runs(table)
    count = lengths // SEGMENT
    first = np.repeat(starts, count) + SEGMENT * (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count))
    if not len(first):
        return None
    first = first[:: max(1, len(first) // most)]
    second = np.diff(table[c.X].to_numpy(np.float64)[first[:, None] + np.arange(SEGMENT)], n=2, axis=1)
    window = np.hanning(second.shape[1])
    power = np.abs(np.fft.rfft(second * window, axis=1)) ** 2 / (window**2).sum()
    return np.asarray(np.fft.rfftfreq(second.shape[1], FRAME_STEP)), np.asarray(power)


def _usual(power: Floats) -> Floats:
    """Return the mean over segments without the largest, as of exponentially distributed powers."""
    kept = max(1, int(USUAL * len(power)))
    share = 1.0 + (1.0 - USUAL) * np.log(1.0 - USUAL) / USUAL
    return np.asarray(np.sort(power, axis=0)[:kept].mean(axis=0) / share)


def _smeared(spectra: Floats) -> Floats:
    """Return spectra, one a column, as the periodogram's window (Hann) smears them over the next frequencies."""
    beside = np.vstack([spectra[1], spectra, spectra[-2]])
    return np.asarray((4.0 * spectra + beside[:-2] + beside[2:]) / 6.0)


def _fitted(frequency: Floats, power: Floats) -> Noise:
    """Fit white and autoregressive noise to a periodogram of second differences."""
    omega = 2.0 * np.pi * frequency * FRAME_STEP
    gain = (2.0 - 2.0 * np.cos(omega)) ** 2
    shapes = [gain] + [gain * _spectrum(memory, omega) for memory in MEMORIES]
    shapes.append(FRAME_STEP**4 / (np.maximum(frequency, frequency[1]) / LOWEST) ** 4)  # what drivers do, falling off
    used = slice(int(np.argmax(frequency >= LOWEST)), -1)  # the last, half the frame rate, is distributed otherwise
    design, wanted = _smeared(np.stack(shapes, 1))[used], power[used]
    weight = 1.0 / np.maximum(wanted, 1e-12)
    scale = (design * weight[:, None]).max(axis=0)
    solved, _ = nnls(design * weight[:, None] / scale, wanted * weight)
    solved = solved / scale
    return Noise(float(solved[0]), solved[1:-1], MEMORIES)
