"""Rounds of the competition: what wins is put into the model, and everything competes anew around it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import columns as co
from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis import selection as se
from idm_sumo.diagnosis.chance import draws
from idm_sumo.diagnosis.driving import Driven, Road
from idm_sumo.diagnosis.evidence import Evidence, Subject, examine
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.law_misfit import FormEvidence
from idm_sumo.diagnosis.library import Library, library_of
from idm_sumo.diagnosis.model import Placed, placed_of, present_columns, whole_score
from idm_sumo.diagnosis.settings import Settings
from idm_sumo.runtime.progress import Progress
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]

ROUNDS = 6  # of what enters or leaves the model
COMPARED = 2  # of these, by what is left unexplained around each
TRIED = 3  # effects that are driven in one round
UNSETTLED = 2.0  # standard errors, by which a size may be off
SURE = 0.5  # probability of a family within a component


@dataclass(frozen=True)
class Look:
    """A competition around one model."""

    fit: Fit
    effects: tuple[Placed, ...]
    evidence: Evidence
    library: Library
    score: Floats
    selection: se.Selection
    settings: Settings

    def winner(self, component: se.Component) -> int | None:
        """Return a component's likeliest hypothesis if its family is significant and more likely than not, else None."""
        probability = component.probability(self.library)
        family = int(np.argmax(probability))
        if probability[family] < SURE or self.selection.is_by_chance(family, float(component.by_family[family])):
            return None
        inside = np.where(self.library.family == family, component.weight, 0.0)
        return int(np.argmax(inside))

    @property
    def of_form(self) -> FormEvidence:
        """What the recording says of the law's form, beside all that competes successfully."""
        smooth = self.library.plan.of(pl.MISFIT)[:-1]  # the last is the response, of no place in this space
        unsure = self.evidence.inflation * (1.0 + 0.5 * np.pi / len(self.evidence.nulls))  # of a median of replicates
        gram = self.evidence.gram[smooth] / unsure
        left = self.score[smooth] / unsure - gram @ self.selection.explained
        return FormEvidence(left, gram[:, smooth])

    def effective_drivers(self, hypothesis: int) -> float:
        """Return on how many drivers a hypothesis rests, by Kish's formula on what each says for it."""
        row = self.library.mix[hypothesis]
        own = self.evidence.by_driver[:, row.indices] @ row.data
        total = float(row.data @ self.score[row.indices])
        share = np.maximum(row.multiply(row) @ self.evidence.part.T, 0.0).ravel()
        own = own + (total - own.sum()) * share / max(share.sum(), 1e-300)
        own = np.maximum(own * np.sign(total), 0.0)
        return float(own.sum() ** 2 / max((own**2).sum(), 1e-300))


@dataclass(frozen=True)
class Found:
    """The first look, without any effect, and the last."""

    base: Fit
    first: Look
    last: Look
    settings: Settings


@dataclass(frozen=True)
class Trial:
    """A model that may take the place of another one; ``entered`` names what it has more, and ``explained`` is what that explains."""

    look: Look
    now: Look
    entered: str = ""
    explained: float = 0.0

    @cached_property
    def is_refused(self) -> bool:
        """Whether what entered does not win where it is in the model: it would leave at once."""
        return bool(self.entered) and self.entered not in winners(self.look)

    @property
    def better(self) -> float:
        """How much likelier the recording is by it (a log-likelihood ratio).

        Where a little of an effect says what much of it does, what its entering explains is what it leaves less to explain. Where they
        differ, neither alone is right, and their mean is taken.
        """
        if self.is_refused:
            return -np.inf
        less = self.now.selection.unexplained - self.look.selection.unexplained
        return 0.5 * (self.explained + less) if self.entered else less


Looking = Callable[[Fit, tuple[Placed, ...]], Look]


def looking(subject: Subject, settings: Settings, rng: np.random.Generator) -> Looking:
    """Return the function that lets everything compete around a model with effects, always with the same draws."""
    chances = draws(subject.windows, subject.noises, settings.replicates, rng)

    def look(fit: Fit, effects: tuple[Placed, ...]) -> Look:
        plan = co.plan_of(subject.windows, fit)
        evidence = examine(subject, fit, plan, chances)
        library = library_of(plan, settings)
        score = whole_score(evidence, effects)
        selection = se.compete(evidence, library, settings, score)
        return Look(fit, effects, evidence, library, score, selection, settings)

    return look


def search(subject: Subject, base: Fit, settings: Settings, rng: np.random.Generator, progress: Progress) -> Found:
    """Return what competes best, each effect at its size.

    The linear competition says what is worth driving, the likelihood of the driven effect at which size. Of the two that are likeliest so,
    and of the effects in the model at the sizes that null replicates of it say, that model is taken that explains most and leaves least
    unexplained. Everything competes anew around it, and what no longer wins leaves. It ends when chance makes as much as what is left,
    or as what a change explains.
    """
    look = looking(subject, settings, rng)
    progress("comparing hypotheses", 0, 1)
    first = now = look(base, ())
    left: set[str] = set()  # what left does not come back
    refused: set[str] = set()  # by the model as it is
    for number in range(ROUNDS):
        progress("driving with effects and comparing anew", number, ROUNDS)
        road = Road(subject.windows, now.fit, first.library.plan)
        there = winners(now)
        kept = tuple(one for one in now.effects if one.name in there)
        if len(kept) < len(now.effects):
            left |= {one.name for one in now.effects} - {one.name for one in kept}
            now = look(*road.together(kept, [_slope(now, one) for one in kept])) if kept else first
            continue
        if now.selection.unexplained < settings.chance:
            break
        trials = _trials(now, road, look, left | refused)
        best = max(trials, key=lambda one: one.better, default=Trial(now, now))
        if best.better >= settings.chance:
            now, refused = best.look, set()
            continue
        anew = {one.entered for one in trials if one.is_refused}
        if not anew:
            break
        refused |= anew
    return Found(base, first, now, settings)


