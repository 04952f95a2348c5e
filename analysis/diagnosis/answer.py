"""The first screen of a diagnosis, in plain sentences."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from idm_sumo.diagnosis import Diagnosis
from idm_sumo.models import laws
from idm_sumo.models.effects import BY_NAME, format_quantity

from . import contract as c
from .outcome import Outcome, outcome_of, told
from .shape import lacks
from .words import lanes, p_value, plain, sentence, where

FEW_NAMES = 4  # effects named one by one


@dataclass(frozen=True)
class Answer:
    """What a traffic engineer reads first.

    Attributes
    ----------
    what, where, better : str
        Three sentences: what was found, where or when, how much better the simulation is for it.
    advice, basis, limits, models : tuple of str
        What to do; on what it rests; what the data cannot say; both models.
    """

    what: str
    where: str
    better: str
    advice: tuple[str, ...]
    basis: tuple[str, ...]
    limits: tuple[str, ...]
    models: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """The three sentences."""
        return self.what, self.where, self.better


def answer(outcome: Outcome) -> Answer:
    """Return the first screen.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.

    Returns
    -------
    Answer
        Its sentences.
    """
    what, place = {"named": _named, "none": _none, "unknown": _unknown}[outcome.content.verdict](outcome)
    return Answer(what, place, better(outcome), _advice(outcome), _basis(outcome), _limits(outcome), _models(outcome))


def spoken(found: Diagnosis) -> tuple[str, ...]:
    """Return what a terminal says of a diagnosis.

    Parameters
    ----------
    found : Diagnosis
        What the finder returns.

    Returns
    -------
    tuple of str
        One line each.
    """
    outcome = outcome_of(found)
    said = answer(outcome)
    names = ", ".join(plain(cause.name) for cause in outcome.content.causes)
    verdict = f"verdict: {outcome.content.verdict}" + (f" ({names})" if names else "")
    return verdict, *said.sentences, *said.limits


def behaviour(outcome: Outcome, cause: c.Cause) -> str:
    """Return what drivers do, with the size in engineering units.

    Parameters
    ----------
    outcome : Outcome
        To whose median driver the size refers.
    cause : contract.Cause
        Named or without gain.

    Returns
    -------
    str
        Such as ``drivers hold back (acceleration lower by 0.12 m/s²)``.
    """
    modelled = outcome.modelled(cause)
    who = f"about {modelled.share:.0%} of the drivers" if modelled is not None and modelled.share < 1.0 else "drivers"
    telling, values = told(cause), {symbol: one.value for symbol, one in cause.parameters.items()}
    if telling is None:
        effect = BY_NAME.get(cause.name)
        does = f"behave as one who {effect.summary}" if effect else f"show {plain(cause.name)}"
        sizes = ", ".join(f"{s} = {format_quantity(one.value, one.unit)}" for s, one in cause.parameters.items())
        return f"{who} {does}" + (f" ({sizes})" if sizes else "")
    does = telling.more if values[telling.symbol] >= 0.0 or not telling.less else telling.less
    return f"{who} {does} ({telling.size(values, outcome.median)})"


def situation(outcome: Outcome, cause: c.Cause) -> str:
    """Return where, when and in which lanes a cause acts.

    Parameters
    ----------
    outcome : Outcome
        Of which whole road and recording are known.
    cause : contract.Cause
        Named or without gain.

    Returns
    -------
    str
        Such as ``in the last five seconds before the lane change, everywhere``.
    """
    telling = told(cause)
    region = cause.where or c.Where()
    bounds = outcome.bounded("position", region.position_m), outcome.bounded("time", region.time_s)
    place = (where(*bounds) + lanes(region.lanes)).strip()
    when = telling.when if telling is not None else ""
    return ", ".join(filter(None, (when, place or "everywhere on the road and all the time")))


def _named(outcome: Outcome) -> tuple[str, str]:
    causes = outcome.content.causes
    what = "; and ".join(behaviour(outcome, cause) + _or_else(cause) for cause in causes)
    places = [situation(outcome, cause) for cause in causes]
    if len(causes) == 1:
        return sentence(what), sentence(f"This happens {places[0]}")
    numbered = zip(("the first", "the second", "the third"), places, strict=False)
    return sentence(what), sentence("; ".join(f"{which} happens {place}" for which, place in numbered))


def _or_else(cause: c.Cause) -> str:
    """Return what the data cannot tell from a cause."""
    others = [f"{plain(name)}: {BY_NAME[name].summary}" if name in BY_NAME else plain(name) for name in cause.one_of]
    return (
        f", or it is {' or '.join(f'“{one}”' for one in others)}, which looks the same in these data" if others else ""
    )


def _none(outcome: Outcome) -> tuple[str, str]:
    content = outcome.content
    looked = sentence(f"Looked at were {_seen(outcome)}")
    if not content.gain.vehicles and outcome.notes and not content.without_gain:
        return sentence(f"No verdict: {outcome.notes[0]}"), looked
    if content.without_gain:
        there = _listed(behaviour(outcome, cause) for cause in content.without_gain)
        return sentence(f"No cause improves the simulation. Present, but without gain: {there}"), looked
    if shape := lacks(outcome):
        return f"No effect of the catalogue was found, but {law_of(outcome)} lacks a shape: {shape}.", looked
    return f"No cause was found: these data show nothing beyond {law_of(outcome)}.", looked


def _unknown(outcome: Outcome) -> tuple[str, str]:
    found = outcome.content.unexplained
    what = _listed(f"{plain(one.covariate)} from {one.range[0]:.4g} to {one.range[1]:.4g}" for one in found)
    bounds = [(outcome.bounded("position", one.position_m), outcome.bounded("time", one.time_s)) for one in found]
    places = dict.fromkeys(where(*one).strip() or "everywhere on the road and all the time" for one in bounds)
    return (
        f"Something in these data is explained by no effect of the catalogue: it shows in {what}.",
        sentence(f"It shows {'; '.join(places)}"),
    )


def better(outcome: Outcome) -> str:
    """Return how much better held-out drivers are simulated.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.

    Returns
    -------
    str
        One sentence.
    """
    gain = outcome.content.gain
    if not gain.vehicles:
        return "Too few drivers to hold some out: no gain was measured."
    if outcome.content.verdict != "named":
        return (
            f"The simulation of {gain.vehicles} held-out drivers is {gain.base:.2f} m off on average; the model is "
            "left as it is."
        )
    moves = "falls" if gain.difference > 0.0 else "rises"
    share = f" ({abs(gain.difference) / gain.base:.1%})" if gain.base else ""
    sure = "" if gain.ci95[0] > 0.0 else ", which may be chance"
    return (
        f"With this in the model, the mean error of the position of {gain.vehicles} held-out drivers {moves} from "
        f"{gain.base:.3f} to {gain.extended:.3f} m{share}{sure}."
    )


def _advice(outcome: Outcome) -> tuple[str, ...]:
    content = outcome.content
    if content.verdict == "none":
        if lacks(outcome):
            return (
                f"Expect errors there, however {law_of(outcome)} is calibrated: no parameters make up for it.",
                "A law with more freedom in gap, speed and approach rate would follow these drivers more closely.",
            )
        known = content.gain.vehicles or content.without_gain
        return ("Calibrate and simulate as before.",) if known else ("Record more drivers, or for longer.",)
    if content.verdict == "unknown":
        return (
            "Leave the stretches named here out of calibration, and look at what happens there in the recording.",
            "The model is left as it is: nothing that was found could be put into it.",
        )
    found = [one.advice for cause in content.causes if (one := told(cause)) is not None]
    plain_sumo = [
        f"Plain SUMO can have it by {effect.sumo}."
        for cause in content.causes
        if (effect := BY_NAME.get(cause.name)) is not None and effect.sumo
    ]
    use = "Or simulate with it: replay, export and interactive take --model model.json."
    return (*dict.fromkeys(found), use, *dict.fromkeys(plain_sumo))


def _basis(outcome: Outcome) -> tuple[str, ...]:
    content = outcome.content
    held = content.gain.vehicles
    out = [sentence(f"{_seen(outcome)}; each of {held} was held out once, from the sizes with which it is simulated")]
    for cause in content.causes:
        shown = f"{plain(cause.name)}: {p_value(cause.p_value)}, corrected for all that was tested"
        shown += f"; probability {cause.probability:.2f} that it is this and nothing else"
        rests = f"; it rests on about {cause.effective_drivers:.0f} drivers" if cause.effective_drivers else ""
        alone = f"; by itself it spares {_spared(cause.gain)}" if cause.gain is not None else ""
        out.append(sentence(shown + rests + alone))
    return tuple(out)


def _spared(gain: c.Share) -> str:
    low, high = gain.ci95
    return f"{gain.difference:.1%} of a driver's error (95 %: {low:.1%} to {high:.1%})"


def _limits(outcome: Outcome) -> tuple[str, ...]:
    content, out = outcome.content, []
    for cause in content.causes:
        effect = BY_NAME.get(cause.name)
        if cause.at_bound:
            out.append(f"The size of {plain(cause.name)} is at the bound of what is searched: it may be larger.")
        if cause.one_of:
            out.append(f"{plain(cause.name)} cannot be told from {_listed(map(plain, cause.one_of))}.")
        if effect is not None and effect.hindsight:
            out.append(
                f"{plain(cause.name)} rests on what happens later in the recording: a replay can have it, a forecast "
                "cannot."
            )
    if content.verdict == "named" and content.gain.ci95[0] <= 0.0:
        low, high = content.gain.ci95
        out.append(f"That the simulation is better at all is not sure: the gain is {low:.3f} to {high:.3f} m (95 %).")
    if content.causes and content.without_gain:
        there = _listed(behaviour(outcome, cause) for cause in content.without_gain)
        out.append(f"Present, but without a gain of the simulation: {there}.")
    if content.causes and content.unexplained:
        out.append(f"Left unexplained: {_listed(plain(one.covariate) for one in content.unexplained)}.")
    if content.verdict != "none" and (shape := lacks(outcome)):
        out.append(f"{law_of(outcome)} lacks a shape, whatever its parameters: {shape}.")
    if content.untestable:
        names = [plain(name) for name in content.untestable]
        some = f"{_listed(names[:FEW_NAMES])}{' and more' if len(names) > FEW_NAMES else ''}"
        out.append(f"Not to be tested with these data ({len(names)} of the catalogue): {some}.")
    return tuple(map(sentence, out))


def _models(outcome: Outcome) -> tuple[str, ...]:
    own, share = outcome.base.parameters, outcome.drivers_at_bound()
    out = [
        f"Base model: {law_of(outcome)}; its median driver has a time headway of {own.T:.2f} s, accelerates with up "
        f"to {own.a:.2f} m/s², brakes comfortably with {own.b:.2f} m/s², stands at {own.d0:.1f} m and wants "
        f"{3.6 * outcome.base.desired_speed:.0f} km/h."
    ]
    if share:
        worst = max((name for name in share if name != "any"), key=lambda name: share[name])
        most = f", most often of {worst} ({share[worst]:.0%})" if share[worst] else ""
        out.append(f"{share['any']:.0%} of the drivers have a parameter at a bound of what calibration allows{most}.")
    if outcome.collisions is not None:
        base, extended = outcome.collisions
        both = "" if outcome.content.verdict != "named" else f", the extended model in {extended:.1%}"
        out.append(f"The base model collides in {base:.1%} of the windows of held-out drivers{both}.")
    return tuple(out)


def law_of(outcome: Outcome) -> str:
    """Return the car-following law to which causes are added.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.

    Returns
    -------
    str
        Name for sentences.
    """
    return laws.TITLES[laws.NAMES.index(outcome.content.law)]


def _seen(outcome: Outcome) -> str:
    """Return how much was looked at."""
    position, time = outcome.whole["position"], outcome.whole["time"]
    seen = where(position, time) if position[0] < position[1] else ""
    return f"{len(outcome.drivers)} drivers in {outcome.windows} windows{seen}"


def _listed(parts: Iterable[str]) -> str:
    """Join parts by commas and a last "and"."""
    each = list(parts)
    return each[0] if len(each) == 1 else f"{', '.join(each[:-1])} and {each[-1]}" if each else ""
