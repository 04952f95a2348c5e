"""Rounds of the competition: what wins is put into the model, and everything competes anew around it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import columns as co
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

Floats = npt.NDArray[np.float64]

ROUNDS = 6  # of what enters or leaves the model
LITTLE = 1e-6  # of a log-likelihood
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

    def winner(self, component: se.Component) -> int | None:
        """Return a component's likeliest hypothesis if its family is significant and more likely than not, else None."""
        probability = component.probability(self.library)
        family = int(np.argmax(probability))
        if probability[family] < SURE or component.by_family[family] < max(self.selection.threshold[family], 0.0):
            return None
        inside = np.where(self.library.family == family, component.weight, 0.0)
        return int(np.argmax(inside))

    def arena(self, settings: Settings, score: Floats | None = None) -> se.Competition:
        """Return the competition with the law's misfit that is likeliest, over another score if one is given."""
        score = self.score if score is None else score
        return se.Competition(self.evidence, self.library, settings, score, self.selection.tau)

    def is_likely(self, driven: Driven, hypothesis: int, settings: Settings) -> bool:
        """Return whether a driven effect is above chance, and likelier than nothing when judged carefully.

        Its family's mean Bayes factor is taken as if no other of its hypotheses could explain anything.
        """
        arena, family = self.arena(settings), int(self.library.family[hypothesis])
        squared, slab = driven.effects[-1].value ** 2, arena.slab[hypothesis]
        said = max(driven.support, LITTLE) / (self.evidence.inflation * arena.unsure[hypothesis])

        def log_bf(doubt: float) -> float:
            variance = 0.5 * squared / said + doubt
            keep = slab / (variance + slab)
            mean = 0.5 * np.log1p(-keep) + 0.5 * squared / variance * keep + np.log(self.library.within[hypothesis])
            return float(mean)

        odds = np.log((1.0 - settings.nothing) * self.library.prior[family] / settings.nothing)
        chance = max(float(self.selection.threshold[family]), 0.0)
        return log_bf(0.0) >= chance and log_bf(float(arena.fixed[hypothesis])) + odds >= 0.0

    @property
    def of_form(self) -> FormEvidence:
        """What the recording says of the law's form, beside all that competes successfully."""
        smooth = self.library.plan.of(co.MISFIT)[:-1]  # the last is the response, of no place in this space
        gram = self.evidence.gram[smooth] / self.evidence.inflation
        left = self.score[smooth] / self.evidence.inflation - gram @ self.selection.explained
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


def search(subject: Subject, base: Fit, settings: Settings, rng: np.random.Generator, progress: Progress) -> Found:
    """Return what competes best, each effect at its size.

    The linear competition says what is worth driving, the likelihood of the driven effect whether it enters the model and at which
    size; then everything competes anew around it, and what no longer wins leaves.
    """
    chances = draws(subject.windows, subject.noises, settings.replicates, rng)

    def look(fit: Fit, effects: tuple[Placed, ...]) -> Look:
        stage = "comparing hypotheses at the sizes reached" if effects else "comparing hypotheses"
        progress(stage, 0, 1)
        plan = co.plan_of(subject.windows, fit)
        evidence = examine(subject, fit, plan, chances)
        library = library_of(plan, settings)
        score = whole_score(evidence, effects)
        selection = se.compete(evidence, library, settings, score, np.random.default_rng(0))
        progress(stage, 1, 1)
        return Look(fit, effects, evidence, library, score, selection)

    first = now = look(base, ())
    road = Road(subject, base, first.library.plan)
    gone: set[str] = set()
    for _ in range(ROUNDS):
        kept = tuple(one for one in now.effects if one.name in winners(now, settings))
        if len(kept) < len(now.effects):
            gone |= {one.name for one in now.effects} - {one.name for one in kept}
            now = look(*road.together(kept, [_slope(now, one) for one in kept])) if kept else first
            continue
        moved = _resized(now, settings)
        if moved != now.effects:
            now = look(road.fitted(moved), moved)
            continue
        # What was not likely may be so beside what has entered since.
        entering = _entering(now, road, set(gone), settings, progress) if len(kept) < settings.components else None
        if entering is None:
            break
        slopes = [*(_slope(now, one) for one in kept), entering.slope]
        now = look(*road.together(entering.driven.effects, slopes))
    return Found(base, first, now, settings)


