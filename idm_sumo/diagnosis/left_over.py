"""What is left over: the free fields, and the oscillation, that say more than the null replicates do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import oscillation, variance
from idm_sumo.diagnosis.bins import pulse_means, sums_by_bin
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.pulses import Pulses, pulses_of
from idm_sumo.diagnosis.regressors import Answer, Grid
from idm_sumo.diagnosis.rollout import BIN
from idm_sumo.diagnosis.scans import Stretch, best_stretch, beyond_margins, corrected_p
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Range = tuple[float, float]

SWING = "own oscillation in time"
SWELL = f"{SWING}, periods around"
UNSTEADY = "variance"
NO_TWIN = "rear_gap"  # the follower answers the real driver, not the replicate
NARROWEST, WIDEST = 2, 0.7  # bins; share of the road, of the time, of both
CLUMSIEST = 1.5  # times the variance of the model that the clustered one may count
BY_ONE = 0.5  # of the score: what one block of neighbours says more of is what happened to them
PLAIN_BEFORE_BOTH = 8.0  # of squared z
MOST_TOLD, NEARLY = 3, 0.4  # of the strongest's squared z
OWN_WORDS = 0.5  # of the score, at least, that the recording itself must say of where and when: the rest is what drawn drivers do
# Where next to nothing is answered, or by few, or in an emergency, a response seems many times stronger, or turned round; of a share,
# and of s of delay.
LARGEST = {ff.RESPONSE: (-1.0, 1.5), ff.DELAY: (-1.0, 3.0)}
# Times the least that may be told: in one lane there are few drivers, and as many looks as in all; of place and time together most looks.
OF_MANY_LOOKS = 1.5
LEAST = {ff.ACCELERATION: 0.04, ff.HEADWAY: 0.04, ff.RESPONSE: 0.05, ff.DELAY: 0.1}  # m/s², of log T, share, s


@dataclass(frozen=True)
class LeftOver:
    """What no effect of the catalogue was asked for.

    Attributes
    ----------
    covariate : str
    range : tuple of float
        Of the covariate; the lane twice for a lane.
    position_m, time_s : tuple of float or None
        Where and when, if it has a place and a time.
    value : float
        m/s² of acceleration; share of the time headway or of the response; s of delay; times the usual power or variance.
    z : float
        Standard errors beyond the replicates.
    p : float
        Corrected for everything looked at.
    is_credible : bool
        Whether it may be told at all: large enough, no larger than can be, not said by a single block of neighbours, and by the
        recording rather than by its replicates: in light traffic drivers drawn anew are far from where those before them were.
    lane : int
        In which alone it is; 0 for all, or if it is not a question of place or time.
    score, bias : float
        Of a field: the recording's, less the replicates' mean, which is the bias.
    beyond : float
        Standard errors of a rectangle of place and time beyond what each of its places does at all times and each of its times at all
        places; zero for everything else.
    """

    covariate: str
    range: Range
    position_m: Range | None
    time_s: Range | None
    value: float
    z: float
    p: float
    is_credible: bool
    lane: int = 0
    score: float = 0.0
    bias: float = 0.0
    beyond: float = 0.0

    @property
    def subject(self) -> str:
        """What it lies along, whatever is different there."""
        return self.covariate.split(" over ")[-1]

    @property
    def kind(self) -> str:
        """The covariate, in whichever lane it is."""
        return self.covariate.removesuffix(str(self.lane)) if self.lane else self.covariate

    @property
    def is_seen(self) -> bool:
        """Whether it lies along what a driver sees, and is no question of where or when."""
        return self.subject in ff.EDGES

    def meets(self, other: LeftOver) -> bool:
        """Return whether another is, or may be, at the same place and time; what is in all lanes is in each."""
        ranges = ((self.position_m, other.position_m), (self.time_s, other.time_s))
        same_lane = not (self.lane and other.lane) or self.lane == other.lane
        return same_lane and all(a is None or b is None or (a[0] < b[1] and b[0] < a[1]) for a, b in ranges)


@dataclass(frozen=True)
class Evaluated:
    """What one replicate says of everything free: total scores in the order of the families, spectra, squares along place and time."""

    totals: Floats
    spectrum: Floats
    squares: dict[str, Floats]


def evaluate(windows: Windows, fit: Fit, grid: Grid, answer: Answer, families: ff.Families = ff.families) -> Evaluated:
    """Return what a replicate says."""
    pulses = pulses_of(windows, fit, answer)
    by_frame = np.repeat(pulses.score, BIN, axis=1) / BIN
    scored = {content: value * by_frame for content, value in ff.contents(pulses.state).items()}
    whole = {content: each.sum() for content, each in scored.items()}
    totals: list[Floats] = []
    squares = {}
    for family, number in families(windows, pulses.state, grid):
        totals += [sums_by_bin(number, scored[family.content], family.count), np.array([whole[family.content]])]
        if variance.concerns(family):
            squares[family.covariate] = variance.spread(pulses, number, family.count).squares.sum(axis=0)
    return Evaluated(np.concatenate(totals), oscillation.spectrum(pulses), squares)


def left_over(
    windows: Windows, fit: Fit, grid: Grid, answer: Answer, fitted: list[Evaluated], drawn: list[Evaluated], inflation: float,
    families: ff.Families = ff.families,
) -> list[LeftOver]:  # fmt: skip
    """Return everything that is free in its best stretch, the most significant first.

    Parameters
    ----------
    windows, fit, grid, answer : Windows, Fit, Grid, Answer
        Of the recording.
    fitted, drawn : list of Evaluated
        Of replicates with the fitted drivers, and with drivers drawn anew: the null of what differs between drivers.
    inflation : float
        Of variances beyond the model's.
    families : callable
        Which yields those that were evaluated.
    """
    pulses = pulses_of(windows, fit, answer)
    every, what = list(families(windows, pulses.state, grid)), ff.contents(pulses.state)
    begins = np.cumsum([0, *(family.count + 1 for family, _ in every)])

    def best(which: int) -> Said | None:
        family, number = every[which]
        evaluated = [one.totals[begins[which] : begins[which + 1]] for one in (drawn if family.is_regional else fitted)]
        value = what[family.content]
        return _of_family(pulses, family, number, value, np.array(evaluated) * (family.covariate != NO_TWIN), inflation)

    found = [one for one in each_in_threads(best, range(len(every))) if one is not None]
    unsteady = []
    for family, number in every:
        if variance.concerns(family):
            replicate = np.mean([evaluated.squares[family.covariate] for evaluated in fitted], axis=0)
            most = variance.most_unsteady(variance.spread(pulses, number, family.count), replicate, len(fitted))
            unsteady += [_unsteady(family, most)] if most is not None else []
    looks = _looks(found)
    named = [_named(one, looks[one.family.is_around]) for one in _with_one_path(found)]
    spectrum, replicates = oscillation.spectrum(pulses), [one.spectrum for one in fitted]
    line, swell = oscillation.line(spectrum, oscillation.usual(replicates)), oscillation.swell(spectrum, replicates)
    swings = [
        _swinging(line, f"{SWING}, period {np.sqrt(line.low * line.high):.3g} s", grid),
        _swinging(oscillation.own_lines(spectrum, replicates), f"{SWING}, each driver's own period", grid),
        _swinging(swell, f"{SWELL} {np.sqrt(swell.low * swell.high):.2g} s", grid),
    ]
    return sorted([*named, *unsteady, *swings], key=rank)


def _looks(found: list[Said]) -> dict[bool, int]:
    """Return by how many looks to correct what is around a driver (true) and everything else: each half of the error.

    Of the scans' thousands of looks the few questions of who is around would have to answer for every one otherwise.
    """
    return {
        around: 2 * sum(one.stretch.looks for one in found if one.family.is_around == around)
        for around in (True, False)
    }


def _with_one_path(found: list[Said]) -> list[Said]:
    """Return what was found, of all speeds at which bands move the one that says most: its neighbours say the same."""
    moving = [one for one in found if one.family.path is not None]
    best = max(moving, key=lambda one: abs(one.z), default=None)
    return [one for one in found if one.family.path is None or one is best]


def rank(one: LeftOver) -> float:
    """Return less for what says more; a rectangle, which is a place or a time and then some, has to say more than either."""
    both = one.position_m is not None and one.time_s is not None
    return PLAIN_BEFORE_BOTH * both - one.z**2


class Said(NamedTuple):
    """The best stretch of a family, its standard errors, the replicates' mean score there, whether few drivers say it all; ``beyond``."""

    family: ff.Family
    stretch: Stretch
    z: float
    bias: float
    by_few: bool
    beyond: float = 0.0

    @property
    def by_replicates(self) -> bool:
        """Whether it is the replicates, of drawn drivers, that say it and not the recording."""
        own = self.stretch.score + self.bias
        return self.family.is_regional and own * np.sign(self.stretch.score) < OWN_WORDS * abs(self.stretch.score)


