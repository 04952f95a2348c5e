"""What a recording says of every column: scores less those of null replicates, and their Gram matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix

from idm_sumo.diagnosis import columns as co
from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Chance, Noises
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.replicates import driven_again, refit
from idm_sumo.diagnosis.rollout import PARAMETERS
from idm_sumo.diagnosis.swings import Swings, power
from idm_sumo.models.effects import BY_NAME
from idm_sumo.recordings.columns import TRUCK
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


ROUNDING = 1e-6  # of the largest entry of a Gram matrix, which is summed in single precision


@dataclass(frozen=True)
class Subject:
    """A recording under examination: its windows, noises, and whether it needed no smoothing."""

    windows: w.Windows
    noises: Noises
    is_smooth: bool


class Measure(NamedTuple):
    """What a recording and its replicates have in common.

    Attributes
    ----------
    longest : float64, shape (secants,)
        How long a difference of rollouts may be in one window.
    by : float64, shape (absorbed, absorbed + columns)
        How much of each column is absorbed by all drivers together, and by trucks as drivers.
    """

    longest: Floats
    by: Floats


@dataclass(frozen=True)
class Evidence:
    """Scores of all columns at one model.

    Attributes
    ----------
    plan : Plan
    u : float64, shape (drivers, columns)
        The recording's scores by driver, as they are.
    nulls : float64, shape (replicates, columns)
        Total scores of each null replicate.
    gram : float64, shape (columns, columns)
    part : float64, shape (drivers, columns)
        Each driver's part of the diagonal of ``gram``.
    block : int64, shape (drivers,)
        Of neighbours.
    share : float64, shape (drivers,)
        Of the windows.
    measure : Measure
        How null replicates are measured alike.
    of_blocks : Evidence or None
        That of the recording, if this is of followers that were driven once more: it says how blocks of neighbours vary.
    swings : Swings or None
        How strongly drivers swing, and their replicates; None with several periods.
    """

    plan: pl.Plan
    u: Floats
    nulls: Floats
    gram: Floats
    part: Floats
    block: Integers
    share: Floats
    measure: Measure
    of_blocks: Evidence | None = None
    swings: Swings | None = None

    @cached_property
    def usual(self) -> Floats:
        """What the replicates show, shape ``(columns,)``: their median, as one may have driven into its leader."""
        return np.asarray(np.median(self.nulls, axis=0))

    @cached_property
    def score(self) -> Floats:
        """Total scores less what the replicates show, shape ``(columns,)``."""
        return np.asarray(self.u.sum(axis=0) - self.usual)

    @property
    def by_driver(self) -> Floats:
        """The same by driver, the replicates' mean taken off evenly."""
        return np.asarray(self.u - self.share[:, None] * self.usual)

    def replicate_error(self, mix: csr_matrix) -> Floats:
        """Return by how much the replicates' mean adds to the variance of combined scores, as a share of the model's.

        Replicates whose drivers are drawn anew may differ by more than windows with the same drivers do.
        """
        own = np.maximum(np.asarray(mix.multiply(mix @ self.gram).sum(axis=1)).ravel(), 1e-9)
        varied = np.asarray(self.nulls @ mix.T).var(axis=0, ddof=1) if len(self.nulls) > 1 else own
        return np.asarray(np.maximum(varied / own, self.inflation) / len(self.nulls) / self.inflation)

    @cached_property
    def inflation(self) -> float:
        """By how much the variance of blocks of neighbours exceeds the model's, the median over bins of catalogued effects."""
        if self.of_blocks is not None:
            return self.of_blocks.inflation
        which = [k for g in self.plan.groups if g.axes and g.name for k in range(g.first, g.first + g.count)]
        said, own = np.diag(self.gram), self.part.sum(axis=0)
        rounding = ROUNDING * float(said.max(initial=0.0))
        known = np.array([k for k in which if said[k] > rounding and own[k] > 0.5 * said[k]], np.int64)
        if not len(known):
            return 1.5
        own, part = self.by_driver[:, known], self.part[:, known]
        own = own - own.sum(axis=0) * part / np.maximum(part.sum(axis=0), 1e-300)
        sums = np.zeros((int(self.block.max()) + 1, len(known)))
        np.add.at(sums, self.block, own)
        return float(max(np.median((sums**2).sum(axis=0) / np.diag(self.gram)[known]), 1.0))


