r"""One competition: a sum of single effects on scores and their Gram matrix.

Each component is one hypothesis with a size :math:`\beta \sim N(0, W)`, :math:`W` the squared typical size. With an estimate of
variance :math:`V` and :math:`z^2 = \hat\beta^2/V`, the logarithm of its Bayes factor is

.. math:: \tfrac12 \ln\frac{V}{V+W} + \tfrac12 z^2 \frac{W}{V+W}

The law's own misfit is a smooth field with a prior :math:`N(0, \tau^2)`, integrated out; :math:`\tau` is the likeliest.

References
----------
Wang, Sarkar, Carbonetto and Stephens (2020), A simple new approach to variable selection in regression (SuSiE).
Kennedy and O'Hagan (2001), Bayesian calibration of computer models.
Wakefield (2009), Bayes factors for genome-wide association studies.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.special import log_ndtr, logsumexp

from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.library import Library
from idm_sumo.diagnosis.plan import MISFIT
from idm_sumo.diagnosis.settings import Settings

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

TAUS = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)  # m/s², of the law's misfit
RESPONSE_SPREAD = 1.0  # of the law's response, everywhere: that of another law
ROUNDS = 12  # of the competition
NULL_DRAWS = 2000  # for thresholds
LEAST = 1e-9


@dataclass(frozen=True)
class Component:
    """One effect of the sum.

    Attributes
    ----------
    weight : float64, shape (hypotheses,)
        Posterior probability of each hypothesis; sums to one less the probability that there is nothing.
    size, deviation : float64, shape (hypotheses,)
        Posterior mean and standard deviation of each magnitude.
    log_bf : float64, shape (hypotheses,)
    by_family : float64, shape (names,)
        Logarithm of the mean Bayes factor over a family's hypotheses.
    z : float64, shape (hypotheses,)
    """

    weight: Floats
    size: Floats
    deviation: Floats
    log_bf: Floats
    by_family: Floats
    z: Floats

    def probability(self, library: Library) -> Floats:
        """Return the probability of each family."""
        return np.asarray(np.bincount(library.family, self.weight, len(library.names)))

    def odds(self, library: Library, settings: Settings) -> Floats:
        """Return the logarithm of the posterior odds of each family against nothing, as if there were no other."""
        prior = (1.0 - settings.nothing) * library.prior / settings.nothing
        return np.asarray(self.by_family + np.log(prior))


@dataclass(frozen=True)
class Selection:
    """The outcome of a competition.

    Attributes
    ----------
    components : tuple of Component
        Strongest first.
    tau : float
        Of the law's misfit (m/s²).
    arena : Competition
        In which they settled.
    explained : float64, shape (columns,)
        Sizes that the components expect together.
    unexplained : float
        How much likelier the recording is with something beside the effects in the model (a log-likelihood ratio).
    """

    components: tuple[Component, ...]
    tau: float
    arena: Competition
    explained: Floats
    unexplained: float

    def is_by_chance(self, family: int, log_bf: float) -> bool:
        """Return whether chance makes a family's mean Bayes factor as large as this, or it speaks for nothing."""
        return log_bf <= 0.0 or log_bf <= self.arena.threshold(family)


def misfit_columns(library: Library, tau: float) -> tuple[Integers, Floats]:
    """Return the columns of the law's misfit, and the precision of each one's prior.

    The smooth functions come first, of deviation ``tau``, none of them if that is zero; a response that is stronger or weaker everywhere comes last.
    """
    columns = library.plan.of(MISFIT)
    if tau == 0.0:
        return columns[-1:], np.full(len(columns[-1:]), RESPONSE_SPREAD**-2)
    return columns, np.append(np.full(len(columns) - 1, tau**-2), RESPONSE_SPREAD**-2)


