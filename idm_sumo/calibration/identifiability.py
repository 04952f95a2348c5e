r"""How well a window determines a driver's parameters.

Covariance, undetermined parameters and flat directions. The fit is an M-estimate: it minimises
:math:`\sum_t \rho(e_t)` of errors that are correlated in time. With the errors' derivatives
:math:`J_t`, the mean curvature :math:`\alpha_t =
\mathrm E\,\rho''` and score variance :math:`\beta_t = \mathrm E\,\rho'^2`, both for normal errors
of the residual variance :math:`\sigma^2`,

.. math:: A = \sum_t \alpha_t J_t J_t^\top,\qquad B = \tau\sum_t \beta_t J_t J_t^\top,\qquad
    C = (A B^{-1} A + P)^{-1},

the sandwich (Huber, 1967). :math:`\tau` is the errors' correlation time in frames, so that
``frames / tau`` errors are worth independent ones (Geyer's initial positive sequence, 1992),
and :math:`P` the precision of a uniform distribution between the bounds: what is known of a
parameter of which the window says nothing. The sandwich needs errors that are noise; where
the model itself is wrong, as on real drivers, the interval is one for the parameters that fit
best, not for a truth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import objective as o
from idm_sumo.calibration.kernel import (
    LOWER,
    PARAMETERS,
    UPPER,
    costs,
    costs_and_derivatives,
    from_search,
    slopes_at,
    start_sensitivities,
)  # fmt: skip
from idm_sumo.calibration.problem import Problem
from idm_sumo.models import idm

Floats = npt.NDArray[np.float64]

NAMES = idm.IDMParameters._fields
NORMAL_95 = 1.959964  # standard deviations on either side of a 95 % interval
UNDETERMINED_SHARE = 0.5  # of the range between the bounds: a 95 % interval wider than this says little
NEAR_BOUND = 1e-3  # of the range
# Known drivers behind noise were covered too rarely in short windows, where the fit also takes the
# slow part of the errors and is far from linear: the scores' variance is divided by this power of the
# share of the errors that the fit leaves, and not below this share. What is left differs by parameter
# and is set right by FACTORS; SYSTEMATIC (of log(b)) is what smoothing the leader's speed moves b by,
# however long the window. All chosen on known drivers so that 90 to 98 % are covered in windows of 10,
# 30 and 60 s (tests/calibration/test_recovery.py), every parameter by itself.
SMALL_SAMPLE, LEAST_LEFT = 5, 0.5
FACTORS = np.array([0.8, 1.0, 1.06, 1.15, 1.0])
SYSTEMATIC = np.array([0.0, 0.04, 0.0, 0.0, 0.0])
FEWEST = PARAMETERS + 2.0  # effective frames
# Frames: the correlation time of white noise smoothed by a cubic over 21 frames; no interval counts on a shorter one.
SMOOTHED = 9.3
START_SPEED_SD = 2.77  # 1/s: the error of a speed over that of a position, both smoothed by a cubic over 21 frames
LEAST_ERROR = 1e-3  # m (or the objective's unit), below any measurement: keeps a perfect fit's variance positive


class Identification(NamedTuple):
    """What a window says of its driver, for ``n`` drivers.

    Attributes
    ----------
    covariance : float64, shape (n, 5, 5)
        Of ``a, b, T, d0, d1`` in their SI units.
    search_sd : float64, shape (n, 5)
        Standard deviations in search coordinates, where the intervals are symmetric.
    effective_frames : float64, shape (n,)
        How many independent frames the errors are worth.
    error_sd : float64, shape (n,)
        Of the errors, corrected for what the fit absorbed.
    """

    covariance: Floats
    search_sd: Floats
    effective_frames: Floats
    error_sd: Floats

    @property
    def sd(self) -> Floats:
        """Standard deviations, shape ``(n, 5)``."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def identify(problem: Problem, z: Floats) -> Identification:
    """Return what the windows say of their drivers.

    Parameters
    ----------
    problem : Problem
    z : float64, shape (n, 5)
        Fits in search coordinates.

    Returns
    -------
    Identification
    """
    from scipy.stats import t  # here: scipy.stats takes long to load

    errors, every = start_sensitivities(problem, z)
    slopes, by_start = every[:, :PARAMETERS], every[:, PARAMETERS:]
    frames = problem.counted.sum(axis=1)
    worth = effective_frames(errors, problem.counted)
    effective = np.maximum(np.minimum(worth, frames / SMOOTHED), FEWEST)
    left = np.maximum(1.0 - PARAMETERS / effective, LEAST_LEFT)  # what the fit leaves of the errors
    variance = np.einsum("nh,nh->n", errors, errors) / np.maximum(frames, 1) / left**2  # squared: HC3
    variance = np.maximum(variance, LEAST_ERROR**2)
    alpha, beta = _expectations(problem, np.sqrt(variance))
    bread = np.einsum("nh,njh,nmh->njm", alpha, slopes, slopes, optimize=True)
    meat = np.einsum(
        "nh,njh,nmh->njm", beta * (frames / effective / left**SMALL_SAMPLE)[:, None], slopes, slopes, optimize=True
    )
    meat += _from_the_start(alpha[:, None] * slopes, by_start, variance)
    student = (t.ppf(0.975, effective - PARAMETERS) / NORMAL_95) ** 2
    prior = np.diag(12.0 / (UPPER - LOWER) ** 2)
    ridge = 1e-9 * np.einsum("njj->n", meat)[:, None, None] * np.eye(PARAMETERS) + 1e-300 * np.eye(PARAMETERS)
    information = bread @ np.linalg.solve((meat + ridge) * student[:, None, None], bread)
    in_search = np.linalg.inv(information + prior) * FACTORS[:, None] * FACTORS + np.diag(SYSTEMATIC**2)
    scale = slopes_at(z)
    covariance = in_search * scale[:, :, None] * scale[:, None, :]
    return Identification(covariance, np.sqrt(np.einsum("njj->nj", in_search)), worth, np.sqrt(variance))


