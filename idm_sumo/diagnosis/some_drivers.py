r"""A cause that some drivers have and others have not: who, by a mixture of each driver's likelihood with it and without.

Of drivers some of whom are late by 0.8 s, and the others not at all, no delay is right for all, and none of them gains anything on average.
Each driver alone says clearly which of the two it is. With :math:`g_i` the log-likelihood that a driver gains by having the cause, the share
:math:`s` of drivers who have it maximises :math:`\sum_i \log(1 - s + s e^{g_i})` (a mixture of two; McLachlan and Peel 2000), and who has it is
likelier with it, given the share.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from idm_sumo.diagnosis.chance import Chance, draws
from idm_sumo.diagnosis.driving import Road
from idm_sumo.diagnosis.evidence import Subject
from idm_sumo.diagnosis.fit import Fit, fit_drivers, fit_to_population
from idm_sumo.diagnosis.likelihood import log_likelihood
from idm_sumo.diagnosis.model import Placed, placed_of, with_effects
from idm_sumo.diagnosis.replicates import driven_again
from idm_sumo.diagnosis.result import Estimate
from idm_sumo.diagnosis.search import Found, Look
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.models.effects import BY_NAME
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Booleans = npt.NDArray[np.bool_]

MULTIPLES = (1.0, 2.0)  # of the typical size, at which those who have it may have it
DRIVEN = 2  # effects, of those of which a mixture of the scores says most
LEAST_SHARE, SHARES = 1e-4, np.linspace(0.002, 0.998, 250)
RARELY = 3.84  # twice the log-likelihood, that chance takes off a share in one of twenty cases


class Mixture(NamedTuple):
    """A share of the drivers, and the log-likelihood that they gain if so many have a cause, and the others not.

    Within ``ci95`` a share is not so much less likely that chance would rarely have it so (the likelihood's own 95 % interval).
    """

    share: float
    support: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Some:
    """A cause that some drivers have.

    Attributes
    ----------
    placed : Placed
    hypothesis : int
        Of the look at no effects.
    fit : Fit
        Of drivers of both kinds.
    windows : Windows
        Those of drivers who have it not driven without it.
    share : Estimate
        Of the drivers who have it.
    support : float
        Log-likelihood over that of what all have.
    """

    placed: Placed
    hypothesis: int
    fit: Fit
    windows: Windows
    share: Estimate
    support: float


def mixture(gain: Floats) -> Mixture:
    """Return the likeliest share of drivers who have what each gains so much log-likelihood by, shape ``(drivers,)``."""

    def unlikely(share: float) -> float:
        return -float(np.logaddexp(np.log1p(-share), np.log(share) + gain).sum())

    found = minimize_scalar(unlikely, bounds=(LEAST_SHARE, 1.0 - LEAST_SHARE), method="bounded")
    within = [share for share in (*SHARES, found.x) if 2.0 * (unlikely(share) - found.fun) <= RARELY]
    return Mixture(float(found.x), -float(found.fun), (float(min(within)), float(max(within))))


def has(gain: Floats, share: float) -> Booleans:
    """Return who of the drivers more likely has the cause than not, given the share of all who do."""
    return np.asarray(gain + np.log(share) - np.log1p(-share) > 0.0)


def some_who_differ(subject: Subject, found: Found, rng: np.random.Generator) -> Some | None:
    """Return the cause that some drivers have, if that makes the recording likelier than what is in the model.

    The scores say which forms are worth driving. Of these the one is taken by which the recording is likeliest, and only if it is so by more
    than chance makes at the stated rate of false alarms beside what null replicates show, and so many have it that it rests on enough drivers.
    """
    windows, settings, first = subject.windows, found.settings, found.first
    chance = settings.chance
    road = Road(windows, found.base, first.library.plan)
    base, _ = road.driven(())
    named = float((road.driven(found.last.effects)[0] - base).sum()) if found.last.effects else 0.0

    def driven(tried: tuple[int, Placed]) -> tuple[Mixture, Floats]:
        gain = road.driven((tried[1],))[0] - base
        return mixture(gain), gain

    worth = list(_worth_driving(first))
    if not worth:
        return None
    each = each_in_threads(driven, worth)
    best = max(range(len(each)), key=lambda n: each[n][0].support)
    found_share, gain = each[best]
    beside = max(named, *(float(one.sum()) for _, one in each))
    if found_share.support < beside + chance:
        return None
    having = has(gain, found_share.share)
    if min(having.sum(), (~having).sum()) < settings.least_drivers:
        return None
    hypothesis, placed = worth[best]
    if found_share.support - beside < max(_of_replicates(subject, found, placed, rng)) + chance:
        return None
    return _refined(windows, found, hypothesis, placed, having, beside)


def _of_replicates(subject: Subject, found: Found, placed: Placed, rng: np.random.Generator) -> list[float]:
    """Return by how much a mixture beats models of all alike in replicates of the model that all have: noise and refitting make that of it.

    Where a cause shows in a few moments only, drivers err in them more than the covariance of all moments says.
    """
    models = ((placed,), (), *filter(None, [found.last.effects]))

    def beaten(chance: Chance) -> float:
        null, _ = driven_again(subject.windows, found.last.fit, chance, drawn=False, is_smooth=subject.is_smooth)
        road = Road(null, found.base, found.first.library.plan)
        with_it, without, *named = (road.driven(effects)[0] for effects in models)
        gain = with_it - without
        beside = max(0.0, float(gain.sum()), *(float((one - without).sum()) for one in named))
        return mixture(gain).support - beside

    return each_in_threads(beaten, draws(subject.windows, subject.noises, found.settings.replicates, rng))


def _refined(
    windows: Windows, found: Found, hypothesis: int, placed: Placed, having: Booleans, beside: float
) -> Some | None:
    """Return the cause with drivers of both kinds fitted together, and who has it by their own windows then."""
    apart = told_apart(windows, having)
    with_it = with_effects(found.base, (placed,), found.first.library.plan)
    both = fit_drivers(apart, of_two_kinds(with_it, found.base).by_lane, found.base.start_variance)
    gain = gain_of_each(windows, both)
    mixed = mixture(gain)
    having = has(gain, mixed.share)
    least = found.settings.least_drivers
    if min(having.sum(), (~having).sum()) < least:
        return None
    apart = told_apart(windows, having)
    share = Estimate(mixed.share, "1", mixed.ci95)
    return Some(placed, hypothesis, both, apart, share, mixed.support - beside)


def _worth_driving(look: Look) -> Iterator[tuple[int, Placed]]:
    """Yield every form of the effects of which a mixture of drivers' scores says most, over what all drivers alike say."""
    library = look.library
    more = {n: _more_of_some(look, n) for n in range(len(library.family)) if _may_differ(look, n)}
    by_family: dict[str, float] = {}
    for number, said in more.items():
        name = library.group_of(number).name
        by_family[name] = max(said, by_family.get(name, 0.0))
    chance = look.settings.chance
    likely = sorted((name for name in by_family if by_family[name] > chance), key=lambda name: -by_family[name])
    driven: set[tuple[object, ...]] = set()
    for number in more:
        group = library.group_of(number)
        for multiple in MULTIPLES if group.name in likely[:DRIVEN] else ():
            sign = 1.0 if library.lower[number] >= 0.0 else float(np.sign(library.mix[number].dot(look.score)[0]))
            one = placed_of(library, number, sign * multiple * library.size[number], ())
            what = (one.name, one.form.slot, one.form.fixed, one.value)
            if what not in driven:
                driven.add(what)
                yield number, one


def _may_differ(look: Look, number: int) -> bool:
    """Return whether a hypothesis is of an effect that some drivers may have, everywhere and always, and others not."""
    group = look.library.group_of(number)
    return not (group.axes or group.lane or group.present or group.is_free or BY_NAME[group.name].between)


def _more_of_some(look: Look, number: int) -> float:
    """Return how much likelier drivers' scores are if some have a hypothesis, and others not, than if all have it alike."""
    library, phi = look.library, look.evidence.inflation
    row = library.mix[number]
    score = look.evidence.by_driver[:, row.indices] @ row.data / phi
    information = np.maximum(look.evidence.part[:, row.indices] @ (row.data**2), 0.0) / phi
    alike = float(score.sum()) ** 2 / max(2.0 * float(information.sum()), 1e-300)
    signs = (1.0,) if library.lower[number] >= 0.0 else (1.0, -1.0)
    sizes = [sign * n * library.size[number] for sign in signs for n in MULTIPLES]
    return max(mixture(size * score - 0.5 * size**2 * information).support for size in sizes) - alike


def of_two_kinds(with_it: Fit, without: Fit) -> Fit:
    """Return a fit with the magnitudes of drivers with and without a cause, the second half of the rows without; the drivers not yet refitted."""
    return replace(with_it, by_lane=np.concatenate([with_it.by_lane, without.by_lane]), rolled=None)


def gain_of_each(windows: Windows, fit: Fit) -> Floats:
    """Return the log-likelihood that each driver gains by having what only some have, shape ``(drivers,)``; none without a window.

    ``fit`` is of drivers of both kinds, its population known; the windows may be of other drivers.
    """
    nobody = np.zeros(len(windows.seen), dtype=bool)
    each = [windows.without(nobody), windows.without(~nobody)]
    with_it, without = (log_likelihood(kind, fit_to_population(kind, fit)) for kind in each)
    return np.asarray(with_it - without)


def told_apart(windows: Windows, having: Booleans) -> Windows:
    """Return the windows, those of drivers who have not the cause driven without it; ``having`` of shape ``(drivers,)``."""
    return windows.without(~having[windows.driver])


def by_their_other_windows(windows: Windows, fit: Fit, share: float) -> Windows:
    """Return the windows, each driven with the cause or without as the driver's other windows say, every second of them.

    So what decides is not what the decision is then judged by. A driver with a single window is what most drivers are.
    """
    first = np.searchsorted(windows.driver, np.arange(windows.drivers))
    is_even = (np.arange(len(windows.driver)) - first[windows.driver]) % 2 == 0
    without = np.zeros(len(windows.driver), dtype=bool)
    for half in (is_even, ~is_even):
        others = has(gain_of_each(windows.of_rows(np.flatnonzero(~half)), fit), share)
        without[half] = ~others[windows.driver[half]]
    return windows.without(without)
