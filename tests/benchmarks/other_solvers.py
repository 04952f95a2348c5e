"""Solvers that others calibrate with, on our compiled objective: differential evolution, a swarm, a genetic algorithm.

Each gets every driver's costs many at a time from the same kernel, so that only the search itself differs. pyswarms
and pygad belong to the extra ``bench``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.optimize import differential_evolution

from idm_sumo.calibration.kernel import LOWER, PARAMETERS, UPPER, costs_of
from idm_sumo.calibration.problem import Problem, only

Floats = npt.NDArray[np.float64]
Search = Callable[[Callable[[Floats], Floats], int], tuple[Floats, float]]

MEMBERS, GENERATIONS = 50, 200  # of a swarm or population: 10,000 rollouts a driver


def fit(search: Search, problem: Problem, which: npt.NDArray[np.int64]) -> Floats:
    """Fit drivers ``which`` one by one; return the objective that each ended with."""
    return np.array([search(costs_of_one(problem, i), int(i))[1] for i in which])


def costs_of_one(problem: Problem, i: int) -> Callable[[Floats], Floats]:
    """Return a driver's cost as a function of search coordinates, shape ``(m, 5)``."""
    one = only(problem, np.array([i]))

    def costs(z: Floats) -> Floats:
        values = np.empty(len(z))
        costs_of(one, 0, np.ascontiguousarray(z), 0.0, values)
        return values

    return costs


def evolution(costs: Callable[[Floats], Floats], seed: int) -> tuple[Floats, float]:
    """Search by scipy's differential evolution, by its defaults."""
    found = differential_evolution(
        lambda at: costs(at.T) if at.ndim == 2 else costs(at[None])[0],
        list(zip(LOWER, UPPER, strict=True)), rng=np.random.default_rng([0, seed]),
        vectorized=True, updating="deferred",
    )  # fmt: skip
    return found.x, float(found.fun)


def swarm(costs: Callable[[Floats], Floats], seed: int) -> tuple[Floats, float]:
    """Search by pyswarms' global best particle swarm, with the constriction weights of Clerc and Kennedy (2002)."""
    from pyswarms.single import GlobalBestPSO

    np.random.seed(seed)  # noqa: NPY002 - pyswarms draws from numpy's global generator
    weights = {"c1": 1.49618, "c2": 1.49618, "w": 0.7298}
    search = GlobalBestPSO(MEMBERS, PARAMETERS, weights, bounds=(LOWER, UPPER))
    value, at = search.optimize(costs, GENERATIONS, verbose=False)
    return at, float(value)


def genetic(costs: Callable[[Floats], Floats], seed: int) -> tuple[Floats, float]:
    """Search by pygad's genetic algorithm: half of the population are parents, one gene of each child mutates."""
    import pygad

    search = pygad.GA(
        GENERATIONS, MEMBERS // 2, lambda _search, members, _which: list(-costs(members)), fitness_batch_size=MEMBERS,
        sol_per_pop=MEMBERS, num_genes=PARAMETERS, mutation_num_genes=1, random_seed=seed, suppress_warnings=True,
        gene_space=[{"low": low, "high": high} for low, high in zip(LOWER, UPPER, strict=True)],
    )  # fmt: skip
    search.run()
    at, fitness, _ = search.best_solution(search.last_generation_fitness)
    return at, -float(fitness)