def _from_the_start(gains: Floats, by_start: Floats, variance: Floats) -> Floats:
    """Return what the start adds to the scores' covariance.

    The start is recorded with the same noise as everything else, and its error lasts: position and
    speed at the start are wrong by as much as any. Shape ``(n, 5, 5)``.
    """
    scores = np.einsum("njh,nsh->nsj", gains, by_start, optimize=True)
    weighted = scores * (variance[:, None] * np.array([1.0, START_SPEED_SD**2]))[:, :, None]
    return np.asarray(np.einsum("nsj,nsm->njm", weighted, scores))


def effective_frames(errors: Floats, counted: npt.NDArray[np.bool_]) -> Floats:
    """Return how many independent frames errors are worth.

    Parameters
    ----------
    errors : float64, shape (n, h)
    counted : bool, shape (n, h)

    Returns
    -------
    float64, shape (n,)
    """
    return np.asarray(np.maximum(counted.sum(axis=1) / correlation_times(errors, counted), FEWEST))


def correlation_times(errors: Floats, counted: npt.NDArray[np.bool_]) -> Floats:
    """Return the correlation time of errors, in frames.

    One plus twice the sum of the autocorrelation up to its first value that is not positive
    (the initial positive sequence of Geyer, 1992).

    Parameters
    ----------
    errors : float64, shape (n, h)
    counted : bool, shape (n, h)

    Returns
    -------
    float64, shape (n,)
        At least 1.
    """
    h = errors.shape[1]
    centred = np.where(counted, errors, 0.0)
    spectrum = np.fft.rfft(centred, 2 * h, axis=1)
    correlation = np.fft.irfft(spectrum * spectrum.conj(), 2 * h, axis=1)[:, :h]
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.where(correlation[:, :1] > 0.0, correlation / correlation[:, :1], 0.0)
    positive = np.cumprod(correlation > 0.0, axis=1)
    return np.asarray(np.maximum(2.0 * (correlation * positive).sum(axis=1) - 1.0, 1.0))


def _expectations(problem: Problem, sd: Floats) -> tuple[Floats, Floats]:
    r"""Return every frame's mean curvature and score variance.

    Of the cost, for normal errors of standard deviation ``sd``; 0 where no frame counts.
    For the ADE, :math:`\alpha = (e_y^2 + \pi\sigma^2/2)^{-1/2}` and :math:`\beta = \sigma^2/(e_y^2 +
    \sigma^2)`, exact for a lateral error of 0 and for a large one.
    """
    s = sd[:, None]
    if problem.objective == o.ADE:
        square = problem.lateral**2
        alpha, beta = 1.0 / np.sqrt(square + 0.5 * np.pi * s * s), s * s / (square + s * s)
    elif problem.loss == o.SQUARED:
        alpha, beta = np.ones_like(problem.lateral), s * s * np.ones_like(problem.lateral)
    else:
        weight = problem.scale / np.hypot(problem.scale, s) * np.ones_like(problem.lateral)
        alpha, beta = weight, (weight * s) ** 2
    return np.where(problem.counted, alpha, 0.0), np.where(problem.counted, beta, 0.0)


