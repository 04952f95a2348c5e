"""All results of one run of the study."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from idm_sumo.simulation.rollout import Trajectories

from .agents.rows import Agents
from .source import Source
from .study import Study


@dataclass(frozen=True)
class Results:
    """All results of one run.

    Attributes
    ----------
    source : Source
        Recordings, split into training and test.
    study : Study
        Training and test drivers.
    methods : pandas.DataFrame
        The table of methods.
    scores : dict of str to pandas.DataFrame
        By method, one row a window.
    driven : dict of str to list of Trajectories
        By method, one a period.
    features, frames, neighbours : pandas.DataFrame
        Accuracy by features, observed frames and number of neighbours.
    other_methods : pandas.DataFrame
        The table of methods for the other start of the simulation.
    backend_difference_m : float
        Largest distance between SUMO's and the kernel's oracles (m).
    agents : Agents or None
        Learned agents, if the run has them.
    prediction : dict of str to pandas.DataFrame
        Tables on prediction by the name of their file.
    missing : pandas.DataFrame
        Accuracy by the share of vehicles that are missing from the scene.
    """

    source: Source
    study: Study
    methods: pd.DataFrame
    scores: dict[str, pd.DataFrame]
    driven: dict[str, list[Trajectories]]
    features: pd.DataFrame
    frames: pd.DataFrame
    neighbours: pd.DataFrame
    other_methods: pd.DataFrame
    backend_difference_m: float
    agents: Agents | None
    prediction: dict[str, pd.DataFrame]
    missing: pd.DataFrame
