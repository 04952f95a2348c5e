"""What a diagnosis says, and the arrays that its pictures need. Nothing is computed here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.diagnosis.law_misfit import LawMisfit
from idm_sumo.models.effects import ExtendedModel

Floats = npt.NDArray[np.float64]
Range = tuple[float, float]

NAMED, NONE, UNKNOWN = "named", "none", "unknown"  # verdicts


@dataclass(frozen=True)
class Estimate:
    """A number with its unit and its 95 % interval."""

    value: float
    unit: str
    ci95: Range


@dataclass(frozen=True)
class Region:
    """Where and when a cause acts: position (m), time since the recording's first frame (s), lanes; None for all."""

    position_m: Range | None = None
    time_s: Range | None = None
    lanes: tuple[int, ...] | None = None


@dataclass(frozen=True)
class CauseFound:
    """A cause that is there.

    Attributes
    ----------
    name : str
    parameters : mapping of str to Estimate
    where : Region or None
        None if it acts everywhere.
    p_value : float
        Corrected for all hypotheses tested.
    evidence : str
        One sentence.
    one_of : tuple of str
        Names that these data cannot tell from it.
    gain : Gain or None
        Share of a driver's ADE that it spares beside the others, on drivers that took no part in its size.
    probability : float
        That it is this and nothing else.
    effective_drivers : float
        On how many drivers it rests.
    at_bound : bool
        Whether its magnitude is at a bound of what is searched.
    """

    name: str
    parameters: Mapping[str, Estimate]
    where: Region | None
    p_value: float
    evidence: str
    one_of: tuple[str, ...] = ()
    gain: Gain | None = None
    probability: float = 1.0
    effective_drivers: float = 0.0
    at_bound: bool = False


@dataclass(frozen=True)
class Unexplained:
    """A bias that no catalogue effect explains: where, when, along which covariate."""

    covariate: str
    range: Range
    position_m: Range | None
    time_s: Range | None
    p_value: float


Z95 = 1.96  # standard errors from a value to the end of its 95 % interval
NINE_TO_ONE = 0.65  # of the distance to the end of a 95 % interval: the end of an 80 % one


@dataclass(frozen=True)
class Gain:
    """A measure of the error on held-out drivers, base and extended; ``difference`` is base minus extended."""

    metric: str
    base: float
    extended: float
    difference: float
    ci95: Range
    vehicles: int
    held_out: bool = True

    @property
    def standard_error(self) -> float:
        """What the interval below the difference amounts to."""
        return (self.difference - self.ci95[0]) / Z95

    @property
    def is_likely(self) -> bool:
        """Whether the odds are nine to one that there is a gain: zero is below an 80 % interval."""
        return self.difference > NINE_TO_ONE * (self.difference - self.ci95[0])


@dataclass(frozen=True)
class Law:
    """A car-following law that drivers follow more likely than the IDM.

    Attributes
    ----------
    name : str
        Of :data:`idm_sumo.models.laws.NAMES`.
    likelier : Gain
        Negative log-likelihood of a driver that fits: by the IDM, and by this law; no causes in either.
    gain : Gain
        ADE of held-out drivers, each fitted, likewise. It may be a loss: the law whose parameters take up more of the drivers' noise is
        nearer to them.
    """

    name: str
    likelier: Gain
    gain: Gain


class LawCompared(NamedTuple):
    """What a car-following law makes of some drivers.

    Attributes
    ----------
    typical_ade : float
        Geometric mean of the drivers' ADE (m), each fitted.
    log_likelihood : float
        Mean over drivers, whatever their parameters, less that by the IDM.
    """

    typical_ade: float
    log_likelihood: float


@dataclass(frozen=True)
class RuledOut:
    """An effect that is not claimed, with its corrected p-value, its estimated size, and why not."""

    name: str
    p_value: float
    confusable_with: tuple[str, ...]
    estimate: Estimate | None = None
    why: str = ""


@dataclass(frozen=True)
class Detectable:
    """An effect's size, in how many injections into the recording's own followers it was found, and of how many."""

    name: str
    symbol: str
    unit: str
    size: float
    found: int
    of: int

    @property
    def share(self) -> float:
        """Share of the injections in which it was found."""
        return self.found / self.of


@dataclass(frozen=True)
class Scan:
    """An estimate by bins of one covariate: ``edges`` shape ``(bins + 1,)``, the others ``(bins,)``."""

    covariate: str
    unit: str
    edges: Floats
    estimate: Floats
    standard_error: Floats


@dataclass(frozen=True)
class Diagnosis:
    """All of it.

    Attributes
    ----------
    verdict : {"named", "none", "unknown"}
    causes : tuple of CauseFound
        Strongest first; empty unless named.
    without_gain : tuple of CauseFound
        Present, but the simulation is not better for it.
    unexplained : tuple of Unexplained
    gain : Gain
        ADE of the rollouts; with verdicts other than named base and extended are the same.
    other_gains : tuple of Gain
        FDE (m), gap error (m), speed error (m/s), collisions (share of windows).
    ruled_out : tuple of RuledOut
    untestable : mapping of str to str
        Effect and reason.
    model, base_model : ExtendedModel
        Base: the median driver by the law that drivers follow, the plain IDM or another, without causes.
    residuals : pandas.DataFrame
        One row a compared moment of a held-out window: ``vehicle, window, lag, position, time, speed, gap,
        approach_rate, leader_acceleration, since_change, lane, leader_class, adjacent_difference, rear_gap`` and
        ``base, extended`` (m, recorded minus simulated position).
    drivers : pandas.DataFrame
        One row a driver: ``period, vehicle, held_out, windows, base_ade, extended_ade`` (m), and its parameters with the extended model,
        ``a, b, T, d0, d1, desired_speed_m_s`` (SI).
    scans : tuple of Scan
        Free acceleration along position and time (m/s²), base model.
    excluded : mapping of str to int
        Why rows or vehicles did not take part.
    notes : tuple of str
    seconds : mapping of str to float
        Wall time of each stage.
    law : Law or None
        Which drivers follow more likely than the IDM; it is then in both models, and gains are beside it. None for the IDM.
    by_law : mapping of str to LawCompared
        By its name, what each law makes of some drivers that fit, no causes in any.
    law_misfit : LawMisfit or None
        The acceleration that the law lacks with the causes in the model; None of too little data.
    detectable : tuple of Detectable
        Effects that were injected, by name, sizes ascending; empty if none were asked for.
    """

    verdict: str
    causes: tuple[CauseFound, ...]
    without_gain: tuple[CauseFound, ...]
    unexplained: tuple[Unexplained, ...]
    gain: Gain | None
    other_gains: tuple[Gain, ...]
    ruled_out: tuple[RuledOut, ...]
    untestable: Mapping[str, str]
    model: ExtendedModel
    base_model: ExtendedModel
    residuals: pd.DataFrame
    drivers: pd.DataFrame
    scans: tuple[Scan, ...]
    excluded: Mapping[str, int]
    notes: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    law: Law | None = None
    by_law: Mapping[str, LawCompared] = field(default_factory=dict)
    law_misfit: LawMisfit | None = None
    detectable: tuple[Detectable, ...] = ()
