"""Behaviour cloning: a network that imitates recorded controls.

It takes the agent's observation and is trained frame by frame with scikit-learn. Training never shows
it the states to which its own errors lead; the paper names this weakness, but its table leaves the
method out.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

from idm_sumo.irl.demonstrations import Demonstrations
from idm_sumo.irl.episodes import Episodes, Surroundings
from idm_sumo.irl.policy import Policy
from idm_sumo.irl.simulation import OBSERVATIONS, actions_of, observe_along

HIDDEN = (64, 64)
EPOCHS = 15
BATCH = 512
LEARNING_RATE = 1e-3


def clone(
    demonstrations: Demonstrations,
    episodes: Episodes,
    around: Surroundings,
    *,
    seed: int,
    hidden: Sequence[int] = HIDDEN,
    epochs: int = EPOCHS,
) -> Policy:
    """Fit a network to the controls of demonstrations.

    Parameters
    ----------
    demonstrations : Demonstrations
        Paths and controls of the drivers.
    episodes : Episodes
        The same windows, in the same order.
    around : Surroundings
        Traffic around them.
    seed : int
        For the network's initial weights and the order of the frames.
    hidden : sequence of int
        Sizes of the hidden layers.
    epochs : int
        Passes over the frames.

    Returns
    -------
    Policy
        Minimises squared errors, each control in units of its own standard deviation.
    """
    seen = observe_along(demonstrations.state[:, :-1], episodes, around).reshape(-1, OBSERVATIONS)
    done = actions_of(demonstrations.control).reshape(len(seen), -1)
    network = MLPRegressor(
        hidden_layer_sizes=tuple(hidden),
        activation="tanh",
        batch_size=min(BATCH, len(seen)),
        learning_rate_init=LEARNING_RATE,
        max_iter=epochs,
        random_state=seed,
    )
    spread = done.std(axis=0) + 1e-12
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # the number of epochs is fixed
        network.fit(seen, done / spread)
    layers = [
        (np.asarray(w, dtype=np.float64), np.asarray(b, dtype=np.float64))
        for w, b in zip(network.coefs_, network.intercepts_, strict=True)
    ]
    layers[-1] = (layers[-1][0] * spread, layers[-1][1] * spread)
    facts = {
        "kind": "cloning",
        "seed": seed,
        "epochs": network.n_iter_,
        "frames": len(seen),
        "loss": float(network.loss_),
    }
    return Policy(tuple(layers), facts)