def examine(subject: Subject, fit: Fit, plan: pl.Plan, chances: Sequence[Chance]) -> Evidence:
    """Score a recording and its null replicates at one model."""
    windows = subject.windows
    answer = co.answer_of(windows, fit)
    longest = co.longest_of(windows, fit, answer, plan)
    found, by = _scores(windows, fit, answer, plan, longest)
    measure = Measure(longest, by)
    of_fixed, of_drawn = (_half(plan, measure, drawn=drawn) for drawn in (False, True))
    swing = of_fixed.plan.of(pl.SWING)
    swinging = found.part[:, plan.of(pl.SWING)]

    def replicate(what: tuple[Half, Chance]) -> tuple[Floats, Floats]:
        half, chance = what
        null, drivers = driven_again(windows, fit, chance, drawn=half is of_drawn, is_smooth=subject.is_smooth)
        own = by_driver(null, refit(null, drivers), half.plan, half.measure)
        power_of = power(own[:, swing], swinging).mean(axis=0) if half is of_fixed else np.empty(0)
        return np.asarray(own.sum(axis=0)), power_of

    each = each_in_threads(replicate, [(half, chance) for half in (of_fixed, of_drawn) for chance in chances])
    nulls = np.empty((len(chances), plan.count))
    nulls[:, of_fixed.columns] = [total for total, _ in each[: len(chances)]]
    nulls[:, of_drawn.columns] = [total for total, _ in each[len(chances) :]]
    share = np.bincount(windows.driver, minlength=windows.drivers) / len(windows.driver)
    usual = np.mean([own for _, own in each[: len(chances)]], axis=0)
    swings = Swings(power(found.u[:, plan.of(pl.SWING)], swinging), usual) if len(swing) else None
    return Evidence(plan, found.u, nulls, found.gram, found.part, windows.platoon, share, measure, swings=swings)


class Half(NamedTuple):
    """Those columns that replicates of fitted drivers are for, or those that replicates of drawn drivers are for."""

    plan: pl.Plan
    columns: Integers
    measure: Measure


def _half(plan: pl.Plan, measure: Measure, *, drawn: bool) -> Half:
    groups = [group for group in plan.groups if _is_between(group) == drawn]
    columns = np.array([k for g in groups for k in range(g.first, g.first + g.count)], np.int64)
    secants = np.isin(co.secants_of(plan), columns)
    known = measure.by.shape[1] - plan.count
    by = measure.by[:, np.concatenate([np.arange(known), known + columns])]
    return Half(plan.only(groups), columns, Measure(measure.longest[secants], by))


def _is_between(group: pl.Group) -> bool:
    """Return whether a hypothesis is about what differs between drivers, of which the fitted ones carry a part."""
    if group.is_free:
        return any(axis.is_scanned for axis in group.axes)
    return group.competes and BY_NAME[group.name].between


def by_driver(windows: w.Windows, fit: Fit, plan: pl.Plan, measure: Measure) -> Floats:
    """Return the scores of windows at a fit, shape ``(drivers, columns)``, orthogonal to what drivers and the recording's population absorb."""
    answer, truck = co.answer_of(windows, fit), trucks(windows)
    prior = np.asarray(np.linalg.inv(fit.spread), dtype=np.float64)
    u = np.zeros((windows.drivers, len(measure.by) + plan.count))
    for rows in co.chunks(windows):
        some, of = windows.of_rows(np.arange(rows.start, rows.stop)), co.of_rows(answer, rows)
        left = of.line.whitener @ np.concatenate([of.line.error[:, :, None], of.line.jacobian], axis=2)
        vectors = left.transpose(0, 2, 1) @ of.line.whitener
        seen = co.seen_through(some, fit, of, plan, vectors, measure.longest)
        first, last = int(some.driver[0]), int(some.driver[-1]) + 1
        both = np.concatenate([vectors @ _common(of, truck[rows]), seen], axis=2)
        sums = gls.by_driver(both, some.driver - first, last - first)
        inner = sums[:, 1:, :PARAMETERS] + prior
        u[first:last] = sums[:, 0] - np.einsum(
            "ip,ipa->ia", np.linalg.solve(inner, sums[:, 0, :PARAMETERS, None])[:, :, 0], sums[:, 1:]
        )
    known = len(measure.by)
    return np.asarray(u[:, known:] - u[:, :known] @ measure.by[:, known:])


