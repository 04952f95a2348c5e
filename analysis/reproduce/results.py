"""Everything that one run of the study computes."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from idm_sumo.simulation.rollout import Trajectories

from .agents.rows import Agents
from .source import Source
from .study import Study


@dataclass(frozen=True)
class Results:
    """Everything that the report shows."""

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
