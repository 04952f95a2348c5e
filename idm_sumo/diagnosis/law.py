"""Which car-following law the drivers follow, before anything beyond it is looked for.

Of drivers who follow another law than the IDM, the IDM leaves something wherever they follow. That looks like one effect or another
(a delay, a headway that changes with speed), and hides what the drivers do beyond their law.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis.fit import ROUNDS, Fit, fit_drivers
from idm_sumo.diagnosis.gain import compare, driven, typical
from idm_sumo.diagnosis.likelihood import log_likelihood
from idm_sumo.diagnosis.result import Gain, LawCompared
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.models import laws
from idm_sumo.models.effects import slots
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]
# Drivers, and rounds of their fits, by which laws are compared before the best one is fitted to all.
SOME, FEW_ROUNDS = 120, 8
FITTED_TO_ALL = 3  # of the likeliest other laws, at most
# Standard errors of the log-likelihood's gain, by which another law must be likelier than the IDM.
SURE = 3.0


def of(law: int, reaction: float = laws.REACTION) -> Floats:
    """Return the magnitudes of a law without any effect, shape ``(9, slots.COUNT)``; of Krauss's with a reaction time (s)."""
    by_lane = PLAIN.copy()
    by_lane[:, slots.LAW], by_lane[:, slots.REACTION_CHANGE] = law, reaction - laws.REACTION
    return by_lane


def law_of(fit: Fit) -> int:
    """Return the number of the law that a fit's drivers follow."""
    return int(fit.by_lane[0, slots.LAW])


def reaction_of(fit: Fit) -> float:
    """Return the time (s) in which a fit's drivers reach their safe speed, if they follow Krauss's law."""
    return float(laws.REACTION + fit.by_lane[0, slots.REACTION_CHANGE])


class Followed(NamedTuple):
    """Drivers by the law that they follow.

    Attributes
    ----------
    fit : Fit
    likelier : Gain or None
        Negative log-likelihood of a driver by the IDM, and by the law that they follow; None if that is the IDM.
    by_law : mapping of str to LawCompared
        What each law, by its name, makes of the drivers that were asked.
    forms : tuple of float64, shape (9, slots.COUNT)
        Magnitudes of each law, as it is likeliest.
    """

    fit: Fit
    likelier: Gain | None
    by_law: Mapping[str, LawCompared]
    forms: tuple[Floats, ...]


def followed(windows: Windows, base: Fit, rng: np.random.Generator) -> Followed:
    """Return the drivers fitted by the law that they most likely follow, ``base`` unless another one is clearly likelier than the IDM.

    Likelier, not nearer to each fitted driver: of laws that say as much, the one whose parameters take up more of the drivers' noise is
    nearer.

    Parameters
    ----------
    windows : Windows
    base : Fit
        By the IDM.
    rng : numpy.random.Generator
        Of the drivers that are asked first.
    """
    asked = np.sort(rng.permutation(windows.drivers)[:SOME])
    some = windows.of_drivers(asked)
    fits = each_in_threads(lambda law: _fitted(some, law, base), range(len(laws.NAMES)))
    forms = tuple(fit.by_lane for fit in fits)
    each = np.stack([log_likelihood(some, fit) for fit in fits])
    likelier = each - each[laws.IDM]
    by_law = {
        name: LawCompared(typical_ade(some, fit), float(gain.mean()))
        for name, fit, gain in zip(laws.NAMES, fits, likelier, strict=True)
    }
    likeliest = sorted(range(1, len(laws.NAMES)), key=lambda law: -float(likelier[law].mean()))
    may_be = [
        law for law in likeliest if _may_be_likelier(likelier[law]) and _may_be_likelier(each[law] - each[likeliest[0]])
    ]
    best, gain = base, None
    for law in may_be[:FITTED_TO_ALL]:
        other = fit_drivers(windows, forms[law], base.start_variance, rounds=ROUNDS)
        more = likelihood_gain(windows, base, other, rng)
        if gain is None or more.difference > gain.difference:
            best, gain = other, more
    if gain is None:
        return Followed(base, None, by_law, forms)
    return Followed(best, gain, by_law, forms) if is_sure(gain) else Followed(base, None, by_law, forms)


def likelihood_gain(windows: Windows, before: Fit, after: Fit, rng: np.random.Generator) -> Gain:
    """Return by how much drivers are likelier by one fit than by another; its metric is the negative log-likelihood of a driver."""
    each = [-log_likelihood(windows, fit) for fit in (before, after)]
    return compare("unlikelihood", each[0], each[1], windows.platoon, rng, held_out=False)


def is_sure(gain: Gain) -> bool:
    """Return whether drivers are surely likelier."""
    return gain.difference > SURE * gain.standard_error


def _standard_error(gain: Floats) -> float:
    """Return that of the mean over drivers."""
    return float(gain.std() / np.sqrt(len(gain)))


def _may_be_likelier(gain: Floats) -> bool:
    """Return whether all drivers may be likelier, by so much on the mean of some of them."""
    return bool(gain.mean() + SURE * _standard_error(gain) >= 0.0)


def _fitted(windows: Windows, law: int, base: Fit) -> Fit:
    return fit_drivers(windows, of(law), base.start_variance, rounds=FEW_ROUNDS)


def typical_ade(windows: Windows, fit: Fit) -> float:
    """Return the geometric mean, over the drivers that fit, of their average displacement errors (m)."""
    return float(np.exp(typical(driven(windows, fit, known=True).ade_m).mean()))
