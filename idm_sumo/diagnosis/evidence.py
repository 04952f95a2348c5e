"""What the data say about every atom: scores less those of the null twins, Gram matrix, inflation."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import get_num_threads

from idm_sumo.diagnosis import atoms as at
from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.left_over import Heard, LeftOver, hear, left_over
from idm_sumo.diagnosis.luck import Luck, Noises
from idm_sumo.diagnosis.rollout import PARAMETERS
from idm_sumo.diagnosis.twins import drawn_anew, make_twin, refit, start_behind
from idm_sumo.effects.leader_class import TRUCK
from idm_sumo.progress import Progress

Floats = npt.NDArray[np.float64]
Build = Callable[[w.Windows, Fit, at.Answer, at.Grid], tuple[list[at.Atom], Floats]]

ENDOGENOUS = ("follower_pressure",)  # the follower answers the real driver, not the twin: no twin for these
# What differs between drivers more than within one: part of it is in the fitted drivers, so twins of drawn ones are the null.
BETWEEN = (
    "leader_class", "speed_dependent_headway", "time_of_day", "location", "desired_speed", "vehicle_class", "lane_change_relaxation",
)  # fmt: skip


@dataclass(frozen=True)
class Subject:
    """A recording under examination.

    Attributes
    ----------
    windows : Windows
    noises : Noises
    grid : Grid
    is_smooth : bool
        Whether it needed no smoothing.
    """

    windows: w.Windows
    noises: Noises
    grid: at.Grid
    is_smooth: bool


@dataclass(frozen=True)
class Evidence:
    """Scores of all atoms at one model.

    Attributes
    ----------
    atoms : list of Atom
    u : float64, shape (drivers, atoms)
        The recording's scores, the twins' mean taken off each driver evenly.
    twins : float64, shape (twins, atoms)
        Total scores of each twin.
    gram : float64, shape (atoms, atoms)
    part : float64, shape (drivers, atoms)
        Each driver's share of the diagonal of ``gram``.
    block : int64, shape (drivers,)
        Platoon blocks.
    free : tuple of LeftOver
        What no effect was asked for, the most significant first; empty if it was not looked for.
    """

    atoms: list[at.Atom]
    u: Floats
    twins: Floats
    gram: Floats
    part: Floats
    block: npt.NDArray[np.int64]
    free: tuple[LeftOver, ...] = ()

    def total(self) -> Floats:
        """Return the corrected total score of each atom."""
        return np.asarray(self.u.sum(axis=0))

    def clustered(self, mix: Floats) -> Floats:
        """Return the variance of combined scores from blocks of drivers and from the twins, shape ``(combinations,)``.

        What each driver would score if the estimate were true is taken off: a rare effect is not its own noise.
        """
        values = self.u @ mix
        part = self.part @ mix
        expected = values.sum(axis=0) * part / np.maximum(part.sum(axis=0), 1e-300)
        sums = np.zeros((self.block.max() + 1, values.shape[1]))
        np.add.at(sums, self.block, values - expected)
        between = (self.twins @ mix).var(axis=0, ddof=1) / len(self.twins) if len(self.twins) > 1 else 0.0
        return np.asarray((sums**2).sum(axis=0) + between)

    def inflation(self) -> float:
        """Return by how much the clustered variance exceeds the model's, the median over bins of place and time."""
        bins = [n for n, atom in enumerate(self.atoms) if atom.name in ("location", "time_of_day")]
        informative = [n for n in bins if self.gram[n, n] > 1e-9]
        if not informative:
            return 1.5
        ratio = self.clustered(np.eye(len(self.atoms))[:, informative]) / np.diag(self.gram)[informative]
        return float(max(np.median(ratio), 1.0))


