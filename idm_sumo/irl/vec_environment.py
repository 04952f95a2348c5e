"""Many episodes side by side for stable-baselines3.

A step is one compiled call for all of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from idm_sumo.irl.episodes import Episodes, Surroundings
from idm_sumo.irl.reward import Reward
from idm_sumo.irl.simulation import ACTIONS, COLLIDED, OBSERVATIONS, OFF_ROAD, RUNNING, Simulation

OUTCOMES = {RUNNING: "time", COLLIDED: "collision", OFF_ROAD: "off_road"}


def observation_space() -> spaces.Box:
    """Return the space of the observations.

    Returns
    -------
    gymnasium.spaces.Box
        See :mod:`idm_sumo.irl.simulation`.
    """
    return spaces.Box(-np.inf, np.inf, (OBSERVATIONS,), np.float32)


def action_space() -> spaces.Box:
    """Return the space of the actions.

    Returns
    -------
    gymnasium.spaces.Box
        See :mod:`idm_sumo.irl.simulation`.
    """
    return spaces.Box(-1.0, 1.0, (ACTIONS,), np.float32)


class ReplayVecEnv(VecEnv):
    """Modelled vehicles in replayed traffic, in windows drawn at random.

    Parameters
    ----------
    episodes : Episodes
        Starts of the windows.
    around : Surroundings
        Traffic.
    reward : Reward
        Reward of a step.
    horizon : int
        Steps of an episode, 0.1 s each.
    number : int
        Number of episodes side by side.
    seed : int
        For the draws of windows.

    Notes
    -----
    A collision or leaving the road ends an episode with a penalty. The horizon truncates it
    (``TimeLimit.truncated``), so that the value of the state is still estimated.
    """

    def __init__(
        self, episodes: Episodes, around: Surroundings, reward: Reward, *, horizon: int, number: int, seed: int
    ) -> None:
        super().__init__(number, observation_space(), action_space())
        self.reward_of, self.horizon = reward, horizon
        self.windows = len(episodes.length)
        self.rng = np.random.default_rng(seed)
        self.simulation = Simulation(episodes, around, self.rng.integers(self.windows, size=number))
        self.returns = np.zeros(number)
        self._action: npt.NDArray[np.float32] = np.zeros((number, ACTIONS), dtype=np.float32)

    def reset(self) -> npt.NDArray[np.float32]:
        """Start a new episode everywhere."""
        self._draw(np.arange(self.num_envs))
        return self.simulation.observation.copy()

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions of the next step.

        Parameters
        ----------
        actions : float32, shape (episodes, 2)
            See :mod:`idm_sumo.irl.simulation`.
        """
        self._action = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Drive all vehicles one step and restart finished episodes.

        Returns
        -------
        observation : float32, shape (episodes, 16)
            After the step, or at the start of a new episode.
        reward : float32, shape (episodes,)
            Of the step.
        done : bool, shape (episodes,)
            Whether the episode ended.
        infos : list of dict
            For an episode that ended: its last observation, length, return and outcome.
        """
        simulation = self.simulation
        simulation.advance(self._action)
        rewards = self.reward_of.in_training(simulation.features, simulation.status)
        self.returns += rewards
        done = (simulation.status != RUNNING) | (simulation.step >= self.horizon)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        finished = np.flatnonzero(done)
        for i in finished.tolist():
            infos[i] = self._final_info(i)
        self._draw(finished)
        return simulation.observation.copy(), rewards.astype(np.float32), done, infos

    def _final_info(self, i: int) -> dict[str, Any]:
        """Return the information about an episode that ends.

        stable-baselines3 and the learning curve use it.
        """
        status, steps = int(self.simulation.status[i]), int(self.simulation.step[i])
        return {
            "terminal_observation": self.simulation.observation[i].copy(),
            "TimeLimit.truncated": status == RUNNING,
            "episode": {"r": float(self.returns[i]), "l": steps, "t": 0.0, "outcome": OUTCOMES[status]},
        }

    def _draw(self, which: npt.NDArray[np.int64]) -> None:
        self.simulation.restart(which, self.rng.integers(self.windows, size=len(which)))
        self.returns[which] = 0.0

    def state(self) -> dict[str, Any]:
        """Return everything that changes during training.

        Returns
        -------
        dict
            For :meth:`restore`.
        """
        s = self.simulation
        names = ("row", "step", "state", "observation", "status", "overlapping")
        return {name: getattr(s, name).copy() for name in names} | {
            "returns": self.returns.copy(),
            "rng": self.rng.bit_generator.state,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a stored :meth:`state`.

        Parameters
        ----------
        state : dict
            As :meth:`state` returns it.
        """
        for name in ("row", "step", "state", "observation", "status", "overlapping"):
            getattr(self.simulation, name)[:] = state[name]
        self.returns[:] = state["returns"]
        self.rng.bit_generator.state = state["rng"]

    def close(self) -> None:
        """Do nothing; no resource is held."""

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """Return an attribute, the same for every episode.

        Parameters
        ----------
        attr_name : str
            Name.
        indices : int or iterable of int, optional
            Episodes; all by default.

        Returns
        -------
        list
            One value an episode.
        """
        return [getattr(self, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Refuse, since the episodes share their attributes.

        Parameters
        ----------
        attr_name, value, indices
            As stable-baselines3 calls it.

        Raises
        ------
        NotImplementedError
            Always.
        """
        raise NotImplementedError("the episodes of one environment share their attributes")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refuse, since there are no single environments.

        Parameters
        ----------
        method_name, *args, indices, **kwargs
            As stable-baselines3 calls it.

        Raises
        ------
        NotImplementedError
            Always.
        """
        raise NotImplementedError("there are no single environments inside")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that no wrapper is used.

        Parameters
        ----------
        wrapper_class, indices
            As stable-baselines3 calls it.

        Returns
        -------
        list of bool
            False for every episode.
        """
        return [False for _ in self._get_indices(indices)]