class Competition:
    """Scores and Gram matrix of all hypotheses, the law's misfit integrated out."""

    def __init__(self, evidence: Evidence, library: Library, settings: Settings, score: Floats, tau: float) -> None:
        self.library, self.settings, self.inflation = library, settings, evidence.inflation
        gram = evidence.gram / evidence.inflation
        self.unsure = 1.0 + evidence.replicate_error(library.mix)
        self.rough, precision = misfit_columns(library, tau)
        inner = gram[np.ix_(self.rough, self.rough)]
        self.held = np.linalg.inv(inner + np.diag(precision))
        self.log_volume = float(np.linalg.slogdet(np.eye(len(self.rough)) + inner / precision)[1])
        self.by = gram[:, self.rough] @ self.held
        self.gram = gram - self.by @ gram[self.rough]
        self.mixed = library.mix @ self.gram
        self.information = np.maximum(np.asarray(library.mix.multiply(self.mixed).sum(axis=1)).ravel(), LEAST)
        shares = np.maximum(evidence.part @ (library.mix.multiply(library.mix)).T, 0.0)
        shares /= np.maximum(shares.sum(axis=0), 1e-300)
        self.few = (shares**2).sum(axis=0)
        self.slab = library.size**2
        doubt = (settings.doubt * library.size) ** 2 + library.selection**2
        self.fixed = settings.spread**2 * self.slab * self.few + doubt
        self.is_positive = library.lower >= 0.0
        self._thresholds: dict[int, float] = {}
        self._take(score)

    def _take(self, score: Floats) -> None:
        score = score / self.inflation
        known = score[self.rough]
        self.misfit_evidence = 0.5 * float(known @ self.held @ known) - 0.5 * self.log_volume
        self.score = score - self.by @ known

    def over(self, score: Floats) -> Competition:
        """Return the same competition over another score."""
        other = copy.copy(self)
        other._take(score)
        return other

    def component(self, others: Floats, *, careful: bool = False) -> Component:
        """Return the single effect that explains what other effects, as sizes of columns, leave.

        A size near zero may underrate an effect, and so is only ``careful`` at the size reached: then it has a systematic error, and
        drivers differ in it.
        """
        theirs = self.mixed @ others
        estimate = (self.library.mix @ self.score - theirs) / self.information
        leak = self.settings.doubt * theirs / self.information
        variance = self.unsure / self.information + leak**2 + (self.fixed if careful else 0.0)
        keep = self.slab / (variance + self.slab)
        z = estimate / np.sqrt(variance)
        log_bf = 0.5 * np.log1p(-keep) + 0.5 * z**2 * keep
        mean, deviation = estimate * keep, np.sqrt(variance * keep)
        inside = mean / deviation
        one_sided = np.log(2.0) + log_ndtr(inside)
        log_bf = np.where(self.is_positive, log_bf + one_sided, log_bf)
        mean = np.where(self.is_positive, np.maximum(mean, 0.0), mean)
        library = self.library
        family = _by_family(log_bf + np.log(library.within), library)
        prior = np.log((1.0 - self.settings.nothing) * library.prior[library.family] * library.within)
        weight = log_bf + prior
        total = logsumexp(np.append(weight, np.log(self.settings.nothing)))
        return Component(np.exp(weight - total), mean, deviation, log_bf, family, z)

    @property
    def nothing(self) -> Floats:
        """Return the sizes of columns of no effect."""
        return np.zeros(self.library.plan.count)

    def contribution(self, component: Component) -> Floats:
        """Return the sizes of columns that a component expects."""
        return np.asarray(self.library.mix.T @ (component.weight * component.size))

    def threshold(self, family: int) -> float:
        """Return what a family's mean Bayes factor exceeds by chance at the stated rate of false alarms."""
        if family not in self._thresholds:
            which = self.library.family == family
            information = self.information[which]
            keep = (self.slab[which] / (self.unsure[which] / information + self.slab[which]))[:, None]
            z = (self.library.mix[which] @ self._by_chance) / np.sqrt(information)[:, None]
            log_bf = 0.5 * np.log1p(-keep) + 0.5 * z**2 * keep
            log_bf = np.where(self.is_positive[which, None] & (z < 0.0), np.log1p(-keep), log_bf)
            most = logsumexp(log_bf + np.log(self.library.within[which])[:, None], axis=0)
            rate = self.settings.false_alarms / len(self.library.names)
            self._thresholds[family] = float(np.quantile(most, 1.0 - rate))
        return self._thresholds[family]

    @cached_property
    def _by_chance(self) -> Floats:
        """Scores of columns where nothing is hidden, shape ``(columns, NULL_DRAWS)``; always the same draws."""
        values, vectors = np.linalg.eigh(self.gram)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(root @ np.random.default_rng(0).standard_normal((len(values), NULL_DRAWS)))


def _by_family(values: Floats, library: Library) -> Floats:
    """Return the log-sum-exp of values over each family."""
    top = np.full(len(library.names), -np.inf)
    np.maximum.at(top, library.family, values)
    sums = np.bincount(library.family, np.exp(values - top[library.family]), len(top))
    return np.asarray(top + np.log(sums))


def compete(evidence: Evidence, library: Library, settings: Settings, score: Floats) -> Selection:
    """Return the sum of single effects that explains a score best, with the likeliest size of the law's misfit."""
    best, most, unexplained = None, -np.inf, -np.inf
    for tau in TAUS:
        arena = Competition(evidence, library, settings, score, tau)
        support, components = _at(arena)
        if support > most:
            best, most = (tau, arena, components), support
        left = support if score is evidence.score else _at(arena.over(evidence.score))[0]
        unexplained = max(unexplained, left)
    assert best is not None
    tau, arena, components = best
    components = _settled(arena, components)
    order = sorted(components, key=lambda one: -float(one.by_family.max()))
    explained = np.sum([arena.contribution(one) for one in components], axis=0)
    return Selection(tuple(order), tau, arena, explained, unexplained)


def _at(arena: Competition) -> tuple[float, list[Component]]:
    """Return how likely the score is at a size of the misfit, and components found one after the other."""
    components: list[Component] = []
    support, others = arena.misfit_evidence, np.zeros(arena.library.plan.count)
    for _ in range(arena.settings.components):
        one = arena.component(others)
        prior = np.log((1.0 - arena.settings.nothing) * arena.library.prior)
        support += float(logsumexp(np.append(one.by_family + prior, np.log(arena.settings.nothing))))
        components.append(one)
        others = others + arena.contribution(one)
    return support, components


def _settled(arena: Competition, components: list[Component]) -> list[Component]:
    """Return components each of which explains what the others leave."""
    parts = [arena.contribution(one) for one in components]
    for _ in range(ROUNDS):
        for n in range(len(components)):
            others = sum((part for k, part in enumerate(parts) if k != n), np.zeros(arena.library.plan.count))
            components[n] = arena.component(others)
            parts[n] = arena.contribution(components[n])
    return components
