"""What the data say about every regressor: scores less those of the null replicates, Gram matrix, inflation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis.chance import Chance
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.free_fields import Families
from idm_sumo.diagnosis.law_misfit import FormEvidence
from idm_sumo.diagnosis.left_over import Evaluated, LeftOver, evaluate, left_over
from idm_sumo.diagnosis.linear_pulses import GUARD
from idm_sumo.diagnosis.look import Build, Look, Subject, look, score
from idm_sumo.diagnosis.replicates import driven_again, refit
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.runtime.progress import Progress
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ENDOGENOUS = ("follower_pressure",)  # the follower answers the real driver, not the replicate: no replicate for these
# What differs between drivers more than within one: part of it is in the fitted drivers, so replicates of drawn ones are the null.
BETWEEN = (
    "leader_class", "speed_dependent_headway", "time_of_day", "location", "desired_speed", "vehicle_class", "lane_change_relaxation",
)  # fmt: skip


@dataclass(frozen=True)
class Evidence:
    """Scores of all regressors at one model.

    Attributes
    ----------
    regressors : list of Regressor
    u : float64, shape (drivers, regressors)
        The recording's scores, the replicates' mean taken off each driver evenly.
    replicates : float64, shape (replicates, regressors)
        Total scores of each replicate.
    gram : float64, shape (regressors, regressors)
    part : float64, shape (drivers, regressors)
        Each driver's share of the diagonal of ``gram``.
    block : int64, shape (drivers,)
        Platoon blocks.
    free : tuple of LeftOver
        What no effect was asked for, the most significant first; empty if it was not looked for.
    lane : int64, shape (drivers,)
        Usual lanes, 0 for none; empty if lanes are not told apart.
    of_form : FormEvidence or None
        Of the car-following's own form, before it is taken out of the others; its variance inflated as theirs.
    """

    regressors: list[rg.Regressor]
    u: Floats
    replicates: Floats
    gram: Floats
    part: Floats
    block: Integers
    free: tuple[LeftOver, ...] = ()
    lane: Integers = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    of_form: FormEvidence | None = None

    def total(self) -> Floats:
        """Return the corrected total score of each regressor."""
        return np.asarray(self.u.sum(axis=0))

    def of(self, which: npt.NDArray[np.bool_]) -> Evidence:
        """Return what some of the drivers say, as far as shares tell: theirs of the Gram matrix's diagonal, and of the replicates' scores."""
        share = np.sqrt(np.clip(self.part[which].sum(axis=0) / np.maximum(self.part.sum(axis=0), 1e-300), 0.0, 1.0))
        return Evidence(
            self.regressors, self.u[which], self.replicates * which.mean(), self.gram * np.outer(share, share), self.part[which],
            np.unique(self.block[which], return_inverse=True)[1], lane=self.lane[which],
        )  # fmt: skip

    def clustered(self, mix: Floats) -> Floats:
        """Return the variance of combined scores from blocks of drivers and from the replicates, shape ``(combinations,)``.

        What each driver would score if the estimate were true is taken off: a rare effect is not its own noise.
        """
        values = self.u @ mix
        part = self.part @ mix**2
        expected = values.sum(axis=0) * part / np.maximum(part.sum(axis=0), 1e-300)
        sums = np.zeros((self.block.max() + 1, values.shape[1]))
        np.add.at(sums, self.block, values - expected)
        between = (
            (self.replicates @ mix).var(axis=0, ddof=1) / len(self.replicates) if len(self.replicates) > 1 else 0.0
        )
        return np.asarray((sums**2).sum(axis=0) + between)

    def effective_drivers(self, mix: Floats) -> float:
        """Return on how many drivers a combination's score rests.

        Kish's formula on what each driver says for it: one who says it all counts as one.
        """
        own = self.u @ mix
        own = np.maximum(own * np.sign(own.sum()), 0.0)
        return float(own.sum() ** 2 / max((own**2).sum(), 1e-300))

    @cached_property
    def inflation(self) -> float:
        """By how much the clustered variance exceeds the model's, the median over bins of place and time."""
        bins = [
            n
            for n, regressor in enumerate(self.regressors)
            if regressor.name in ("location", "time_of_day") and not regressor.fixed
        ]
        informative = [n for n in bins if self.gram[n, n] > 1e-9]
        if not informative:
            return 1.5
        ratio = self.clustered(np.eye(len(self.regressors))[:, informative]) / np.diag(self.gram)[informative]
        return float(max(np.median(ratio), 1.0))


def examine(
    subject: Subject, fit: Fit, chances: list[Chance], *, progress: Progress, stage: str,
    free: Families | None = None,
) -> Evidence:  # fmt: skip
    """Score the recording and its null replicates, one for each chance, at one model.

    And, if ``free`` says which, families of what is no effect of the catalogue.
    """
    answer = rg.answer_of(subject.windows, fit, subject.grid.pivot)
    looked = look(subject, fit, rg.build, answer)
    progress(stage, 0, 1)
    evaluated = None if free is None else Replicates([], [], free)
    totals = null_totals(subject, fit, chances, looked, evaluated)
    progress(stage, 1, 1)
    windows = subject.windows
    corrected = less_chance(looked.u, totals.corrected, windows)
    evidence = Evidence(
        looked.regressors,
        corrected,
        totals.corrected,
        looked.gram,
        looked.found.part,
        windows.platoon,
        lane=windows.usual_lane,
    )
    evidence = replace(evidence, of_form=_of_form(looked, totals.own, evidence.inflation))
    if evaluated is None:
        return evidence
    left = left_over(
        subject.windows,
        fit,
        subject.grid,
        answer,
        evaluated.fitted,
        evaluated.drawn,
        evidence.inflation,
        evaluated.families,
    )
    return replace(evidence, free=tuple(left))


