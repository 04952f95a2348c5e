"""The search for causes: examine, accept the best that passes every gate, refit, examine again."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import free_gates, gain_gates, gates
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.atoms import Atom
from idm_sumo.diagnosis.edges import sharpened
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import LeftOver, told
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.luck import Luck, draws
from idm_sumo.diagnosis.one_lane import place_in_one_lane
from idm_sumo.diagnosis.recovery import is_over_at_once
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.sizes import DELAY, Tried, anew, climbed, gain_of, magnitude_of, refined, typical_ade
from idm_sumo.diagnosis.twins import driver_noise
from idm_sumo.progress import Progress, silent

Floats = npt.NDArray[np.float64]

MOST_CAUSES = 3
CLOSE = 0.3  # of the best's squared z: from there on causes are brought to their sizes and compared
TRIED = 3
FIRST_TWINS, TWINS = 5, 3  # whether anything is there at all is looked at more closely than how much
HEARD = 1  # of them, on the way to the size of a delay
MANY = 750  # drivers; of more, fewer twins say as much
SHADOW = 0.65  # of the support of what was refused: with less, another may be no more than its shadow
FORM = 0.5  # of the best form's support: one of the same effect with less is not taken for it, however it drives
WANTED = 20.0  # support that says of itself that all drivers have a cause
RIVAL = 0.85  # of the best cause's support: one with as much cannot be told apart


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


@dataclass(frozen=True)
class NoInterval:
    """A place or a time that was put into the model and left another one about as sure: the form, and what was refused before."""

    form: Atom
    without_gain: tuple[Candidate, ...]


def search(subject: Subject, base: Fit, rng: np.random.Generator, progress: Progress) -> Found:
    """Find the causes, strongest first."""
    lucks = draws(subject.windows, subject.noises, _twins_of(subject, FIRST_TWINS), rng)
    first = ev.examine(subject, base, lucks, progress=progress, stage="looking for causes", free=True)
    known = Known()
    strange = _outside(subject, base, first, lucks, known, progress)
    found = _search(subject, base, first, strange, lucks, (), known, rng, progress)
    # Less there may have been meant where more elsewhere had been put, or the reverse.
    if isinstance(found, NoInterval):
        found = _search(subject, base, first, strange, lucks, (found.form,), known, rng, progress)
    if isinstance(found, NoInterval):
        return Found(base, base, (), found.without_gain, first, first, left_without_causes(first))
    return found


def _search(
    subject: Subject, base: Fit, first: ev.Evidence, strange: tuple[LeftOver, ...], lucks: list[Luck],
    but: tuple[Atom, ...], known: Known, rng: np.random.Generator, progress: Progress,
) -> Found | NoInterval:  # fmt: skip
    """Find the causes, none of them in the forms ``but``, after the first look, what was strange in it, and what climbed."""
    fit, last = base, first
    accepted: list[Accepted] = []
    without: list[Candidate] = []
    while len(accepted) < MOST_CAUSES:
        chosen = (
            _in_one_lane(subject, fit, strange, rng)
            if strange
            else _next(subject, fit, last, accepted, without, lucks, rng, but, known)
        )
        if chosen is None:
            break
        strange, known = (), Known()
        accepted.append(chosen)
        progress(f"refining {chosen.candidate.name}", 0, 1)
        subject = with_its_noise(subject, chosen.tried.fit, rng)
        count = _twins_of(subject, TWINS)
        lucks = draws(subject.windows, subject.noises, count, rng)  # not the luck that had a hand in the choice
        smaller = fit
        fit = refined(subject, chosen.tried.fit, [cause.candidate.name for cause in accepted], lucks, rng)
        if not _is_still_large(chosen, fit) or is_over_at_once(chosen.candidate.name, fit):
            fit, without = smaller, [*without, accepted.pop().candidate]
            break
        last = ev.examine(subject, fit, lucks, progress=progress, stage="looking for further causes")
        if len(accepted) == 1 and _is_no_interval(chosen.candidate, first, last):
            return NoInterval(chosen.candidate.atom, tuple(without))
        accepted = [_measured(cause, fit, last) for cause in accepted]
    left = told(strange) if strange or accepted else left_without_causes(first)
    return Found(base, fit, tuple(accepted), tuple(without), first, last, left)


def _twins_of(subject: Subject, most: int) -> int:
    """Return how many twins to hear: the more drivers, the surer is each."""
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
    subject: Subject, fit: Fit, first: ev.Evidence, lucks: list[Luck], known: Known, progress: Progress
) -> tuple[LeftOver, ...]:
    """Return what is free and belongs to no effect of the catalogue.

    Where the best effect, once at its size, says more than what is free, it is put into the model, its edges where they belong (a
    second beside, and drivers seem to answer otherwise there), and what is free is looked for again: then it counts only if it is
    still there, and if no second effect beside the first says more than that and takes it away. What is there and then only needs no
    such look: no cause of the catalogue is.
    """
    strange = free_gates.outside(first)
    if not strange or free_gates.is_neither(strange[0]) or free_gates.is_in_the_foot(strange[0]):
        return strange
    left, names, evidence = strange, list[str](), first
    for beside in (known, Known()):
        best = _most_supported(subject, fit, evidence, lucks, names, beside)
        if best is None or best.support < left[0].z ** 2:
            return strange
        names.append(best.candidate.name)
        fit = anew(subject, sharpened(subject, best.fit, names))
        evidence = ev.examine(subject, fit, lucks, progress=progress, stage="looking for what is left", free=True)
        if not free_gates.is_left(strange[0], evidence):
            return ()
        left = free_gates.outside(evidence)
    return strange


def _most_supported(
    subject: Subject, fit: Fit, evidence: ev.Evidence, lucks: list[Luck], but: Container[str], known: Known
) -> Tried | None:
    """Return the likely effect, none of those named, with most support once at its size."""
    likely = [c for c in gates.believed(evidence) if gates.is_likely(c) and c.name not in but][:TRIED]
    each = [_at_size(subject, fit, form, lucks, known) for c in likely for form in hy.forms(evidence, c)]
    return max((one for one in each if gates.is_there(one)), key=lambda one: one.support, default=None)


def _in_one_lane(
    subject: Subject, fit: Fit, strange: tuple[LeftOver, ...], rng: np.random.Generator
) -> Accepted | None:
    """Return the location in one lane only that what is strange is, if it passes the gates."""
    candidate = place_in_one_lane(strange[0])
    return None if candidate is None else _judged(subject, fit, [candidate], None, [candidate], [], rng)[1]


def _next(
    subject: Subject, fit: Fit, evidence: ev.Evidence, accepted: list[Accepted], without: list[Candidate],
    lucks: list[Luck], rng: np.random.Generator, but: Container[Atom] = (), known: Known | None = None,
) -> Accepted | None:  # fmt: skip
    """Return the next cause that passes every gate and is no shadow of one that does not, with the refitted model.

    What is there without gain is added to ``without``; the forms ``but`` are left out. Who, where or when is no shadow of what was
    refused if it is still there with that in the model; beside it the refused may gain, and is asked again.
    """
    used = {a.candidate.name for a in accepted} | {c.name for c in without}
    there = [c for c in gates.believed(evidence) if c.name not in used]
    open_ = [c for c in there if gates.is_worth_trying(c, is_first=not accepted)]
    if accepted:
        open_ = [c for c in open_ if not gates.is_rest_of_delay(c, evidence)]
    refused: Tried | None = None  # of most support, that was there and no cause
    while open_:
        close = gates.with_what_it_may_hide([c for c in open_ if c.z**2 > CLOSE * open_[0].z ** 2][:TRIED], open_)
        forms = [
            form for c in close for form in hy.forms(evidence, c)
            if form.atom not in but and not gates.is_past_unseen(form, evidence, used)
        ]  # fmt: skip
        if not forms:
            open_ = [c for c in open_ if c not in close]
            continue
        best, chosen = _judged(subject, fit, forms, accepted[0].tried if accepted else None, there, lucks, rng, known)
        if chosen is not None and (refused is None or chosen.tried.support > SHADOW * refused.support):
            return chosen
        if chosen is not None and refused is not None and _stands_beside(subject, refused, chosen.candidate, lucks):
            without[:] = [c for c in without if c.name != refused.candidate.name]
            return chosen
        if chosen is not None:
            return None
        refused = best if refused is None else max(refused, best, key=lambda one: one.support)
        if gates.is_significant(best.candidate):
            without.append(best.candidate)
        open_ = [c for c in open_ if c.name != best.candidate.name]
    return None


def _stands_beside(subject: Subject, refused: Tried, candidate: Candidate, lucks: list[Luck]) -> bool:
    """Return whether who, where or when, which no motion makes up, is still there with what was refused in the model."""
    if candidate.name not in gates.OUTER:
        return False
    evidence = ev.examine(subject, refused.fit, lucks, progress=silent, stage="")
    there = next((c for c in hy.candidates(evidence) if c.name == candidate.name), None)
    return there is not None and there.value * candidate.value > 0.0 and there.z**2 > gates.STILL * candidate.z**2


def _judged(
    subject: Subject, fit: Fit, forms: list[Candidate], first: Tried | None, there: list[Candidate], lucks: list[Luck],
    rng: np.random.Generator, known: Known | None = None,
) -> tuple[Tried, Accepted | None]:  # fmt: skip
    """Return the best of several candidates, and it as a cause if it passes every gate beside all that is there."""
    best, rivals = _strongest(subject, fit, forms, lucks, rng, known)
    best = replace(best, fit=anew(subject, best.fit))
    gain = gain_of(subject, fit, best.fit, rng)
    candidate = best.candidate
    # A likelihood that gains next to nothing, or falls, although vehicles are driven clearly better: not all drivers have it. What
    # they have on average, as the score near zero sees it, must be large enough then.
    on_average = any(form.near_enough for form in forms if form.name == candidate.name)
    wanted = best.support > WANTED or (gain.ci95[0] > 0.0 and on_average)
    passes = (
        wanted
        and gates.is_there(best)
        and gain_gates.is_worth_it(gain, best, first, gates.surest_beside(candidate, there))
    )
    return best, Accepted(best, candidate.value, candidate.error, gain, rivals) if passes else None


def _strongest(
    subject: Subject, fit: Fit, close: list[Candidate], lucks: list[Luck], rng: np.random.Generator,
    known: Known | None = None,
) -> tuple[Tried, tuple[str, ...]]:  # fmt: skip
    """Bring each candidate to its size and return the best, and those of other names with nearly as much support.

    Of an effect's forms those count that are significant and large enough at their size, if any is. The best has most support,
    unless another drives the vehicles clearly better: where no form is quite right, the likelihood may hold on to how errors vary
    together more than to where the vehicles are. Of causes with nearly as much support the one that drives them best is taken.
    Which of two places (or times) is meant, support alone decides: what one has too much the other has too little. So it does
    between forms of an effect of which one has far less, and between a delay and the hysteresis that it looks like.
    """
    each = [_at_size(subject, fit, c, lucks, {} if known is None else known) for c in close]
    there = {tried.candidate.name for tried in each if gates.is_there(tried)}
    believed = [tried for tried in each if gates.is_there(tried) or tried.candidate.name not in there]
    most, *others = sorted(believed, key=lambda t: -t.support)
    alike = [t for t in others if t.support > RIVAL * most.support and t.candidate.name != most.candidate.name]
    rivals = {t.candidate.name for t in [most, *alike]}
    best = min([most, *alike], key=lambda t: typical_ade(subject, t.fit)) if alike else most
    for other in [t for t in [most, *others] if t is not best]:
        if not _support_decides(other, best) and gain_of(subject, best.fit, other.fit, rng).ci95[0] > 0.0:
            best = other
    return best, tuple(sorted(rivals - {best.candidate.name}))


def _at_size(subject: Subject, fit: Fit, candidate: Candidate, lucks: list[Luck], known: Known) -> Tried:
    """Return a candidate at its size, from those that are there already if it is one of them."""
    if candidate not in known:
        known[candidate] = climbed(subject, fit, candidate, lucks[:HEARD])
    return known[candidate]


def _support_decides(other: Tried, best: Tried) -> bool:
    """Return whether support alone decides between two candidates.

    So it is with places or times, where a form of an effect has far less, and with what is easily taken for a delay: in drivers of
    another law it may drive a little better than the delay they have, with less of what a delay alone explains.
    """
    if best.candidate.name != other.candidate.name:
        return best.candidate.name == DELAY and other.candidate.name == gates.LIKE_A_DELAY
    return best.candidate.name in hy.SCANNED or other.support < FORM * best.support
