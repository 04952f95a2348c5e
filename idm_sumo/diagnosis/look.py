"""A look at a recording, or at a replicate, at one model: scores of all regressors, free of the car-following's own form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Noises
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.linear_pulses import GUARD
from idm_sumo.diagnosis.rollout import PARAMETERS
from idm_sumo.recordings.columns import TRUCK

Floats = npt.NDArray[np.float64]
Build = Callable[[w.Windows, Fit, rg.Answer, rg.Grid], tuple[list[rg.Regressor], Floats]]


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
    grid: rg.Grid
    is_smooth: bool


@dataclass(frozen=True)
class Look:
    """What a recording says at one model, before any replicate is evaluated.

    Attributes
    ----------
    regressors : list of Regressor
    build : callable
        That made them.
    found : Scores
    free_of_form : float64, shape (regressors, regressors)
        Of :func:`guard`.
    """

    regressors: list[rg.Regressor]
    build: Build
    found: gls.Scores
    free_of_form: Floats

    @property
    def u(self) -> Floats:
        """Scores free of the form, shape ``(drivers, regressors)``."""
        return np.asarray(self.found.u @ self.free_of_form)

    @property
    def gram(self) -> Floats:
        """Gram matrix of regressors free of the form; they and those that are laws of the moment are not compared."""
        instant = _are_instant(self.regressors)
        return np.asarray((self.free_of_form.T @ self.found.gram @ self.free_of_form) * (instant[:, None] == instant))

    @property
    def names(self) -> list[str]:
        """The regressors' effects, whether or not they are in the model already."""
        return [regressor.name.removeprefix(rg.LOCAL) for regressor in self.regressors]


def look(subject: Subject, fit: Fit, build: Build, answer: rg.Answer | None = None) -> Look:
    """Return what the recording says at a fit of all regressors that ``build`` makes."""
    regressors, found = score(subject, subject.windows, fit, build, answer)
    return Look(regressors, build, found, guard(regressors, found.gram))


def score(
    subject: Subject, windows: w.Windows, fit: Fit, build: Build = rg.build, answer: rg.Answer | None = None
) -> tuple[list[rg.Regressor], gls.Scores]:
    """Return the scores of all regressors, orthogonal to what drivers, trucks as drivers and the population can absorb.

    Not yet to the car-following's own form: that is for :func:`guard`, after the replicates.
    """
    answer = rg.answer_of(windows, fit, subject.grid.pivot) if answer is None else answer
    line = answer.line
    regressors, columns = build(windows, fit, answer, subject.grid)
    truck = (windows.seen[:, w.OWN_KIND, -1] == TRUCK)[:, None, None]
    of_trucks = line.jacobian * truck if truck.any() else line.jacobian[:, :, :0]
    common = np.concatenate([line.jacobian, of_trucks, line.shared], axis=2)
    known = common.shape[2]
    white = np.empty((*columns.shape[:2], known + columns.shape[2]))
    np.matmul(line.whitener, common, out=white[:, :, :known])
    np.matmul(line.whitener, columns, out=white[:, :, known:])
    white[:, :, known:] *= rg.taming(columns)[:, None, :]
    whole = gls.scores(
        line.whitener @ line.error[:, :, None],
        white[:, :, :PARAMETERS],
        white,
        np.asarray(np.linalg.inv(fit.spread), dtype=np.float64),
        windows.driver,
        windows.drivers,
    )
    whole = whole.without(np.arange(known))
    return regressors, gls.Scores(whole.u[:, known:], whole.gram[known:, known:], whole.part[:, known:])


def guard(regressors: list[rg.Regressor], gram: Floats) -> Floats:
    """Return what projects the car-following's own form out of every regressor that is not itself an instantaneous law.

    Scores times this matrix are free of it. Without it another model underneath (not an IDM) shows as effects of place and
    time, wherever speeds differ.
    """
    instant = _are_instant(regressors)
    form = np.array(
        [
            n
            for n, regressor in enumerate(regressors)
            if regressor.name.startswith(GUARD) or regressor.name in rg.INSTANT[:2]
        ]
    )
    out = np.eye(len(regressors))
    out[np.ix_(form, np.flatnonzero(~instant))] -= (
        gls.scaled_inverse(gram[np.ix_(form, form)]) @ gram[form][:, ~instant]
    )
    return out


def _are_instant(regressors: list[rg.Regressor]) -> npt.NDArray[np.bool_]:
    """Return which regressors are themselves laws of the moment, or the form of one."""
    names = [regressor.name.removeprefix(rg.LOCAL) for regressor in regressors]
    return np.array([name in rg.INSTANT or name.startswith(GUARD) for name in names])
