"""The search for a cause that only some drivers have, and for what is there beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idm_sumo.diagnosis import choice, gates
from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis import some_drivers as sd
from idm_sumo.diagnosis.chance import draws
from idm_sumo.diagnosis.choice import Accepted, Known
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.likelihood import log_likelihood
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.result import Estimate
from idm_sumo.diagnosis.search import (
    FIRST_REPLICATES,
    Brief,
    Found,
    NoInterval,
    replicates_of,
    search_on,
    with_its_noise,
)
from idm_sumo.diagnosis.sizes import Tried, anew
from idm_sumo.runtime.progress import Progress
from idm_sumo.runtime.threads import each_in_threads

# What drivers some of whom are late may seem to have on average. (In one of five such recordings the asymmetry had no rival.)
STAND_INS = ("acceleration_asymmetry", "hysteresis")


def search_among_some(subject: Subject, found: Found, rng: np.random.Generator, progress: Progress) -> Found:
    """Find a cause that only some drivers have, and what is there beside it, or return what was ``found``.

    It is asked for where nothing is named, or something that may as well be another, or stand in for it. Those who have it are examined alone, as all were, and
    must show it so surely that it passes every gate.
    """
    first = found.accepted[0] if found.accepted else None
    if found.unexplained or (first is not None and not first.rivals and first.candidate.name not in STAND_INS):
        return found
    progress("looking for what some drivers have", 0, 1)
    some = sd.some_who_differ(subject.windows, found.base, found.fit)
    cause = None if some is None else _as_they_show_it(subject, found.base, some, rng, progress)
    if some is None or cause is None:
        return found
    gain = sd.gain_of_each(subject.windows, cause.tried.fit)  # now that it has its size
    mixed = sd.mixture(gain)
    subject = replace(subject, windows=sd.told_apart(subject.windows, sd.has(gain, mixed.share)))
    begin = replace(cause, tried=replace(cause.tried, fit=anew(subject, cause.tried.fit)))
    again = search_on(subject, found.base, found.first, (), [], Known(), Brief(rng, progress), (begin,))
    if isinstance(again, NoInterval) or some.name not in {one.candidate.name for one in again.accepted}:
        return found
    return replace(again, share=Estimate(mixed.share, "1", mixed.ci95))


def _as_they_show_it(
    subject: Subject, base: Fit, some: sd.Some, rng: np.random.Generator, progress: Progress
) -> Accepted | None:
    """Return the cause as those show it who seem to have it, if it passes every gate there, its fit of all drivers.

    Of its forms at their sizes the one by which all drivers are likeliest: near the edge of stability, where some are so late, the integral
    over the way there says less.
    """
    theirs = replace(subject, windows=subject.windows.of_drivers(np.flatnonzero(some.has)))
    if theirs.windows.drivers < sd.LEAST_DRIVERS:
        return None
    own = anew(theirs, base)
    theirs = with_its_noise(theirs, own, rng)
    chances = draws(theirs.windows, theirs.noises, replicates_of(theirs, FIRST_REPLICATES), rng)
    evidence = ev.examine(theirs, own, chances, progress=progress, stage="looking at those who seem to have it")
    there, known = gates.believed(evidence), Known()
    forms = [form for c in there if c.name == some.name for form in hy.forms(evidence, c)]
    cause = choice.judged(theirs, own, forms, None, there, chances, rng, known)[1] if forms else None
    if cause is None:
        return None
    everybody = replace(subject, windows=sd.told_apart(subject.windows, some.has))

    def of_all(tried: Tried) -> Tried:
        return replace(tried, fit=anew(everybody, sd.of_two_kinds(tried.fit, base)))

    each = each_in_threads(of_all, [tried for tried in known.values() if gates.is_there(tried)])
    return replace(cause, tried=max(each, key=lambda tried: float(log_likelihood(everybody.windows, tried.fit).sum())))