def score(
    subject: Subject, windows: w.Windows, fit: Fit, build: Build = at.build, answer: at.Answer | None = None
) -> tuple[list[at.Atom], gls.Scores]:
    """Return the scores of all atoms, orthogonal to what drivers, trucks as drivers and the population can absorb.

    Not yet to the car-following's own form: that is for :func:`guard`, after the twins.
    """
    answer = at.answer_of(windows, fit) if answer is None else answer
    line = answer.line
    atoms, columns = build(windows, fit, answer, subject.grid)
    columns = at.tamed(columns)
    truck = (windows.seen[:, -1, w.OWN_KIND] == TRUCK)[:, None, None]
    parts = [line.jacobian * truck, columns] if truck.any() else [columns]
    error, own, *rest = (line.whitener @ part for part in (line.error[:, :, None], line.jacobian, *parts))
    known = PARAMETERS * (2 if truck.any() else 1)
    whole = gls.scores(
        error,
        own,
        np.concatenate([own, *rest], axis=2),
        np.asarray(np.linalg.inv(fit.spread), dtype=np.float64),
        windows.driver,
        windows.drivers,
    )
    whole = whole.without(np.arange(known))
    return atoms, gls.Scores(whole.u[:, known:], whole.gram[known:, known:], whole.part[:, known:])


def _are_instant(atoms: list[at.Atom]) -> npt.NDArray[np.bool_]:
    """Return which atoms are themselves laws of the moment, or the form of one."""
    names = [atom.name.removeprefix(at.LOCAL) for atom in atoms]
    return np.array([name in at.INSTANT or name.startswith(at.GUARD) for name in names])


def guard(atoms: list[at.Atom], gram: Floats) -> Floats:
    """Return what projects the car-following's own form out of every atom that is not itself an instantaneous law.

    Scores times this matrix are free of it. Without it another model underneath (not an IDM) shows as effects of place and
    time, wherever speeds differ.
    """
    instant = _are_instant(atoms)
    form = np.array(
        [n for n, atom in enumerate(atoms) if atom.name.startswith(at.GUARD) or atom.name in at.INSTANT[:2]]
    )
    out = np.eye(len(atoms))
    out[np.ix_(form, np.flatnonzero(~instant))] -= (
        gls.scaled_inverse(gram[np.ix_(form, form)]) @ gram[form][:, ~instant]
    )
    return out


def examine(
    subject: Subject,
    fit: Fit,
    lucks: list[Luck],
    *,
    progress: Progress,
    stage: str,
    free: bool = False,
) -> Evidence:
    """Score the recording and its null twins, one for each luck, at one model.

    If ``free``, everything that is no effect of the catalogue, too.
    """
    answer = at.answer_of(subject.windows, fit)
    atoms, found = score(subject, subject.windows, fit, at.build, answer)
    free_of_form = guard(atoms, found.gram)
    progress(stage, 0, 1)
    heard = Twins([], []) if free else None
    totals = _twin_totals(subject, fit, lucks, atoms, at.build, free_of_form, heard)
    progress(stage, 1, 1)
    evidence = _corrected(subject, atoms, found, free_of_form, totals)
    if heard is None:
        return evidence
    left = left_over(subject.windows, fit, subject.grid, answer, heard.fitted, heard.drawn, evidence.inflation())
    return replace(evidence, free=tuple(left))


class Twins(NamedTuple):
    """What twins of the fitted drivers, and of drivers drawn anew, say of everything free."""

    fitted: list[Heard]
    drawn: list[Heard]


def _twin_totals(
    subject: Subject, fit: Fit, lucks: list[Luck], atoms: list[at.Atom], build: Build,
    free_of_form: Floats, heard: Twins | None = None,
) -> Floats:  # fmt: skip
    """Return the total scores of null twins, shape ``(twins, atoms)``: of drawn drivers for what differs between drivers.

    The form of the car-following is taken out of them as out of the recording, by the recording's Gram matrix and as twins of
    the fitted drivers show it: these share their paths with the recording, drawn ones do not. What they say of everything free
    is added to ``heard``.
    """
    names = [atom.name.removeprefix(at.LOCAL) for atom in atoms]
    asked = np.array([build is at.build or atom.name.startswith(at.LOCAL) for atom in atoms])
    between = asked & np.array([name.startswith(BETWEEN) for name in names])
    listen = heard is not None
    own = {}
    for drawn in (False, True) if between.any() else (False,):
        each = _each_twin(subject, fit, lucks, build, drawn=drawn, listen=listen)
        own[drawn] = np.array([scores for scores, _ in each])
        if heard is not None:
            heard[drawn].extend(free for _, free in each if free is not None)
    of_form = own[False] @ (free_of_form - np.eye(len(atoms)))
    totals = np.where(between, own.get(True, own[False]), own[False])
    return np.asarray(totals * [name not in ENDOGENOUS for name in names] + of_form)


