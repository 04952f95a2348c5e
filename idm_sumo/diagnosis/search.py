"""The search for causes: examine, accept the best that passes every gate, refit, examine again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.fit import Fit, fit_drivers, improve
from idm_sumo.diagnosis.gain import compare, errors
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.effects import BY_NAME
from idm_sumo.progress import Progress

Floats = npt.NDArray[np.float64]

TWINS = 3
REFINEMENTS = 4
MOST_CAUSES = 3
SIGNIFICANT = 1e-3  # corrected p of a cause
CLEAR = 5.0  # standard errors that a further cause needs, beside its share of the first one's evidence
FURTHER_SHARE = 0.06  # of the first cause's squared z, for a further one: less is what its shape leaves over
LEAST_GAIN = 0.004  # of the ADE, on the drivers that fit
CLOSE = 0.6  # of the best's squared z: from there on causes are refitted and compared
DELAYS = (0.2, 0.45, 0.8)  # s
RIVAL = 1.003  # times the least ADE: a refitted cause that leaves no more cannot be told apart
FREE_EXCESS = 1.5  # times the best cause's squared z: from there on a free field says the catalogue does not hold it
FREE_CLEAR = 7.0  # standard errors of a free field


@dataclass(frozen=True)
class Accepted:
    """A cause in the model, the evidence with which it came, and its refined size."""

    candidate: Candidate
    value: float
    error: float
    gain: float
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Found:
    """Outcome of a search."""

    base: Fit
    fit: Fit
    accepted: tuple[Accepted, ...]
    without_gain: tuple[Candidate, ...]
    first: ev.Evidence
    last: ev.Evidence
    unexplained: tuple[Candidate, ...]


def with_cause(fit: Fit, candidate: Candidate, value: float | None = None) -> Fit:
    """Return the fit with a cause in its magnitudes, the drivers not yet refitted."""
    by_lane = fit.by_lane.copy()
    for number, (slot, size) in enumerate(hy.slots_of(candidate)):
        by_lane[:, slot] = size if number or value is None else value
    return replace(fit, by_lane=by_lane)


def refitted(subject: ev.Subject, fit: Fit, *, rounds: int = 3) -> Fit:
    """Return the fit with drivers, population and noise adapted to its magnitudes."""
    for _ in range(rounds):
        fit = improve(subject.windows, fit)
    return fit


def search(subject: ev.Subject, base: Fit, rng: np.random.Generator, progress: Progress) -> Found:
    """Find the causes, strongest first."""
    fit = base
    accepted: list[Accepted] = []
    without: list[Candidate] = []
    first = last = ev.examine(subject, fit, rng, twins=TWINS, progress=progress, stage="looking for causes")
    strange = _outside(first)
    while not strange and len(accepted) < MOST_CAUSES:
        chosen = _next(subject, fit, last, accepted, without, rng)
        if chosen is None:
            break
        candidate, fit, gained, rivals = chosen
        accepted.append(Accepted(candidate, candidate.value, candidate.error, gained, rivals))
        last = ev.examine(subject, fit, rng, twins=TWINS, progress=progress, stage=f"refining {candidate.name}")
        accepted, fit, last = _refined(subject, fit, last, accepted)
    left = tuple(strange) if strange else tuple(c for c in hy.free(last)[:3] if _stands_out(c)) if not accepted else ()
    return Found(base, fit, tuple(accepted), tuple(without), first, last, left)


def _stands_out(free: Candidate) -> bool:
    return abs(free.z) > FREE_CLEAR and abs(free.value) > 0.08


def _outside(evidence: ev.Evidence) -> list[Candidate]:
    """Return the free fields that say more than any effect of the catalogue."""
    best = max((c.z**2 for c in hy.candidates(evidence) if c.large_enough), default=0.0)
    return [c for c in hy.free(evidence)[:3] if _stands_out(c) and c.z**2 > FREE_EXCESS * best + FREE_CLEAR**2]


def _next(
    subject: ev.Subject, fit: Fit, evidence: ev.Evidence, accepted: list[Accepted], without: list[Candidate],
    rng: np.random.Generator,
) -> tuple[Candidate, Fit, float, tuple[str, ...]] | None:  # fmt: skip
    """Return the next cause that passes every gate, with the refitted model."""
    used = {a.candidate.name for a in accepted} | {c.name for c in without}
    open_ = [c for c in hy.candidates(evidence) if c.name not in used and c.large_enough and c.p < SIGNIFICANT]
    if accepted:
        needed = max(CLEAR**2, FURTHER_SHARE * accepted[0].candidate.z ** 2)
        open_ = [c for c in open_ if c.z**2 > needed]
    if not open_:
        return None
    chosen, model, rivals = _best_refit(subject, fit, open_, hy.candidates(evidence), used)
    before, after = errors(subject.windows, fit).ade_m, errors(subject.windows, model).ade_m
    gain = compare("ade_m", before, after, subject.windows.platoon, rng, held_out=False)
    if gain.difference < LEAST_GAIN * gain.base or gain.ci95[0] <= 0.0:
        without.append(chosen)
        return _next(subject, fit, evidence, accepted, without, rng)
    return chosen, model, gain.difference, rivals


def _best_refit(
    subject: ev.Subject, fit: Fit, open_: list[Candidate], every: list[Candidate], used: set[str]
) -> tuple[Candidate, Fit, tuple[str, ...]]:
    """Refit the most significant causes, and a delay at several sizes, and return the one that leaves least.

    A long delay is far from what is linear near none: its score alone underrates it.
    """
    close = [c for c in open_ if c.z**2 > CLOSE * open_[0].z ** 2][:3]
    delay = next((c for c in every if c.name == "reaction_delay" and c.name not in used), None)
    if delay is not None and delay.value > 0.0 and delay.p < SIGNIFICANT:
        close = [c for c in close if c.name != delay.name] + [replace(delay, value=size) for size in DELAYS]
    models = [
        fit_drivers(subject.windows, with_cause(fit, c).by_lane, fit.start_variance, rounds=6)
        if c.name == "reaction_delay"  # from scratch: drivers fitted without a delay are far from those with one
        else refitted(subject, with_cause(fit, c))
        for c in close
    ]
    if len(models) == 1:
        return close[0], models[0], ()
    left = np.array([errors(subject.windows, model).ade_m.mean() for model in models])
    best = int(np.argmin(left))
    rivals = {c.name for c, ade in zip(close, left, strict=True) if ade < RIVAL * left[best]} - {close[best].name}
    return close[best], models[best], tuple(sorted(rivals))


def _refined(
    subject: ev.Subject, fit: Fit, evidence: ev.Evidence, accepted: list[Accepted]
) -> tuple[list[Accepted], Fit, ev.Evidence]:
    """Move every accepted magnitude to where recording and twins agree."""
    for _ in range(REFINEMENTS):
        steps = [hy.local(evidence, cause.candidate.name) for cause in accepted]
        by_lane = fit.by_lane.copy()
        out = []
        for cause, step in zip(accepted, steps, strict=True):
            first = BY_NAME[cause.candidate.name].parameters[0]
            now = float(by_lane[0, first.slot])
            move = 0.0 if step is None else float(np.clip(step.value, -0.6 * abs(now), 0.6 * abs(now)))
            by_lane[:, first.slot] = np.clip(now + move, first.lower, first.upper)
            error = cause.error if step is None else step.error
            out.append(replace(cause, value=float(by_lane[0, first.slot]), error=error))
        accepted = out
        fit = refitted(subject, replace(fit, by_lane=by_lane), rounds=1)
        evidence = ev.rescored(subject, fit, evidence)
    return accepted, fit, evidence
