"""One parameter set for many drivers.

Its mean ADE is the smallest that is possible without knowing the driver.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from idm_sumo.calibration import status
from idm_sumo.calibration.kernel import (
    LOWER,
    PARAMETERS,
    UPPER,
    costs_and_derivatives,
    costs_of_designs,
    from_search,
)
from idm_sumo.calibration.lanes import LANES
from idm_sumo.calibration.problem import Problem, prepare
from idm_sumo.calibration.solver import SMOOTHING, design_of_starts
from idm_sumo.calibration.steps import steps_from
from idm_sumo.models.idm import IDMParameters
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

STARTS = 64
CANDIDATES = 3
ITERATIONS = 40
SMALLEST_DROP = 1e-6  # relative
FAN = 10.0 ** np.linspace(-2.0, 5.0, LANES)  # times the last damping
DAMPING_LEAST = 1e-4
REACH = (0.1, 0.002)  # of the last compass search, in search coordinates


def pooled(
    scenes: Scenes | Sequence[Scenes], *, objective: str = "ade", loss: str | None = None,
    desired_speed: float | None = None,
) -> IDMParameters:  # fmt: skip
    """Fit one parameter set to all drivers together.

    Parameters
    ----------
    scenes : Scenes or sequence of Scenes
    objective, loss : str
        As for :func:`~idm_sumo.calibration.table.calibrate`.
    desired_speed : float, optional
        m/s; by default the road's speed limit.

    Returns
    -------
    IDMParameters
        With the smallest mean objective.

    Raises
    ------
    InputError
        If no window can be fitted.

    Notes
    -----
    The sum over drivers of the same cost, gradient and Gauss-Newton matrix as in the single
    fit; a design of starts screened over all drivers, the best refined, then a compass
    search. Deterministic.
    """
    every = [scenes] if isinstance(scenes, Scenes) else list(scenes)
    problems = [prepare(one, objective=objective, loss=loss, desired_speed=desired_speed) for one in every]
    usable = [usable_windows(problem, one) for problem, one in zip(problems, every, strict=True)]
    if not sum(int(u.sum()) for u in usable):
        raise InputError("pooled calibration: no window can be fitted; see `idm-sumo inspect` for why")
    together = Together(problems, usable)
    designs = design_of_starts(STARTS)
    order = np.argsort(together.screen(designs), kind="stable")[:CANDIDATES]
    refined = [_refine(together, designs[s]) for s in order]
    best = min(refined, key=together.cost)
    return IDMParameters(*from_search(_polish(together, best)).tolist())


def usable_windows(problem: Problem, scenes: Scenes) -> npt.NDArray[np.bool_]:
    """Return which windows can be fitted at all.

    Parameters
    ----------
    problem : Problem
    scenes : Scenes
        What it was prepared from.

    Returns
    -------
    bool, shape (windows,)
    """
    first = scenes.start
    state = status.statuses(problem, scenes.speed[:, first : first + scenes.window.horizon + 1])
    return np.asarray(~np.isin(state.astype(str), list(status.WITHOUT_FIT)))


class Together:
    """Several problems as one, over all their usable windows."""

    def __init__(self, problems: list[Problem], usable: list[npt.NDArray[np.bool_]]) -> None:
        self.parts = list(zip(problems, usable, strict=True))
        self.windows = sum(int(u.sum()) for u in usable)

    def screen(self, designs: Floats) -> Floats:
        """Return the mean cost at every design point.

        Parameters
        ----------
        designs : float64, shape (m, 5)
            Search coordinates.

        Returns
        -------
        float64, shape (m,)
        """
        total = sum(costs_of_designs(problem, designs, 0.0)[use].sum(axis=0) for problem, use in self.parts)
        return np.asarray(total / self.windows)

    def cost(self, z: Floats) -> float:
        """Return the mean cost.

        Parameters
        ----------
        z : float64, shape (5,)
            Search coordinates.

        Returns
        -------
        float
        """
        return float(self.screen(z[None, :])[0])

    def derivatives(self, z: Floats) -> tuple[float, Floats, Floats]:
        """Return the mean cost and its derivatives, smoothed.

        Parameters
        ----------
        z : float64, shape (5,)
            Search coordinates.

        Returns
        -------
        value : float
        gradient : float64, shape (5,)
        matrix : float64, shape (5, 5)
            Of Gauss and Newton.
        """
        value, gradient, normal = 0.0, np.zeros(PARAMETERS), np.zeros((PARAMETERS, PARAMETERS))
        for problem, use in self.parts:
            all_z = np.ascontiguousarray(np.broadcast_to(z, (len(use), PARAMETERS)))
            v, g, h = costs_and_derivatives(problem, all_z, SMOOTHING)
            value, gradient, normal = value + v[use].sum(), gradient + g[use].sum(axis=0), normal + h[use].sum(axis=0)
        return value / self.windows, gradient / self.windows, normal / self.windows


def _refine(together: Together, start: Floats) -> Floats:
    """Refine one start by damped Gauss-Newton steps.

    Over all drivers, the best of a fan of dampings at a time.
    """
    z, damping, best = start, 1e-1, np.inf
    for _ in range(ITERATIONS):
        _, gradient, normal = together.derivatives(z)
        trials = steps_from(z, gradient, normal, damping * FAN)
        values = together.screen(trials)
        q = int(np.argmin(values))
        if not values[q] < best:
            break
        drop, best = best - values[q], float(values[q])
        z, damping = trials[q], max(damping * FAN[q], DAMPING_LEAST)
        if drop < SMALLEST_DROP * best:
            break
    return z


def _polish(together: Together, z: Floats) -> Floats:
    """Finish by a compass search, all ten neighbours at once."""
    (reach, least), value = REACH, together.cost(z)
    while reach > least:
        around = np.clip(z + reach * np.vstack([np.eye(PARAMETERS), -np.eye(PARAMETERS)]), LOWER, UPPER)
        screened = together.screen(np.ascontiguousarray(around))
        best = int(np.argmin(screened))
        if screened[best] < value:
            z, value = around[best], float(screened[best])
        else:
            reach *= 0.5
    return z
