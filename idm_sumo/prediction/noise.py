"""How far positions will be from a predicted rollout: intervals, coverage and CRPS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

LEVELS = np.concatenate([[0.01, 0.025], np.arange(0.05, 0.96, 0.05), [0.975, 0.99]])


@dataclass(frozen=True)
class ResidualNoise:
    """Quantiles of recorded less predicted positions in units of each driver's scale.

    Attributes
    ----------
    quantiles : float64, shape (levels, steps)
        At :data:`LEVELS`, for each step of the rollout.
    """

    quantiles: Floats

    @classmethod
    def fit(cls, residuals: Floats, scale: Floats) -> ResidualNoise:
        """Learn from drivers that the prediction has not seen; both of shape ``(windows, steps)``, in m."""
        return cls(np.nanquantile(residuals / scale, LEVELS, axis=0))

    def interval(self, share: float, scale: Floats) -> tuple[Floats, Floats]:
        """Return lower and upper end (m, from the rollout) of the middle ``share`` of positions."""
        ends = [self._quantile(0.5 - 0.5 * share), self._quantile(0.5 + 0.5 * share)]
        return ends[0] * scale, ends[1] * scale

    def crps(self, residuals: Floats, scale: Floats) -> Floats:
        """Return the continuous ranked probability score (m) of each window and step.

        Twice the mean quantile (pinball) loss over the levels (Gneiting and Raftery, 2007), the levels' spacing as weights.
        """
        edges = np.concatenate([[0.0], 0.5 * (LEVELS[1:] + LEVELS[:-1]), [1.0]])
        total = np.zeros(residuals.shape)
        for level, weight, quantile in zip(LEVELS, np.diff(edges), self.quantiles, strict=True):
            off = residuals - quantile * scale
            total += 2.0 * weight * np.maximum(level * off, (level - 1.0) * off)
        return total

    def _quantile(self, level: float) -> Floats:
        return np.array([np.interp(level, LEVELS, column) for column in self.quantiles.T])
