"""Rollouts of drivers as they are and a little otherwise, side by side: what a fit is linearised by, and judged by before that."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis.rollout import PARAMETERS, positions_beside
from idm_sumo.diagnosis.windows import Windows

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

STEP = 0.03  # of a log-parameter
NUDGES = np.array([0.2, 0.2])  # m, m/s: of the start
# Rollouts side by side: as they are; a parameter moved; the start moved.
OWN_STEPS = np.hstack([np.zeros((PARAMETERS, 1)), STEP * np.eye(PARAMETERS), np.zeros((PARAMETERS, len(NUDGES)))])
START_STEPS = np.hstack([np.zeros((len(NUDGES), 1 + PARAMETERS)), np.diag(NUDGES)])


@dataclass(frozen=True)
class Rolled:
    """Positions of drivers as they are and a little otherwise.

    Attributes
    ----------
    windows : Windows
    own : float64, shape (drivers, 5)
        Log-parameters.
    by_lane : float64, shape (rows, slots.COUNT)
    beside : float64, shape (windows, moments, 8)
        m: as they are, with each parameter moved, with the start moved.
    """

    windows: Windows
    own: Floats
    by_lane: Floats
    beside: Floats

    def is_of(self, windows: Windows, own: Floats, by_lane: Floats) -> bool:
        """Return whether these are the rollouts of the very same arrays: nothing that is fitted is changed in place."""
        return self.windows is windows and self.own is own and self.by_lane is by_lane

    @property
    def base(self) -> Floats:
        """Positions (m) as they are, shape ``(windows, moments)``."""
        return np.ascontiguousarray(self.beside[:, :, 0])

    @property
    def by_own(self) -> Floats:
        """Their derivatives by each log-parameter (m), shape ``(windows, moments, 5)``."""
        return np.asarray((self.beside[:, :, 1 : 1 + PARAMETERS] - self.beside[:, :, :1]) / STEP)

    @property
    def by_start(self) -> Floats:
        """Their derivatives by the start's place (1) and speed (s), shape ``(windows, moments, 2)``."""
        return np.asarray((self.beside[:, :, 1 + PARAMETERS :] - self.beside[:, :, :1]) / NUDGES)

    def with_drivers(self, which: Integers, some: Windows, own: Floats) -> Rolled:
        """Return the rollouts with some drivers as given; only they are driven again.

        Parameters
        ----------
        which : int64, shape (some,)
            Their numbers, ascending.
        some : Windows
            Theirs.
        own : float64, shape (some, 5)
            Log-parameters.
        """
        if not len(which):
            return self
        every, beside = self.own.copy(), self.beside.copy()
        every[which] = own
        beside[np.isin(self.windows.driver, which)] = roll(some, own, self.by_lane).beside
        return replace(self, own=every, beside=beside)


def roll(windows: Windows, own: Floats, by_lane: Floats) -> Rolled:
    """Drive all windows by their drivers' log-parameters, shape ``(drivers, 5)``, and the magnitudes, as they are and a little otherwise."""
    moved = np.exp(np.repeat(own[:, :, None], OWN_STEPS.shape[1], axis=2) + OWN_STEPS)
    return Rolled(windows, own, by_lane, positions_beside(windows, moved, by_lane, START_STEPS))
