"""From recorded drivers to a reward and an agent."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.irl import features
from idm_sumo.irl.cloning import clone
from idm_sumo.irl.demonstrations import Demonstrations, demonstrations_of
from idm_sumo.irl.episodes import Episodes, Surroundings, episodes_of
from idm_sumo.irl.inverse_control import Expansion, LearnedReward, learn, learn_wanted, log_likelihood
from idm_sumo.irl.reward import Reward
from idm_sumo.irl.trajectory import derivatives, step_features
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.threads import one_blas_thread
from idm_sumo.scenes.windows import Scenes

if TYPE_CHECKING:
    import pandas as pd

    from idm_sumo.irl.policy import Policy
    from idm_sumo.irl.ppo import Training

CURVE = ("steps", "episodes", "mean_return", "mean_length", "collision_share", "off_road_share", "seconds")
INSTALL = "pip install 'idm-sumo[rl]'"
HELD_OUT = 0.25  # share of the demonstrations that is not used for learning
CLONED_DRIVERS = 600


class Lessons(NamedTuple):
    """Training drivers as demonstrations in their traffic.

    Attributes
    ----------
    demonstrations : Demonstrations
        Paths and controls.
    episodes : Episodes
        Starts of the same windows.
    around : Surroundings
        Traffic around them.
    """

    demonstrations: Demonstrations
    episodes: Episodes
    around: Surroundings

    def rows(self, which: npt.NDArray[np.int64]) -> Lessons:
        """Return some of the drivers.

        Parameters
        ----------
        which : int64 array
            Rows to keep.

        Returns
        -------
        Lessons
            Those drivers, in the same traffic.
        """
        return Lessons(self.demonstrations.rows(which), self.episodes.rows(which), self.around)


class RewardReport(NamedTuple):
    """The result of :func:`learn_reward`.

    Attributes
    ----------
    wanted : LearnedReward
        The weights on which an agent is trained; none is negative.
    free : LearnedReward
        The weights without that bound.
    held_out : float
        Mean log-likelihood under ``wanted`` of demonstrations that were not used for learning.
    scale, shift : float
        Of the reward of a step, see :class:`idm_sumo.irl.reward.Reward`.
    standing : int
        Number of drivers left out because they (almost) come to rest.
    """

    wanted: LearnedReward
    free: LearnedReward
    held_out: float
    scale: float
    shift: float
    standing: int

    @property
    def reward(self) -> Reward:
        """The reward of a step."""
        return Reward(self.wanted.weights, self.shift, self.scale)

    def to_json(self) -> dict[str, Any]:
        """Return plain values.

        Returns
        -------
        dict
            Ready for JSON.
        """
        return {
            "wanted": self.wanted.to_json(),
            "free": self.free.to_json(),
            "held_out_log_likelihood": self.held_out,
            "scale": self.scale,
            "shift": self.shift,
            "standing": self.standing,
            "features": list(features.NAMES),
        }


def reward_of_json(stored: dict[str, Any]) -> Reward:
    """Return the reward stored by :meth:`RewardReport.to_json`.

    Parameters
    ----------
    stored : dict
        As :meth:`RewardReport.to_json` returns it.

    Returns
    -------
    Reward
        Reward of a step.

    Raises
    ------
    KeyError
        If an entry is missing.
    """
    named = stored["wanted"]["weights"]
    return Reward(features.weights_from(named), float(stored["shift"]), float(stored["scale"]))


def rl_is_installed() -> bool:
    """Return whether torch and stable-baselines3 are installed."""
    try:
        return find_spec("stable_baselines3") is not None and find_spec("torch") is not None
    except ModuleNotFoundError:
        return False


def require_rl() -> None:
    """Raise an error if torch or stable-baselines3 is missing.

    Raises
    ------
    InputError
        Names the command that installs them.
    """
    if not rl_is_installed():
        raise InputError(f"training an agent needs torch and stable-baselines3: {INSTALL}")


def lessons_of(scenes: Sequence[Scenes]) -> Lessons:
    """Track all drivers of one or more periods.

    Parameters
    ----------
    scenes : sequence of Scenes
        One for each period.

    Returns
    -------
    Lessons
        All drivers in their order.
    """
    parts = [demonstrations_of(one) for one in scenes]
    together = Demonstrations(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    return Lessons(together, *episodes_of(scenes))


@one_blas_thread
def learn_reward(
    lessons: Lessons, *, most: int = 200, steps: int = 50, seed: int = 1, progress: Progress = silent
) -> RewardReport:
    """Learn the reward's weights by continuous inverse optimal control.

    Parameters
    ----------
    lessons : Lessons
        Drivers to learn from.
    most : int
        Largest number of drivers to learn from, drawn at random; a third as many are held out.
    steps : int
        Steps of each, 0.1 s.
    seed : int
        For the random draws.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    RewardReport
        Weights, their scale, and the likelihood of held-out drivers.

    Raises
    ------
    InputError
        If fewer than two drivers keep moving.
    """
    moving = np.flatnonzero(lessons.demonstrations.moving)
    standing = len(lessons.episodes.length) - len(moving)
    if len(moving) < 2:
        raise InputError(
            "fewer than two drivers keep moving over the whole horizon; a reward cannot be learned from them"
        )
    drawn = np.random.default_rng(seed).permutation(moving)
    used = min(most, max(1, round(len(drawn) * (1 - HELD_OUT))))
    learned_from, unseen = drawn[:used], drawn[used : used + max(1, most // 3)]
    expansion = expansion_of(lessons.rows(learned_from), steps)
    free = learn(expansion, progress=progress)
    wanted = learn_wanted(expansion, free, progress)
    held_out = log_likelihood(expansion_of(lessons.rows(unseen), steps), wanted.weights, wanted.dummy)
    recorded = step_features(lessons.demonstrations, lessons.episodes, lessons.around)
    reward = Reward.brought_to_scale(wanted.weights, recorded)
    return RewardReport(wanted, free, float(held_out.mean()), reward.scale, reward.shift, standing)


def expansion_of(lessons: Lessons, steps: int) -> Expansion:
    """Return the features about demonstrations, to second order.

    Parameters
    ----------
    lessons : Lessons
        Drivers in their traffic.
    steps : int
        Of each, 0.1 s.

    Returns
    -------
    Expansion
        One row a driver.
    """
    short = lessons.demonstrations.first(steps)
    return Expansion.of(*derivatives(short, lessons.episodes, lessons.around))


def train_agent(
    lessons: Lessons,
    reward: Reward,
    training: Training,
    *,
    seed: int,
    checkpoint: Path | None = None,
    progress: Progress = silent,
) -> tuple[Policy, pd.DataFrame]:
    """Train an agent among the lessons' drivers.

    Parameters
    ----------
    lessons : Lessons
        Drivers in their traffic.
    reward : Reward
        Reward of a step.
    training : Training
        Settings of the training.
    seed : int
        For the network and the random draws.
    checkpoint : Path, optional
        File from which training continues, see :func:`idm_sumo.irl.ppo.train`.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    policy : Policy
        The agent.
    curve : pandas.DataFrame
        Learning curve, see :func:`idm_sumo.irl.ppo.train`.

    Raises
    ------
    InputError
        If the extra ``rl`` is not installed, or the checkpoint does not fit.
    """
    require_rl()
    from idm_sumo.irl.ppo import train
    from idm_sumo.irl.vec_environment import ReplayVecEnv

    environment = ReplayVecEnv(
        lessons.episodes,
        lessons.around,
        reward,
        horizon=lessons.demonstrations.control.shape[1],
        number=training.episodes,
        seed=seed,
    )
    return train(environment, training, seed=seed, checkpoint=checkpoint, progress=progress)


def clone_drivers(lessons: Lessons, *, seed: int) -> Policy:
    """Fit a behaviour clone to some of the drivers.

    Parameters
    ----------
    lessons : Lessons
        Drivers in their traffic.
    seed : int
        For the draw of at most ``CLONED_DRIVERS`` drivers and for the network.

    Returns
    -------
    Policy
        The clone.
    """
    n = len(lessons.episodes.length)
    chosen = lessons.rows(np.sort(np.random.default_rng(seed).permutation(n)[:CLONED_DRIVERS]))
    return clone(chosen.demonstrations, chosen.episodes, chosen.around, seed=seed)
