"""Which sizes of an effect would have been found: the effect is injected into the recording's own followers.

The fitted drivers, with the effect, follow the recorded leaders once more; their motion gets the drivers' own noise, is measured and
smoothed as the recording was, and is looked at as the recording was. An effect counts as found if it is believed and among the surest,
and, at the size that was injected, passes the gates of size and gain on the drivers that fit. That size need not be searched for, nothing
competes at its own size, and no drivers are held out, so shares are upper bounds.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import gain_gates, gates
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis.chance import Chance, draws
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.look import Look, Subject, look, score
from idm_sumo.diagnosis.replicates import driven_again, refit
from idm_sumo.diagnosis.result import Detectable
from idm_sumo.diagnosis.search import CLOSE, FIRST_REPLICATES, Found, replicates_of, with_its_noise
from idm_sumo.diagnosis.sizes import Tried, gain_of, with_cause
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.runtime.progress import Progress
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]

MULTIPLES = (0.5, 1.0, 2.0)  # of an effect's typical size
STAGE = "injecting effects"


def detectable(
    subject: Subject, found: Found, number: int, rng: np.random.Generator, progress: Progress
) -> tuple[Detectable, ...]:
    """Inject every effect that is not in the model at several sizes.

    Parameters
    ----------
    subject : Subject
    found : Found
        Outcome of the search; its model drives the followers.
    number : int
        Injections of each effect and size.
    rng : numpy.random.Generator
    progress : callable

    Returns
    -------
    tuple of Detectable
        By effect, sizes ascending.
    """
    there = {one.candidate.name for one in found.accepted}
    effects = [c for c in hy.candidates(found.first) if c.name not in there and c.name not in ev.ENDOGENOUS]
    plans = list(itertools.product(effects, MULTIPLES))
    laboratory = Laboratory(with_its_noise(subject, found.fit, rng), found.fit, rng)
    out = []
    for done, (effect, multiple) in enumerate(plans):
        progress(STAGE, done, len(plans))
        out.append(laboratory.trial(_usual(effect, multiple, laboratory.looked.regressors), number))
    progress(STAGE, len(plans), len(plans))
    return tuple(out)


def _usual(candidate: Candidate, multiple: float, regressors: list[rg.Regressor]) -> Candidate:
    """Return an effect in its usual form, at a multiple of its typical size; places, times and lanes as they look surest."""
    if not (np.isfinite(candidate.regressor.low) or candidate.regressor.lane):
        candidate = replace(
            candidate, regressor=next(regressor for regressor in regressors if regressor.name == candidate.name)
        )
    first = hy.acting_of(candidate)[0]
    sign = float(np.sign(candidate.value)) if candidate.name in hy.EITHER_SIGN else 1.0
    return replace(candidate, value=float(np.clip(sign * multiple * first.typical, first.lower, first.upper)))


class Injected(NamedTuple):
    """Followers with an effect, and their fit by the model without it."""

    windows: Windows
    fitted: Fit


class Laboratory:
    """The recording's followers without the effects to be injected, and what null replicates of them show."""

    def __init__(self, subject: Subject, fit: Fit, rng: np.random.Generator) -> None:
        self.subject, self.fit, self.rng = subject, fit, rng
        self.looked: Look = look(subject, fit, rg.build)
        chances = draws(subject.windows, subject.noises, replicates_of(subject, FIRST_REPLICATES), rng)
        self.nulls = ev.null_totals(subject, fit, chances, self.looked).corrected

    def trial(self, effect: Candidate, number: int) -> Detectable:
        """Return in how many injections an effect is found."""
        chances = draws(self.subject.windows, self.subject.noises, number, self.rng)
        hits = each_in_threads(lambda chance: self.is_found(effect, chance), chances)
        first = hy.acting_of(effect)[0]
        return Detectable(effect.name, first.symbol, first.unit, effect.value, int(sum(hits)), number)

    def is_found(self, effect: Candidate, chance: Chance) -> bool:
        """Return whether an effect, injected once, is believed, among the surest, and worth it at its size."""
        injected = self.injected(effect, chance)
        there = gates.believed(self.evidence(injected))
        tried = [c for c in there if gates.is_worth_trying(c, is_first=True)]
        close = [c for c in tried if c.z**2 > CLOSE * tried[0].z ** 2]
        seen = next((c for c in gates.with_what_it_may_hide(close, tried) if c.name == effect.name), None)
        return seen is not None and self.is_worth_it(injected, replace(seen, value=effect.value), there)

    def is_worth_it(self, injected: Injected, seen: Candidate, there: list[Candidate]) -> bool:
        """Return whether an effect at its size passes the gates of a first cause."""
        subject = replace(self.subject, windows=injected.windows)
        known = with_cause(injected.fitted, seen)
        known = refit(injected.windows, refit(injected.windows, known))
        gain = gain_of(subject, injected.fitted, known, np.random.default_rng(0))
        tried = Tried(seen, known, seen.z**2)
        return gates.is_there(tried) and gain_gates.is_worth_it(gain, tried, None, gates.surest_beside(seen, there))

    def injected(self, effect: Candidate, chance: Chance) -> Injected:
        """Return followers with an effect, and their fit by the model without it.

        What differs between drivers is injected into drivers drawn anew: fitted ones are of a recording without it.
        """
        followers, drivers = driven_again(
            self.subject.windows, self.fit, chance, drawn=effect.name in ev.BETWEEN, is_smooth=self.subject.is_smooth,
            having=lambda drivers: with_cause(drivers, effect),
        )  # fmt: skip
        return Injected(followers, refit(followers, refit(followers, drivers)))

    def evidence(self, injected: Injected) -> ev.Evidence:
        """Return what followers show at the model without the effect."""
        windows, fitted = injected
        own = score(self.subject, windows, fitted)[1].u @ self.looked.free_of_form
        return ev.Evidence(
            self.looked.regressors, ev.less_chance(own, self.nulls, windows), self.nulls, self.looked.gram,
            self.looked.found.part, windows.platoon, lane=windows.usual_lane,
        )  # fmt: skip
