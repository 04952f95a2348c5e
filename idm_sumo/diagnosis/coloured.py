"""Shapes of coloured noise, of variance one each: how it is drawn, goes with itself, and is spread over frequencies."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from idm_sumo.road import FRAME_STEP

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
    """White noise that went through a bell; the standard deviation of that, its width, in s."""

    width: float

    def draw(self, rows: int, steps: int, rng: np.random.Generator) -> Floats:
        """Return it, stationary from the first step."""
        width = self.width / FRAME_STEP
        more = int(np.ceil(FARTHEST * width))
        bell = np.exp(-0.5 * (np.arange(-more, more + 1) / width) ** 2)
        normal = rng.standard_normal((rows, steps + 2 * more))
        drawn = gaussian_filter1d(normal, width, axis=1, radius=more)[:, more : more + steps]
        return np.asarray(drawn * bell.sum() / np.sqrt((bell**2).sum()))

    def correlation(self, lag: Integers) -> Floats:
        """Return how it goes with itself so many frames later."""
        return np.asarray(np.exp(-0.25 * (lag * FRAME_STEP / self.width) ** 2))

    def spectrum(self, omega: Floats) -> Floats:
        """Return its power at angular frequencies per frame, from 0 to pi."""
        width = self.width / FRAME_STEP
        folded = np.exp(-((omega * width) ** 2)) + np.exp(-(((2.0 * np.pi - omega) * width) ** 2))
        return np.asarray(2.0 * np.sqrt(np.pi) * width * folded)
