"""Which effect it is: candidates are brought to their sizes, the best is chosen and asked whether it may be a cause."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, replace

import numpy as np

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import gain_gates, gates
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.chance import Chance
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.regressors import KNOWN
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.sizes import DELAY, Tried, anew, climbed, gain_of, typical_ade
from idm_sumo.runtime.progress import silent
from idm_sumo.runtime.threads import each_in_threads

TRIED = 3  # effects at most, that are brought to their sizes and compared
EVALUATED = 2  # of the replicates, on the way to the size of a candidate; where there are two only, as of many drivers, one says as much
FORM = 0.5  # of the best form's support: one of the same effect with less is not taken for it, however it drives
FAR_LESS = (
    0.35  # of the best cause's support: another with less is at most what the best one looks like, however it drives
)
WANTED = 20.0  # support that says of itself that all drivers have a cause
RIVAL = 0.85  # of the best cause's support: one with as much cannot be told apart

MORE = 2  # things known in spite of a delay, from which on a form is tried only if less says that it is worth it
Form = frozenset[tuple[int, float]]  # what is known in spite of a delay

Known = dict[Candidate, Tried]  # candidates at their sizes beside one model: a climb is the dearest there is


@dataclass(frozen=True)
class Accepted:
    """A cause in the model, as it came, with its refined size and its gain on the drivers that fit."""

    tried: Tried
    value: float
    error: float
    gain: Gain
    rivals: tuple[str, ...]

    @property
    def candidate(self) -> Candidate:
        """The evidence with which it came."""
        return self.tried.candidate


def judged(
    subject: Subject, fit: Fit, forms: list[Candidate], first: Tried | None, there: list[Candidate], chances: list[Chance],
    rng: np.random.Generator, known: Known | None = None,
) -> tuple[Tried, Accepted | None]:  # fmt: skip
    """Return the best of several candidates, and it as a cause if it passes every gate beside all that is there.

    What says less than the best, both at their sizes, is not held against it, however sure it looked near zero.
    """
    known = {} if known is None else known
    best, rivals = strongest(subject, fit, forms, chances, rng, known)
    gain = gain_of(subject, fit, best.fit, rng)
    candidate = best.candidate
    # A likelihood that gains next to nothing, or falls, although vehicles are driven clearly better: not all drivers have it. What
    # they have on average, as the score near zero sees it, must be large enough then.
    on_average = any(form.near_enough for form in forms if form.name == candidate.name)
    wanted = best.support > WANTED or (gain.ci95[0] > 0.0 and on_average)
    passes = (
        wanted
        and gates.is_there(best)
        and gain_gates.is_worth_it(gain, best, first, gates.surest_beside(candidate, _not_outdone(there, best, known)))
    )
    return best, Accepted(best, candidate.value, candidate.error, gain, rivals) if passes else None


def _not_outdone(there: list[Candidate], best: Tried, known: Known) -> list[Candidate]:
    """Return what is there without the effects that have been brought to their sizes and say less there than the best, in any form."""
    support: dict[str, float] = {}
    for tried in known.values():
        support[tried.candidate.name] = max(tried.support, support.get(tried.candidate.name, -np.inf))
    return [c for c in there if support.get(c.name, np.inf) >= best.support]


def strongest(
    subject: Subject, fit: Fit, close: list[Candidate], chances: list[Chance], rng: np.random.Generator,
    known: Known | None = None,
) -> tuple[Tried, tuple[str, ...]]:  # fmt: skip
    """Bring each candidate to its size and return the best, and those of other names with nearly as much support.

    Of an effect's forms those count that are significant and large enough at their size, if any is. The best has most support,
    unless another drives the vehicles clearly better: where no form is quite right, the likelihood may hold on to how errors vary
    together more than to where the vehicles are. Of causes with nearly as much support the one that drives them best is taken.
    Which of two places (or times) is meant, support alone decides unless both have nearly as much: what one has too much the other has too
    little. So it does between what has far less and what has more, and between a delay and the hysteresis that it looks like.
    Those that it does not decide between are compared at rest.
    """
    each = at_sizes(subject, fit, close, chances, {} if known is None else known)
    there = {tried.candidate.name for tried in each if gates.is_there(tried)}
    believed = [tried for tried in each if gates.is_there(tried) or tried.candidate.name not in there]
    most, *others = sorted(believed, key=lambda t: -t.support)
    compared = [t for t in others if _is_rival(t, most) or not _support_decides(t, most)]
    most, *others = _at_rest(subject, [most, *compared])
    alike = [t for t in others if _is_rival(t, most)]
    rivals = {t.candidate.name for t in [most, *alike]}
    best = min([most, *alike], key=lambda t: typical_ade(subject.windows, t.fit)) if alike else most
    for other in [t for t in [most, *others] if t is not best]:
        if not _support_decides(other, best) and gain_of(subject, best.fit, other.fit, rng).ci95[0] > 0.0:
            best = other
    return best, tuple(sorted(rivals - {best.candidate.name}))


def at_sizes(subject: Subject, fit: Fit, each: list[Candidate], chances: list[Chance], known: Known) -> list[Tried]:
    """Return candidates at their sizes, from those that are there already where they are among them.

    A climb to a delay is the dearest there is: that of drivers who know more than one thing in spite of it is made only if a form
    with one thing less has more support than those with two less.
    """

    def climb(some: list[Candidate]) -> list[Tried]:
        new = [c for c in some if c not in known]
        evaluated = chances[: EVALUATED if len(chances) > EVALUATED else 1]
        known.update(zip(new, each_in_threads(lambda c: climbed(subject, fit, c, evaluated), new), strict=True))
        return [known[c] for c in some]

    late = [c for c in each if c.name == DELAY]
    support = {_late_form(c): -np.inf for c in late}
    tried = climb([c for c in each if len(_late_form(c)) < MORE])
    for many in range(MORE, len(KNOWN) + 1):
        support |= {_late_form(t.candidate): t.support for t in tried if t.candidate.name == DELAY}
        tried += climb([c for c in late if len(_late_form(c)) == many and _is_wanted(_late_form(c), support)])
    return tried


def _at_rest(subject: Subject, each: list[Tried]) -> list[Tried]:
    """Return what was tried with drivers fitted from scratch: after a climb some are farther from where they come to rest than others.

    (A dead band of 1 m/s, hidden beyond another law, had come as a soft one of 0.75: its own form, once at rest, drives an eighth nearer.)
    """
    fits = each_in_threads(lambda tried: anew(subject, tried.fit), each)
    return [replace(tried, fit=fit) for tried, fit in zip(each, fits, strict=True)]


def _is_rival(other: Tried, most: Tried) -> bool:
    """Return whether another cause has nearly as much support as the one that has most."""
    return other.support > RIVAL * most.support and other.candidate.name != most.candidate.name


def _late_form(candidate: Candidate) -> Form:
    """Return what drivers know in spite of a delay; nothing of another effect."""
    return frozenset(candidate.regressor.fixed[1:] if candidate.name == DELAY else ())


def _is_wanted(form: Form, support: Mapping[Form, float]) -> bool:
    """Return whether a form of a delay with one known thing less has more support than any with two less.

    Not each: without what else is known, one of them may say less. (Who knows a new leader and his own speed at once, under full velocity
    difference: the speed alone 142, neither 222, the leader alone 650, both 764, and in the approach rate, too, 921.)

    ``support`` is that of all forms that there are, minus infinity where it was not asked.
    """

    def with_one_less(form: Form) -> list[Form]:
        return [form - {one} for one in form if form - {one} in support]

    return any(
        support[less] > max((support[least] for least in with_one_less(less)), default=-np.inf)
        for less in with_one_less(form)
    )


def _support_decides(other: Tried, best: Tried) -> bool:
    """Return whether support alone decides between two candidates.

    So it is with places or times of which one has clearly less (less braking before a place, and braking at it, had 136 and 124 of support, and
    drove 0.304 and 0.279 m off), with forms that have far less, and with what is easily taken for a delay: in drivers of another law it
    may drive a little better than the delay they have, with less of what a delay alone explains. Where few drivers have a delay, one
    for all of them drives the others worse, and an asymmetry with a fourth of its support does not. Nor does a follower's place, which tells of its
    leader's noise, decide against what says far more.
    """
    if best.candidate.name != other.candidate.name:
        far_less = other.support < FAR_LESS * best.support
        if best.candidate.name == DELAY:
            return far_less or other.candidate.name == gates.LIKE_A_DELAY
        return far_less and other.candidate.name in ev.ENDOGENOUS
    enough = RIVAL if best.candidate.name in hy.SCANNED else FORM
    return other.support < enough * best.support


def most_supported(
    subject: Subject, fit: Fit, evidence: ev.Evidence, chances: list[Chance], but: Container[str], known: Known
) -> Tried | None:
    """Return the likely effect, none of those named, with most support once at its size."""
    likely = [c for c in gates.believed(evidence) if gates.is_likely(c) and c.name not in but][:TRIED]
    each = at_sizes(subject, fit, [form for c in likely for form in hy.forms(evidence, c)], chances, known)
    return max((one for one in each if gates.is_there(one)), key=lambda one: one.support, default=None)


def stands_beside(subject: Subject, refused: Tried, candidate: Candidate, chances: list[Chance]) -> bool:
    """Return whether what no motion makes up (who, where, when, a lane change to come) is still there with what was refused in the model."""
    if candidate.name not in gates.NO_MOTION:
        return False
    evidence = ev.examine(subject, refused.fit, chances, progress=silent, stage="")
    there = next((c for c in hy.candidates(evidence) if c.name == candidate.name), None)
    return there is not None and there.value * candidate.value > 0.0 and there.z**2 > gates.STILL * candidate.z**2