def _trials(now: Look, road: Road, look: Looking, gone: set[str]) -> list[Trial]:
    """Return models that may take the place of this one: other sizes of its effects, or if those say no more, one effect more."""
    moved = _resized(now)
    trials = [Trial(look(road.fitted(moved), moved), now)] if moved != now.effects else []
    enough = len(now.effects) >= now.settings.components
    if enough or (trials and trials[0].better >= now.settings.chance):
        return trials
    slopes = [_slope(now, one) for one in now.effects]

    def with_one_more(one: Driven) -> Trial:
        around = look(*road.together(one.effects, [*slopes, one.slope]))
        return Trial(around, now, one.last.name, one.total)

    return trials + each_in_threads(with_one_more, _entering(now, road, gone))


def winners(now: Look) -> dict[str, int]:
    """Return the hypothesis of each name that wins a component on enough drivers."""
    out: dict[str, int] = {}
    for component in now.selection.components:
        winner = now.winner(component)
        if winner is not None and now.effective_drivers(winner) >= now.settings.least_drivers:
            out.setdefault(now.library.names[int(now.library.family[winner])], winner)
    return out


def _resized(now: Look) -> tuple[Placed, ...]:
    """Return the effects, those moved to where they are likeliest that are farther from it than two standard errors.

    Null replicates of the model that has them show what measurement makes of an effect of this size; those of the model without it do not.
    """
    arena = now.selection.arena
    parts = [arena.contribution(one) for one in now.selection.components]
    moved = {}
    for n, component in enumerate(now.selection.components):
        winner = now.winner(component)
        if winner is None or not now.library.group_of(winner).present:
            continue
        others = sum((part for k, part in enumerate(parts) if k != n), arena.nothing)
        careful = arena.component(others, careful=True)
        moved[name_of(now.library, winner)] = float(component.size[winner]), float(careful.deviation[winner])
    out = []
    for one in now.effects:
        size, error = moved.get(one.name, (one.value, np.inf))
        first = one.magnitude
        size = float(
            np.clip(size, max(first.lower, one.value - abs(one.value)), min(first.upper, one.value + abs(one.value)))
        )
        out.append(replace(one, value=size) if abs(size - one.value) > UNSETTLED * error else one)
    return tuple(out)


def _candidates(now: Look, refused: set[str]) -> list[list[tuple[int, float]]]:
    """Return effects that are worth driving, each as hypotheses and the sizes at which they win; none if nothing is left to explain.

    Of an effect that is linear the likeliest hypothesis is enough. How others act at their size a little of them does not say: of these
    every form is driven, each where it is likeliest.
    """
    there, won = {one.name for one in now.effects}, winners(now)
    if not set(won) - there:
        return []
    library, arena = now.library, now.selection.arena
    held: list[se.Component] = []
    others: list[se.Component] = []
    for component in now.selection.components:
        own = library.names[int(np.argmax(component.probability(library)))]
        (held if own in there else others).append(component)
    alone = arena.component(sum((arena.contribution(one) for one in held), arena.nothing))
    close: list[tuple[bool, float, str, list[tuple[int, float]]]] = []
    for one in (alone, *others):
        for family, said in enumerate(one.by_family.tolist()):
            if now.selection.is_by_chance(family, said):
                continue
            name = library.names[family]
            inside = np.where(library.family == family, one.log_bf + np.log(library.within), -np.inf)
            best = int(np.argmax(inside))
            if library.is_free(best) or name in there | refused | {other for _, _, other, _ in close}:
                continue
            if now.effective_drivers(best) >= now.settings.least_drivers:
                forms = [best] if library.is_linear(best) else library.best_of_forms(inside)
                close.append((name in won, said, name, [(n, float(one.size[n])) for n in forms]))
    return [forms for *_, forms in sorted(close, reverse=True)[:TRIED]]


def name_of(library: Library, hypothesis: int) -> str:
    """Return the family of a hypothesis."""
    return library.names[int(library.family[hypothesis])]


def _entering(now: Look, road: Road, gone: set[str]) -> list[Driven]:
    """Return the effects that may enter the model: the likeliest once they are driven.

    One that is likeliest beyond all that drivers can have of it is not what they have.
    """
    tried = _candidates(now, gone)
    without = road.driven(now.effects)[0] if tried else np.empty(0)

    def driven(forms: list[tuple[int, float]]) -> Driven:
        each = [
            (placed_of(now.library, hypothesis, size, now.effects), _null_slope(now, hypothesis))
            for hypothesis, size in forms
        ]
        one, slope = each[road.likeliest(now.effects, each, without)]
        return road.sized(now.effects, one, slope, without)

    each = each_in_threads(driven, tried)
    likely = [one for one in each if one.total > 0.0 and not one.last.at_bound]
    likely = sorted(likely, key=lambda one: -one.total)[:COMPARED]
    # None leaves less than nothing unexplained: who cannot be better than the likeliest of them, or than chance, is not looked at.
    left = now.selection.unexplained
    least = max([2.0 * now.settings.chance - left, *(one.total - left for one in likely[:1])])
    return [one for one in likely if one.total > least]


def _null_slope(now: Look, hypothesis: int) -> float:
    """Return what null replicates say of a little of a hypothesis."""
    row = now.library.mix[hypothesis]
    return float(row.data @ now.evidence.usual[row.indices])


def _slope(now: Look, one: Placed) -> float:
    """Return what null replicates say of a little more of an effect in the model."""
    return float(now.evidence.usual[present_columns(now.library.plan, [one])[0]])
