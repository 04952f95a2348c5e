"""A diagnosis in sentences; every number in them is computed."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from idm_sumo.diagnosis import Detectable, Diagnosis
from idm_sumo.models import laws
from idm_sumo.models.effects import format_quantity


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
    if time is None:
        return place
    return f"{place}{' and' if place else ''} from {clock(time[0])} to {clock(time[1])} (min:s)"


def clock(seconds: float) -> str:
    """Return a time as minutes and seconds.

    Parameters
    ----------
    seconds : float
        Since the period began.

    Returns
    -------
    str
        Such as ``7:05``.
    """
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


def lanes(numbers: Sequence[int] | None) -> str:
    """Return lanes as words.

    Parameters
    ----------
    numbers : sequence of int or None
        As in the recording; None for all.

    Returns
    -------
    str
        Empty for all lanes, else with a blank before.
    """
    return "" if not numbers else f" in lane {', '.join(map(str, numbers))}"


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

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    str
        Sentences, empty for the IDM.
    """
    return " ".join(filter(None, (_followed(found), _with_causes(found))))


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


def detectable_sentences(found: Diagnosis) -> list[str]:
    """Return in how many injections each effect was found.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    list of str
        One line an effect; empty if nothing was injected.
    """
    by_effect = itertools.groupby(found.detectable, key=lambda one: (one.name, one.symbol))
    return [_injected(plain(name), symbol, list(each)) for (name, symbol), each in by_effect]


def _injected(name: str, symbol: str, each: list[Detectable]) -> str:
    shares = ", ".join(f"of {format_quantity(one.size, one.unit)} in {one.found} of {one.of}" for one in each)
    return f"{name}, injected into these very drivers ({symbol}): {shares}"