def _at_bound(z: Floats) -> npt.NDArray[np.bool_]:
    """Return which search coordinates are at a bound."""
    return np.asarray(np.minimum(z - LOWER, UPPER - z) <= NEAR_BOUND * (UPPER - LOWER))


def at_bound(parameters: Floats) -> npt.NDArray[np.bool_]:
    """Return which parameters are at a bound.

    Parameters
    ----------
    parameters : float64, shape (n, 5)
        ``a, b, T, d0, d1`` in SI units.

    Returns
    -------
    bool, shape (n, 5)
        Within 0.1 % of the range between the bounds.
    """
    lower, upper = np.array(idm.LOWER), np.array(idm.UPPER)
    return np.asarray(np.minimum(parameters - lower, upper - parameters) <= NEAR_BOUND * (upper - lower))


def undetermined(identification: Identification, z: Floats) -> npt.NDArray[np.bool_]:
    """Return which parameters the window does not determine.

    Their 95 % interval is wider than half of the range between the bounds (of ``a, b``: in
    logarithms), or the fit ended on a bound, where the best value may lie beyond.

    Parameters
    ----------
    identification : Identification
    z : float64, shape (n, 5)
        Fits in search coordinates.

    Returns
    -------
    bool, shape (n, 5)
    """
    wide = 2.0 * NORMAL_95 * identification.search_sd > UNDETERMINED_SHARE * (UPPER - LOWER)
    return np.asarray(wide | _at_bound(z))


def names_of(which: npt.NDArray[np.bool_]) -> list[str]:
    """Return the names of the marked parameters, row by row.

    Parameters
    ----------
    which : bool, shape (n, 5)

    Returns
    -------
    list of str
        Joined by commas, '' for none.
    """
    return [",".join(name for name, hit in zip(NAMES, row, strict=True) if hit) for row in which]


def along_flat_direction(problem: Problem, z: Floats, shares: npt.ArrayLike = (0.05, 0.1, 0.2, 0.4)) -> pd.DataFrame:
    """Measure how the objective grows along its flattest direction.

    Parameters
    ----------
    problem : Problem
    z : float64, shape (n, 5)
        Fits in search coordinates.
    shares : array_like
        How far, as shares of the box between the bounds (which has sides of length 1).

    Returns
    -------
    pandas.DataFrame
        A row a driver and share: ``driver`` (row of ``z``), ``share``, ``objective`` at the fit, ``increase``
        (the cheaper of the two senses, NaN if both leave the box at once), and the parameters there.
        A move that meets a bound goes on along it.
    """
    box = UPPER - LOWER
    _, _, normal = costs_and_derivatives(problem, z, LEAST_ERROR)
    _, vectors = np.linalg.eigh(normal * box[:, None] * box[None, :])
    step = np.asarray(shares, dtype=np.float64)
    moves = np.concatenate([step, -step])[None, :, None] * vectors[:, None, :, 0] * box
    there = np.clip(z[:, None, :] + moves, LOWER, UPPER)
    found = costs(problem, np.ascontiguousarray(np.concatenate([z[:, None], there], axis=1)), 0.0)
    length = np.linalg.norm((there - z[:, None]) / box, axis=2)
    growth = np.where(length >= 0.5 * np.tile(step, 2), found[:, 1:] - found[:, :1], np.nan)
    both = np.stack([growth[:, : len(step)], growth[:, len(step) :]])
    back = np.nan_to_num(both[1], nan=np.inf) < np.nan_to_num(both[0], nan=np.inf)
    chosen = np.where(back[..., None], there[:, len(step) :], there[:, : len(step)])
    table = pd.DataFrame(from_search(chosen).reshape(-1, PARAMETERS), columns=list(NAMES))
    table.insert(0, "increase", np.where(back, both[1], both[0]).ravel())
    table.insert(0, "objective", np.repeat(found[:, 0], len(step)))
    table.insert(0, "share", np.tile(step, len(z)))
    table.insert(0, "driver", np.repeat(np.arange(len(z)), len(step)))
    return table
