"""A diagnosis in sentences; every number in them is computed."""

from __future__ import annotations

from idm_sumo.diagnosis import CauseFound, Diagnosis, Gain, Region
from idm_sumo.models import laws
from idm_sumo.models.effects import format_quantity

SURE_MISFIT = 3.0  # standard errors, from which on the law's misfit is told


def plain(name: str) -> str:
    """Return a catalogue name as words.

    Parameters
    ----------
    name : str
        Name with underscores.

    Returns
    -------
    str
        Name with spaces.
    """
    return name.replace("_", " ")


def sentence(text: str) -> str:
    """Return a text as a sentence.

    Parameters
    ----------
    text : str
        Text without a capital letter or a full stop.

    Returns
    -------
    str
        Sentence.
    """
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")


def p_value(p: float) -> str:
    """Return a p-value as text.

    Parameters
    ----------
    p : float
        The p-value.

    Returns
    -------
    str
        ``p = 0.012``, or ``p < 0.0001``.
    """
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


def headline(found: Diagnosis) -> str:
    """Return the verdict in one sentence.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        Sentence.
    """
    if found.verdict == "named":
        names = " and ".join(_sized(cause) for cause in found.causes)
        return f"Named: {names}."
    if found.verdict == "unknown":
        places = "; ".join(
            f"{plain(one.covariate)} from {one.range[0]:.4g} to {one.range[1]:.4g}{where(one.position_m, one.time_s)} "
            f"({p_value(one.p_value)})"
            for one in found.unexplained
        )
        return f"Unknown: residuals that no effect of the catalogue explains, at {places}."
    if found.gain is None and found.notes:
        return f"None: {sentence(found.notes[0])}"
    if found.without_gain:
        return "None: no effect of the catalogue improves the simulation."
    return f"None: these data show nothing beyond {law_of(found)}."


def _sized(cause: CauseFound) -> str:
    drivers = f"; rests on about {cause.effective_drivers:.0f} drivers" if cause.effective_drivers else ""
    bound = "; its size is at the bound of what is searched" if cause.at_bound else ""
    shown = f"{_sizes(cause)}; {p_value(cause.p_value)}; probability {cause.probability:.2f}"
    return f"{_what(cause)} ({shown}{drivers}{bound})"


def _what(cause: CauseFound) -> str:
    region = cause.where
    place = "" if region is None else where(region.position_m, region.time_s) + lanes(region)
    drifts = cause.name == "time_of_day" and "delta" in cause.parameters
    return f"{plain(cause.name)}{', drifting' if drifts else ''}{place}"


def _sizes(cause: CauseFound) -> str:
    return ", ".join(
        f"{symbol} = {format_quantity(one.value, one.unit)} (95 %: {one.ci95[0]:.3g} to {one.ci95[1]:.3g})"
        for symbol, one in cause.parameters.items()
    )


def without_gain_sentence(found: Diagnosis) -> str:
    """Name the causes that do not improve rollouts.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        Sentence, empty without such causes.
    """
    there = " and ".join(f"{_what(one)} ({_sizes(one)}; {p_value(one.p_value)})" for one in found.without_gain)
    return f"Present, but without a gain of the rollouts: {there}." if there else ""


def where(position: tuple[float, float] | None, time: tuple[float, float] | None) -> str:
    """Return where and when something holds, as words.

    Parameters
    ----------
    position, time : (float, float) or None
        Intervals (m, s); None for everywhere or always.

    Returns
    -------
    str
        Empty without intervals, else with a blank before.
    """
    place = "" if position is None else f" between {position[0]:.0f} and {position[1]:.0f} m"
    return place + ("" if time is None else f" between {time[0]:.0f} and {time[1]:.0f} s")


def lanes(region: Region) -> str:
    """Return the lanes of a region, as words.

    Parameters
    ----------
    region : Region
        A part of the road and of the recording.

    Returns
    -------
    str
        Empty for all lanes, else with a blank before.
    """
    return "" if region.lanes is None else f" in lane {', '.join(map(str, region.lanes))}"


