"""The search for causes: examine, accept the best that passes every gate, refit, examine again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.free_fields import CHANGES, DOUBTFUL, HELD
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import LeftOver, told
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.luck import Luck, draws
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.sizes import Tried, anew, climbed, gain_of, magnitude_of, refined
from idm_sumo.progress import Progress

Floats = npt.NDArray[np.float64]

MOST_CAUSES = 3
SIGNIFICANT = 1e-3  # corrected p of a cause
# Standard errors. What smoothing hides of a leader is in part its answer to the second one, and the twins' leaders do not follow; what
# drivers of another law do after a cut-in looks a little like relaxation.
SURER = {"multi_leader_anticipation": 6.0, "lane_change_relaxation": 5.0}
CLEAR = 5.0  # standard errors that a further cause needs, beside its share of the first one's evidence
FURTHER_SHARE = 0.06  # of the first cause's squared z, for a further one: less is what its shape leaves over
LEAST_GAIN = 0.004  # of the ADE, on the drivers that fit
UNTWINNED_GAIN = 0.02  # of the ADE, for what has no null twin: a follower answers its leader, so its place tells of the leader's noise
SURE, BEYOND_DOUBT = 4.8, 7.0  # standard errors, from which on any gain will do, and no loss beyond chance
CHANCE = 0.01  # of the ADE
CLOSE = 0.3  # of the best's squared z: from there on causes are brought to their sizes and compared
TRIED = 3
FIRST_TWINS, TWINS = 5, 3  # whether anything is there at all is looked at more closely than how much
RIVAL = 0.85  # of the best cause's support: one with as much cannot be told apart
# Standard errors from which on something free stands out; a response that changes, of which there are most looks, and what
# another car-following model looks like, too, need more.
FREE_CLEAR, FREE_CHANGED, FREE_DOUBTFUL = 5.5, 6.5, 9.0
# Times the best cause's squared z, and more, from which on the catalogue does not hold it. A response that changes from place to
# place, or with time, is what goes beyond the same change everywhere, and has to be only half as sure as that.
FREE_EXCESS, FREE_CHANGE, FREE_MORE = 1.5, 0.5, 25.0


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
    unexplained: tuple[LeftOver, ...]


def search(subject: Subject, base: Fit, rng: np.random.Generator, progress: Progress) -> Found:
    """Find the causes, strongest first."""
    fit = base
    accepted: list[Accepted] = []
    without: list[Candidate] = []
    first = last = ev.examine(
        subject, fit, draws(subject.windows, subject.noises, FIRST_TWINS, rng),
        progress=progress, stage="looking for causes", free=True,
    )  # fmt: skip
    lucks: list[Luck] = []  # other luck for the sizes: that of the first look had a hand in the choice
    strange = _outside(first)
    while not strange and len(accepted) < MOST_CAUSES:
        chosen = _next(subject, fit, last, accepted, without, rng)
        if chosen is None:
            break
        candidate, fit, gained, rivals = chosen
        accepted.append(Accepted(candidate, candidate.value, candidate.error, gained, rivals))
        progress(f"refining {candidate.name}", 0, 1)
        lucks = lucks or draws(subject.windows, subject.noises, TWINS, rng)
        fit = refined(subject, fit, [cause.candidate.name for cause in accepted], lucks, rng)
        last = ev.examine(subject, fit, lucks, progress=progress, stage="looking for further causes")
        accepted = [_measured(cause, fit, last) for cause in accepted]
    left = told(strange) if strange or accepted else left_without_causes(first)
    return Found(base, fit, tuple(accepted), tuple(without), first, last, left)


def left_without_causes(first: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return what is worth telling of the first look if no cause is named."""
    return told(tuple(one for one in first.free if _stands_out(one)))


def _measured(cause: Accepted, fit: Fit, evidence: ev.Evidence) -> Accepted:
    """Return the cause with its refined size and its standard error there."""
    there = hy.local(evidence, cause.candidate.name)
    value = float(fit.by_lane[0, magnitude_of(cause.candidate.name).slot])
    return replace(cause, value=value, error=cause.error if there is None else there.error)


