"""Two causes that gain together and hide each other alone."""

from __future__ import annotations

import numpy as np

from idm_sumo.diagnosis import choice, gain_gates, gates
from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.chance import Chance
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.sizes import Tried, anew, gain_of, without_cause
from idm_sumo.runtime.progress import Progress


def two_together(
    subject: Subject, fit: Fit, refused: Tried, chances: list[Chance], rng: np.random.Generator, progress: Progress
) -> tuple[Accepted, ...]:
    """Return what was refused because it does not gain, and what gains beside it, if neither is worth anything without the other.

    Drivers who relax and brake harder than they accelerate, say, come back to their gaps slower than a relaxation alone has them: with
    it alone rollouts are no better, and without it the asymmetry is hardly to be seen.

    Parameters
    ----------
    subject : Subject
    fit : Fit
        Without either.
    refused : Tried
        Of most support, beside ``fit``.
    chances : list of Chance
    rng : numpy.random.Generator
    progress : callable

    Returns
    -------
    tuple of Accepted
        Both, that which was refused first; empty unless each gains clearly beside the other, and both do beside neither.
    """
    if (
        not gates.is_significant(refused.candidate)
        or refused.candidate.name in ev.ENDOGENOUS
        or not gates.is_there(refused)
    ):
        return ()
    evidence = ev.examine(subject, refused.fit, chances, progress=progress, stage="looking for two causes at once")
    there = [c for c in gates.believed(evidence) if c.name != refused.candidate.name]
    likely = [c for c in there if gates.is_worth_trying(c, is_first=False)][: choice.TRIED]
    forms = [form for c in likely for form in hy.forms(evidence, c)]
    if not forms:
        return ()
    _, second = choice.judged(subject, refused.fit, forms, refused, there, chances, rng)
    if second is None or not gain_gates.is_clear(gain_of(subject, fit, second.tried.fit, rng)):
        return ()
    alone = anew(subject, without_cause(second.tried.fit, refused.candidate.name))
    gain = gain_of(subject, alone, second.tried.fit, rng)
    if not gain_gates.is_clear(gain):
        return ()
    candidate = refused.candidate
    return Accepted(refused, candidate.value, candidate.error, gain, ()), second
