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
from idm_sumo.diagnosis.result import Gain
from idm_sumo.effects import BY_NAME, Parameter
from idm_sumo.progress import Progress

Floats = npt.NDArray[np.float64]

TWINS = 3
REFINEMENTS = 5
ROUNDS_OF_TWINS = 3
MOST_CAUSES = 3
SIGNIFICANT = 1e-3  # corrected p of a cause
CLEAR = 5.0  # standard errors that a further cause needs, beside its share of the first one's evidence
FURTHER_SHARE = 0.06  # of the first cause's squared z, for a further one: less is what its shape leaves over
LEAST_GAIN = 0.004  # of the ADE, on the drivers that fit
NO_DOUBT = 6.0  # standard errors, from which on any gain will do
ROUNDS = 12  # of a fit from scratch
CLOSE = 0.3  # of the best's squared z: from there on causes are brought to their sizes and compared
TRIED = 3
CLIMBS = 5
LONGEST_MOVE, SETTLED = 0.6, 0.02  # of a magnitude, in one step; below, it has settled
LARGEST_FACTOR = 6.0  # by which steps may grow
DELAYS = (0.2, 0.45, 0.8)  # s
RIVAL = 0.85  # of the best cause's support: one with as much cannot be told apart
LEAST_FREE = 0.05  # m/s^2
FREE_EXCESS = 1.5  # times the best cause's squared z: from there on a free field says the catalogue does not hold it
FREE_CLEAR = 5.2  # standard errors of a free field, if no cause is found
FREE_RULES = 7.0  # and of one that keeps causes from being looked for


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


def anew(subject: ev.Subject, fit: Fit) -> Fit:
    """Return drivers, population and noise fitted from scratch to the same magnitudes: fits on the way to rest do not compare."""
    return fit_drivers(subject.windows, fit.by_lane, fit.start_variance, rounds=ROUNDS)


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
        progress(f"refining {candidate.name}", 0, 1)
        fit = _refined(subject, fit, [cause.candidate.name for cause in accepted], rng)
        last = ev.examine(subject, fit, rng, twins=TWINS, progress=progress, stage="looking for further causes")
        accepted = [_measured(cause, fit, last) for cause in accepted]
    left = tuple(strange) if strange else tuple(c for c in hy.free(last)[:3] if _stands_out(c)) if not accepted else ()
    return Found(base, fit, tuple(accepted), tuple(without), first, last, left)


def _measured(cause: Accepted, fit: Fit, evidence: ev.Evidence) -> Accepted:
    """Return the cause with its refined size and its standard error there."""
    there = hy.local(evidence, cause.candidate.name)
    value = float(fit.by_lane[0, _first(cause.candidate.name).slot])
    return replace(cause, value=value, error=cause.error if there is None else there.error)


def _stands_out(free: Candidate) -> bool:
    return abs(free.z) > FREE_CLEAR and abs(free.value) > LEAST_FREE


def _outside(evidence: ev.Evidence) -> list[Candidate]:
    """Return the free fields that say more than any effect of the catalogue."""
    best = max((c.z**2 for c in hy.candidates(evidence) if c.large_enough), default=0.0)
    return [c for c in hy.free(evidence)[:3] if _stands_out(c) and c.z**2 > FREE_EXCESS * best + FREE_RULES**2]


def _next(
    subject: ev.Subject, fit: Fit, evidence: ev.Evidence, accepted: list[Accepted], without: list[Candidate],
    rng: np.random.Generator,
) -> tuple[Candidate, Fit, float, tuple[str, ...]] | None:  # fmt: skip
    """Return the next cause that passes every gate, with the refitted model."""
    used = {a.candidate.name for a in accepted} | {c.name for c in without}
    open_ = [c for c in hy.candidates(evidence) if c.name not in used and c.near_enough and c.p < SIGNIFICANT]
    if accepted:
        needed = max(CLEAR**2, FURTHER_SHARE * accepted[0].candidate.z ** 2)
        open_ = [c for c in open_ if c.z**2 > needed]
    while open_:
        close = [c for c in open_ if c.z**2 > CLOSE * open_[0].z ** 2][:TRIED]
        best, rivals = _strongest(subject, fit, [form for c in close for form in hy.forms(evidence, c)])
        model = anew(subject, best.fit)
        before, after = errors(subject.windows, fit).ade_m, errors(subject.windows, model).ade_m
        gain = compare("ade_m", before, after, subject.windows.platoon, rng, held_out=False)
        if best.candidate.large_enough and _worth_it(gain, best.candidate):
            return best.candidate, model, gain.difference, rivals
        without.append(best.candidate)
        open_ = [c for c in open_ if c.name != best.candidate.name]
    return None


def _worth_it(gain: Gain, candidate: Candidate) -> bool:
    """Return whether rollouts are better for a cause: clearly, or at all if there is no doubt that it is there."""
    clearly = gain.difference >= LEAST_GAIN * gain.base and gain.ci95[0] > 0.0
    return clearly or (abs(candidate.z) > NO_DOUBT and gain.difference > 0.0)


