"""Training an agent by proximal policy optimisation, with checkpoints.

Training that continues from a checkpoint gives exactly the result of uninterrupted training. Needs
the extra ``rl`` (stable-baselines3, torch).
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from idm_sumo.irl.learning import CURVE
from idm_sumo.irl.policy import Policy
from idm_sumo.irl.vec_environment import ReplayVecEnv
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.progress import Progress, silent


@dataclass(frozen=True)
class Training:
    """Settings of an agent's training.

    Attributes
    ----------
    steps : int
        Environment steps in all, rounded up to whole rollouts.
    episodes : int
        Number of episodes side by side.
    rollout : int
        Steps of each between two updates.
    batch, passes : int
        Samples of a gradient step, and passes over the rollout in an update.
    learning_rate : float
        At the start; it falls linearly to zero.
    discount, trace : float
        Discount of rewards by step, and lambda of the generalised advantage estimation.
    clip : float
        Clip range of PPO.
    first_spread : float
        Standard deviation of the actions (-1 ... 1) at the start.
    hidden : tuple of int
        Sizes of the layers of policy and value network.
    checkpoint_every : int
        Updates between checkpoints.
    """

    steps: int = 1_200_000
    episodes: int = 128
    rollout: int = 50
    batch: int = 1600
    passes: int = 6
    learning_rate: float = 1e-3
    discount: float = 0.99
    trace: float = 0.95
    clip: float = 0.2
    first_spread: float = 0.2
    hidden: tuple[int, ...] = (64, 64)
    checkpoint_every: int = 25

    @property
    def updates(self) -> int:
        """Number of rollouts, each followed by an update."""
        return -(-self.steps // (self.episodes * self.rollout))


def train(
    environment: ReplayVecEnv,
    training: Training,
    *,
    seed: int,
    checkpoint: Path | None = None,
    progress: Progress = silent,
) -> tuple[Policy, pd.DataFrame]:
    """Train an agent, or continue from its checkpoint.

    Parameters
    ----------
    environment : ReplayVecEnv
        With ``training.episodes`` episodes, made with the same seed.
    training : Training
        Settings.
    seed : int
        For the network and the random draws.
    checkpoint : Path, optional
        Written every ``checkpoint_every`` updates and at the end. If it exists, training continues from it.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    policy : Policy
        The agent.
    curve : pandas.DataFrame
        One row an update, columns ``CURVE``: means over the episodes that ended in the rollout.

    Raises
    ------
    InputError
        If the checkpoint belongs to other settings or another seed, or cannot be read.
    """
    torch.set_num_threads(1)  # networks this small are slower on several cores
    model = _new_model(environment, training, seed)
    identity = {"training": _plain(asdict(training)), "seed": seed}
    recorder = _Recorder(training, identity, checkpoint, progress)
    if checkpoint is not None and checkpoint.is_file():
        recorder.rows = _restore(model, environment, checkpoint, identity)
    left = training.updates * training.episodes * training.rollout - model.num_timesteps
    if left > 0:
        model.learn(left, callback=recorder, reset_num_timesteps=model.num_timesteps == 0)
        recorder.save_checkpoint(model)
    facts = {"kind": "ppo", "seed": seed, "steps": model.num_timesteps, "training": _plain(asdict(training))}
    return _policy_of(model, facts), pd.DataFrame(recorder.rows, columns=list(CURVE))


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}


def _new_model(environment: ReplayVecEnv, t: Training, seed: int) -> PPO:
    return PPO(
        "MlpPolicy",
        environment,
        learning_rate=lambda left: t.learning_rate * left,
        n_steps=t.rollout,
        batch_size=t.batch,
        n_epochs=t.passes,
        gamma=t.discount,
        gae_lambda=t.trace,
        clip_range=t.clip,
        seed=seed,
        device="cpu",
        policy_kwargs={"net_arch": list(t.hidden), "log_std_init": float(np.log(t.first_spread))},
    )


def _policy_of(model: PPO, facts: dict[str, Any]) -> Policy:
    """Copy the policy's layers from torch."""
    policy: Any = model.policy
    linear = [layer for layer in policy.mlp_extractor.policy_net if isinstance(layer, torch.nn.Linear)]
    layers = tuple(
        (layer.weight.detach().numpy().T.astype(np.float64), layer.bias.detach().numpy().astype(np.float64))
        for layer in [*linear, policy.action_net]
    )
    return Policy(layers, facts)


