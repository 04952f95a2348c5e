"""Test drivers driven by learned agents, and their rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.evaluation.metrics import summary
from idm_sumo.irl import approaches
from idm_sumo.irl.demonstrations import Demonstrations, rollout
from idm_sumo.irl.learning import (
    lessons_of,
    reward_of_json,
)
from idm_sumo.irl.policy import drive_policy
from idm_sumo.irl.trajectory import step_features
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.simulation.rollout import Trajectories

from ..drivers import Drivers
from .learners import LEFT_OUT, Learners
from .training import AGENT

COUNTED = ("collisions", "contacts", "critical_ttc_vehicles")  # counts of a seed, averaged over seeds
SPREAD = ("ade_m", "fde_m", "collisions")
BY_SEED = ("ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "contacts", "vehicles")
CHECKED = 6  # test drivers whose actions are driven in SUMO, too


@dataclass(frozen=True)
class Agents:
    """Test drivers driven by the learned policies.

    Attributes
    ----------
    learners : Learners
        Reward and policies.
    driven : dict of str to tuple of list of Trajectories
        By method, one entry a seed, each one a period.
    scores : dict of str to tuple of pandas.DataFrame
        By method, one entry a seed.
    sumo_difference_m : float
        Largest distance between SUMO and the kernel on the same actions (m).
    """

    learners: Learners
    driven: dict[str, tuple[list[Trajectories], ...]]
    scores: dict[str, tuple[pd.DataFrame, ...]]
    sumo_difference_m: float


def drive_agents(test: Drivers, learners: Learners, *, in_sumo: bool, progress: Progress = silent) -> Agents:
    """Drive the test drivers by every policy.

    Parameters
    ----------
    test : Drivers
        Test drivers.
    learners : Learners
        Reward and policies.
    in_sumo : bool
        Whether to compare with SUMO on the same actions.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    Agents
        Trajectories and scores.
    """
    progress("driving by agents", 0, 1)
    driven = {
        name: tuple([drive_policy(scenes, policy) for scenes in test.scenes] for policy in policies)
        for name, policies in learners.policies.items()
    }
    scores = {name: tuple(test.score(trajectories) for trajectories in seeds) for name, seeds in driven.items()}
    difference = _sumo_difference(test, next(iter(driven.values()))[0]) if in_sumo else 0.0
    progress("driving by agents", 1, 1)
    return Agents(learners, driven, scores, difference)


def _sumo_difference(test: Drivers, driven: list[Trajectories]) -> float:
    """Return the largest distance (m) between SUMO and the kernels.

    A few test drivers are driven by the same actions.
    """
    from idm_sumo.sumo.replay.actions import replay_controls

    which = np.unique(np.linspace(0, len(test.scenes[0]) - 1, CHECKED).astype(np.int64))
    ours = driven[0].rows(which)
    theirs = replay_controls(test.scenes[0].subset(which), ours.acceleration, ours.steering)
    return float(np.hypot(theirs.x - ours.x, theirs.y - ours.y).max())


def missing_row(table: pd.DataFrame) -> str:
    """Return how to install what a table's missing row needs.

    Parameters
    ----------
    table : pandas.DataFrame
        A table of methods.

    Returns
    -------
    str
        Empty if the row of agents is there.
    """
    return "" if AGENT in set(table["method"]) else LEFT_OUT


def rows(agents: Agents) -> pd.DataFrame:
    """Return the rows of the learned methods.

    Means are over seeds and vehicles, standard errors over vehicles, with each vehicle's runs of
    different seeds averaged first. ``collisions`` and other counts are means over seeds.

    Parameters
    ----------
    agents : Agents
        Runs of the test drivers.

    Returns
    -------
    pandas.DataFrame
        One row a method; ``seeds`` is their number, and ``ade_seed_sd_m`` and others are standard deviations
        over seeds.
    """
    table = []
    for name, scores in agents.scores.items():
        by_seed = pd.DataFrame([summary(score) for score in scores])
        figures: dict[str, Any] = dict(summary(pd.concat(scores, ignore_index=True)))
        figures |= {count: float(by_seed[count].mean()) for count in COUNTED}
        spread = by_seed[list(SPREAD)].std(ddof=1)
        figures |= {
            "seeds": len(scores),
            "ade_seed_sd_m": spread["ade_m"],
            "fde_seed_sd_m": spread["fde_m"],
            "collisions_seed_sd": spread["collisions"],
        }
        table.append({"method": name, **figures})
    return pd.DataFrame(table)


def by_seed(test: Drivers, agents: Agents) -> pd.DataFrame:
    """Return the results of each method and seed.

    Parameters
    ----------
    test : Drivers
        Test drivers.
    agents : Agents
        Their runs.

    Returns
    -------
    pandas.DataFrame
        One row a method and seed, with quantiles over runs.
    """
    table = []
    for name, seeds in agents.scores.items():
        for policy, score, driven in zip(agents.learners.policies[name], seeds, agents.driven[name], strict=True):
            figures, clearance = summary(score), clearances(test, driven)["clearance_m"]
            table.append(
                {
                    "method": name,
                    "seed": policy.facts["seed"],
                    **{key: figures[key] for key in BY_SEED},
                    "ade_10th_m": score["ade_m"].quantile(0.1),
                    "ade_90th_m": score["ade_m"].quantile(0.9),
                    "ade_largest_m": score["ade_m"].max(),
                    "brushes": int(((clearance > 0) & (clearance < 0.5)).sum()),
                }
            )
    return pd.DataFrame(table)


def clearances(test: Drivers, driven: list[Trajectories]) -> pd.DataFrame:
    """Return the closest approach of every test driver.

    Parameters
    ----------
    test : Drivers
        Test drivers.
    driven : list of Trajectories
        One a period.

    Returns
    -------
    pandas.DataFrame
        See :func:`idm_sumo.irl.approaches.closest_approaches`.
    """
    parts = [approaches.closest_approaches(s, t) for s, t in zip(test.scenes, driven, strict=True)]
    return pd.concat(parts, ignore_index=True)


def recorded_paths(test: Drivers) -> list[Trajectories]:
    """Return the recorded vehicles' paths as trajectories.

    Parameters
    ----------
    test : Drivers
        Test drivers.

    Returns
    -------
    list of Trajectories
        One a period, for comparison with driven ones.
    """
    paths = []
    for scenes in test.scenes:
        span = slice(scenes.start, scenes.start + scenes.window.horizon + 1)
        path = Trajectories.of(scenes)
        for name in ("x", "y", "heading", "speed"):
            getattr(path, name)[:] = getattr(scenes, name)[:, span]
        paths.append(path)
    return paths


def rewards_a_step(test: Drivers, driven: list[Trajectories], reward: dict[str, Any]) -> tuple[float, float]:
    """Return the mean reward of a step, driven and recorded.

    Parameters
    ----------
    test : Drivers
        Test drivers.
    driven : list of Trajectories
        One a period.
    reward : dict
        As stored.

    Returns
    -------
    driven, recorded : float
        Learned reward without penalties.
    """
    recorded = lessons_of(test.scenes)
    control = np.concatenate([np.stack([path.acceleration, path.steering], axis=2) for path in driven])
    modelled = Demonstrations(rollout(recorded.episodes, control), control, np.zeros(len(control)))
    weigh = reward_of_json(reward).of
    steps = (step_features(paths, recorded.episodes, recorded.around) for paths in (modelled, recorded.demonstrations))
    ours, theirs = (float(weigh(features).mean()) for features in steps)
    return ours, theirs


def weights_table(reward: dict[str, Any]) -> pd.DataFrame:
    """Return the learned weights, with and without the bound.

    Parameters
    ----------
    reward : dict
        As stored.

    Returns
    -------
    pandas.DataFrame
        One row a feature.
    """
    wanted, free = reward["wanted"], reward["free"]
    return pd.DataFrame(
        [
            {
                "feature": name,
                "weight": wanted["weights"][name],
                "standard error": wanted["standard_errors"][name],
                "weight without bound": free["weights"][name],
                "its standard error": free["standard_errors"][name],
            }
            for name in reward["features"]
        ]
    )
