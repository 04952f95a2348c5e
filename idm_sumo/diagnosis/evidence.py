"""What the data say about every atom: scores less those of the null twins, Gram matrix, inflation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import atoms as at
from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit, linearise
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.rollout import PARAMETERS
from idm_sumo.diagnosis.twins import make_twin, refit
from idm_sumo.effects.leader_class import TRUCK
from idm_sumo.progress import Progress

Floats = npt.NDArray[np.float64]

ENDOGENOUS = (
    "follower_pressure",
    "free:rear_gap",
)  # the follower answers the real driver, not the twin: no twin for these


@dataclass(frozen=True)
class Subject:
    """A recording under examination.

    Attributes
    ----------
    windows : Windows
    measurement, driver : Noise
    grid : Grid
    is_smooth : bool
        Whether it needed no smoothing.
    """

    windows: w.Windows
    measurement: Noise
    driver: Noise
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
    block : int64, shape (drivers,)
        Platoon blocks.
    """

    atoms: list[at.Atom]
    u: Floats
    twins: Floats
    gram: Floats
    block: npt.NDArray[np.int64]

    def total(self) -> Floats:
        """Return the corrected total score of each atom."""
        return np.asarray(self.u.sum(axis=0))

    def clustered(self, mix: Floats) -> Floats:
        """Return the variance of combined scores from blocks of drivers and from the twins, shape ``(combinations,)``."""
        values = self.u @ mix
        sums = np.zeros((self.block.max() + 1, values.shape[1]))
        np.add.at(sums, self.block, values - values.mean(axis=0))
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


def score(subject: Subject, windows: w.Windows, fit: Fit) -> tuple[list[at.Atom], gls.Scores]:
    """Return the scores of all atoms, orthogonal to what drivers, trucks as drivers and the population can absorb."""
    line = linearise(windows, fit)
    atoms, columns, _, _ = at.build(windows, fit, line.simulated, subject.grid)
    truck = (windows.seen[:, -1, w.OWN_KIND] == TRUCK)[:, None, None]
    parts = [line.jacobian * truck, columns] if truck.any() else [columns]
    error, own, *rest = gls.whiten(line.covariance, line.error[:, :, None], line.jacobian, *parts)
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
    return atoms, guarded(atoms, gls.Scores(whole.u[:, known:], whole.gram[known:, known:]))


def guarded(atoms: list[at.Atom], plain: gls.Scores) -> gls.Scores:
    """Project the car-following's own form out of every atom that is not itself an instantaneous law.

    Without it another model underneath (not an IDM) shows as effects of place and time, wherever speeds differ.
    """
    names = [atom.name.removeprefix(at.LOCAL) for atom in atoms]
    instant = np.array([name in at.INSTANT or name.startswith(at.GUARD) for name in names])
    form = np.array(
        [n for n, atom in enumerate(atoms) if atom.name.startswith(at.GUARD) or atom.name in at.INSTANT[:2]]
    )
    others = plain.without(form)
    u = np.where(instant, plain.u, others.u)
    both = np.outer(instant, instant)
    return gls.Scores(u, np.where(both, plain.gram, np.where(np.outer(~instant, ~instant), others.gram, 0.0)))


def examine(
    subject: Subject, fit: Fit, rng: np.random.Generator, *, twins: int, progress: Progress, stage: str
) -> Evidence:
    """Score the recording and its null twins at one model."""
    atoms, found = score(subject, subject.windows, fit)
    totals = np.zeros((twins, len(atoms)))
    for k in range(twins):
        progress(stage, k, twins)
        twin = make_twin(subject.windows, fit, subject.measurement, subject.driver, rng, is_smooth=subject.is_smooth)
        totals[k] = score(subject, twin, refit(twin, fit))[1].u.sum(axis=0)
    progress(stage, twins, twins)
    totals[:, [n for n, atom in enumerate(atoms) if atom.name in ENDOGENOUS]] = 0.0
    share = np.bincount(subject.windows.driver, minlength=len(found.u)) / len(subject.windows.driver)
    corrected = found.u - share[:, None] * totals.mean(axis=0)
    return Evidence(atoms, corrected, totals, found.gram, subject.windows.platoon)


def rescored(subject: Subject, fit: Fit, evidence: Evidence) -> Evidence:
    """Score the recording at a model close by, with the twins of the old one."""
    atoms, found = score(subject, subject.windows, fit)
    share = np.bincount(subject.windows.driver, minlength=len(found.u)) / len(subject.windows.driver)
    return Evidence(
        atoms, found.u - share[:, None] * evidence.twins.mean(axis=0), evidence.twins, found.gram, evidence.block
    )
