"""Which car-following law the drivers follow, before anything beyond it is looked for.

Of drivers who follow another law than the IDM, the IDM leaves something wherever they follow. That looks like one effect or another
(a delay, a headway that changes with speed), and hides what the drivers do beyond their law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo import laws
from idm_sumo.diagnosis.fit import Fit, fit_drivers
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.diagnosis.sizes import ROUNDS, gain_share, log_ade
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.effects import slots

# Drivers, and rounds of their fits, by which laws are compared before the best one is fitted to all.
SOME, FEW_ROUNDS = 120, 8
# Of the typical ADE, by which another law must be nearer than the IDM. (Of 46 recordings of IDM drivers, with effects hidden or without,
# one of another law was nearer by 0.01 at most; of drivers by another law by 0.02 to 0.42 where it was.)
LEAST_GAIN = 0.02


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
    typical : mapping of str to float
        By each law's name the typical ADE (m) of the drivers that were asked, each fitted.
    """

    fit: Fit
    typical: Mapping[str, float]


def followed(windows: Windows, base: Fit, rng: np.random.Generator) -> Followed:
    """Return the drivers fitted by the law that they follow most closely, ``base`` unless another one is clearly nearer than the IDM.

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
    fits = [replace(base, own=base.own[asked]), *(_fitted(some, law, base) for law in range(1, len(laws.NAMES)))]
    typical = {name: float(np.exp(log_ade(some, fit).mean())) for name, fit in zip(laws.NAMES, fits, strict=True)}
    best = laws.NAMES.index(min(typical, key=typical.__getitem__))
    if best == laws.IDM:
        return Followed(base, typical)
    other = fit_drivers(windows, of(best), base.start_variance, rounds=ROUNDS)
    gain = gain_share(windows, base, other, rng)
    return Followed(other if gain.is_likely and gain.difference > LEAST_GAIN else base, typical)


def _fitted(windows: Windows, law: int, base: Fit) -> Fit:
    return fit_drivers(windows, of(law), base.start_variance, rounds=FEW_ROUNDS)
