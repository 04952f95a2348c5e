"""Drivers refitted without d1 by the solver of all five parameters, as SUMO integrates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import integrators, kernel
from idm_sumo.calibration.problem import Problem, prepare
from idm_sumo.calibration.table import calibrate
from idm_sumo.calibration.without_d1 import REFIT, linearise, mean_speeds, refit, refit_table
from idm_sumo.models import idm
from idm_sumo.scenes.windows import Scenes
from tests.helpers.known_drivers import known_drivers

NAMES = list(idm.IDMParameters._fields)
SCHEMES = ("euler", "ballistic")


@pytest.fixture(scope="module")
def known() -> tuple[Scenes, pd.DataFrame]:
    scenes, _ = known_drivers(40, noise=0.2, seed=21)
    return scenes, calibrate(scenes)


def at(problem: Problem, seed: int = 3) -> Any:
    """Return search coordinates inside the bounds, one set a driver."""
    rng = np.random.default_rng(seed)
    low, high = kernel.LOWER, kernel.UPPER
    return low + rng.uniform(0.1, 0.6, (len(problem.start_x), 5)) * (high - low)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_solvers_rollout_is_the_integrators(known: tuple[Scenes, pd.DataFrame], scheme: str) -> None:
    problem = prepare(known[0], desired_speed=11.0)  # below what some are recorded at: SUMO brakes them
    z = at(problem)
    lanes = kernel.costs(integrators.integrated(problem, scheme), z[:, None], 0.0)[:, 0]
    one_by_one = integrators.ades(problem, kernel.from_search(z), scheme)
    assert lanes == pytest.approx(one_by_one, rel=1e-9)
    assert not np.allclose(lanes, kernel.costs(problem, z[:, None], 0.0)[:, 0], rtol=1e-4)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_its_derivatives_are_those_of_differences(known: tuple[Scenes, pd.DataFrame], scheme: str) -> None:
    problem = integrators.integrated(prepare(known[0]), scheme)
    z, step, smoothing = at(problem), 1e-6, 0.3
    _, gradient, _ = kernel.costs_and_derivatives(problem, z, smoothing)
    held = kernel.costs_and_derivatives(problem._replace(moves_d1=0.0), z, smoothing)[1]
    differences = np.empty_like(gradient)
    for m in range(5):
        ends = [kernel.costs(problem, (z + sign * step * np.eye(5)[m])[:, None], smoothing)[:, 0] for sign in (1, -1)]
        differences[:, m] = (ends[0] - ends[1]) / (2 * step)
    off = np.abs(gradient - differences).max(axis=1) / (1e-3 + np.abs(differences).max(axis=1))
    assert (off < 1e-3).mean() > 0.9  # where a leader changes within the step a difference is none
    assert (held[:, 4] == 0.0).all()
    assert held[:, :4] == pytest.approx(gradient[:, :4])


@pytest.mark.parametrize("scheme", ["paper", *SCHEMES])
def test_nobody_is_worse_than_without_or_with_linearised_d1(known: tuple[Scenes, pd.DataFrame], scheme: str) -> None:
    scenes, fits = known
    problem, theta, speed = prepare(scenes), fits[NAMES].to_numpy(), mean_speeds(scenes)
    found, ade = refit(problem, theta, speed, integration=scheme)
    assert (found[:, 4] == 0.0).all()
    assert ((found >= idm.LOWER) & (found <= idm.UPPER)).all()
    assert ade == pytest.approx(integrators.ades(problem, found, scheme))
    linear = np.clip(linearise(theta, speed, problem.desired_speed), idm.LOWER, idm.UPPER)
    for other in (theta * [1, 1, 1, 1, 0], linear):
        assert (ade <= integrators.ades(problem, other, scheme) + 1e-12).all()
    assert ade.mean() < 1.1 * fits["ade_m"].mean() + 0.02


def test_a_driver_without_d1_is_found_again() -> None:
    theta = np.column_stack([np.full(5, 1.2), np.full(5, 1.6), np.linspace(0.8, 1.6, 5), np.full(5, 2.5), np.zeros(5)])
    scenes, _ = known_drivers(5, seconds=40, seed=4, drivers=theta)
    found = refit_table(calibrate(scenes), scenes, integration="paper")
    assert found["ade_refit_m"].max() < 0.05
    assert found[REFIT[2]].to_numpy() == pytest.approx(theta[:, 2], abs=0.1)
