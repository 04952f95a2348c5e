"""The damped step inside the bounds, against a solver of bounded least squares."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from idm_sumo.calibration.coordinates import LOWER, UPPER
from idm_sumo.calibration.lanes import LANES
from idm_sumo.calibration.steps import LEAST_SCALE, steps_from

DAMPINGS = 10.0 ** np.linspace(-3, 3, LANES)


def problem(seed, at_bound):
    """Return a place, a gradient and a positive definite matrix."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(LOWER, UPPER)
    held = rng.uniform(size=5) < at_bound
    z[held] = np.where(rng.uniform(size=5) < 0.5, LOWER, UPPER)[held]
    slopes = rng.normal(size=(5, 12)) * 10.0 ** rng.uniform(-1, 1, (5, 1))
    return z, slopes @ rng.normal(size=12), slopes @ slopes.T / 12


def damped(normal, damping):
    diagonal = np.diag(normal)
    return normal + damping * np.diag(diagonal + LEAST_SCALE * diagonal.max())


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.3, 0.8]))
def test_steps_stay_inside_and_are_newton_s_where_no_bound_is_near(seed, at_bound):
    """Cut off at bounds they need not lower the model: the solver judges every step by the cost itself."""
    z, gradient, normal = problem(seed, at_bound)
    ends = steps_from(z, gradient, normal, DAMPINGS)
    assert np.all((ends >= LOWER) & (ends <= UPPER))
    for end, damping in zip(ends, DAMPINGS, strict=True):
        matrix, step = damped(normal, damping), end - z
        free = np.linalg.solve(matrix, -gradient)
        if np.all((z + free > LOWER) & (z + free < UPPER)) and np.all((z > LOWER) & (z < UPPER)):
            assert np.allclose(step, free, rtol=1e-6, atol=1e-9)


def test_nearly_always_it_is_the_best_step_inside_the_bounds():
    """Coordinates put on a bound are not set free again: rarely that is not the best."""
    short = []
    for seed in range(300):
        z, gradient, normal = problem(seed, 0.3)
        matrix = damped(normal, DAMPINGS[3])
        root = np.linalg.cholesky(matrix).T
        best = lsq_linear(root, -np.linalg.solve(root.T, gradient), (LOWER - z - 1e-12, UPPER - z + 1e-12)).x
        step = steps_from(z, gradient, normal, DAMPINGS)[3] - z

        def model(s, gradient=gradient, matrix=matrix):
            return gradient @ s + 0.5 * s @ matrix @ s

        short.append(1.0 - model(step) / model(best))
    assert np.quantile(short, 0.8) < 1e-6
    assert np.mean(short) < 0.1
