"""Sentences on the learner; every number in them is computed."""

from __future__ import annotations

import numpy as np

from idm_sumo.evaluation import risk

from ..drivers import Drivers
from ..paper import METHODS
from .learners import CLONE
from .rows import Agents, clearances, recorded_paths, rewards_a_step
from .training import AGENT

ON_TOP, FAR_OFF, BRUSH = 1.0, 10.0, 0.5  # m


def describe(test: Drivers, agents: Agents) -> dict[str, str]:
    """Return the sentences by their name in the template.

    Parameters
    ----------
    test : Drivers
        Test drivers.
    agents : Agents
        Their runs.

    Returns
    -------
    dict of str to str
        Sentences.
    """
    return {
        "agent_missing": agents.learners.missing,
        "agent_findings": _findings(test, agents),
        "agent_scales": (
            f"The Gaussians of the collision risk have standard deviations of {risk.LENGTH_SCALE:g} vehicle length "
            f"along and {risk.WIDTH_SCALE:g} vehicle width across; the paper gives no numbers."
        ),
        "agent_effort": _effort(agents),
    }


def _findings(test: Drivers, agents: Agents) -> str:
    if AGENT not in agents.scores:
        return ""
    ade = np.concatenate([score["ade_m"].to_numpy() for score in agents.scores[AGENT]])
    close = np.concatenate([clearances(test, driven)["clearance_m"].to_numpy() for driven in agents.driven[AGENT]])
    recorded = clearances(test, recorded_paths(test))["clearance_m"].to_numpy()
    final = np.concatenate(
        [
            path.x[:, -1] - s.x[:, s.start + s.window.horizon]
            for driven in agents.driven[AGENT]
            for s, path in zip(test.scenes, driven, strict=True)
        ]
    )
    paper = METHODS[AGENT]
    return (
        f"Of the agents' runs {np.mean(ade < ON_TOP):.0%} stay within {ON_TOP:g} m of the recorded driver on "
        f"average and {np.mean(ade > FAR_OFF):.0%} are more than {FAR_OFF:g} m off (the worst {ade.max():.0f} m). "
        f"At the end they are {abs(final.mean()):.1f} m {'ahead of' if final.mean() > 0 else 'behind'} the recorded "
        f"vehicle on average, between {np.quantile(final, 0.05):.0f} and {np.quantile(final, 0.95):.0f} m in nine "
        f"of ten runs. {np.mean(close < BRUSH):.1%} come within {BRUSH:g} m of another vehicle or touch it, of the "
        f"recorded drivers {np.mean(recorded < BRUSH):.1%}. The mean ADE is {ade.mean():.2f} m, in the paper "
        f"{paper.ade_m:.2f} m. {_optimised(test, agents)}"
    )


def _optimised(test: Drivers, agents: Agents) -> str:
    """Compare the reward of agents and recorded drivers.

    This tells a reward that says too little from an agent that did not learn it.
    """
    ours, theirs = rewards_a_step(test, agents.driven[AGENT][0], agents.learners.reward)
    verdict = (
        "the agent earns more than people do, so it differs from them because of the reward, not of the training"
        if ours > theirs
        else "the training does not reach what the reward allows"
    )
    return f"By its own reward an agent's step is worth {ours:.2f}, a recorded driver's {theirs:.2f}: {verdict}."


def _effort(agents: Agents) -> str:
    if agents.learners.curve.empty:
        return ""
    steps = agents.learners.curve.groupby("seed")["steps"].max()
    return (
        f"{len(steps)} seeds ({', '.join(map(str, steps.index))}), {steps.max() / 1e6:.2g} million steps of 0.1 s "
        "each. A collision or leaving the road "
        "ends an episode with a penalty in training only; the runs scored here last to the end, by the policy's "
        "mean action."
    )


def clone_sentence(agents: Agents) -> str:
    """Return how the clone compares with the agents.

    Parameters
    ----------
    agents : Agents
        Runs of the test drivers.

    Returns
    -------
    str
        Empty without agents or clones.
    """
    if AGENT not in agents.scores or CLONE not in agents.scores:
        return ""
    agent, copy = (np.mean([s["ade_m"].mean() for s in agents.scores[name]]) for name in (AGENT, CLONE))
    return (
        "Behaviour cloning, the same network fitted frame by frame to the drivers' controls, has an ADE of "
        f"{copy:.2f} m against the agents' {agent:.2f} m: it is {'better' if copy < agent else 'worse'} here."
    )
