r"""A cause that some drivers have and others have not: who, by a mixture of each driver's likelihood with it and without.

Of drivers some of whom are late by 0.8 s, and the others not at all, no delay is right for all, and none of them gains anything on average.
Each driver alone says clearly which of the two it is. With :math:`g_i` the log-likelihood that a driver gains by having the cause, the share
:math:`s` of drivers who have it maximises :math:`\sum_i \log(1 - s + s e^{g_i})` (a mixture of two; McLachlan and Peel 2000), and who has it is
likelier with it, given the share.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis.fit import Fit, fit_drivers, fit_to_population
from idm_sumo.diagnosis.gain_gates import LAWLIKE
from idm_sumo.diagnosis.likelihood import log_likelihood
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.models.effects import slots
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]

# Effects at a large size, each in the forms that differ most: who has less of it is likelier with so much, too, than without.
LARGE: tuple[rg.Regressor, ...] = tuple(
    rg.Regressor(name, fixed[0][1], fixed)
    for name, fixed in (
        ("reaction_delay", ((slots.DELAY, 0.8),)),
        ("reaction_delay", ((slots.DELAY, 0.8), rg.KNOWN[0])),
        ("reaction_delay", ((slots.DELAY, 0.8), rg.KNOWN[1])),
        ("multi_leader_anticipation", ((slots.SECOND_LEADER, 0.3),)),
        ("multi_leader_anticipation", ((slots.SECOND_LEADER, 0.4), (slots.SECOND_SPEED_ONLY, 1.0))),
        ("lane_change_relaxation", ((slots.RELAXATION, 0.75), (slots.RELAXATION_TIME, 12.0))),
        ("acceleration_asymmetry", ((slots.ASYMMETRY, 0.4),)),
        ("leader_class", ((slots.LEADER_CLASS, 0.4),)),
        ("perception_threshold", ((slots.BAND, 0.8),)),
        ("hysteresis", ((slots.HYSTERESIS, 0.25),)),
        ("adjacent_lane_friction", ((slots.FRICTION, 0.08),)),
    )
)
LEAST_DRIVERS = 24  # who seem to have it, to look at them alone
FEW_ROUNDS = 8  # of the fits that are compared
LEAST_SHARE, SHARES = 1e-4, np.linspace(0.002, 0.998, 250)
RARELY = 3.84  # twice the log-likelihood, that chance takes off a share in one of twenty cases
# Twice the log-likelihood that a mixture gains, from which on some drivers may have a cause; by how many times more it must be than what
# all of them gain, by having it or by what is named, and than what a mixture of any other effect gains; and their least share: a few whom no
# law fits say whatever is asked. (Of 29 recordings with nothing hidden, all that had more than 125 was of 5 to 14 %. Of eleven some of whose
# drivers had a delay, a relaxation or watched a second leader, the surest mixture was of that, 130 to 9600, and of 17 to 42 %.)
SURE, TIMES, FEWEST = 150.0, 2.0, 0.15


class Mixture(NamedTuple):
    """A share of the drivers, and twice the log-likelihood that they gain if so many have a cause, and the others not.

    Within ``ci95`` a share is not so much less likely that chance would rarely have it so (the likelihood's own 95 % interval).
    """

    share: float
    support: float
    ci95: tuple[float, float]


class Some(NamedTuple):
    """A cause that some drivers seem to have: its name, how many, and who; shape ``(drivers,)``."""

    name: str
    share: float
    has: Booleans


def mixture(gain: Floats) -> Mixture:
    """Return the likeliest share of drivers who have what each gains so much log-likelihood by, shape ``(drivers,)``."""

    def unlikely(share: float) -> float:
        return -2.0 * float(np.logaddexp(np.log1p(-share), np.log(share) + gain).sum())

    found = minimize_scalar(unlikely, bounds=(LEAST_SHARE, 1.0 - LEAST_SHARE), method="bounded")
    within = [share for share in (*SHARES, found.x) if unlikely(share) - found.fun <= RARELY]
    return Mixture(float(found.x), -float(found.fun), (float(min(within)), float(max(within))))


def has(gain: Floats, share: float) -> Booleans:
    """Return who of the drivers more likely has the cause than not, given the share of all who do."""
    return np.asarray(gain + np.log(share) - np.log1p(-share) > 0.0)


def some_who_differ(windows: Windows, base: Fit, named: Fit) -> Some | None:
    """Return the cause that some drivers have, if a mixture of one effect says far more than of any other, and than what all have.

    Parameters
    ----------
    windows : Windows
    base : Fit
        Without any cause.
    named : Fit
        With what is named so far, which all drivers have.
    """
    without = log_likelihood(windows, base)

    def gained(regressor: rg.Regressor) -> Floats:
        with_it = rg.with_regressor(base.by_lane, regressor)
        fit = fit_drivers(windows, with_it, base.start_variance, rounds=FEW_ROUNDS)
        return log_likelihood(windows, fit) - without

    each = each_in_threads(gained, LARGE)
    mixtures = [mixture(gain) for gain in each]
    best = max(range(len(LARGE)), key=lambda n: mixtures[n].support)
    name, found = LARGE[best].name, mixtures[best]
    others = [one.support for regressor, one in zip(LARGE, mixtures, strict=True) if regressor.name != name]
    all_alike = [2.0 * float(gain.sum()) for regressor, gain in zip(LARGE, each, strict=True) if regressor.name == name]
    beside = max(*others, *all_alike, 2.0 * float((log_likelihood(windows, named) - without).sum()))
    # Not every driver need follow the law, and an asymmetry is what any other one looks like.
    if name == LAWLIKE or found.share < FEWEST or found.support < max(SURE, TIMES * beside):
        return None
    return Some(name, found.share, has(each[best], found.share))


def of_two_kinds(with_it: Fit, without: Fit) -> Fit:
    """Return a fit with the magnitudes of drivers with and without a cause, the second half of the rows without; the drivers not yet refitted."""
    return replace(with_it, by_lane=np.concatenate([with_it.by_lane, without.by_lane]))


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


def by_their_windows(windows: Windows, fit: Fit, share: float) -> Windows:
    """Return the windows, those of drivers who are likelier without the cause driven without it."""
    return told_apart(windows, has(gain_of_each(windows, fit), share))


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