def gain_sentence(gain: Gain | None) -> str:
    """Describe the gain of the extended model on held-out drivers.

    Parameters
    ----------
    gain : Gain or None
        The gain, None if no drivers were held out.

    Returns
    -------
    str
        Sentences.
    """
    if gain is None:
        return "Too few drivers to hold some out: no gain was measured."
    if gain.difference == 0.0:
        error = f"The mean displacement error is {gain.base:.2f} m on {gain.vehicles} held-out drivers"
        return f"{error}; the model is not extended."
    share = gain.difference / gain.base if gain.base else 0.0
    moves = "falls" if gain.difference > 0.0 else "rises"
    sure = "" if gain.ci95[0] > 0.0 else " An effect can be significant without a gain: here nothing is clearly gained."
    return (
        f"On {gain.vehicles} held-out drivers the mean displacement error {moves} from {gain.base:.3f} to "
        f"{gain.extended:.3f} m, a gain of {gain.difference:.3f} m or {share:.1%} (95 %: {gain.ci95[0]:.3f} to "
        f"{gain.ci95[1]:.3f} m).{sure}"
    )


def law_of(found: Diagnosis) -> str:
    """Return the car-following law to which causes are added.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        Name for sentences.
    """
    return laws.TITLES[laws.IDM if found.law is None else laws.NAMES.index(found.law.name)]


def law_sentence(found: Diagnosis) -> str:
    """Name the drivers' law if it is not the IDM.

    It also says whether their law deviates from all known ones.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        Sentences, empty for the IDM.
    """
    return " ".join(filter(None, (_followed(found), _with_causes(found), _another(found))))


def _followed(found: Diagnosis) -> str:
    if found.law is None:
        return ""
    gain, likelier = found.law.gain, found.law.likelier
    low, high = likelier.ci95
    return (
        f"These drivers follow {law_of(found)} more likely than the IDM: whatever a driver's parameters, the "
        f"log-likelihood is higher by {likelier.difference:.2f} a driver (95 %: {low:.2f} to {high:.2f}). On "
        f"{gain.vehicles} held-out drivers, each fitted, the mean displacement error is {gain.extended:.3f} m by it "
        f"and {gain.base:.3f} m by the IDM.{_reached(found)} The causes below are in addition to that law, "
        "which the model file holds."
    )


def _reached(found: Diagnosis) -> str:
    """Return Krauss's reaction time as a sentence, if it applies."""
    model = found.base_model
    return f" They reach it within {model.reaction:.2g} s." if model.law == laws.NAMES[laws.KRAUSS] else ""


def _with_causes(found: Diagnosis) -> str:
    """Return which law is likelier without causes, as a sentence."""
    if found.law is None:
        return ""
    likeliest = max(found.by_law, key=lambda name: found.by_law[name].log_likelihood, default=found.law.name)
    if likeliest == found.law.name:
        return ""
    return (
        f"That holds with the causes in the model; without them {laws.TITLES[laws.NAMES.index(likeliest)]} would be "
        "likelier, because it absorbs a part of the named causes."
    )


def _another(found: Diagnosis) -> str:
    misfit = found.misfit
    if misfit.standard_errors < SURE_MISFIT:
        return ""
    return (
        f"{sentence(law_of(found)).rstrip('.')} is not quite the law of these drivers, whatever its parameters: it "
        f"lacks a smooth acceleration of gap, speed and approach rate of about {misfit.deviation:.2g} m/s² "
        f"({misfit.standard_errors:.0f} standard errors), with which every effect has to compete."
    )


def detectable_sentences(found: Diagnosis) -> list[str]:
    """Return how often each effect was found in followers.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    list of str
        One line an effect and size.
    """
    return [
        f"{plain(one.name)} of {one.symbol} = {format_quantity(one.size, one.unit)}, put into these very followers, "
        f"was found in {round(one.found * one.of)} of {one.of}"
        for one in found.detectable
    ]
