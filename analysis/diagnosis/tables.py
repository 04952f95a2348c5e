"""Tables of a diagnosis, for its report and as CSV."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from idm_sumo.diagnosis import CauseFound, Diagnosis, Gain
from idm_sumo.models import laws
from idm_sumo.models.effects import format_quantity

from .outcome import Outcome
from .words import lanes, plain, where

MEASURES = {
    "ade_m": "mean displacement error (m)",
    "fde_m": "displacement error at the end (m)",
    "gap_m": "gap error (m)",
    "gap_rmse_m": "gap error, RMSE (m)",
    "speed_m_s": "speed error (m/s)",
    "speed_rmse_m_s": "speed error, RMSE (m/s)",
    "log_gap": "gap error (of its logarithm)",
    "speed_mps": "speed error (m/s)",
    "collisions": "collisions (share of windows)",
}


def laws_table(found: Diagnosis) -> pd.DataFrame:
    """Return the likelihood of each law, the likeliest first.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    pandas.DataFrame
        One row a law.
    """
    ordered = sorted(found.by_law.items(), key=lambda one: -one[1].log_likelihood)
    return pd.DataFrame(
        [
            (laws.TITLES[laws.NAMES.index(name)], f"{one.log_likelihood:.3g}", f"{one.typical_ade:.3g}")
            for name, one in ordered
        ],
        columns=["law", "log-likelihood a driver, less the IDM's", "typical ADE (m)"],
    )


def gains_table(gains: Sequence[Gain | None]) -> pd.DataFrame:
    """Return all measures of the gain.

    Parameters
    ----------
    gains : sequence of Gain or None
        Gains by measure; None is left out.

    Returns
    -------
    pandas.DataFrame
        One row a measure.
    """
    return pd.DataFrame(
        [
            {
                "measure": MEASURES.get(one.metric, one.metric),
                "base": f"{one.base:.4g}",
                "extended": f"{one.extended:.4g}",
                "difference": f"{one.difference:.3g}",
                "95 %": f"{one.ci95[0]:.3g} to {one.ci95[1]:.3g}",
                "vehicles": one.vehicles,
            }
            for one in gains
            if one is not None
        ]
    )


def causes_table(causes: Sequence[CauseFound]) -> pd.DataFrame:
    """Return causes, one row a parameter.

    Parameters
    ----------
    causes : sequence of CauseFound
        Named causes, or those without gain.

    Returns
    -------
    pandas.DataFrame
        Sizes, intervals, p-values and places.
    """
    return pd.DataFrame(
        [
            {
                "cause": plain(cause.name),
                "symbol": symbol,
                "value": format_quantity(one.value, one.unit) + (" (bound)" if cause.at_bound and n == 0 else ""),
                "95 %": f"{one.ci95[0]:.3g} to {one.ci95[1]:.3g}",
                "p": f"{cause.p_value:.2g}",
                "spared of a driver's ADE": "–" if cause.gain is None else f"{cause.gain.difference:.1%}",
                "probability": f"{cause.probability:.2f}",
                "drivers it rests on": f"{cause.effective_drivers:.0f}" if cause.effective_drivers else "–",
                "where and when": "everywhere"
                if cause.where is None
                else (where(cause.where.position_m, cause.where.time_s) + lanes(cause.where.lanes)).strip()
                or "everywhere",
                "cannot be told from": ", ".join(map(plain, cause.one_of)) or "–",
            }
            for cause in causes
            for n, (symbol, one) in enumerate(cause.parameters.items())
        ]
    )


def ruled_out_table(found: Diagnosis) -> pd.DataFrame:
    """Return the hypotheses that were tested and not kept.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    pandas.DataFrame
        One row a hypothesis, with the reason.
    """
    return pd.DataFrame(
        [
            {
                "effect": plain(one.name),
                "p": f"{one.p_value:.2g}",
                "estimated size": "–"
                if one.estimate is None
                else format_quantity(one.estimate.value, one.estimate.unit, 2),
                "95 %": "–" if one.estimate is None else f"{one.estimate.ci95[0]:.2g} to {one.estimate.ci95[1]:.2g}",
                "why not": plain(one.why),
                "confusable with": ", ".join(map(plain, one.confusable_with)) or "–",
            }
            for one in found.ruled_out
        ]
    )


def unexplained_table(outcome: Outcome) -> pd.DataFrame:
    """Return what no effect explains.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.

    Returns
    -------
    pandas.DataFrame
        One row a pattern.
    """
    return pd.DataFrame(
        [
            {
                "covariate": plain(one.covariate),
                "from": f"{one.range[0]:.4g}",
                "to": f"{one.range[1]:.4g}",
                "p": f"{one.p_value:.2g}",
                "where and when": where(
                    outcome.bounded("position", one.position_m), outcome.bounded("time", one.time_s)
                ).strip()
                or "everywhere",
            }
            for one in outcome.content.unexplained
        ]
    )


def untestable_table(found: Diagnosis) -> pd.DataFrame:
    """Return the effects that could not be tested.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    pandas.DataFrame
        One row an effect, with the reason.
    """
    return pd.DataFrame(
        {"effect": [plain(name) for name in found.untestable], "reason": list(found.untestable.values())}
    )
