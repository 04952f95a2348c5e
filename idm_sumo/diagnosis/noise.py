r"""Noise, estimated from the data: of the measurement by its spectrum, of the drivers by the residuals' covariance.

Above 0.3 Hz what a recorded position does is not the driver's. The periodogram of its second difference is fitted by a sum of
white noise, first-order autoregressive noises of several memories, and white noise that somebody has smoothed already
(non-negative least squares).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from idm_sumo.diagnosis.coloured import Once, Shape, Twice, average, bell, cubic
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import runs

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]

SEGMENT = 128  # frames of a periodogram
LOWEST = 0.35  # Hz
# s, of the autoregressive parts. With fewer, two stand in for one between them, and longer ones look alike above `LOWEST`: either
# says far too much of slow errors.
MEMORIES = np.array([0.1, 0.15, 0.25, 0.4, 0.6, 1.0])
# What may have smoothed white noise before it was recorded: bells (so many that each is between near ones), and what
# tools do besides, moving averages and local cubics. Nothing is left of such noise at high frequencies, where autoregressive noises
# have most, so none of those can stand in for it. Asked everywhere, they would leave slow errors to the drivers' motion.
BELLS = np.linspace(0.1, 0.5, 21)  # s
AVERAGES = (3, 5, 7, 9, 11, 15, 21)  # frames
CUBICS = (7, 9, 11, 15, 21, 31)  # frames
SMOOTHED = [*map(bell, BELLS.tolist()), *map(average, AVERAGES), *map(cubic, CUBICS)]
LOST = 0.05  # of the largest power, below which what is left beyond it says little of the noise and much of the form of its bell
MISFIT = 0.15  # of the powers, from which on noise is no sum of white and autoregressive ones
USUAL = 0.95  # of the segments at each frequency: the others are jumps of the tracking and hard braking
DRIVER_MEMORIES = np.array([0.7, 2.0, 5.0, 12.0])  # s
# Of vehicles' own accelerations: who follows smooths what the leader does, so that most of it has no jumps.
MOTION_MEMORIES = np.array([1.4, 12.0, 0.7, 1.5, 3.0])  # s
MOTION_TWICE = np.array([False, False, True, True, True])
TYPICAL_MOTION = np.array([0.05, 0.25, 0.0, 0.0, 0.2])  # m²/s⁴, of recordings too short to tell


@dataclass(frozen=True)
class Noise:
    """Variances of white noise, of autoregressive noises with memories ``memory`` (s), and of white noise smoothed.

    Those that are ``twice`` filtered have no jumps: a first-order autoregressive noise drives another one of the same memory.
    Those ``smoothed`` were so before they were recorded, as ``SMOOTHED`` says, one variance each; or there are none.
    """

    white: float
    variance: Floats
    memory: Floats
    twice: Booleans | None = None
    smoothed: Floats | None = None

    @property
    def deviation(self) -> float:
        """Standard deviation of it all."""
        return float(np.sqrt(self.white + sum(variance for variance, _ in self._parts())))

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return noise of shape ``(rows, steps)``, stationary from the first step."""
        total = np.sqrt(self.white) * rng.standard_normal((rows, steps)) if self.white > 0 else np.zeros((rows, steps))
        for variance, shape in self._parts():
            total += np.sqrt(variance) * shape.draw(rows, steps, rng)
        return total

    def covariance(self, steps: int) -> Floats:
        """Return the covariance of ``steps`` frames in a row, shape ``(steps, steps)``."""
        lag = np.abs(np.subtract.outer(np.arange(steps), np.arange(steps)))
        parts = (variance * shape.correlation(lag) for variance, shape in self._parts())
        return self.white * np.eye(steps) + sum(parts, np.zeros(lag.shape))

    def spectrum(self, omega: Floats) -> Floats:
        """Return the power at angular frequencies per frame."""
        parts = (variance * shape.spectrum(omega) for variance, shape in self._parts())
        return self.white + sum(parts, np.zeros(omega.shape))

    def _parts(self) -> Iterator[tuple[float, Shape]]:
        """Yield what there is of coloured noise, with its shape."""
        twice = np.zeros(len(self.memory), dtype=bool) if self.twice is None else self.twice
        remembered = [Twice(m) if t else Once(m) for m, t in zip(self.memory, twice, strict=True)]
        parts: list[tuple[float, Shape]] = [*zip(self.variance.tolist(), remembered, strict=True)]
        if self.smoothed is not None:
            parts += zip(self.smoothed.tolist(), SMOOTHED, strict=True)
        yield from (part for part in parts if part[0] > 0.0)


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
    shapes = [(Twice if t else Once)(m).spectrum(omega) for m, t in zip(MOTION_MEMORIES, MOTION_TWICE, strict=True)]
    # A second difference is the mean of the accelerations before and after, each of which holds for a frame.
    motion = FRAME_STEP**4 * 0.5 * (1.0 + np.cos(omega)) * np.stack(shapes)
    smeared, wanted = _smeared(np.vstack([noise, motion]).T)[1:], power.mean(axis=0)[1:]
    # Where next to nothing was recorded (noise that somebody smoothed), what the noise's form says too much is no motion's.
    scale = np.maximum(np.maximum(wanted, smeared[:, 0]), 1e-12)
    solved, _ = nnls(smeared[:, 1:] / scale[:, None], (wanted - smeared[:, 0]) / scale)
    return Noise(0.0, solved, MOTION_MEMORIES, MOTION_TWICE)


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
    """Fit white and autoregressive noise to a periodogram of second differences; where they do not fit, smoothed noise as well."""
    omega = 2.0 * np.pi * frequency * FRAME_STEP
    used = (frequency >= LOWEST) & (omega < np.pi)  # half the frame rate is distributed otherwise
    used &= (np.arange(len(power)) <= power.argmax()) | (power > LOST * power.max())
    if not used.any():  # nothing is recorded above the lowest frequency: positions without noise
        return Noise(1e-6, np.zeros(len(MEMORIES)), MEMORIES)
    remembered: list[Shape] = [Once(memory) for memory in MEMORIES]

    found, misfit = _mixed(remembered, omega, power, used)
    if misfit > MISFIT:
        found, _ = _mixed([*remembered, *SMOOTHED], omega, power, used)
    variance, rest = np.split(found[1:], [len(MEMORIES)])
    return Noise(float(found[0]), variance, MEMORIES, smoothed=rest if len(rest) else None)


def _mixed(shapes: list[Shape], omega: Floats, power: Floats, used: Booleans) -> tuple[Floats, float]:
    """Return the variances of white noise and of each shape, and by what share the powers are missed (root mean square)."""
    gain = (2.0 - 2.0 * np.cos(omega)) ** 2
    drivers = FRAME_STEP**4 / (np.maximum(omega, omega[1]) / (2.0 * np.pi * LOWEST * FRAME_STEP)) ** 4  # falling off
    columns = [gain, *(gain * shape.spectrum(omega) for shape in shapes), drivers]
    design = _smeared(np.stack(columns, 1))[used] / np.maximum(power[used], 1e-12)[:, None]
    scale = design.max(axis=0)
    solved, missed = nnls(design / scale, np.ones(len(design)))
    return (solved / scale)[:-1], float(missed / np.sqrt(len(design)))
