"""Shapes of coloured noise, of variance one each: how it is drawn, goes with itself, and is spread over frequencies."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter, oaconvolve, savgol_coeffs

from idm_sumo.recordings.columns import FRAME_STEP

FARTHEST = 4.0  # widths of a bell, as far as it is drawn

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Shape(Protocol):
    """Coloured noise of variance one."""

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return it, shape ``(rows, steps)``."""

    def correlation(self, lag: Integers) -> Floats:
        """Return how it goes with itself so many frames later."""

    def spectrum(self, omega: Floats) -> Floats:
        """Return its power at angular frequencies per frame."""


def _kept(memory: float) -> float:
    """Return the share of an autoregressive noise that is left a frame later; its memory in s."""
    return float(np.exp(-FRAME_STEP / memory))


class Once(NamedTuple):
    """First-order autoregressive noise; its memory in s."""

    memory: float

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return it, stationary from the first step."""
        kept = _kept(self.memory)
        normal = rng.standard_normal((rows, steps)) * np.sqrt(1.0 - kept * kept)
        normal[:, 0] /= np.sqrt(1.0 - kept * kept)
        return np.asarray(lfilter([1.0], [1.0, -kept], normal, axis=1))

    def correlation(self, lag: Integers) -> Floats:
        """Return how it goes with itself so many frames later."""
        return np.asarray(_kept(self.memory) ** lag)

    def spectrum(self, omega: Floats) -> Floats:
        """Return its power at angular frequencies per frame."""
        kept = _kept(self.memory)
        return np.asarray((1.0 - kept * kept) / (1.0 - 2.0 * kept * np.cos(omega) + kept * kept))


class Twice(NamedTuple):
    """First-order autoregressive noise driven by another one of the same memory (s), so that it has no jumps."""

    memory: float

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return it, stationary from the first step."""
        kept, next_to = _kept(self.memory), self.correlation(np.array(1))
        before = rng.standard_normal((rows, 2)) @ np.array([[1.0, next_to], [0.0, np.sqrt(1.0 - next_to**2)]])
        state = np.stack([2.0 * kept * before[:, 0] - kept**2 * before[:, 1], -(kept**2) * before[:, 0]], axis=1)
        normal = rng.standard_normal((rows, steps)) * np.sqrt((1.0 - kept**2) ** 3 / (1.0 + kept**2))
        return np.asarray(lfilter([1.0], [1.0, -2.0 * kept, kept**2], normal, axis=1, zi=state)[0])

    def correlation(self, lag: Integers) -> Floats:
        """Return how it goes with itself so many frames later."""
        kept = _kept(self.memory)
        return np.asarray((1.0 + lag * (1.0 - kept**2) / (1.0 + kept**2)) * kept**lag)

    def spectrum(self, omega: Floats) -> Floats:
        """Return its power at angular frequencies per frame."""
        kept = _kept(self.memory)
        once = 1.0 - 2.0 * kept * np.cos(omega) + kept * kept
        return np.asarray((1.0 - kept**2) ** 3 / (1.0 + kept**2) / once**2)


class Smoothed(NamedTuple):
    """White noise that somebody has smoothed, by weights of an odd number of frames, the same to both sides."""

    weights: tuple[float, ...]

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return it, stationary from the first step."""
        weights = self._unit()
        normal = rng.standard_normal((rows, steps + len(weights) - 1))
        return np.asarray(oaconvolve(normal, weights[None], mode="valid", axes=1))

    def correlation(self, lag: Integers) -> Floats:
        """Return how it goes with itself so many frames later."""
        weights = self._unit()
        itself = np.append(np.correlate(weights, weights, mode="full")[len(weights) - 1 :], 0.0)
        return np.asarray(itself[np.minimum(lag, len(weights))])

    def spectrum(self, omega: Floats) -> Floats:
        """Return its power at angular frequencies per frame."""
        weights = self._unit()
        frames = np.arange(len(weights)) - len(weights) // 2
        return np.asarray((np.cos(omega[..., None] * frames) @ weights) ** 2)

    def _unit(self) -> Floats:
        """Return the weights for a variance of one."""
        weights = np.array(self.weights)
        return np.asarray(weights / np.sqrt((weights**2).sum()))


def bell(width: float) -> Smoothed:
    """Return noise smoothed by Gaussian weights; their standard deviation in s."""
    more = int(np.ceil(FARTHEST * width / FRAME_STEP))
    frames = np.arange(-more, more + 1)
    return Smoothed(tuple(np.exp(-0.5 * (frames * FRAME_STEP / width) ** 2).tolist()))


def average(window: int) -> Smoothed:
    """Return noise smoothed by a moving average over an odd number of frames."""
    return Smoothed((1.0,) * window)


def cubic(window: int) -> Smoothed:
    """Return noise smoothed by local cubics over an odd number of frames (Savitzky and Golay)."""
    half = savgol_coeffs(window, 3)[window // 2 :].tolist()  # rounding leaves the other one a little different
    return Smoothed((*half[:0:-1], *half))
