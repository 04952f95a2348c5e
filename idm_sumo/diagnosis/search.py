"""Rounds of the competition: what wins is put into the model, and everything competes anew around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import columns as co
from idm_sumo.diagnosis import selection as se
from idm_sumo.diagnosis.evidence import Evidence, Subject, examine
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.library import Library, library_of
from idm_sumo.diagnosis.luck import draws
from idm_sumo.diagnosis.model import Placed, climbed, placed_of, present_columns, whole_score
from idm_sumo.diagnosis.settings import Settings
from idm_sumo.runtime.progress import Progress

Floats = npt.NDArray[np.float64]

ROUNDS = 4  # of linearisation at the sizes reached
SAME = 0.1  # of a size: a smaller change needs no further round
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
    """Return what competes best, each effect at its size."""
    lucks = draws(subject.windows, subject.noises, settings.replicates, rng)

    def look(fit: Fit, effects: tuple[Placed, ...], stage: str) -> Look:
        progress(stage, 0, 1)
        plan = co.plan_of(subject.windows, fit)
        evidence = examine(subject, fit, plan, lucks)
        library = library_of(plan, settings)
        score = whole_score(evidence, effects)
        selection = se.compete(evidence, library, settings, score, np.random.default_rng(0))
        progress(stage, 1, 1)
        return Look(fit, effects, evidence, library, score, selection)

    first = now = look(base, (), "comparing hypotheses")
    for number in range(ROUNDS):
        wanted = _wanted(now, settings, most=number + 1)
        if _is_settled(wanted, now.effects):
            break
        progress(f"fitting {len(wanted)} effects", 0, 1)
        fit, effects = climbed(subject, base, wanted, now.library.plan, _biases(now, wanted)) if wanted else (base, [])
        now = look(fit, tuple(effects), "comparing hypotheses at the sizes reached") if effects else first
    return Found(base, first, now, settings)


def _wanted(now: Look, settings: Settings, most: int) -> list[Placed]:
    """Return the effects that win, at the sizes at which they do."""
    wanted: list[Placed] = []
    for component in now.selection.components:
        winner = now.winner(component)
        if winner is None or now.library.is_free(winner) or now.effective_drivers(winner) < settings.least_drivers:
            continue
        one = placed_of(now.library, winner, float(component.size[winner]), now.effects)
        if all(one.name != other.name for other in wanted) and len(wanted) < most:
            wanted.append(one)
    return wanted


def _is_settled(wanted: list[Placed], effects: tuple[Placed, ...]) -> bool:
    """Return whether the model already holds what is wanted."""
    if {one.name for one in wanted} != {one.name for one in effects}:
        return False
    pairs = [(one, next(other for other in effects if other.name == one.name)) for one in wanted]
    return all(
        one.is_like(other) and abs(one.value - other.value) <= SAME * max(abs(other.value), 0.5 * one.magnitude.typical)
        for one, other in pairs
    )


def _biases(now: Look, wanted: list[Placed]) -> dict[str, float]:
    """Return what null replicates say of a little more of each effect."""
    plan, nulls = now.library.plan, now.evidence.nulls.mean(axis=0)
    out = {}
    for one in wanted:
        there = [other for other in now.effects if other.name == one.name]
        if there:
            out[one.name] = float(nulls[present_columns(plan, there)[0]])
            continue
        for number in range(len(now.library.group)):
            group = now.library.group_of(number)
            if group.name == one.name and group.form == one.form and now.library.edges(number) == dict(one.edges):
                row = now.library.mix[number]
                out[one.name] = float(row.data @ nulls[row.indices])
                break
    return out
