"""The reward of a step: learned weights, scaled, with penalties."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.irl.simulation import RUNNING

Floats = npt.NDArray[np.float64]

ALIVE = 1.0  # mean reward of a recorded driver's step
PENALTY = 25.0  # the reward of 2.5 s of a recorded driver
WORST = -5.0  # least reward of a step: the boundary feature is unbounded, and no single step may dominate


class Reward(NamedTuple):
    """A reward that is linear in the features.

    The learned weights say which of two trajectories is better. Scale and shift do not change that while
    an episode lasts; they make the reward learnable: recorded drivers get ``ALIVE`` a step on average,
    with a standard deviation of 1.

    Attributes
    ----------
    weights : float64, shape (features,)
        Weights of the features.
    shift, scale : float
        The reward of a step is ``(weights . features - shift) / scale``.
    penalty : float
        Once, at the end of the episode by a collision or by leaving the road, in training only.
    """

    weights: Floats
    shift: float
    scale: float
    penalty: float = PENALTY

    @classmethod
    def brought_to_scale(cls, weights: Floats, recorded: Floats) -> Reward:
        """Return the reward scaled by recorded drivers.

        Parameters
        ----------
        weights : float64, shape (features,)
            Learned weights.
        recorded : float64, shape (..., features)
            Features of the recorded drivers' steps.

        Returns
        -------
        Reward
            With mean ``ALIVE`` and standard deviation 1 over those steps.
        """
        steps = recorded.reshape(-1, recorded.shape[-1]) @ weights
        scale = float(steps.std()) or 1.0
        return cls(np.asarray(weights, dtype=np.float64), float(steps.mean()) - ALIVE * scale, scale)

    def of(self, features: Floats) -> Floats:
        """Return the reward of steps.

        Parameters
        ----------
        features : float64, shape (..., features)
            Features of the steps.

        Returns
        -------
        float64, shape (...)
            At least ``WORST``.
        """
        return np.maximum((features @ self.weights - self.shift) / self.scale, WORST)

    def in_training(self, features: Floats, status: npt.NDArray[np.int64]) -> Floats:
        """Return the reward less the penalties.

        Parameters
        ----------
        features : float64, shape (..., features)
            Features of the steps.
        status : int64, shape (...)
            Status of :class:`idm_sumo.irl.simulation.Simulation`; a collision or leaving the road has a penalty.

        Returns
        -------
        float64, shape (...)
            Reward.
        """
        return np.asarray(self.of(features) - self.penalty * (status != RUNNING))