@dataclass(frozen=True)
class Tried:
    """A candidate at the size where the data want it, and how much they want it (twice the log-likelihood's gain)."""

    candidate: Candidate
    fit: Fit
    support: float


def _strongest(subject: ev.Subject, fit: Fit, close: list[Candidate]) -> tuple[Tried, tuple[str, ...]]:
    """Bring each candidate to its size and return the one with most support, and those with nearly as much."""
    tried = sorted((_climbed(subject, fit, c) for c in close), key=lambda t: -t.support)
    best = tried[0]
    rivals = {t.candidate.name for t in tried[1:] if t.support > RIVAL * best.support} - {best.candidate.name}
    return best, tuple(sorted(rivals))


def _climbed(subject: ev.Subject, fit: Fit, candidate: Candidate) -> Tried:
    """Move a candidate's magnitude to where its score vanishes.

    The score near zero underrates what is not linear (a dead band, a long delay) or what the fitted drivers have absorbed. The
    integral of the score over the magnitude, freed from the twins' at every point, is the log-likelihood that it gains.
    """
    if candidate.name == "reaction_delay":
        now = _delayed(subject, fit, candidate)
    else:
        now = refitted(subject, with_cause(fit, candidate), rounds=2)
    slot = _first(candidate.name).slot
    value, before, score, support = float(now.by_lane[0, slot]), 0.0, candidate.score, 0.0
    error, stride = candidate.error, Stride()
    for _ in range(CLIMBS):
        step = ev.local_scores(subject, now)[candidate.name]
        free = step.score - candidate.bias
        support += (score + free) * (value - before)
        before, score, error = (
            value,
            free,
            candidate.error * np.sqrt(candidate.information / max(step.information, 1e-9)),
        )
        value = stride.moved(candidate.name, value, free / max(step.information, 1e-9))
        if stride.settled:
            break
        by_lane = now.by_lane.copy()
        by_lane[:, slot] = value
        now = refitted(subject, replace(now, by_lane=by_lane), rounds=1)
    return Tried(replace(candidate, value=value, error=error), now, support)


def _delayed(subject: ev.Subject, fit: Fit, candidate: Candidate) -> Fit:
    """Return the fit with the delay that leaves least, from scratch: drivers fitted without one are far from those with it."""
    models = [
        fit_drivers(subject.windows, with_cause(fit, candidate, size).by_lane, fit.start_variance, rounds=6)
        for size in DELAYS
    ]
    return min(models, key=lambda model: float(errors(subject.windows, model).ade_m.mean()))


def _refined(subject: ev.Subject, fit: Fit, names: list[str], rng: np.random.Generator) -> Fit:
    """Move the magnitudes in the model to where recording and twins agree.

    What twins show depends on the model that drives them, and they begin where the recorded vehicles were, which the true
    effect put there: so twins are made anew until nothing moves.
    """
    strides = {name: Stride() for name in names}
    for _ in range(ROUNDS_OF_TWINS):
        bias = ev.local_biases(subject, fit, rng, twins=TWINS)
        for _ in range(REFINEMENTS):
            by_lane, steps = fit.by_lane.copy(), ev.local_scores(subject, fit)
            for name, stride in strides.items():
                slot = _first(name).slot
                free = steps[name].score - bias[name].score
                by_lane[:, slot] = stride.moved(
                    name, float(by_lane[0, slot]), free / max(steps[name].information, 1e-9)
                )
            fit = refitted(subject, replace(fit, by_lane=by_lane), rounds=1)
            if all(stride.settled for stride in strides.values()):
                break
        if all(stride.settled for stride in strides.values()):
            break
    return anew(subject, fit)


class Stride:
    """Steps towards the size of a magnitude that grow as long as they go the same way.

    The population follows a magnitude only slowly (expectation and maximisation), and the score with it: a step that is right
    for the drivers as they are is too short.
    """

    def __init__(self) -> None:
        self.settled = False
        self._factor, self._last = 0.5, 0.0

    def moved(self, name: str, value: float, step: float) -> float:
        """Return the magnitude after a step: within its bounds, and off zero, where no further step could be taken."""
        same = step * self._last > 0.0
        self._factor = (
            min(2.0 * self._factor, LARGEST_FACTOR) if same or not self._last else max(0.25 * self._factor, 0.5)
        )
        self._last, self.settled = step, abs(step) < SETTLED * abs(value)
        first = _first(name)
        longest = LONGEST_MOVE * abs(value)
        moved = value + float(np.clip(self._factor * step, -longest, longest))
        return float(np.clip(moved, first.lower, first.upper)) or 1e-3 * first.typical


def _first(name: str) -> Parameter:
    return BY_NAME[name].parameters[0]
