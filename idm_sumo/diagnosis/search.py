"""The search for causes: examine, accept the best that passes every gate, refit, examine again."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import choice, free_gates, gates
from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.chance import Chance, draws
from idm_sumo.diagnosis.choice import Accepted, Known
from idm_sumo.diagnosis.edges import sharpened
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import LeftOver, told
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.one_lane import place_in_one_lane
from idm_sumo.diagnosis.recovery import is_over_at_once
from idm_sumo.diagnosis.regressors import Regressor
from idm_sumo.diagnosis.replicates import driver_noise
from idm_sumo.diagnosis.result import Estimate
from idm_sumo.diagnosis.sizes import Tried, anew, magnitude_of, refined, without_cause
from idm_sumo.diagnosis.together import two_together
from idm_sumo.diagnosis.windows import several_periods
from idm_sumo.models.effects import BY_NAME, slots
from idm_sumo.runtime.progress import Progress, silent

Floats = npt.NDArray[np.float64]

MOST_CAUSES = 3
CLOSE = 0.3  # of the best's squared z: from there on causes are brought to their sizes and compared
FIRST_REPLICATES, REPLICATES = 5, 3  # whether anything is there at all is looked at more closely than how much
MANY = 750  # drivers; of more, fewer replicates say as much
SHADOW = 0.65  # of the support of what was refused: with less, another may be no more than its shadow


@dataclass(frozen=True)
class Found:
    """Outcome of a search; ``share`` of the drivers have what only some have, and None says that nothing is so."""

    base: Fit
    fit: Fit
    accepted: tuple[Accepted, ...]
    without_gain: tuple[Candidate, ...]
    first: ev.Evidence
    last: ev.Evidence
    unexplained: tuple[LeftOver, ...]
    share: Estimate | None = None


@dataclass(frozen=True)
class NoInterval:
    """A place or a time that was put into the model and left another one about as sure: the form, and what was refused before."""

    form: Regressor
    without_gain: tuple[Candidate, ...]


@dataclass(frozen=True)
class Brief:
    """What a search goes by: names that are tried however sure they look, forms that are left out."""

    rng: np.random.Generator
    progress: Progress = silent
    asked: Container[str] = ()
    but: Container[Regressor] = ()


def search(
    subject: Subject, base: Fit, rng: np.random.Generator, progress: Progress, asked: Container[str] = ()
) -> Found:
    """Find the causes, strongest first; those that are ``asked`` for, as named beyond another law, are tried however sure they are."""
    chances = draws(subject.windows, subject.noises, replicates_of(subject, FIRST_REPLICATES), rng)
    first = ev.examine(subject, base, chances, progress=progress, stage="looking for causes", free=ff.families)
    known = Known()
    strange = _outside(subject, base, first, chances, known, progress)
    brief = Brief(rng, progress, asked)
    found = search_on(subject, base, first, strange, chances, known, brief)
    # Less there may have been meant where more elsewhere had been put, or the reverse.
    if isinstance(found, NoInterval):
        found = search_on(subject, base, first, strange, chances, known, replace(brief, but=(found.form,)))
    if isinstance(found, NoInterval):
        return Found(base, base, (), found.without_gain, first, first, left_without_causes(first))
    return found


def search_on(
    subject: Subject, base: Fit, first: ev.Evidence, strange: tuple[LeftOver, ...], chances: list[Chance], known: Known, brief: Brief,
    begin: tuple[Accepted, ...] = (),
) -> Found | NoInterval:  # fmt: skip
    """Find the causes after the first look, what was strange in it, and what climbed; or beside those with which to ``begin``."""
    fit, last, rng, progress = base, first, brief.rng, brief.progress
    accepted: list[Accepted] = []
    without: list[Candidate] = []
    while len(accepted) < MOST_CAUSES:
        chosen = begin or (
            _in_one_lane(subject, fit, strange, rng)
            if strange
            else _next(subject, fit, last, accepted, without, chances, brief, known)
        )
        if not chosen:
            break
        strange, known, begin = (), Known(), ()
        accepted += chosen
        newest = chosen[-1]
        progress(f"refining {newest.candidate.name}", 0, 1)
        subject = with_its_noise(subject, newest.tried.fit, rng)
        count = replicates_of(subject, REPLICATES)
        chances = draws(subject.windows, subject.noises, count, rng)  # not the chance that had a hand in the choice
        smaller = fit
        fit = refined(subject, newest.tried.fit, [cause.candidate.name for cause in accepted], chances, rng)
        if not all(_is_still_large(cause, fit) and not is_over_at_once(cause.candidate.name, fit) for cause in chosen):
            fit, without = smaller, [*without, *(cause.candidate for cause in chosen)]
            del accepted[-len(chosen) :]
            break
        last = _examined(subject, fit, accepted, chances, progress)
        if len(accepted) == 1 and _is_no_interval(newest.candidate, first, last):
            return NoInterval(newest.candidate.regressor, tuple(without))
        accepted = [_measured(cause, fit, last) for cause in accepted]
    left = told(strange) if strange or accepted else left_without_causes(first)
    found = Found(base, fit, tuple(accepted), tuple(without), first, last, left)
    return _without(found, free_gates.only_there_and_then(last), subject, chances, brief)


def _examined(
    subject: Subject, fit: Fit, accepted: list[Accepted], chances: list[Chance], progress: Progress
) -> ev.Evidence:
    """Return the evidence with causes in the model; of places and times whether they are so at all times, and places."""
    causes = [one.candidate for one in accepted if one.candidate.name in hy.SCANNED and not one.candidate.only_lanes]
    intervals = [interval for cause in causes if (interval := _interval(fit, cause.name)) is not None]
    free = ff.inside(intervals) if intervals and not several_periods(subject.windows) else None
    return ev.examine(subject, fit, chances, progress=progress, stage="looking for further causes", free=free)


def _interval(fit: Fit, name: str) -> ff.Interval | None:
    """Return the place or the time of a cause that is in the model; none of a drift, which is at no time another."""
    size, begin, end = BY_NAME[name].acting(fit.by_lane[0])
    if size.slot == slots.PERIOD_DRIFT:
        return None
    content = ff.ACCELERATION if size.slot == slots.PLACE else ff.HEADWAY
    value, low, high = (float(fit.by_lane[0, one.slot]) for one in (size, begin, end))
    return ff.Interval(gates.FREELY[name], low, high, content, float(np.sign(value)))


def _without(
    found: Found, there_and_then: tuple[LeftOver, ...], subject: Subject, chances: list[Chance], brief: Brief
) -> Found:
    """Return what was found without the places that are not so at all times, and the times that are not at all places."""
    if not there_and_then:
        return found
    refused = {one.subject for one in there_and_then}
    kept = [c for c in found.accepted if ff.WITHIN.get(gates.FREELY.get(c.candidate.name, "")) not in refused]
    if not kept:
        return replace(found, fit=found.base, accepted=(), last=found.first, unexplained=there_and_then)
    fit = found.fit
    for cause in found.accepted:
        if cause not in kept:
            fit = without_cause(fit, cause.candidate.name)
    fit = refined(subject, anew(subject, fit), [cause.candidate.name for cause in kept], chances, brief.rng)
    last = _examined(subject, fit, kept, chances, brief.progress)
    measured = tuple(_measured(cause, fit, last) for cause in kept)
    return replace(found, fit=fit, accepted=measured, last=last, unexplained=there_and_then)


def replicates_of(subject: Subject, most: int) -> int:
    """Return how many replicates to make: the more drivers, the surer is each."""
    return int(np.clip(round(most * MANY / subject.windows.drivers), 2, most))


def with_its_noise(subject: Subject, fit: Fit, rng: np.random.Generator) -> Subject:
    """Return the subject with the drivers' noise that a fit leaves: what the fit explains is none."""
    noise = driver_noise(subject.windows, fit, subject.noises, rng, is_smooth=subject.is_smooth)
    return replace(subject, noises=replace(subject.noises, driver=noise))