class _Recorder(BaseCallback):
    """Records the learning curve and writes checkpoints."""

    def __init__(
        self, training: Training, identity: dict[str, Any], checkpoint: Path | None, progress: Progress
    ) -> None:
        super().__init__()
        self.rows: list[list[float]] = []
        self._of, self._identity, self._checkpoint, self._report = training, identity, checkpoint, progress
        self._ended: list[dict[str, Any]] = []
        self._begin = time.perf_counter()

    def _on_rollout_start(self) -> None:
        """Write a checkpoint after every few updates."""
        if self.rows and len(self.rows) % self._of.checkpoint_every == 0:
            self.save_checkpoint(self.model)
        self._ended = []

    def _on_step(self) -> bool:
        self._ended += [info["episode"] for info in self.locals["infos"] if "episode" in info]
        return True

    def _on_rollout_end(self) -> None:
        ended, now = self._ended, time.perf_counter()
        outcomes = [episode["outcome"] for episode in ended]
        mean = [float(np.mean([e[key] for e in ended])) if ended else np.nan for key in ("r", "l")]
        shares = [outcomes.count(what) / max(len(ended), 1) for what in ("collision", "off_road")]
        self.rows.append([self.model.num_timesteps, len(ended), *mean, *shares, now - self._begin])
        self._begin = now
        self._report(f"training agent, seed {self._identity['seed']}", len(self.rows), self._of.updates)

    def save_checkpoint(self, model: Any) -> None:
        """Write the whole state of the training."""
        if self._checkpoint is None:
            return
        environment: ReplayVecEnv = model.env
        state: Any = np.random.get_state()  # noqa: NPY002 - stable-baselines3 draws from it
        kind, keys, position, gauss, cached = state
        record = {
            "identity": self._identity, "rows": self.rows, "steps": model.num_timesteps, "updates": model._n_updates,
            "policy": model.policy.state_dict(), "optimizer": model.policy.optimizer.state_dict(),
            "observation": torch.tensor(model._last_obs), "starts": torch.tensor(model._last_episode_starts),
            "environment": {
                k: torch.tensor(v) if isinstance(v, np.ndarray) else v for k, v in environment.state().items()
            },
            "torch": torch.get_rng_state(),
            "numpy": [kind, torch.tensor(keys.astype(np.int64)), position, gauss, cached],
        }  # fmt: skip
        with new_file(self._checkpoint) as part:
            torch.save(record, part)


def _restore(model: PPO, environment: ReplayVecEnv, checkpoint: Path, identity: dict[str, Any]) -> list[list[float]]:
    """Load a checkpoint into model and environment.

    Returns the learning curve.
    """
    try:
        record = torch.load(checkpoint, weights_only=True)
        same = record["identity"] == identity
    except Exception as error:
        raise InputError(f"{checkpoint}: cannot be read ({type(error).__name__}); remove it to start again") from None
    if not same:
        raise InputError(f"{checkpoint}: belongs to other settings or another seed; choose another output or remove it")
    try:
        return _put_in(model, environment, record)
    except (AttributeError, KeyError, IndexError, TypeError, ValueError, RuntimeError) as error:
        raise InputError(f"{checkpoint}: is damaged ({type(error).__name__}); remove it to start again") from None


def _put_in(model: PPO, environment: ReplayVecEnv, record: dict[str, Any]) -> list[list[float]]:
    model.policy.load_state_dict(record["policy"])
    model.policy.optimizer.load_state_dict(record["optimizer"])
    model.num_timesteps, model._n_updates = record["steps"], record["updates"]
    environment.restore({k: v.numpy() if isinstance(v, torch.Tensor) else v for k, v in record["environment"].items()})
    model._last_obs, model._last_episode_starts = record["observation"].numpy(), record["starts"].numpy()
    torch.set_rng_state(record["torch"])
    kind, keys, position, gauss, cached = record["numpy"]
    np.random.set_state((kind, keys.numpy().astype(np.uint32), position, gauss, cached))  # noqa: NPY002
    rows: list[list[float]] = record["rows"]
    return rows
