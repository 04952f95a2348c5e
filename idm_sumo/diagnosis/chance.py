"""What chance adds to a null replicate: measurement errors, drivers' noise, what smoothing hid of the leaders, who drives.

Drawn once, it serves replicates of one model after the other: what differs between them is then the model, not the chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.rollout import PARAMETERS
from idm_sumo.diagnosis.smoother import Smoother, travelled
from idm_sumo.diagnosis.windows import LEADERS, Windows
from idm_sumo.recordings.smoothing import Path
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]
Singles = npt.NDArray[np.float32]  # enough for what is added to a path, and half the memory


@dataclass(frozen=True)
class Noises:
    """What makes a recording beside the model: measurement errors (m²), drivers' and leaders' own motion (m²/s⁴).

    ``leader`` is None where leaders were not smoothed, so that nothing of theirs is hidden.
    """

    measurement: Noise
    driver: Noise
    leader: Noise | None = None


def measured(noise: Noise, smoother: Smoother, rows: int, frames: int, rng: np.random.Generator) -> Path:
    """Return what measurement errors are smoothed to."""
    return _inner(smoother.rows(noise.draw(rows, frames + 2 * smoother.half, rng)), smoother)


def _inner(path: Path, smoother: Smoother) -> Path:
    """Return a path without its ends, of which the smoother sees less."""
    one, two, three = (part[:, smoother.half : part.shape[1] - smoother.half] for part in path)
    return one, two, three


def hidden(noises: Noises, smoother: Smoother, rows: int, frames: int, rng: np.random.Generator) -> tuple[Path, Path]:
    """Return what a smoothed leader really did beside what is shown of it, and what is shown of that.

    The first is a motion of the leaders' own spectrum less what the smoother makes of its measurement; the second is that,
    measured anew and smoothed.
    """
    if noises.leader is None:
        return (np.zeros((rows, frames)),) * 3, measured(noises.measurement, smoother, rows, frames, rng)
    longer = frames + 4 * smoother.half
    path = travelled(noises.leader.draw(rows, longer, rng))
    shown = smoother.rows(path[0] + noises.measurement.draw(rows, longer, rng))
    one, two, three = (true - part for true, part in zip(path, shown, strict=True))
    truth = _inner((one, two, three), smoother)
    again = smoother.rows(truth[0] + noises.measurement.draw(rows, longer - 2 * smoother.half, rng))
    return _inner(truth, smoother), _inner(again, smoother)


@dataclass(frozen=True)
class Chance:
    """All that chance adds to the windows of one replicate.

    Attributes
    ----------
    hidden, shown : float32, shape (windows, frames, 5)
        In the columns ``LEADERS``: what leaders really did beside what is shown of them, and what is shown of that.
    pushed : float64, shape (windows, frames - 1)
        Drivers' noise, m/s².
    error : tuple of float32 arrays, shape (windows, frames)
        Smoothed measurement error of the followers: m, m/s.
    drivers : float64, shape (drivers, 5)
        Standard normal numbers: who the drivers are if they are drawn anew.
    """

    hidden: Singles
    shown: Singles
    pushed: Floats
    error: tuple[Singles, Singles]
    drivers: Floats


def draw(windows: Windows, noises: Noises, rng: np.random.Generator) -> Chance:
    """Return the chance of one replicate."""
    rows, _, frames = windows.seen.shape
    truth, shown = np.empty((2, rows, len(LEADERS), frames), dtype=np.float32)
    for begin, parts in ((0, 3), (3, 2)):  # of the first and of the second leader, whose acceleration nobody sees
        one, other = hidden(noises, windows.leaders, rows, frames, rng)
        for number in range(parts):
            truth[:, begin + number], shown[:, begin + number] = one[number], other[number]
    pushed = noises.driver.draw(rows, frames - 1, rng)
    x, v, _ = measured(noises.measurement, windows.own, rows, frames, rng)
    error = np.asarray(x, dtype=np.float32), np.asarray(v, dtype=np.float32)
    return Chance(truth, shown, pushed, error, rng.standard_normal((windows.drivers, PARAMETERS)))


def draws(windows: Windows, noises: Noises, number: int, rng: np.random.Generator) -> list[Chance]:
    """Return the chance of several replicates."""
    return each_in_threads(lambda one: draw(windows, noises, one), rng.spawn(number))