def left_without_causes(first: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return what is worth telling of the first look if no cause is named."""
    return told(free_gates.untold(first))


def _is_no_interval(candidate: Candidate, first: ev.Evidence, last: ev.Evidence) -> bool:
    """Return whether what goes on along the road or in time is more than the one place or time that was put into the model."""
    if candidate.only_lanes or not gates.is_another(candidate, last):
        return False
    return any(one.covariate == gates.FREELY[candidate.name] for one in free_gates.standing_out(first))


def _is_still_large(cause: Accepted, fit: Fit) -> bool:
    """Return whether a cause is large enough for a name with its refined size, too."""
    value = float(fit.by_lane[0, magnitude_of(fit, cause.candidate.name).slot])
    return replace(cause.candidate, value=value).large_enough


def _measured(cause: Accepted, fit: Fit, evidence: ev.Evidence) -> Accepted:
    """Return the cause with its refined size and its standard error there."""
    there = hy.local(evidence, cause.candidate.name)
    value = float(fit.by_lane[0, magnitude_of(fit, cause.candidate.name).slot])
    return replace(cause, value=value, error=cause.error if there is None else there.error)


def _outside(
    subject: Subject, fit: Fit, first: ev.Evidence, chances: list[Chance], known: Known, progress: Progress
) -> tuple[LeftOver, ...]:
    """Return what is free and belongs to no effect of the catalogue.

    Where the best effect, once at its size, says more than what is free, it is put into the model, its edges where they belong (a
    second beside, and drivers seem to answer otherwise there), and what is free is looked for again: then it counts only if it is
    still there, and if no second effect beside the first says more than that and takes it away. What is there and then only needs no
    such look: no cause of the catalogue is. Where drivers seem less steady it is looked for again whatever the best effect says: a time
    or a place that is not in the model makes them seem so.
    """
    strange = free_gates.outside(first)
    if not strange or free_gates.is_neither(strange[0]) or free_gates.is_stood_in_for(strange[0], first):
        return strange
    left, names, evidence = strange, list[str](), first
    for beside in (known, Known()):
        best = choice.most_supported(subject, fit, evidence, chances, names, beside)
        if best is None or (best.support < left[0].z ** 2 and not free_gates.is_unsteady(strange[0])):
            return strange
        names.append(best.candidate.name)
        fit = anew(subject, sharpened(subject, best.fit, names))
        evidence = ev.examine(
            subject, fit, chances, progress=progress, stage="looking for what is left", free=ff.families
        )
        if not free_gates.is_left(strange[0], evidence):
            return ()
        left = free_gates.outside(evidence)
    return strange


def _in_one_lane(
    subject: Subject, fit: Fit, strange: tuple[LeftOver, ...], rng: np.random.Generator
) -> tuple[Accepted, ...]:
    """Return the location in one lane only that what is strange is, if it passes the gates."""
    candidate = place_in_one_lane(strange[0])
    if candidate is None:
        return ()
    chosen = choice.judged(subject, fit, [candidate], None, [candidate], [], rng)[1]
    return () if chosen is None else (chosen,)


def _next(
    subject: Subject, fit: Fit, evidence: ev.Evidence, accepted: list[Accepted], without: list[Candidate],
    chances: list[Chance], brief: Brief, known: Known | None = None,
) -> tuple[Accepted, ...]:  # fmt: skip
    """Return the next cause that passes every gate and is no shadow of one that does not, with the refitted model; or none.

    What is there without gain is added to ``without``. Who, where, when or a lane change to come is no shadow
    of what was refused if it is still there with that in the model; beside it the refused may gain, and is asked again. Where nothing gains alone,
    or only a shadow, two may together.
    """
    used = {a.candidate.name for a in accepted} | {c.name for c in without}
    there = [c for c in gates.believed(evidence) if c.name not in used]
    open_ = [c for c in there if c.name in brief.asked or gates.is_worth_trying(c, is_first=not accepted)]
    if accepted:
        open_ = [c for c in open_ if not gates.is_rest_of_delay(c, evidence)]
    refused: Tried | None = None  # of most support, that was there and no cause
    while open_:
        close = gates.with_what_it_may_hide(
            [c for c in open_ if c.z**2 > CLOSE * open_[0].z ** 2][: choice.TRIED], open_
        )
        forms = [
            form for c in close for form in hy.forms(evidence, c)
            if form.regressor not in brief.but and not gates.is_past_unseen(form, evidence, used)
        ]  # fmt: skip
        if not forms:
            open_ = [c for c in open_ if c not in close]
            continue
        first = accepted[0].tried if accepted else None
        best, chosen = choice.judged(subject, fit, forms, first, there, chances, brief.rng, known)
        if chosen is not None:
            if refused is None or chosen.tried.support > SHADOW * refused.support:
                return (chosen,)
            if not choice.stands_beside(subject, refused, chosen.candidate, chances):
                break
            without[:] = [c for c in without if c.name != refused.candidate.name]
            return (chosen,)
        refused = best if refused is None else max(refused, best, key=lambda one: one.support)
        if gates.is_significant(best.candidate):
            without.append(best.candidate)
        open_ = [c for c in open_ if c.name != best.candidate.name]
    if refused is None or accepted:
        return ()
    both = two_together(subject, fit, refused, chances, brief.rng, brief.progress)
    without[:] = [c for c in without if c.name not in {cause.candidate.name for cause in both}]
    return both