def winners(now: Look, settings: Settings) -> dict[str, int]:
    """Return the hypothesis of each name that wins a component on enough drivers."""
    out: dict[str, int] = {}
    for component in now.selection.components:
        winner = now.winner(component)
        if winner is not None and now.effective_drivers(winner) >= settings.least_drivers:
            out.setdefault(now.library.names[int(now.library.family[winner])], winner)
    return out


def _resized(now: Look, settings: Settings) -> tuple[Placed, ...]:
    """Return the effects, those moved to where they are likeliest that are farther from it than two standard errors.

    Null replicates of the model that has them show what measurement makes of an effect of this size; those of the model without it do not.
    """
    arena = now.arena(settings)
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


def _candidates(now: Look, refused: set[str], settings: Settings) -> list[list[tuple[int, float]]]:
    """Return effects that are worth driving, each as hypotheses and the sizes at which they win; none if nothing is left to explain.

    Of an effect that is linear the likeliest hypothesis is enough. How others act at their size a little of them does not say: of these
    every form is driven, each where it is likeliest.
    """
    there = {one.name for one in now.effects}
    if not set(winners(now, settings)) - there:
        return []
    library, arena = now.library, now.arena(settings)
    held: list[se.Component] = []
    others: list[se.Component] = []
    for component in now.selection.components:
        own = library.names[int(np.argmax(component.probability(library)))]
        (held if own in there else others).append(component)
    alone = arena.component(sum((arena.contribution(one) for one in held), arena.nothing))
    close: list[tuple[float, str, list[tuple[int, float]]]] = []
    for one in (alone, *others):
        for family in np.flatnonzero(one.by_family > np.maximum(now.selection.threshold, 0.0)):
            name = library.names[family]
            inside = np.where(library.family == family, one.log_bf + np.log(library.within), -np.inf)
            best = int(np.argmax(inside))
            if library.is_free(best) or name in there | refused | {other for _, other, _ in close}:
                continue
            if now.effective_drivers(best) >= settings.least_drivers:
                forms = [best] if library.is_linear(best) else library.best_of_forms(inside)
                close.append((float(one.by_family[family]), name, [(n, float(one.size[n])) for n in forms]))
    return [forms for _, _, forms in sorted(close, reverse=True)[:TRIED]]


def name_of(library: Library, hypothesis: int) -> str:
    """Return the family of a hypothesis."""
    return library.names[int(library.family[hypothesis])]


class Entering(NamedTuple):
    """An effect that enters the model, driven beside those in it."""

    driven: Driven
    slope: float


def _entering(now: Look, road: Road, refused: set[str], settings: Settings, progress: Progress) -> Entering | None:
    """Return the effect that is likeliest once it is driven; None if none is likely enough."""
    tried = _candidates(now, refused, settings)
    without = road.driven(now.effects)[0] if tried else np.empty(0)
    likely: list[Entering] = []
    for number, forms in enumerate(tried):
        progress("driving with one more effect", number, len(tried))
        each = [
            (placed_of(now.library, hypothesis, size, now.effects), _null_slope(now, hypothesis))
            for hypothesis, size in forms
        ]
        which = road.likeliest(now.effects, each, without)
        one, slope = each[which]
        driven = road.sized(now.effects, one, slope, without)
        if now.is_likely(driven, forms[which][0], settings):
            likely.append(Entering(driven, slope))
        else:
            refused.add(one.name)
    return max(likely, key=lambda one: one.driven.total, default=None)


def _null_slope(now: Look, hypothesis: int) -> float:
    """Return what null replicates say of a little of a hypothesis."""
    row = now.library.mix[hypothesis]
    return float(row.data @ now.evidence.nulls.mean(axis=0)[row.indices])


def _slope(now: Look, one: Placed) -> float:
    """Return what null replicates say of a little more of an effect in the model."""
    return float(now.evidence.nulls.mean(axis=0)[present_columns(now.library.plan, [one])[0]])
