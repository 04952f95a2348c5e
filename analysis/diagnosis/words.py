"""A diagnosis in sentences, every number computed."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from idm_sumo.diagnosis import CauseFound, Diagnosis, Gain, Power, Region
from idm_sumo.models import laws
from idm_sumo.models.effects import BY_NAME, Parameter, format_quantity

MEASURES = {
    "ade_m": "mean displacement error (m)", "fde_m": "displacement error at the end (m)", "gap_m": "gap error (m)",
    "gap_rmse_m": "gap error, RMSE (m)", "speed_m_s": "speed error (m/s)", "speed_rmse_m_s": "speed error, RMSE (m/s)",
    "log_gap": "gap error (of its logarithm)", "speed_mps": "speed error (m/s)",
    "collisions": "collisions (share of windows)",
}  # fmt: skip


def plain(name: str) -> str:
    """Return a catalogue name as words."""
    return name.replace("_", " ")


def sentence(text: str) -> str:
    """Return a text as a sentence."""
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")


def p_value(p: float) -> str:
    """Return a p-value as one reads it."""
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


def headline(found: Diagnosis) -> str:
    """Say the verdict in one sentence."""
    if found.verdict == "named":
        names = " and ".join(_sized(cause) for cause in found.causes)
        return f"Named: {names}."
    if found.verdict == "unknown":
        places = "; ".join(
            f"{plain(one.covariate)} from {one.range[0]:.4g} to {one.range[1]:.4g}{_where(one.position_m, one.time_s)} "
            f"({p_value(one.p_value)})"
            for one in found.unexplained
        )
        return f"Unknown: something is wrong that no effect of the catalogue explains, at {places}."
    if found.gain is None and found.notes:
        return f"None: {sentence(found.notes[0])}"
    if found.without_gain:
        return "None: no effect of the catalogue makes the simulation better."
    if found.other_law is not None:
        return "None: no effect of the catalogue is shown by these data."
    return f"None: nothing beyond {law_of(found)} is shown by these data."


def _sized(cause: CauseFound) -> str:
    return f"{_what(cause)} ({_sizes(cause)}; {p_value(cause.p_value)}; {cause.share_of_gain:.0%} of the gain)"


def _what(cause: CauseFound) -> str:
    region = cause.where
    place = "" if region is None else _where(region.position_m, region.time_s) + _lanes(region)
    drifts = cause.name == "time_of_day" and "delta" in cause.parameters
    return f"{plain(cause.name)}{', drifting' if drifts else ''}{place}"


def _sizes(cause: CauseFound) -> str:
    return ", ".join(
        f"{symbol} = {format_quantity(one.value, one.unit)} (95 %: {one.ci95[0]:.3g} to {one.ci95[1]:.3g})"
        for symbol, one in cause.parameters.items()
    )


def without_gain_sentence(found: Diagnosis) -> str:
    """Say what is there and makes no rollout better; else nothing."""
    there = " and ".join(f"{_what(one)} ({_sizes(one)}; {p_value(one.p_value)})" for one in found.without_gain)
    return f"Present, but rollouts are not better for it: {there}." if there else ""


def _where(position: tuple[float, float] | None, time: tuple[float, float] | None) -> str:
    place = "" if position is None else f" between {position[0]:.0f} and {position[1]:.0f} m"
    return place + ("" if time is None else f" between {time[0]:.0f} and {time[1]:.0f} s")


def _lanes(region: Region) -> str:
    return "" if region.lanes is None else f" in lane {', '.join(map(str, region.lanes))}"


def gain_sentence(gain: Gain | None) -> str:
    """Say what the extension buys on drivers that were never touched."""
    if gain is None:
        return "Too few drivers to hold some out: no gain was measured."
    if gain.difference == 0.0:
        return f"The mean displacement error is {gain.base:.2f} m on {gain.vehicles} held-out drivers; the model is not extended."
    share = gain.difference / gain.base if gain.base else 0.0
    moves = "falls" if gain.difference > 0.0 else "rises"
    sure = "" if gain.ci95[0] > 0.0 else " Significance and gain are different things: nothing is clearly gained."
    return (
        f"On {gain.vehicles} held-out drivers the mean displacement error {moves} from {gain.base:.3f} to {gain.extended:.3f} m, a gain "
        f"of {gain.difference:.3f} m or {share:.1%} (95 %: {gain.ci95[0]:.3f} to {gain.ci95[1]:.3f} m).{sure}"
    )


def law_of(found: Diagnosis) -> str:
    """Return the car-following law that causes are beyond, in words."""
    return laws.TITLES[laws.IDM if found.law is None else laws.NAMES.index(found.law.name)]


def law_sentence(found: Diagnosis) -> str:
    """Say which law drivers follow if it is not the IDM, and whether what they follow is yet another one; else nothing."""
    return " ".join(filter(None, (_followed(found), _with_causes(found), _another(found))))


def _followed(found: Diagnosis) -> str:
    if found.law is None:
        return ""
    gain, likelier = found.law.gain, found.law.likelier
    low, high = likelier.ci95
    return (
        f"These drivers follow {law_of(found)} more likely than the IDM: whatever a driver's parameters, the log-likelihood is higher by "
        f"{likelier.difference:.2f} a driver (95 %: {low:.2f} to {high:.2f}). On {gain.vehicles} held-out drivers, each fitted, the mean "
        f"displacement error is {gain.extended:.3f} m by it and {gain.base:.3f} m by the IDM.{_reached(found)} What follows is beyond "
        "that law; the model file holds it."
    )


def _reached(found: Diagnosis) -> str:
    """Say how soon drivers of Krauss's law reach their safe speed."""
    model = found.base_model
    return f" They reach it within {model.reaction:.2g} s." if model.law == laws.NAMES[laws.KRAUSS] else ""