def _of_family(
    pulses: Pulses, family: ff.Family, number: Integers, value: Floats, replicates: Floats, inflation: float
) -> Said | None:
    """Return what a family says."""
    u, gram = pulses.along(number, value, family.count)
    mix, sign = _mix(family, gram), family.within.sign if family.within is not None else 0.0
    total = (u.sum(axis=0) - replicates.mean(axis=0)) @ mix
    within = mix.T @ gram @ mix
    best = best_stretch(total, within, family.shape, *_limits(family), of_sign=sign)
    if best is None:
        return None
    unsure = inflation * (1.0 + 1.0 / len(replicates))
    beyond = (
        beyond_margins(total, within, best, family.shape) / np.sqrt(unsure) if family.covariate == ff.REGION else 0.0
    )
    mix = mix @ best.inside(family.shape)
    field = pulse_means(value * (mix[:-1][number] * (number >= 0) + mix[-1]))
    part, own = pulses.information(field), u @ mix
    blocks = np.bincount(pulses.windows.platoon, own - own.sum() * part / max(part.sum(), 1e-300))
    known = best.information * unsure
    clustered = float((blocks**2).sum() + (replicates @ mix).var(ddof=min(1, len(replicates) - 1)) / len(replicates))
    z = best.score / np.sqrt(max(known, min(clustered, CLUMSIEST * known)))
    by_block = np.bincount(pulses.windows.platoon, own) * np.sign(best.score)
    return Said(
        family,
        best,
        float(z),
        float(replicates.mean(axis=0) @ mix),
        bool(by_block.max() > BY_ONE * abs(best.score)),
        beyond,
    )