def trucks(windows: w.Windows) -> Floats:
    """Return one for windows of trucks and zero for others, shape ``(windows, 1, 1)``; empty in the last axis if there are no trucks."""
    truck = (windows.seen[:, w.OWN_KIND, -1] == TRUCK).astype(np.float64)[:, None, None]
    return np.asarray(truck if truck.any() else truck[:, :, :0])


def _common(of: co.Answer, truck: Floats) -> Floats:
    """Return what is absorbed: by drivers, by trucks as drivers, by the population."""
    own = of.line.jacobian
    return np.concatenate([own, own * truck, of.line.shared] if truck.size else [own, of.line.shared], axis=2)


def _scores(
    windows: w.Windows, fit: Fit, answer: co.Answer, plan: pl.Plan, longest: Floats
) -> tuple[gls.Scores, Floats]:
    """Return the scores, orthogonal to what drivers, trucks as drivers and the population absorb, and how much of each column that is."""
    truck = trucks(windows)
    known = _common(co.of_rows(answer, slice(0, 1)), truck[:1]).shape[2]
    count = known + plan.count
    prior = np.asarray(np.linalg.inv(fit.spread), dtype=np.float64)

    def of_chunk(rows: slice) -> Chunk:
        some, line = windows.of_rows(np.arange(rows.start, rows.stop)), co.of_rows(answer, rows)
        of = co.columns(some, fit, line, plan, longest)
        white = line.line.whitener @ np.concatenate([_common(line, truck[rows]), of], axis=2)
        error = (line.line.whitener @ line.line.error[:, :, None])[:, :, 0]
        return _of_chunk(white, error, prior, some.driver)

    each = each_in_threads(of_chunk, co.chunks(windows))
    u, part, gram = np.zeros((windows.drivers, count)), np.zeros((windows.drivers, count)), np.zeros((count, count))
    for one in each:
        u[one.drivers], part[one.drivers] = one.u, one.part
        gram += one.gram
    by = gls.scaled_inverse(gram[:known, :known]) @ gram[:known]
    u -= u[:, :known] @ by
    gram -= gram[:, :known] @ by
    return gls.Scores(u[:, known:], gram[known:, known:], part[:, known:]), by


class Chunk(NamedTuple):
    """Scores of the windows of some drivers, after the drivers' own parameters took what they can."""

    drivers: slice
    u: Floats
    part: Floats
    gram: npt.NDArray[np.float32]


def _of_chunk(white: Floats, error: Floats, prior: Floats, driver: Integers) -> Chunk:
    first = int(driver[0])
    local, drivers = driver - first, int(driver[-1]) - first + 1
    own = white[:, :, :PARAMETERS]
    turned = own.transpose(0, 2, 1)
    inner = np.linalg.inv(gls.by_driver(turned @ own, local, drivers) + prior)
    own_r = gls.by_driver((turned @ error[:, :, None])[:, :, 0], local, drivers)
    own_g = gls.by_driver(turned @ white, local, drivers)
    direct = gls.by_driver((error[:, None, :] @ white)[:, 0], local, drivers)
    taken = inner @ own_g
    u = direct - np.einsum("ipa,ip->ia", taken, own_r)
    part = gls.by_driver((white * white).sum(axis=1), local, drivers) - (own_g * taken).sum(axis=1)
    count = white.shape[2]
    flat, held = white.reshape(-1, count).astype(np.float32), own_g.reshape(-1, count).astype(np.float32)
    gram = flat.T @ flat - held.T @ taken.reshape(-1, count).astype(np.float32)
    return Chunk(slice(first, first + drivers), u, part, gram)