def _with_causes(found: Diagnosis) -> str:
    """Say where the law that is likeliest without causes is not the one that is with them."""
    if found.law is None:
        return ""
    likeliest = max(found.by_law, key=lambda name: found.by_law[name].log_likelihood, default=found.law.name)
    if likeliest == found.law.name:
        return ""
    return (
        f"That holds with the causes in the model; without them {laws.TITLES[laws.NAMES.index(likeliest)]} would be likelier, which "
        "takes up a part of what is named."
    )


def _another(found: Diagnosis) -> str:
    if found.other_law is None:
        return ""
    law, whose = found.other_law, law_of(found)
    return (
        f"{sentence(whose).rstrip('.')} is not quite the law of these drivers, whatever its parameters: what is left looks like "
        f"{plain(law.name)} with {law.symbol} = {format_quantity(law.value, law.unit, 2)} ({law.standard_errors:.1f} standard errors), a sign "
        "that it cannot have. Sizes are what that law would need, their intervals are wider for it, and small effects may stay unseen."
    )


def laws_table(found: Diagnosis) -> pd.DataFrame:
    """Return how likely drivers follow each car-following law, and what it leaves of them; the likeliest first."""
    ordered = sorted(found.by_law.items(), key=lambda one: -one[1].log_likelihood)
    return pd.DataFrame(
        [
            (laws.TITLES[laws.NAMES.index(name)], f"{one.log_likelihood:.3g}", f"{one.typical_ade:.3g}")
            for name, one in ordered
        ],
        columns=["law", "log-likelihood a driver, less the IDM's", "typical ADE (m)"],
    )


def gains_table(gains: Sequence[Gain | None]) -> pd.DataFrame:
    """Return all measures of the gain."""
    return pd.DataFrame(
        [
            {
                "measure": MEASURES.get(one.metric, one.metric), "base": f"{one.base:.4g}", "extended": f"{one.extended:.4g}",
                "difference": f"{one.difference:.3g}", "95 %": f"{one.ci95[0]:.3g} to {one.ci95[1]:.3g}", "vehicles": one.vehicles,
            }
            for one in gains if one is not None
        ]
    )  # fmt: skip


def causes_table(causes: Sequence[CauseFound]) -> pd.DataFrame:
    """Return causes, one row a parameter."""
    return pd.DataFrame(
        [
            {
                "cause": plain(cause.name), "symbol": symbol, "value": format_quantity(one.value, one.unit),
                "95 %": f"{one.ci95[0]:.3g} to {one.ci95[1]:.3g}", "p": f"{cause.p_value:.2g}",
                "share of the gain": f"{cause.share_of_gain:.0%}",
                "where and when": "everywhere" if cause.where is None
                else (_where(cause.where.position_m, cause.where.time_s) + _lanes(cause.where)).strip() or "everywhere",
                "cannot be told from": ", ".join(map(plain, cause.inseparable_from)) or "–",
            }
            for cause in causes for symbol, one in (cause.parameters.items() or {})
        ]
    )  # fmt: skip


def ruled_out_table(found: Diagnosis) -> pd.DataFrame:
    """Return what was tested and not kept, with what it could be confused with."""
    return pd.DataFrame(
        [
            {
                "effect": plain(one.name), "p": f"{one.p_value:.2g}",
                "estimated size": "–" if one.estimate is None else format_quantity(one.estimate.value, one.estimate.unit, 2),
                "95 %": "–" if one.estimate is None else f"{one.estimate.ci95[0]:.2g} to {one.estimate.ci95[1]:.2g}",
                "why not": plain(one.why), "confusable with": ", ".join(map(plain, one.confusable_with)) or "–",
            }
            for one in found.ruled_out
        ]
    )  # fmt: skip


def power_sentences(found: Diagnosis) -> list[str]:
    """Say for each effect which size would have been seen how probably."""
    return [_seen(one) for one in found.power]


def magnitude(power: Power) -> Parameter:
    """Return the parameter whose size a statement of power is about."""
    return next(p for p in BY_NAME[power.name].all_parameters if p.symbol == power.symbol)


def _seen(one: Power) -> str:
    largest = magnitude(one).upper
    if one.size > largest:
        return f"no {plain(one.name)} would surely have been seen, up to {one.symbol} = {format_quantity(largest, one.unit)}"
    size = f"{one.symbol} = {format_quantity(one.size, one.unit)}"
    return f"{plain(one.name)} of {size} would have been seen with probability {one.probability:.2f}"
