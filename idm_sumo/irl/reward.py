"""The reward an agent is trained on: learned weights, brought to a scale, and penalties that end an episode."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.irl.simulation import RUNNING

Floats = npt.NDArray[np.float64]

ALIVE = 1.0  # a step, for driving as the recorded drivers do on average
PENALTY = 25.0  # once, in place of all that the rest of the episode would have brought
WORST = -5.0  # a step: the boundary feature grows without bound, and a single step must not decide


class Reward(NamedTuple):
    """Linear in the features.

    The learned weights say which of two trajectories is better; a scale and a constant a step do
    not change that while an episode lasts, and make it learnable: recorded drivers get
    ``ALIVE`` a step on average, with a standard deviation of 1.

    Attributes
    ----------
    weights : float64, shape (features,)
    shift, scale : float
        The reward of a step is ``(weights . features - shift) / scale``.
    """

    weights: Floats
    shift: float
    scale: float

    @classmethod
    def brought_to_scale(cls, weights: Floats, recorded: Floats) -> Reward:
        """Return the reward by the features of recorded drivers' steps, shape (..., features)."""
        steps = recorded.reshape(-1, recorded.shape[-1]) @ weights
        scale = float(steps.std()) or 1.0
        return cls(np.asarray(weights, dtype=np.float64), float(steps.mean()) - ALIVE * scale, scale)

    def of(self, features: Floats) -> Floats:
        """Return the reward of steps, shape (...,), from features of shape (..., features)."""
        return np.maximum((features @ self.weights - self.shift) / self.scale, WORST)

    def in_training(self, features: Floats, status: npt.NDArray[np.int64]) -> Floats:
        """Return the reward less the penalty for a collision or for leaving the road."""
        return np.asarray(self.of(features) - PENALTY * (status != RUNNING))
