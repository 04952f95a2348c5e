"""What a search's outcome amounts to: one object from which verdict, file, tables, pictures and sentences are made."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from idm_sumo.diagnosis import selection as se
from idm_sumo.diagnosis.evidence import Subject
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.gain import Errors, by_folds, driven, folds_of, lower_bound, typical_gain
from idm_sumo.diagnosis.model import Placed, present_columns, refitted, with_effects
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.search import Found, Look
from idm_sumo.diagnosis.some_drivers import Some, by_their_other_windows, some_who_differ
from idm_sumo.diagnosis.swings import Swing, strongest, tried
from idm_sumo.diagnosis.windows import WITHOUT, Windows

Floats = npt.NDArray[np.float64]

OTHERS = 0.1  # probability from which on another family is among those that cannot be told apart


@dataclass(frozen=True)
class Claim:
    """Something that competes successfully.

    Attributes
    ----------
    name : str
        Effect, or what is free over which covariate.
    hypothesis : int
        Its likeliest form, place and time.
    placed : Placed or None
        As an effect of the model; None for a free field.
    value, error : float
        Magnitude and its standard error, over forms.
    log_bf, threshold, z, p : float
        Logarithm of its Bayes factor, what chance makes of it, standard errors, and the p-value corrected for families.
    probability : float
        That it is this family and no other.
    one_of : tuple of str
        Other families that these data cannot tell from it.
    effective_drivers : float
    gain : Gain or None
        Share of a driver's ADE that it spares on drivers that took no part; None for a free field.
    """

    name: str
    hypothesis: int
    placed: Placed | None
    value: float
    error: float
    log_bf: float
    threshold: float
    z: float
    p: float
    probability: float
    one_of: tuple[str, ...]
    effective_drivers: float
    gain: Gain | None = None


@dataclass(frozen=True)
class Decision:
    """The outcome.

    Attributes
    ----------
    named, without_gain, unexplained : tuple of Claim
    fit : Fit
        Of the extended model.
    base, extended : Errors
        On drivers that took no part in the sizes.
    look : Look
        Around the extended model.
    some : Some or None
        What only some drivers have, if that is what is named.
    """

    named: tuple[Claim, ...]
    without_gain: tuple[Claim, ...]
    unexplained: tuple[Claim, ...]
    fit: Fit
    base: Errors
    extended: Errors
    look: Look
    some: Some | None = None
    swing: Swing | None = None

    @property
    def verdict(self) -> str:
        """Return named, unknown or none."""
        return "named" if self.named else "unknown" if self.unexplained or self.swing else "none"


def decide(subject: Subject, found: Found, rng: np.random.Generator) -> Decision:
    """Return what may be claimed, and which of it improves the simulation of drivers that took no part."""
    settings, windows = found.settings, subject.windows
    claims = claims_of(found)
    there = [one for one in claims if one.placed is not None]
    free = tuple(one for one in claims if one.placed is None)
    fold = folds_of(windows.platoon, settings.folds, rng)
    base = by_folds(windows, [_fitted(subject, found, ())] * settings.folds, fold)
    measured = _with_gains(subject, found, there, base, fold, rng)
    named = tuple(one for one in measured if one.gain and lower_bound(one.gain, settings.gain_level) > 0.0)
    without = tuple(one for one in measured if one not in named)
    fit, extended = found.base, base
    if named:
        fit = _fitted(subject, found, named)
        extended = by_folds(windows, _by_fold(found, fit, named, fold), fold)
    some = some_who_differ(subject, found, rng)
    if some is not None:
        apart = _of_some(windows, found, some, base, extended, rng)
        if apart is not None:
            return apart
    swing = None if named else _swing(found.last)
    return Decision(named, without, free, fit, base, extended, found.last, swing=swing)


def _of_some(
    windows: Windows, found: Found, some: Some, base: Errors, alike: Errors, rng: np.random.Generator
) -> Decision | None:
    """Return that some drivers have a cause, or None.

    It must improve windows that did not say who has it, and more than what is named of all drivers alike improves them.
    """
    extended = driven(by_their_other_windows(windows, some.fit, some.share.value), some.fit)
    gain, more = (
        typical_gain(other.ade_m, extended.ade_m, windows.platoon, rng, held_out=True) for other in (base, alike)
    )
    if min(lower_bound(one, found.settings.gain_level) for one in (gain, more)) <= 0.0:
        return None
    placed, families = some.placed, len(found.first.library.names)
    z, having = float(np.sqrt(2.0 * some.support)), some.windows.seen[:, WITHOUT, 0] == 0.0
    claim = Claim(
        placed.name, some.hypothesis, placed, placed.value, found.settings.doubt * placed.magnitude.typical, some.support,
        found.settings.chance, z, float(min(1.0, 2.0 * families * norm.sf(z))),
        1.0 / (1.0 + float(np.exp(-some.support))), (), float(len(np.unique(windows.driver[having]))), gain,
    )  # fmt: skip
    return Decision((claim,), (), (), some.fit, base, extended, found.last, some)


def _swing(look: Look) -> Swing | None:
    """Return the strongest swing of drivers' own, if chance makes none of its kind at a family's rate of false alarms."""
    if look.evidence.swings is None:
        return None
    swing, rate = strongest(look.evidence.swings), look.settings.false_alarms / len(look.library.names)
    return swing if swing.z > norm.isf(rate / tried()) else None


def claims_of(found: Found) -> list[Claim]:
    """Return everything significant on enough drivers, at sizes that are more than systematic errors."""
    look, settings = found.last, found.settings
    library = look.library
    arena = look.selection.arena
    parts = [arena.contribution(one) for one in look.selection.components]
    claims: list[Claim] = []
    for n, component in enumerate(look.selection.components):
        winner = look.winner(component)
        if winner is None:
            continue
        others = sum((part for k, part in enumerate(parts) if k != n), arena.nothing)
        careful = arena.component(others, careful=True)
        family = int(library.family[winner])
        drivers = look.effective_drivers(winner)
        probability = component.probability(library)
        if careful.odds(library, settings)[family] < 0.0 or drivers < settings.least_drivers:
            continue
        is_known = library.is_free(winner) or any(one.name == library.names[family] for one in look.effects)
        if not is_known or any(one.name == library.names[family] for one in claims):
            continue
        claims.append(_claim(look, component, careful, winner, probability, drivers))
    return sorted(claims, key=lambda one: -one.log_bf)


def _claim(
    look: Look, exact: se.Component, careful: se.Component, winner: int, probability: Floats, drivers: float
) -> Claim:
    library, family = look.library, int(look.library.family[winner])
    group = library.group_of(winner)
    placed = None if group.is_free else next((one for one in look.effects if one.name == group.name), None)
    inside = np.where(library.family == family, exact.weight, 0.0)
    same_unit = library.size == library.size[winner]
    inside = np.where(same_unit, inside, 0.0) / max(float(inside[same_unit].sum()), 1e-300)
    value = float(inside @ exact.size) if placed is None else placed.value
    error = float(np.sqrt(inside @ (careful.deviation**2 + (exact.size - inside @ exact.size) ** 2)))
    z = float(exact.z[winner])
    likely = [n for n in np.argsort(-probability) if n != family and probability[n] > OTHERS]
    return Claim(
        library.names[family], winner, placed, value, error, float(exact.by_family[family]),
        look.selection.arena.threshold(family), z, float(min(1.0, 2.0 * len(library.names) * norm.sf(abs(z)))),
        min(float(probability[family]), 1.0), tuple(library.names[n] for n in likely), drivers,
    )  # fmt: skip


def _with_gains(
    subject: Subject, found: Found, claims: list[Claim], base: Errors, fold: npt.NDArray[np.int64], rng: np.random.Generator
) -> list[Claim]:  # fmt: skip
    """Return the claims, each with what it spares beside the others."""
    if not claims:
        return []
    windows, whole = subject.windows, _fitted(subject, found, claims)
    extended = by_folds(windows, _by_fold(found, whole, claims, fold), fold)
    out = []
    for one in claims:
        rest = [other for other in claims if other is not one]
        without = base
        if rest:
            less = _fitted(subject, found, rest)
            without = by_folds(windows, _by_fold(found, less, rest, fold), fold)
        gain = typical_gain(without.ade_m, extended.ade_m, windows.platoon, rng, held_out=True)
        out.append(replace(one, gain=gain))
    return out


def _fitted(subject: Subject, found: Found, claims: list[Claim] | tuple[Claim, ...]) -> Fit:
    """Return the model with claims: the search's own if they are all that is in it, else one whose drivers adapt from there."""
    effects = [one.placed for one in claims if one.placed is not None]
    if {one.name for one in effects} == {one.name for one in found.last.effects}:
        return found.last.fit
    return refitted(subject.windows, with_effects(found.last.fit, effects, found.last.library.plan))


def _by_fold(found: Found, fit: Fit, claims: list[Claim] | tuple[Claim, ...], fold: npt.NDArray[np.int64]) -> list[Fit]:
    """Return the model for each fold, its sizes estimated without that fold's drivers."""
    look, evidence = found.last, found.last.evidence
    effects = [one.placed for one in claims if one.placed is not None]
    columns = present_columns(evidence.plan, effects)
    own, part = evidence.by_driver[:, columns], evidence.part[:, columns]
    fits = []
    for k in range(found.settings.folds):
        kept = fold != k
        step = own[kept].sum(axis=0) / np.maximum(part[kept].sum(axis=0), 1e-9) - own.sum(axis=0) / np.maximum(
            part.sum(axis=0), 1e-9
        )
        moved = []
        for one, change in zip(effects, step, strict=True):
            first = one.magnitude
            moved.append(replace(one, value=float(np.clip(one.value + change, first.lower, first.upper))))
        fits.append(with_effects(fit, moved, look.library.plan))
    return fits


def errors_of(subject: Subject, fit: Fit) -> Errors:
    """Return the errors of a model on all drivers."""
    return driven(subject.windows, fit)