def _each_twin(
    subject: Subject, fit: Fit, lucks: list[Luck], build: Build, *, drawn: bool, listen: bool
) -> list[tuple[Floats, Heard | None]]:
    """Return the total scores of each twin, with the fitted drivers or with drawn ones, and what is heard of everything free."""

    def one(luck: Luck) -> tuple[Floats, Heard | None]:
        drivers = drawn_anew(fit, luck) if drawn else fit
        behind = start_behind(subject.windows, fit, drivers) if drawn else 0.0
        twin = make_twin(subject.windows, drivers, luck, is_smooth=subject.is_smooth, behind=behind)
        fitted = refit(twin, drivers)
        answer = at.answer_of(twin, fitted)
        total = np.asarray(score(subject, twin, fitted, build, answer)[1].u.sum(axis=0))
        return total, hear(twin, fitted, subject.grid, answer) if listen else None

    with ThreadPoolExecutor(get_num_threads()) as pool:
        return list(pool.map(one, lucks))


def _corrected(
    subject: Subject, atoms: list[at.Atom], found: gls.Scores, free_of_form: Floats, totals: Floats
) -> Evidence:
    """Return the evidence of scores free of the form, from which the twins' mean is taken, a window like the other."""
    share = np.bincount(subject.windows.driver, minlength=len(found.u)) / len(subject.windows.driver)
    corrected = found.u @ free_of_form - share[:, None] * totals.mean(axis=0)
    gram = _gram(atoms, found.gram, free_of_form)
    return Evidence(atoms, corrected, totals, gram, found.part, subject.windows.platoon)


def _gram(atoms: list[at.Atom], gram: Floats, free_of_form: Floats) -> Floats:
    """Return the Gram matrix of atoms free of the form; they and those that are laws of the moment are not compared."""
    instant = _are_instant(atoms)
    return np.asarray((free_of_form.T @ gram @ free_of_form) * (instant[:, None] == instant))


class Local(NamedTuple):
    """Score and information of a little more of a magnitude that is in the model."""

    score: float
    information: float


class Here(NamedTuple):
    """How the recording wants each magnitude in the model changed, before any twin is heard."""

    scores: dict[str, Local]
    atoms: list[at.Atom]
    information: Floats
    free_of_form: Floats


def local_scores(subject: Subject, fit: Fit) -> Here:
    """Return how the recording wants each magnitude in the model changed."""
    atoms, found = score(subject, subject.windows, fit, at.build_local)
    free_of_form = guard(atoms, found.gram)
    information = np.diag(_gram(atoms, found.gram, free_of_form))
    return Here(_by_name(atoms, (found.u @ free_of_form).sum(axis=0), information), atoms, information, free_of_form)


def local_biases(subject: Subject, fit: Fit, here: Here, lucks: list[Luck]) -> dict[str, Local]:
    """Return the same of twins in which the model as it is drives: the score that noise and smoothing make."""
    totals = _twin_totals(subject, fit, lucks, here.atoms, at.build_local, here.free_of_form)
    return _by_name(here.atoms, totals.mean(axis=0), here.information)


def _by_name(atoms: list[at.Atom], total: Floats, information: Floats) -> dict[str, Local]:
    return {
        atom.name.removeprefix(at.LOCAL): Local(float(total[n]), float(information[n]))
        for n, atom in enumerate(atoms)
        if atom.name.startswith(at.LOCAL)
    }
