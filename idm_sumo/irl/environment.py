"""A modelled vehicle in replayed traffic, as gymnasium environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.reward import Reward
from idm_sumo.irl.simulation import RUNNING, Simulation
from idm_sumo.irl.vec_environment import OUTCOMES, action_space, observation_space
from idm_sumo.scenes.windows import Scenes

Observation = npt.NDArray[np.float32]


class ReplayEnv(gymnasium.Env[Any, Any]):
    """A vehicle driven by an agent among recorded vehicles.

    The recorded vehicles do not react.

    Parameters
    ----------
    scenes : sequence of Scenes
        Windows to drive in. Every reset draws one, or takes ``options={"window": number}``.
    reward : Reward
        Reward of a step.
    penalties : bool
        Whether a collision or leaving the road has a penalty and ends the episode, as in training.
        Without them an episode lasts the whole horizon, as in evaluation.

    Notes
    -----
    Observation and action, with their units: :mod:`idm_sumo.irl.simulation`. ``info`` holds the features of
    the step, in the order of :data:`idm_sumo.irl.features.NAMES`, as ``features`` and the state of the
    episode as ``outcome``.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - gymnasium's

    def __init__(self, scenes: Sequence[Scenes], reward: Reward, *, penalties: bool = True) -> None:
        self.episodes, self.around = episodes_of(scenes)
        self.horizon = scenes[0].window.horizon
        self.reward_of, self.penalties = reward, penalties
        self.observation_space = observation_space()
        self.action_space = action_space()
        self.simulation: Simulation | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode.

        Parameters
        ----------
        seed : int, optional
            For the random draws.
        options : dict, optional
            ``window`` chooses the window.

        Returns
        -------
        observation : float32, shape (16,)
            See :mod:`idm_sumo.irl.simulation`.
        info : dict
            The ``window``.
        """
        super().reset(seed=seed)
        window = (options or {}).get("window", self.np_random.integers(len(self.episodes.length)))
        self.simulation = Simulation(self.episodes, self.around, np.array([window]))
        return self.simulation.observation[0].copy(), {"window": int(window)}

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive one frame of 0.1 s.

        Parameters
        ----------
        action : float32, shape (2,)
            See :mod:`idm_sumo.irl.simulation`.

        Returns
        -------
        observation : float32, shape (16,)
            After the step.
        reward : float
            Of the step.
        terminated, truncated : bool
            Whether a penalty ended the episode, and whether the horizon was reached.
        info : dict
            ``features`` and ``outcome``.
        """
        simulation = self.simulation
        if simulation is None:
            raise gymnasium.error.ResetNeeded("call reset first")
        simulation.advance(np.asarray(action)[None])
        status = int(simulation.status[0])
        of = self.reward_of.in_training if self.penalties else lambda features, _: self.reward_of.of(features)
        value = float(of(simulation.features, simulation.status)[0])
        ended = self.penalties and status != RUNNING
        info = {"features": simulation.features[0].copy(), "outcome": OUTCOMES[status]}
        return simulation.observation[0].copy(), value, ended, bool(simulation.step[0] >= self.horizon), info
