r"""Partial pooling of drivers: their parameters and the population's.

Every driver is drawn to the population the more, the less its own window says.

Empirical Bayes. The drivers' parameters are log-normal, :math:`u_i \sim N(\mu, \Sigma)` with
:math:`u = \log(a, b, T, d_0, d_1 + 1\,\mathrm m)`. A window's errors are Laplace-distributed with
a scale of its own; profiled out, the log-likelihood is :math:`-n_i \log c_i(u)` with the
driver's objective :math:`c_i` and the number :math:`n_i` of independent frames its errors are
worth (:func:`~idm_sumo.calibration.identifiability.effective_frames`). EM with Laplace's
approximation (Lindstrom and Bates, 1990): each driver's maximum a posteriori and its
curvature, then :math:`\mu` and :math:`\Sigma` from them, until neither moves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import status
from idm_sumo.calibration.kernel import (
    PARAMETERS,
)
from idm_sumo.calibration.pooled import usable_windows
from idm_sumo.calibration.population import LEAST_VARIANCE, LOWER, MOST_VARIANCE, UPPER, Population, to_parameters
from idm_sumo.calibration.posterior import Part
from idm_sumo.calibration.problem import Problem, only, prepare
from idm_sumo.calibration.table import NAMES, full_ade
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

ROUNDS = 80  # of EM, at most
FURTHEST = 12.0  # times two rounds of EM: the longest extrapolation
STEPS = 3  # Gauss-Newton steps a round
LAST_STEPS = 15  # in the end, the population held
SETTLED = 0.005  # change in a round, of means and of the covariance's logarithm: less than 1 %
FEWEST_DRIVERS = 10


def hierarchical(
    scenes: Scenes | Sequence[Scenes],
    *,
    population: Population | None = None,
    desired_speed: npt.ArrayLike | None = None,
    by_driver: bool = False,
) -> tuple[pd.DataFrame, Population]:
    """Fit all drivers together with the population they come from.

    Parameters
    ----------
    scenes : Scenes or sequence of Scenes
    population : Population, optional
        Known from other drivers: then these are only drawn to it, and one driver is enough.
    desired_speed : array_like, shape (), or (windows,) for one ``Scenes``, optional
        m/s; by default the road's speed limit.
    by_driver : bool
        Whether the windows of a driver have one set of parameters. What changes from window to window is then no
        difference between drivers.

    Returns
    -------
    drivers : pandas.DataFrame
        One row a window: ``period, vehicle, first_frame, a, b, T, d0, d1, ade_m, status``,
        ``effective_frames``, and ``drawn``: 0 where the window alone decides, 1 where it says nothing.
    population : Population

    Raises
    ------
    InputError
        If fewer than ten windows can be fitted and no population is given.
    """
    every = [scenes] if isinstance(scenes, Scenes) else list(scenes)
    problems = [prepare(one, desired_speed=desired_speed) for one in every]
    which = [np.flatnonzero(usable_windows(problem, one)) for problem, one in zip(problems, every, strict=True)]
    count = sum(len(w) for w in which)
    if population is None and count < FEWEST_DRIVERS:
        raise InputError(
            f"hierarchical calibration: {count} windows can be fitted; it needs {FEWEST_DRIVERS} or a population"
        )
    parts = [
        Part.of(only(problem, w), _drivers(one, w) if by_driver else None)
        for one, problem, w in zip(every, problems, which, strict=True)
    ]
    if population is None:
        population = _learn(parts)
    for part in parts:
        typical = np.tile(np.clip(population.mean, LOWER, UPPER), (len(part.u), 1))
        part.settle(population, (part.u, typical), LAST_STEPS)
    rows = zip(every, problems, which, parts, strict=True)
    tables = [_as_table(one, problem, w, part, population, desired_speed) for one, problem, w, part in rows]
    return pd.concat(tables, ignore_index=True), population


def _drivers(scenes: Scenes, which: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the number of each window's driver."""
    keys = scenes.keys().iloc[which]
    return np.asarray(keys.groupby([c.PERIOD, c.VEHICLE], sort=False).ngroup(), dtype=np.int64)


