"""A look at a recording, or at a twin, at one model: scores of all atoms, free of the car-following's own form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import atoms as at
from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.linear_pulses import GUARD
from idm_sumo.diagnosis.luck import Noises
from idm_sumo.diagnosis.rollout import PARAMETERS
from idm_sumo.recordings.columns import TRUCK

Floats = npt.NDArray[np.float64]
Build = Callable[[w.Windows, Fit, at.Answer, at.Grid], tuple[list[at.Atom], Floats]]


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
class Look:
    """What a recording says at one model, before any twin is heard.

    Attributes
    ----------
    atoms : list of Atom
    build : callable
        That made them.
    found : Scores
    free_of_form : float64, shape (atoms, atoms)
        Of :func:`guard`.
    """

    atoms: list[at.Atom]
    build: Build
    found: gls.Scores
    free_of_form: Floats

    @property
    def u(self) -> Floats:
        """Scores free of the form, shape ``(drivers, atoms)``."""
        return np.asarray(self.found.u @ self.free_of_form)

    @property
    def gram(self) -> Floats:
        """Gram matrix of atoms free of the form; they and those that are laws of the moment are not compared."""
        instant = _are_instant(self.atoms)
        return np.asarray((self.free_of_form.T @ self.found.gram @ self.free_of_form) * (instant[:, None] == instant))

    @property
    def names(self) -> list[str]:
        """The atoms' effects, whether or not they are in the model already."""
        return [atom.name.removeprefix(at.LOCAL) for atom in self.atoms]


def look(subject: Subject, fit: Fit, build: Build, answer: at.Answer | None = None) -> Look:
    """Return what the recording says at a fit of all atoms that ``build`` makes."""
    atoms, found = score(subject, subject.windows, fit, build, answer)
    return Look(atoms, build, found, guard(atoms, found.gram))


def score(
    subject: Subject, windows: w.Windows, fit: Fit, build: Build = at.build, answer: at.Answer | None = None
) -> tuple[list[at.Atom], gls.Scores]:
    """Return the scores of all atoms, orthogonal to what drivers, trucks as drivers and the population can absorb.

    Not yet to the car-following's own form: that is for :func:`guard`, after the twins.
    """
    answer = at.answer_of(windows, fit, subject.grid.pivot) if answer is None else answer
    line = answer.line
    atoms, columns = build(windows, fit, answer, subject.grid)
    truck = (windows.seen[:, w.OWN_KIND, -1] == TRUCK)[:, None, None]
    of_trucks = line.jacobian * truck if truck.any() else line.jacobian[:, :, :0]
    common = np.concatenate([line.jacobian, of_trucks, line.shared], axis=2)
    known = common.shape[2]
    white = np.empty((*columns.shape[:2], known + columns.shape[2]))
    np.matmul(line.whitener, common, out=white[:, :, :known])
    np.matmul(line.whitener, columns, out=white[:, :, known:])
    white[:, :, known:] *= at.taming(columns)[:, None, :]
    whole = gls.scores(
        line.whitener @ line.error[:, :, None],
        white[:, :, :PARAMETERS],
        white,
        np.asarray(np.linalg.inv(fit.spread), dtype=np.float64),
        windows.driver,
        windows.drivers,
    )
    whole = whole.without(np.arange(known))
    return atoms, gls.Scores(whole.u[:, known:], whole.gram[known:, known:], whole.part[:, known:])


def guard(atoms: list[at.Atom], gram: Floats) -> Floats:
    """Return what projects the car-following's own form out of every atom that is not itself an instantaneous law.

    Scores times this matrix are free of it. Without it another model underneath (not an IDM) shows as effects of place and
    time, wherever speeds differ.
    """
    instant = _are_instant(atoms)
    form = np.array([n for n, atom in enumerate(atoms) if atom.name.startswith(GUARD) or atom.name in at.INSTANT[:2]])
    out = np.eye(len(atoms))
    out[np.ix_(form, np.flatnonzero(~instant))] -= (
        gls.scaled_inverse(gram[np.ix_(form, form)]) @ gram[form][:, ~instant]
    )
    return out


def _are_instant(atoms: list[at.Atom]) -> npt.NDArray[np.bool_]:
    """Return which atoms are themselves laws of the moment, or the form of one."""
    names = [atom.name.removeprefix(at.LOCAL) for atom in atoms]
    return np.array([name in at.INSTANT or name.startswith(GUARD) for name in names])