def _may_be(candidate: Candidate) -> bool:
    """Return whether a candidate is significant, and may turn out large enough."""
    return candidate.near_enough and candidate.p < SIGNIFICANT and abs(candidate.z) > SURER.get(candidate.name, 0.0)


def _stands_out(free: LeftOver) -> bool:
    usual = FREE_CHANGED if free.covariate.startswith(CHANGES) else FREE_CLEAR
    return free.large_enough and abs(free.z) > (FREE_DOUBTFUL if free.covariate.endswith(DOUBTFUL) else usual)


def _outside(evidence: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return what is free and says more than any effect of the catalogue that might be accepted."""
    best = max((c.z**2 for c in hy.candidates(evidence) if _may_be(c)), default=0.0)

    def needed(one: LeftOver) -> float:
        return FREE_MORE + best * (FREE_CHANGE if one.covariate.startswith(CHANGES) else FREE_EXCESS)

    new = (one for one in evidence.free if best == 0.0 or one.covariate not in HELD)
    return tuple(one for one in new if _stands_out(one) and one.z**2 > needed(one))


def _next(
    subject: Subject, fit: Fit, evidence: ev.Evidence, accepted: list[Accepted], without: list[Candidate],
    rng: np.random.Generator,
) -> tuple[Candidate, Fit, float, tuple[str, ...]] | None:  # fmt: skip
    """Return the next cause that passes every gate, with the refitted model."""
    used = {a.candidate.name for a in accepted} | {c.name for c in without}
    open_ = [c for c in hy.candidates(evidence) if c.name not in used and _may_be(c)]
    if accepted:
        needed = max(CLEAR**2, FURTHER_SHARE * accepted[0].candidate.z ** 2)
        open_ = [c for c in open_ if c.z**2 > needed]
    while open_:
        close = [c for c in open_ if c.z**2 > CLOSE * open_[0].z ** 2][:TRIED]
        best, rivals = _strongest(subject, fit, [form for c in close for form in hy.forms(evidence, c)], rng)
        model = anew(subject, best.fit)
        gain = gain_of(subject, fit, model, rng)
        if best.candidate.large_enough and _worth_it(gain, best.candidate, further=bool(accepted)):
            return best.candidate, model, gain.difference, rivals
        without.append(best.candidate)
        open_ = [c for c in open_ if c.name != best.candidate.name]
    return None


def _worth_it(gain: Gain, candidate: Candidate, *, further: bool) -> bool:
    """Return whether rollouts are better for a cause: clearly; at all, if it is surely there; not worse, if beyond doubt.

    A further cause must make them better, nine to one, however sure it is: what the first one's form leaves over is there, too.
    """
    enough = gain.difference >= LEAST_GAIN * gain.base
    clearly = enough and gain.ci95[0] > 0.0
    if candidate.name in ev.ENDOGENOUS:
        return clearly and gain.difference >= UNTWINNED_GAIN * gain.base
    if clearly:
        return True
    if further:
        return enough and gain.is_likely
    z, share = abs(candidate.z), gain.difference / gain.base
    return (z > SURE and share > 0.0) or (z > BEYOND_DOUBT and share > -CHANCE)


def _strongest(
    subject: Subject, fit: Fit, close: list[Candidate], rng: np.random.Generator
) -> tuple[Tried, tuple[str, ...]]:
    """Bring each candidate to its size and return the best, and those of other names with nearly as much support.

    The best has most support, unless another drives the vehicles clearly better: where no form is quite right, the likelihood
    may hold on to how errors vary together more than to where the vehicles are.
    """
    best, *others = sorted((climbed(subject, fit, c) for c in close), key=lambda t: -t.support)
    rivals = {t.candidate.name for t in others if t.support > RIVAL * best.support}
    for other in others:
        if other.candidate.name != best.candidate.name and gain_of(subject, best.fit, other.fit, rng).ci95[0] > 0.0:
            best = other
    return best, tuple(sorted(rivals - {best.candidate.name}))