def _learn(parts: list[Part]) -> Population:
    """Return the population from which the drivers most likely come.

    EM alone creeps where the windows say little of a parameter. Two of its rounds tell how fast
    they shrink; an extrapolated step follows (SQUAREM, Varadhan and Roland, 2008, scheme S3).
    """
    u = np.concatenate([part.u for part in parts])
    population = Population(u.mean(axis=0), np.cov(u.T) + LEAST_VARIANCE * np.eye(PARAMETERS), len(u), 0)
    for rounds in range(2, ROUNDS + 1, 2):
        once = _em_round(parts, population, rounds)
        twice = _em_round(parts, once, rounds)
        if np.abs(_packed(twice) - _packed(once)).max() < SETTLED:
            return twice
        population = _extrapolated(population, once, twice)
    return twice


def _em_round(parts: list[Part], population: Population, rounds: int) -> Population:
    """Return the population after one round of EM."""
    for part in parts:
        part.draw(population, STEPS)
    u = np.concatenate([part.u for part in parts])
    spread = np.linalg.inv(np.concatenate([part.hessian for part in parts]))
    covariance = np.cov(u.T, bias=True) + spread.mean(axis=0) + LEAST_VARIANCE * np.eye(PARAMETERS)
    return Population(u.mean(axis=0), covariance, len(u), rounds)


def _packed(population: Population) -> Floats:
    """Return a population as numbers without constraints.

    The mean and the logarithm of the covariance; any such numbers are a population.
    """
    values, vectors = np.linalg.eigh(population.covariance)
    return np.concatenate([population.mean, ((vectors * np.log(values)) @ vectors.T).ravel()])


def _extrapolated(population: Population, once: Population, twice: Population) -> Population:
    """Return the population to which the rounds seem to lead.

    At most ``FURTHEST`` times as far as they went.
    """
    start, first, second = _packed(population), _packed(once), _packed(twice)
    step, bend = first - start, second - 2.0 * first + start
    far = float(np.clip(np.linalg.norm(step) / max(float(np.linalg.norm(bend)), 1e-300), 1.0, FURTHEST))
    there = start + 2.0 * far * step + far**2 * bend
    values, vectors = np.linalg.eigh(there[PARAMETERS:].reshape(PARAMETERS, PARAMETERS))
    values = np.exp(np.clip(values, np.log(LEAST_VARIANCE), np.log(MOST_VARIANCE)))
    mean = np.clip(there[:PARAMETERS], LOWER, UPPER)
    return Population(mean, (vectors * values) @ vectors.T, twice.drivers, twice.rounds)


def _as_table(
    scenes: Scenes,
    problem: Problem,
    which: npt.NDArray[np.int64],
    part: Part,
    population: Population,
    desired_speed: npt.ArrayLike | None,
) -> pd.DataFrame:
    """Return one row a window, NaN without a fit."""
    n = len(scenes)
    theta, frames, drawn = np.full((n, PARAMETERS), np.nan), np.full(n, np.nan), np.full(n, np.nan)
    theta[which], frames[which] = to_parameters(part.u)[part.driver], part.frames
    share = np.linalg.inv(part.hessian) @ np.linalg.inv(population.covariance)
    drawn[which] = (np.trace(share, axis1=1, axis2=2) / PARAMETERS)[part.driver]
    table = scenes.keys()
    table[NAMES] = theta
    table["ade_m"] = full_ade(scenes, theta, desired_speed, problem.counted)
    state = status.statuses(problem, scenes.speed[:, scenes.start : scenes.start + scenes.window.horizon + 1])
    table["status"] = pd.Series(state, dtype=str)
    table["effective_frames"], table["drawn"] = frames, drawn
    return table
