"""A trained policy as plain arrays, independent of torch."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from idm_sumo.irl.episodes import episodes_of
from idm_sumo.irl.simulation import OBSERVATIONS, Simulation
from idm_sumo.models import bicycle
from idm_sumo.runtime.arrays import read_arrays
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.inputs import parse_json
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

Floats = npt.NDArray[np.float64]
ACTIONS = 2  # acceleration and steering


@dataclass(frozen=True)
class Policy:
    """A network from observations to actions.

    Its layers have hyperbolic tangents, the last one is linear.

    Attributes
    ----------
    layers : tuple of (weights, bias)
        Shapes ``(inputs, outputs)`` and ``(outputs,)``.
    facts : dict
        How it was made: kind, seed, steps and others; plain values.
    """

    layers: tuple[tuple[Floats, Floats], ...]
    facts: dict[str, Any]

    def __call__(self, observation: npt.NDArray[np.floating]) -> Floats:
        """Return the mean actions for observations.

        Parameters
        ----------
        observation : float array, shape (vehicles, 16)
            See :mod:`idm_sumo.irl.simulation`.

        Returns
        -------
        float64, shape (vehicles, 2)
            Actions from -1 to 1; nothing is drawn at random.
        """
        value = np.asarray(observation, dtype=np.float64)
        for weights, bias in self.layers[:-1]:
            value = np.tanh(value @ weights + bias)
        weights, bias = self.layers[-1]
        return np.clip(value @ weights + bias, -1.0, 1.0)

    def save(self, path: Path) -> None:
        """Write the policy as ``.npz``, whole or not at all.

        Parameters
        ----------
        path : Path
            File to write.
        """
        with new_file(path) as part:
            self.write(part)

    def write(self, path: Path) -> None:
        """Write the policy as ``.npz`` into a temporary file.

        Parameters
        ----------
        path : Path
            One of :func:`idm_sumo.runtime.files.new_files`.
        """
        arrays: dict[str, Any] = {
            f"{kind}{i}": part for i, layer in enumerate(self.layers) for kind, part in zip("wb", layer, strict=True)
        }
        with path.open("wb") as stream:
            np.savez(stream, facts=np.array(json.dumps(self.facts)), **arrays)

    @classmethod
    def load(cls, path: Path) -> Policy:
        """Read a policy that :meth:`save` wrote.

        Parameters
        ----------
        path : Path
            File to read.

        Returns
        -------
        Policy
            The policy.

        Raises
        ------
        InputError
            If the file is missing, or is no policy for this observation.
        """
        stored = read_arrays(path, "make one with `idm-sumo irl train`")
        try:
            layers = tuple((stored[f"w{i}"], stored[f"b{i}"]) for i in range((len(stored) - 1) // 2))
            facts = parse_json(str(stored["facts"]), path)
        except KeyError as error:
            raise InputError(f"{path}: not a policy ({error}); make one with `idm-sumo irl train`") from None
        if not layers or layers[0][0].shape[:1] != (OBSERVATIONS,):
            raise InputError(f"{path}: a policy for another observation; train it again with `idm-sumo irl train`")
        if fault := _fault(layers, facts):
            raise InputError(f"{path}: {fault}; train it again with `idm-sumo irl train`")
        return cls(tuple((w.astype(np.float64), b.astype(np.float64)) for w, b in layers), facts)


def _fault(layers: tuple[tuple[npt.NDArray[Any], npt.NDArray[Any]], ...], facts: Any) -> str:
    """Return what is wrong with a network and its facts.

    The text is empty if nothing is.
    """
    inputs = OBSERVATIONS
    for number, (weights, bias) in enumerate(layers):
        if weights.dtype.kind not in "fiu" or bias.dtype.kind not in "fiu":
            return f"layer {number} does not hold numbers"
        if weights.ndim != 2 or weights.shape[0] != inputs or bias.shape != weights.shape[1:]:
            return f"layer {number} has weights {weights.shape} and bias {bias.shape} for {inputs} inputs"
        if not (np.isfinite(weights).all() and np.isfinite(bias).all()):
            return f"layer {number} holds numbers that are not finite"
        inputs = weights.shape[1]
    if inputs != ACTIONS:
        return f"the last layer gives {inputs} numbers, not the {ACTIONS} actions"
    named = isinstance(facts, dict) and {"kind", "seed"} <= set(facts)
    return "" if named and isinstance(facts["seed"], int) else "its facts do not say kind and seed"


def drive_policy(scenes: Scenes, policy: Policy) -> Trajectories:
    """Drive every vehicle by a policy over the horizon.

    Nothing ends an episode early.

    Parameters
    ----------
    scenes : Scenes
        Windows of the drivers.
    policy : Policy
        The agent.

    Returns
    -------
    Trajectories
        By the paper's transition model, Euler with the old speed. ``gap`` is infinite and ``leader`` is
        ``NOBODY`` throughout, since the policy does not follow a single leader.
    """
    episodes, around = episodes_of([scenes])
    simulation = Simulation(episodes, around, np.arange(len(scenes)))
    out = Trajectories.of(scenes)
    out.gap[:], out.leader[:] = np.inf, NOBODY
    _write(out, 0, simulation, scenes.length)
    for step in range(scenes.window.horizon):
        simulation.advance(policy(simulation.observation))
        out.acceleration[:, step], out.steering[:, step] = simulation.control.T
        _write(out, step + 1, simulation, scenes.length)
    return out


def _write(out: Trajectories, step: int, simulation: Simulation, length: Floats) -> None:
    x, y, heading, speed = simulation.state.T
    for i in range(len(x)):
        out.x[i, step], out.y[i, step] = bicycle.front_of_center(x[i], y[i], heading[i], length[i])
    out.heading[:, step], out.speed[:, step] = heading, speed
