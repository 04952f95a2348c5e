r"""The shape that a car-following law lacks, whatever its drivers' parameters, over gap, speed and approach rate.

What is left of the recording is explained by a smooth acceleration :math:`\sum_k \delta_k f_k(s, v, \Delta v)` through the rollouts'
linear response, with :math:`\delta_k \sim N(0, \tau^2)` and the likeliest :math:`\tau`. Drivers' own parameters take what they can first,
and what null replicates show is taken off, so that neither fitting nor smoothing is mistaken for it.

References
----------
Kennedy and O'Hagan (2001), Bayesian calibration of computer models.
MacKay (1992), Bayesian interpolation (the likeliest :math:`\tau`).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.columns import basis
from idm_sumo.diagnosis.evidence import ROUNDING
from idm_sumo.diagnosis.plan import BASIS

Floats = npt.NDArray[np.float64]

FORMS = len(BASIS)
SMALLEST, LARGEST = 1e-4, 2.0  # m/s², between which tau is looked for
CELLS = 8  # along each side, between quantiles
FEWEST_DRIVERS = 5  # in a cell
COLUMNS = [
    "x_name", "x_low_m_s", "x_high_m_s", "gap_low_m", "gap_high_m", "acceleration_m_s2", "standard_error_m_s2", "drivers",
]  # fmt: skip


class FormEvidence(NamedTuple):
    """What a recording says of the law's form.

    Attributes
    ----------
    score : float64, shape (FORMS,)
        Less that of null replicates.
    gram : float64, shape (FORMS, FORMS)
        Its covariance, if the law lacks nothing.
    """

    score: Floats
    gram: Floats


class Cell(NamedTuple):
    """A range of gaps (m) and of speeds or approach rates (m/s), and the acceleration that the law lacks there (m/s²)."""

    x_name: str
    x_m_s: tuple[float, float]
    gap_m: tuple[float, float]
    acceleration: float
    standard_error: float
    drivers: int


@dataclass(frozen=True)
class LawMisfit:
    r"""The acceleration that the law lacks.

    Attributes
    ----------
    typical_m_s2 : float
        Likeliest standard deviation :math:`\tau` of a coefficient; zero if the law lacks nothing.
    p_value : float
        Of a law that lacks nothing (chi-squared).
    cells : tuple of Cell
        That at least five drivers were in: gaps by speeds, and gaps by approach rates.
    """

    typical_m_s2: float
    p_value: float
    cells: tuple[Cell, ...]

    @property
    def surest(self) -> Cell | None:
        """The cell in which it is most standard errors; None if the law lacks nothing."""
        some = [cell for cell in self.cells if cell.standard_error > 0.0]
        return max(some, key=lambda cell: abs(cell.acceleration) / cell.standard_error, default=None)

    @property
    def table(self) -> pd.DataFrame:
        """One row a cell: ``x_name, x_low_m_s, x_high_m_s, gap_low_m, gap_high_m, acceleration_m_s2, standard_error_m_s2, drivers``."""
        rows = [(c.x_name, *c.x_m_s, *c.gap_m, c.acceleration, c.standard_error, c.drivers) for c in self.cells]
        return pd.DataFrame(rows, columns=COLUMNS)


def law_misfit(windows: w.Windows, evidence: FormEvidence, pivot: float) -> LawMisfit:
    """Return the shape that the law lacks.

    Parameters
    ----------
    windows : Windows
        That were examined.
    evidence : FormEvidence
    pivot : float
        Mean speed of the recording (m/s).

    Returns
    -------
    LawMisfit
    """
    tau = _likeliest(evidence)
    distance = float(evidence.score @ np.linalg.pinv(evidence.gram, rcond=ROUNDING, hermitian=True) @ evidence.score)
    mean, covariance = _posterior(evidence, tau)
    return LawMisfit(tau, float(chi2.sf(distance, FORMS)), _cells(windows, mean, covariance, pivot))


def _likeliest(evidence: FormEvidence) -> float:
    """Return the likeliest standard deviation of the coefficients, zero if none is likelier."""

    def unlikely(log_tau: float) -> float:
        return -_log_evidence(evidence, float(np.exp(log_tau)))

    found = minimize_scalar(unlikely, bounds=(np.log(SMALLEST), np.log(LARGEST)), method="bounded")
    return float(np.exp(found.x)) if found.fun < 0.0 else 0.0


def _log_evidence(evidence: FormEvidence, tau: float) -> float:
    """Return the log-likelihood over that of a law that lacks nothing."""
    inner = evidence.gram + np.eye(FORMS) / tau**2
    pull = evidence.score @ np.linalg.solve(inner, evidence.score)
    return float(0.5 * pull - 0.5 * np.linalg.slogdet(np.eye(FORMS) + tau**2 * evidence.gram)[1])


def _posterior(evidence: FormEvidence, tau: float) -> tuple[Floats, Floats]:
    """Return the coefficients' mean and covariance."""
    if tau == 0.0:
        return np.zeros(FORMS), np.zeros((FORMS, FORMS))
    covariance = np.asarray(np.linalg.inv(evidence.gram + np.eye(FORMS) / tau**2), dtype=np.float64)
    return covariance @ evidence.score, covariance


def _cells(windows: w.Windows, mean: Floats, covariance: Floats, pivot: float) -> tuple[Cell, ...]:
    """Return the missing acceleration, the mean over recorded moments, where drivers were."""
    at = windows.seen[:, :, w.LEAD + w.EVERY :: w.EVERY]
    gap, speed = (at[:, w.REAR] - at[:, w.X]).ravel(), at[:, w.V].ravel()
    rate = speed - at[:, w.SPEED].ravel()
    forms = basis(speed, rate, gap, pivot)
    driver = np.repeat(windows.driver, at.shape[2])
    out = []
    for name, values in (("speed", speed), ("approach_rate", rate)):
        for x, gaps in itertools.product(_intervals(values), _intervals(gap)):
            inside = (values >= x[0]) & (values < x[1]) & (gap >= gaps[0]) & (gap < gaps[1])
            drivers = len(np.unique(driver[inside]))
            if drivers >= FEWEST_DRIVERS:
                usual = forms[inside].mean(axis=0)
                error = float(np.sqrt(usual @ covariance @ usual))
                out.append(Cell(name, x, gaps, float(usual @ mean), error, drivers))
    return tuple(out)


def _intervals(values: Floats) -> list[tuple[float, float]]:
    """Return intervals that hold about as many moments each; a few at either end are left out."""
    edges = np.unique(np.quantile(values, np.linspace(0.01, 0.99, CELLS + 1)))
    return list(itertools.pairwise(edges.tolist()))
