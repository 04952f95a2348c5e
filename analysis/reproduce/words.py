"""Sentences of the report; every number in them is computed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.scenes.windows import LEADER_OF_RECORDED
from idm_sumo.sumo.surrogate import SURROGATE

from ..page.page import not_measured
from . import paper
from .missing import KNOWN
from .settings import Settings

if TYPE_CHECKING:
    from .results import Results


def describe(results: Results) -> dict[str, str | tuple[str, ...]]:
    """Return the report's sentences by their name in the template.

    Parameters
    ----------
    results : Results
        Results of the run.

    Returns
    -------
    dict
        Sentences, or tuples of them.
    """
    settings = results.study.settings
    started = "the simulation starts at the last observed frame"
    if settings.rollout_start == "entry":
        started = "the simulation starts at entry"
    return {
        "title": settings.title or f"Replay study: {results.source.name}",
        "provenance": _provenance(results),
        "notes": results.source.notes,
        "findings": _findings(results),
        "caption": _caption(results),
        "start_text": started,
        "repeat": "The manifest beside this page holds settings, seed, versions and fingerprints of the input; "
        "the same command and seed give the same tables.",
    }


def missing_sentence(table: pd.DataFrame) -> str:
    """Say what missing vehicles do to the oracle.

    The paper's own error stands beside it.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`analysis.reproduce.missing.missing_vehicles`.
    """
    if table.empty:
        return "The recording holds only some of the vehicles, so that nobody can be taken away from it."
    oracle = table[(table["method"] == "idm_oracle") & (table["parameters"] == KNOWN)]
    ade = oracle.groupby("missing_share")[["ade_m", "ade_sd_m", "fde_to_ade"]].mean()
    shares = ", ".join(f"{one.ade_m:.2f} m with {share:.0%} missing" for share, one in ade.iterrows())
    printed, most = paper.METHODS["idm_oracle"], ade.iloc[-1]
    spread = printed.ade_se_m * np.sqrt(paper.TEST_VEHICLES)
    where = f"{ade.index[-1]:.0%} missing"
    return (
        f"The paper models {paper.MODELLED_TEST} of {paper.COUNTED_TEST} counted vehicles of its test period. If the "
        f"others ({paper.MISSING:.0%}) are missing from the replayed scene too, modelled vehicles follow the wrong "
        f"leaders. Here the oracle, fitted while nobody is missing, has an ADE of {shares}. The paper's is "
        f"{printed.ade_m:.2f} m, with a standard deviation over vehicles of {spread:.1f} m (its standard error times "
        f"the root of {paper.TEST_VEHICLES}) and FDE/ADE {printed.fde_m / printed.ade_m:.1f}; with {where} they are "
        f"{most.ade_sd_m:.1f} m and {most.fde_to_ade:.1f} here. That makes missing leaders a candidate for the "
        "paper's large oracle error, not a proof. It does not explain the paper's constant velocity, whose error "
        "hardly depends on who is ahead."
    )


def _provenance(results: Results) -> str:
    settings = results.study.settings
    if SURROGATE in settings.recordings:
        return (
            f"Made from the built-in surrogate recording ({settings.minutes:g} minutes, seed {settings.seed}): "
            "traffic simulated in SUMO and written in NGSIM's layout. It is not real traffic; the paper's numbers "
            "are shown for orientation only."
        )
    if not_measured(results.source.periods):
        return (
            f"Made from {results.source.name}, a surrogate recording: traffic simulated in SUMO and written in "
            "NGSIM's layout. It is not real traffic; the paper's numbers are shown for orientation only."
        )
    return f"Made from {results.source.name}."


def _findings(results: Results) -> str:
    """Describe the table of methods, with paired differences over vehicles."""
    ade = results.methods.set_index("method")["ade_m"]
    mean, error = paired_difference(results.scores["idm_prediction"], results.scores["idm_pooled"])
    better = "better" if mean < 0 else "worse"
    average, error_average = paired_difference(results.scores["idm_prediction"], results.scores["idm_average"])
    versus = "below" if average < 0 else "above"
    return (
        f"ADE over {results.study.settings.horizon / 10:g} s: oracle {ade['idm_oracle']:.2f} m, one pooled "
        f"parameter set {ade['idm_pooled']:.2f} m, the paper's prediction {ade['idm_prediction']:.2f} m, the "
        f"average of the oracles {ade['idm_average']:.2f} m, constant velocity {ade['constant_velocity']:.2f} m. "
        f"Driver by driver the prediction is {abs(average):.2f} ± {error_average:.2f} m {versus} the average of the "
        f"oracles and {abs(mean):.2f} ± {error:.2f} m {better} than the pooled set, which needs no observation of "
        "the driver at all."
    )


def paired_difference(one: pd.DataFrame, other: pd.DataFrame) -> tuple[float, float]:
    """Return the mean difference in ADE and its standard error.

    Parameters
    ----------
    one, other : pandas.DataFrame
        Scores of two methods on the same windows, in the same order.

    Returns
    -------
    mean, error : float
        Of one minus other, over vehicles (m).
    """
    difference = one[[c.PERIOD, c.VEHICLE]].assign(d=one["ade_m"].to_numpy() - other["ade_m"].to_numpy())
    by_vehicle = difference.groupby([c.PERIOD, c.VEHICLE], observed=True)["d"].mean().to_numpy()
    error = by_vehicle.std(ddof=1) / np.sqrt(len(by_vehicle)) if len(by_vehicle) > 1 else np.nan
    return float(by_vehicle.mean()), float(error)


def _on_agents(results: Results) -> str:
    learned = results.agents
    if learned is None:
        return "The paper's learned agent (IRL + PPO) is not part of this run."
    if learned.learners.missing:
        return f"{learned.learners.missing}."
    steps = int(learned.learners.curve["steps"].max())
    short = (
        " (a short training, which shows that the method runs, not how well an agent drives)"
        if steps < Settings.agent_steps
        else ""
    )
    return (
        f"Learned agents and clones are means over {len(learned.scores['irl_rl'])} training seeds; an agent's "
        f"training took {steps:,} steps{short}. They are driven by the compiled kernel; SUMO differs by at most "
        f"{learned.sumo_difference_m * 1000:.2g} mm on the same actions."
    )


def _caption(results: Results) -> str:
    settings = results.study.settings
    leaders = {scenes.leader_source for scenes in results.study.test.scenes}
    leader = "the modelled vehicle follows the recorded vehicle ahead in its lane at its simulated position"
    if leaders == {LEADER_OF_RECORDED}:
        leader = (
            "the recording holds only the modelled vehicles, so a modelled vehicle follows the leader of its "
            "recorded one, also through recorded lane changes, and the leader's length is assumed"
        )
    carrier = {"sumo": "SUMO carries the recorded vehicles", "kernel": "Compiled kernels carry the recorded vehicles"}
    parts = [
        f"Trained on {len(results.study.train)} drivers of {', '.join(results.source.train)}; tested on "
        f"{len(results.study.test)} of {', '.join(results.source.test)}. Mean ± standard error over vehicles. "
        f"{carrier[settings.backend]}; the modelled ones are driven beside them by our own step, Euler with the old "
        f"speed; {leader}. Collisions are those at the modelled vehicle's fault.",
    ]
    if settings.backend == "sumo":
        parts.append(
            f"With the recorded positions read back from SUMO and without SUMO the results differ by at most "
            f"{results.backend_difference_m * 1000:.2g} mm."
        )
    parts.append(_on_agents(results))
    return " ".join(parts)