def _mix(family: ff.Family, gram: Floats) -> Floats:
    """Return what makes the scores of a family's bins of the sums in each bin and of the whole, shape ``(bins + 1, bins)``.

    What is so in all bins, where that is a cause or the model itself, is projected out.
    """
    mix = np.eye(family.count + 1)[:, :-1]
    if family.within is not None:
        everywhere = gram[:-1, :-1].sum(axis=0)
        mix[:-1] -= everywhere / max(everywhere.sum(), 1e-9)
    elif family.is_contrast:
        mix[-1] = -gram[-1, :-1] / max(gram[-1, -1], 1e-9)
    return mix


def _limits(family: ff.Family) -> tuple[int, float]:
    """Return the least bins, and the largest share of all, of a stretch: one lane, part of the road, not every value."""
    if family.is_scanned:
        return NARROWEST, WIDEST
    at_most = 1 if family.covariate == "lane" else max(1, family.count - 1)
    return 1, at_most / family.count


def _named(said: Said, looks: int) -> LeftOver:
    """Return a stretch in words."""
    family, stretch, z = said.family, said.stretch, said.z
    value = stretch.score / stretch.information
    edges = [(float(e[a]), float(e[b if family.covariate != "lane" else a]))
             for e, a, b in zip(family.edges, stretch.first, stretch.last, strict=True)]  # fmt: skip
    covariate = f"{family.content} over {family.covariate}" if family.content else family.covariate
    place = edges[0] if family.covariate.startswith("position") else None
    time = edges[-1] if family.covariate.startswith(("time", ff.REGION)) else None
    if family.path is not None:
        place, time = family.path.swept(*edges[0])
    if family.within is not None:
        held = family.within.begin, family.within.end
        place, time = (held, edges[0]) if family.within.axis == ff.HELD[0] else (edges[0], held)
    p = corrected_p(z, looks)
    lane = int(family.covariate.partition(ff.IN_LANE)[2] or 0)
    low, high = LARGEST.get(family.content, (-np.inf, np.inf))
    least = LEAST[family.content] * (OF_MANY_LOOKS if lane or family.covariate.startswith(ff.REGION) else 1.0)
    is_credible = abs(value) >= least and low <= value <= high and not said.by_few and not said.by_replicates
    return LeftOver(
        covariate, edges[0], place, time, value, z, p, is_credible, lane, stretch.score, said.bias, said.beyond
    )


def _unsteady(family: ff.Family, most: variance.Unsteady) -> LeftOver:
    """Return where or when drivers are unsteady in words."""
    edges = (float(family.edges[0][most.first]), float(family.edges[0][most.last]))
    place, time = (edges, None) if family.covariate == "position" else (None, edges)
    p = float(min(1.0, most.looks * norm.sf(most.z)))
    is_credible = most.ratio > variance.LEAST_RATIO
    return LeftOver(f"{UNSTEADY} over {family.covariate}", edges, place, time, most.ratio, most.z, p, is_credible)


def _swinging(swing: oscillation.Line, covariate: str, grid: Grid) -> LeftOver:
    """Return an oscillation in words."""
    whole = (float(grid.time[0]), float(grid.time[-1]))
    p = float(min(1.0, len(oscillation.PERIODS) * norm.sf(swing.z)))
    return LeftOver(covariate, (swing.low, swing.high), None, whole, swing.ratio, swing.z, p, swing.is_strong)


def told(found: tuple[LeftOver, ...]) -> tuple[LeftOver, ...]:
    """Return what is worth telling: the strongest, and what else is nearly as strong but not the same thing again."""
    kept: list[LeftOver] = []
    for one in found:
        known = any(one.subject == other.subject for other in kept)
        if not known and len(kept) < MOST_TOLD and (not kept or one.z**2 > NEARLY * kept[0].z ** 2):
            kept.append(one)
    return tuple(kept)
