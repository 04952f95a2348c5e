"""A trained policy as plain arrays: what it does needs neither torch nor scikit-learn."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.simulation import OBSERVATIONS, Simulation
from idm_sumo.models import bicycle
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Policy:
    """A network with tanh layers and a linear last one, from observations to actions.

    Attributes
    ----------
    layers : tuple of (weights, bias)
        Shapes ``(inputs, outputs)`` and ``(outputs,)``.
    facts : dict
        How it was made: kind, seed, steps, ...; plain values.
    """

    layers: tuple[tuple[Floats, Floats], ...]
    facts: dict[str, Any]

    def __call__(self, observation: npt.NDArray[np.floating]) -> Floats:
        """Return actions (vehicles, 2) for observations (vehicles, 16), the mean ones: nothing is drawn."""
        value = np.asarray(observation, dtype=np.float64)
        for weights, bias in self.layers[:-1]:
            value = np.tanh(value @ weights + bias)
        weights, bias = self.layers[-1]
        return np.clip(value @ weights + bias, -1.0, 1.0)

    def save(self, path: Path) -> None:
        """Write ``.npz``."""
        arrays: dict[str, Any] = {
            f"{kind}{i}": part for i, layer in enumerate(self.layers) for kind, part in zip("wb", layer, strict=True)
        }
        with new_file(path) as part, part.open("wb") as stream:
            np.savez(stream, facts=np.array(json.dumps(self.facts)), **arrays)

    @classmethod
    def load(cls, path: Path) -> Policy:
        """Read what :meth:`save` wrote.

        Raises
        ------
        InputError
            If the file is missing or no policy of this observation.
        """
        try:
            with np.load(path, allow_pickle=False) as stored:
                layers = tuple((stored[f"w{i}"], stored[f"b{i}"]) for i in range((len(stored.files) - 1) // 2))
                facts = json.loads(str(stored["facts"]))
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{path}: is no policy ({error}); make one with `idm-sumo irl train`") from None
        if not layers or layers[0][0].shape[0] != OBSERVATIONS:
            raise InputError(f"{path}: is a policy of another version's observation; train it anew")
        return cls(layers, facts)


def drive_policy(scenes: Scenes, policy: Policy) -> Trajectories:
    """Let a policy drive every vehicle from its start over the horizon; nothing ends an episode.

    Returns
    -------
    Trajectories
        By the paper's transition model: Euler with the old speed. ``gap`` and ``leader`` are
        not recorded (infinite, ``NOBODY``): the policy perceives more than a leader.
    """
    return _driven(scenes, lambda _, simulation: simulation.advance(policy(simulation.observation)))


def drive_controls(scenes: Scenes, acceleration: Floats, steering: Floats) -> Trajectories:
    """Drive every vehicle by given controls, arrays of shape (vehicles, horizon) in m/s² and rad."""
    control = np.stack([acceleration, steering], axis=2)
    return _driven(scenes, lambda step, simulation: simulation.advance_by(np.ascontiguousarray(control[:, step])))


def _driven(scenes: Scenes, advance: Callable[[int, Simulation], None]) -> Trajectories:
    episodes, around = episodes_of([scenes])
    simulation = Simulation(episodes, around, np.arange(len(scenes)))
    out = Trajectories.empty(len(scenes), scenes.window.horizon)
    out.gap[:], out.leader[:] = np.inf, NOBODY
    _write(out, 0, simulation, scenes.length)
    for step in range(scenes.window.horizon):
        advance(step, simulation)
        out.acceleration[:, step], out.steering[:, step] = simulation.control.T
        _write(out, step + 1, simulation, scenes.length)
    return out


def _write(out: Trajectories, step: int, simulation: Simulation, length: Floats) -> None:
    x, y, heading, speed = simulation.state.T
    for i in range(len(x)):
        out.x[i, step], out.y[i, step] = bicycle.front_of_center(x[i], y[i], heading[i], length[i])
    out.heading[:, step], out.speed[:, step] = heading, speed
