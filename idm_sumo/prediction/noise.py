"""How far positions will be from a predicted rollout.

Scale, intervals, coverage and CRPS.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

FLOOR = 0.01  # of a scale: keeps the logarithm of a residual of nothing finite
RIDGE = 1e-3
BETWEEN = 20  # steps between those that the observed scale is learned from

LEVELS = np.concatenate([[0.01, 0.025], np.arange(0.05, 0.96, 0.05), [0.975, 0.99]])


@dataclass(frozen=True)
class ResidualNoise:
    """Quantiles of residuals in units of each driver's scale.

    A residual is a recorded less a predicted position.

    Attributes
    ----------
    quantiles : float64, shape (levels, steps)
        At :data:`LEVELS`, for each step of the rollout.
    """

    quantiles: Floats

    @classmethod
    def fit(cls, residuals: Floats, scale: Floats) -> ResidualNoise:
        """Learn from drivers that the prediction has not seen.

        Parameters
        ----------
        residuals, scale : float64, shape (windows, steps)
            m.

        Returns
        -------
        ResidualNoise
        """
        return cls(np.nanquantile(residuals / scale, LEVELS, axis=0))

    def interval(self, share: float, scale: Floats) -> tuple[Floats, Floats]:
        """Return the ends of the middle share of positions.

        Parameters
        ----------
        share : float
            Of the positions between the ends.
        scale : float64, shape (windows, steps)
            m.

        Returns
        -------
        lower, upper : float64, shape (windows, steps)
            m, from the rollout.
        """
        ends = [self._quantile(0.5 - 0.5 * share), self._quantile(0.5 + 0.5 * share)]
        return ends[0] * scale, ends[1] * scale

    def crps(self, residuals: Floats, scale: Floats) -> Floats:
        """Return the continuous ranked probability score (m).

        Twice the mean quantile (pinball) loss over the levels (Gneiting and Raftery, 2007), the levels'
        spacing as weights.

        Parameters
        ----------
        residuals, scale : float64, shape (windows, steps)
            m.

        Returns
        -------
        float64, shape (windows, steps)
        """
        edges = np.concatenate([[0.0], 0.5 * (LEVELS[1:] + LEVELS[:-1]), [1.0]])
        total = np.zeros(residuals.shape)
        for level, weight, quantile in zip(LEVELS, np.diff(edges), self.quantiles, strict=True):
            off = residuals - quantile * scale
            total += 2.0 * weight * np.maximum(level * off, (level - 1.0) * off)
        return total

    def _quantile(self, level: float) -> Floats:
        return np.array([np.interp(level, LEVELS, column) for column in self.quantiles.T])


@dataclass(frozen=True)
class ObservedScale:
    """A factor on the scale by what is observed.

    Such as speed and gap: slow traffic is predicted better than fast.

    Attributes
    ----------
    weights : float64, shape (features,)
        Of standardised features, in the logarithm of the factor.
    """

    weights: Floats

    @classmethod
    def fit(cls, features: Floats, residuals: Floats, scale: Floats) -> ObservedScale:
        """Learn from drivers left out.

        The regression of the logarithm of the absolute residual in units of the scale; the weights are
        means over the steps.

        Parameters
        ----------
        features : float64, shape (windows, features)
            Standardised.
        residuals, scale : float64, shape (windows, steps)
            m.

        Returns
        -------
        ObservedScale
        """
        steps = np.arange(min(BETWEEN, residuals.shape[1]) - 1, residuals.shape[1], BETWEEN)
        size = np.log(np.abs(residuals / scale)[:, steps] + FLOOR)
        found = [_slopes(features[known], y[known]) for y in size.T for known in (np.isfinite(y),) if known.any()]
        return cls(np.mean(found, axis=0) if found else np.zeros(features.shape[1]))

    def factor(self, features: Floats) -> Floats:
        """Return the factor of every window.

        Parameters
        ----------
        features : float64, shape (windows, features)
            Standardised.

        Returns
        -------
        float64, shape (windows, 1)
        """
        return np.asarray(np.exp(features @ self.weights)[:, None])


def _slopes(features: Floats, y: Floats) -> Floats:
    """Return the slopes of a regression, hardly drawn to 0."""
    off, z = y - y.mean(), features - features.mean(axis=0)
    return np.asarray(np.linalg.solve(z.T @ z + RIDGE * len(z) * np.eye(z.shape[1]), z.T @ off))
