"""Which sizes of an effect would have been found: the effect is injected into the recording's own followers.

The fitted drivers, with the effect, follow the recorded leaders once more; their motion gets the drivers' own noise, is measured and
smoothed as the recording was, and competes as the recording did. An effect counts as found if it wins on enough drivers. Its size is not
searched for, nor its gain measured, so shares are upper bounds.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import selection as se
from idm_sumo.diagnosis.chance import Chance, draws
from idm_sumo.diagnosis.library import Library, magnitude_of
from idm_sumo.diagnosis.model import Placed, placed_of, whole_score, with_effects
from idm_sumo.diagnosis.replicates import driven_again, refit
from idm_sumo.diagnosis.result import Detectable
from idm_sumo.diagnosis.search import Found, Look, winners
from idm_sumo.models.effects import BY_NAME
from idm_sumo.runtime.progress import Progress
from idm_sumo.runtime.threads import each_in_threads

MULTIPLES = (0.5, 1.0, 2.0)  # of an effect's typical size
STAGE = "injecting effects"


def detectable(
    subject: ev.Subject, found: Found, number: int, rng: np.random.Generator, progress: Progress
) -> tuple[Detectable, ...]:
    """Inject every effect that is not in the model at several sizes.

    Parameters
    ----------
    subject : Subject
    found : Found
        Outcome of the search; its last model drives the followers.
    number : int
        Injections of each effect and size.
    rng : numpy.random.Generator
    progress : callable

    Returns
    -------
    tuple of Detectable
        By effect, sizes ascending.
    """
    look = found.last
    there = {one.name for one in look.effects}
    names = [name for name in look.library.names if name in BY_NAME and name not in there] if number else []
    plans = list(itertools.product(names, MULTIPLES))
    out = []
    for done, (name, multiple) in enumerate(plans):
        progress(STAGE, done, len(plans))
        injected = _usual(look, name, multiple)
        injection = Injection(subject, look, injected)
        hits = each_in_threads(injection.finds, draws(subject.windows, subject.noises, number, rng))
        first = injected.magnitude
        out.append(Detectable(name, first.symbol, first.unit, injected.value, int(sum(hits)), number))
    return tuple(out)


def _usual(look: Look, name: str, multiple: float) -> Placed:
    """Return an effect at a multiple of its typical size, in the form, place and time in which it looks surest."""
    library, component = look.library, look.selection.components[-1]
    seen = component.deviation / library.size  # of a form that nothing in the recording tells of, the prior's
    asked = _of_name(library, name)
    asked &= seen < 1.5 * seen[asked].min()
    best = int(np.argmax(np.where(asked, component.log_bf + np.log(library.within), -np.inf)))
    sign = float(np.sign(component.size[best])) or 1.0
    return placed_of(library, best, sign * multiple * magnitude_of(library.group_of(best)).typical, ())


def _of_name(library: Library, name: str) -> npt.NDArray[np.bool_]:
    return np.asarray(library.family == library.names.index(name))


@dataclass(frozen=True)
class Injection:
    """The recording's followers at a look's model, with an effect beside."""

    subject: ev.Subject
    look: Look
    injected: Placed

    def finds(self, chance: Chance) -> bool:
        """Return whether the effect, injected once, wins on enough drivers.

        What differs between drivers is injected into drivers drawn anew: fitted ones are of a recording without it.
        """
        look, windows = self.look, self.subject.windows
        beside = (*look.effects, self.injected)
        followers, drivers = driven_again(
            windows, look.fit, chance, drawn=BY_NAME[self.injected.name].between, is_smooth=self.subject.is_smooth,
            having=lambda fit: with_effects(fit, beside, look.library.plan),
        )  # fmt: skip
        fitted = refit(followers, refit(followers, drivers))
        scores = ev.by_driver(followers, fitted, look.library.plan, look.evidence.measure)
        evidence = replace(look.evidence, u=scores, of_blocks=look.evidence.of_blocks or look.evidence)
        score = whole_score(evidence, look.effects)
        selection = se.compete(evidence, look.library, look.settings, score)
        seen = replace(look, evidence=evidence, score=score, selection=selection)
        return self.injected.name in winners(seen)
