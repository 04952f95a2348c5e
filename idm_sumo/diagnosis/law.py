"""Which car-following law the drivers follow, before anything beyond it is looked for.

Of drivers who follow another law than the IDM, the IDM leaves something wherever they follow. That looks like one effect or another
(a delay, a headway that changes with speed), and hides what the drivers do beyond their law.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo import laws
from idm_sumo.diagnosis.fit import Fit, fit_drivers
from idm_sumo.diagnosis.gain import compare
from idm_sumo.diagnosis.likelihood import log_likelihood
from idm_sumo.diagnosis.result import Gain, LawCompared
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.diagnosis.sizes import ROUNDS, log_ade
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.effects import slots

# Drivers, and rounds of their fits, by which laws are compared before the best one is fitted to all.
SOME, FEW_ROUNDS = 120, 8
# Standard errors of the log-likelihood's gain, by which another law must be likelier than the IDM. (Of 42 recordings of IDM drivers, with
# effects hidden or without, the surest was 0.1.)
SURE = 3.0


def of(law: int) -> npt.NDArray[np.float64]:
    """Return the magnitudes of a law without any effect, shape ``(9, slots.COUNT)``."""
    by_lane = PLAIN.copy()
    by_lane[:, slots.LAW] = law
    return by_lane


def law_of(fit: Fit) -> int:
    """Return the number of the law that a fit's drivers follow."""
    return int(fit.by_lane[0, slots.LAW])


class Followed(NamedTuple):
    """Drivers by the law that they follow.

    Attributes
    ----------
    fit : Fit
    likelier : Gain or None
        Negative log-likelihood of a driver by the IDM, and by the law that they follow; None if that is the IDM.
    by_law : mapping of str to LawCompared
        What each law, by its name, makes of the drivers that were asked.
    """

    fit: Fit
    likelier: Gain | None
    by_law: Mapping[str, LawCompared]


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
    fits = [_fitted(some, law, base) for law in range(len(laws.NAMES))]
    each = np.stack([log_likelihood(some, fit) for fit in fits])
    likelier = each - each[laws.IDM]
    by_law = {
        name: LawCompared(float(np.exp(log_ade(some, fit).mean())), float(gain.mean()))
        for name, fit, gain in zip(laws.NAMES, fits, likelier, strict=True)
    }
    best = max(range(1, len(laws.NAMES)), key=lambda law: float(each[law].mean()))
    if not _may_be_likelier(likelier[best]):
        return Followed(base, None, by_law)
    other = fit_drivers(windows, of(best), base.start_variance, rounds=ROUNDS)
    gain = compare(
        "unlikelihood", -log_likelihood(windows, base), -log_likelihood(windows, other), windows.platoon, rng, held_out=False
    )  # fmt: skip
    is_sure = gain.difference > SURE * gain.standard_error
    return Followed(other, gain, by_law) if is_sure else Followed(base, None, by_law)


def _may_be_likelier(gain: npt.NDArray[np.float64]) -> bool:
    """Return whether of all drivers another law may be likelier, as far as some of them say."""
    return bool(gain.mean() + SURE * gain.std() / np.sqrt(len(gain)) > 0.0)


def _fitted(windows: Windows, law: int, base: Fit) -> Fit:
    return fit_drivers(windows, of(law), base.start_variance, rounds=FEW_ROUNDS)