class Replicates(NamedTuple):
    """What replicates of the fitted drivers, and of drivers drawn anew, say of everything free."""

    fitted: list[Evaluated]
    drawn: list[Evaluated]
    families: Families


def less_chance(u: Floats, nulls: Floats, windows: Windows) -> Floats:
    """Return scores, shape ``(drivers, regressors)``, without what null replicates show: their mean by each driver's share of the windows."""
    share = np.bincount(windows.driver, minlength=windows.drivers) / len(windows.driver)
    return np.asarray(u - share[:, None] * nulls.mean(axis=0))


class Totals(NamedTuple):
    """Total scores of null replicates, shape ``(replicates, regressors)``: free of the form, and those of the fitted drivers as they are."""

    corrected: Floats
    own: Floats


def _of_form(looked: Look, own: Floats, inflation: float) -> FormEvidence:
    """Return what the recording says of the car-following's form beyond what its replicates show."""
    form = np.flatnonzero([regressor.name.startswith(GUARD) for regressor in looked.regressors])
    wider = inflation * (1.0 + 1.0 / len(own))
    score = looked.found.u[:, form].sum(axis=0) - own[:, form].mean(axis=0)
    return FormEvidence(score / wider, looked.found.gram[np.ix_(form, form)] / wider)


def null_totals(
    subject: Subject, fit: Fit, chances: Sequence[Chance], looked: Look, evaluated: Replicates | None = None
) -> Totals:
    """Return the total scores of null replicates: of drawn drivers for what differs between drivers.

    The form of the car-following is taken out of them as out of the recording, by the recording's Gram matrix and as replicates of
    the fitted drivers show it: these share their paths with the recording, drawn ones do not. What they say of everything free
    is added to ``evaluated``.
    """
    is_asked = np.array(
        [looked.build is rg.build or regressor.name.startswith(rg.LOCAL) for regressor in looked.regressors]
    )
    between = is_asked & np.array([name.startswith(BETWEEN) for name in looked.names])
    kinds = (False, True) if between.any() else (False,)
    each = each_in_threads(
        lambda replicate: _replicate(
            subject,
            fit,
            replicate[1],
            looked.build,
            drawn=replicate[0],
            listen=None if evaluated is None else evaluated.families,
        ),
        [(drawn, chance) for drawn in kinds for chance in chances],
    )
    fitted, drawn = each[: len(chances)], each[len(chances) :]
    if evaluated is not None:
        evaluated.fitted.extend(free for _, free in fitted if free is not None)
        evaluated.drawn.extend(free for _, free in drawn if free is not None)
    own, anew = (np.array([scores for scores, _ in replicates]) for replicates in (fitted, drawn or fitted))
    of_form = own @ (looked.free_of_form - np.eye(len(looked.regressors)))
    totals = np.where(between, anew, own)
    return Totals(np.asarray(totals * [name not in ENDOGENOUS for name in looked.names] + of_form), own)


def _replicate(
    subject: Subject, fit: Fit, chance: Chance, build: Build, *, drawn: bool, listen: Families | None
) -> tuple[Floats, Evaluated | None]:
    """Return the total scores of a replicate, with the fitted drivers or with drawn ones, and what is evaluated of everything free."""
    replicate, drivers = driven_again(subject.windows, fit, chance, drawn=drawn, is_smooth=subject.is_smooth)
    fitted = refit(replicate, drivers)
    answer = rg.answer_of(replicate, fitted, subject.grid.pivot)
    total = np.asarray(score(subject, replicate, fitted, build, answer)[1].u.sum(axis=0))
    return total, None if listen is None else evaluate(replicate, fitted, subject.grid, answer, listen)


class Local(NamedTuple):
    """Score and information of a little more of a magnitude that is in the model."""

    score: float
    information: float


def look_here(subject: Subject, fit: Fit) -> Look:
    """Return how the recording wants each magnitude in the model changed, before any replicate is evaluated."""
    return look(subject, fit, rg.build_local)


def local_scores(looked: Look) -> dict[str, Local]:
    """Return the score of each magnitude in the model."""
    return _by_name(looked, looked.u.sum(axis=0))


def local_biases(subject: Subject, fit: Fit, looked: Look, chances: Sequence[Chance]) -> dict[str, Local]:
    """Return the same of replicates in which the model as it is drives: the score that noise and smoothing make."""
    return _by_name(looked, null_totals(subject, fit, chances, looked).corrected.mean(axis=0))


def _by_name(looked: Look, total: Floats) -> dict[str, Local]:
    information = np.diag(looked.gram)
    return {
        name: Local(float(total[n]), float(information[n]))
        for n, name in enumerate(looked.names)
        if looked.regressors[n].name.startswith(rg.LOCAL)
    }
