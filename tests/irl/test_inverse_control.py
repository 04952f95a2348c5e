"""Do demonstrations of known weights give the weights back?"""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from idm_sumo.irl import features
from idm_sumo.irl.demonstrations import Demonstrations, rollout
from idm_sumo.irl.episodes import Episodes, Surroundings, episodes_of
from idm_sumo.irl.inverse_control import Expansion, LearnedReward, learn, learn_wanted, log_likelihood
from idm_sumo.irl.trajectory import derivatives
from tests.helpers.irl_traffic import busy

Floats = npt.NDArray[np.float64]
STEPS = 12
TRUE = features.weights_from(
    {"lane": 60.0, "heading": 40.0, "speed": 150.0, "collision": 400.0, "acceleration": 12.0, "steering": 12.0}
)  # boundary is switched off


def _expand(control: Floats, episodes: Episodes, around: Surroundings) -> Expansion:
    path = Demonstrations(rollout(episodes, control), control, np.zeros(len(control)))
    return Expansion.of(*derivatives(path, episodes, around))


def _optimal(episodes: Episodes, around: Surroundings, weights: Floats) -> tuple[Floats, Floats]:
    """Return the controls that are best under the weights, and minus the Hessian there."""
    n = len(episodes.length)
    control = np.zeros((n, STEPS, 2))
    floor = np.diag(1.0 / np.tile([features.ACCELERATION_SCALE, features.STEERING_SCALE], STEPS) ** 2)
    for step in range(30):
        expansion = _expand(control, episodes, around)
        g, h = (np.einsum("k,ik...->i...", weights, part) for part in (expansion.gradient, expansion.hessian))
        damping = 50.0 * 0.5**step if step < 20 else 0.0
        move = np.linalg.solve(-h + damping * floor, g[:, :, None])[:, :, 0].reshape(n, STEPS, 2)
        control = control + np.clip(move, (-0.5, -0.01), (0.5, 0.01))
    assert np.abs(move).max() < 1e-8
    return control, -h


@cache
def _demonstrations(seed: int, cars: int) -> Expansion:
    """Draw controls about the best ones, as the maximum-entropy driver does."""
    episodes, around = episodes_of([busy(cars, seed=seed)])
    control, a = _optimal(episodes, around, TRUE)
    rng = np.random.default_rng(seed)
    lower = np.linalg.cholesky(np.linalg.inv(a))
    noise = (lower @ rng.standard_normal((cars, 2 * STEPS, 1)))[:, :, 0].reshape(cars, STEPS, 2)
    return _expand(control + noise, episodes, around)


@cache
def _learned() -> LearnedReward:
    return learn(_demonstrations(1, 200))


def test_weights_come_back() -> None:
    learned = _learned()
    assert learned.converged
    assert learned.dummy == 0.0
    cosine = learned.weights @ TRUE / np.linalg.norm(learned.weights) / np.linalg.norm(TRUE)
    assert np.sqrt(1 - cosine**2) < 0.05
    on = TRUE > 0
    assert (np.abs(learned.weights - TRUE)[on] < 4 * learned.standard_errors[on]).all()


def test_a_feature_that_is_switched_off_comes_out_near_zero() -> None:
    learned = _learned()
    k = features.BOUNDARY
    assert abs(learned.weights[k]) < 3 * learned.standard_errors[k]


def test_unseen_demonstrations_are_as_likely_as_under_the_truth() -> None:
    unseen = _demonstrations(7, 100)
    learned, true = log_likelihood(unseen, _learned().weights), log_likelihood(unseen, TRUE)
    lost = true - learned
    assert abs(lost.mean()) < 3 * true.std() / np.sqrt(len(true))
    assert lost.mean() < 0.05 * abs(true.mean())


def test_standard_errors_are_how_far_estimates_scatter() -> None:
    found = [learn(_demonstrations(10 + seed, 30)) for seed in range(10)]
    scatter = np.std([one.weights for one in found], axis=0, ddof=1)
    said = np.mean([one.standard_errors for one in found], axis=0)
    on = TRUE > 0
    assert (scatter[on] / said[on] > 0.3).all()
    assert (scatter[on] / said[on] < 2.5).all()


def _quadratic(g: Floats, a: Floats) -> Expansion:
    """Return an expansion of two features with a given gradient and curvature, the others nothing."""
    n, _, size = g.shape
    gradient, hessian = np.zeros((n, features.COUNT, size)), np.zeros((n, features.COUNT, size, size))
    gradient[:, :2], hessian[:, :2] = g, -a
    return Expansion.of(gradient, hessian)


def test_likelihood_is_a_gaussians() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(1, 2, 4, 4))
    g, a = rng.normal(size=(1, 2, 4)), root @ root.swapaxes(2, 3) + 0.1 * np.eye(4)
    weights = features.weights_from({"lane": 0.7, "boundary": 1.3})
    total_g, total_a = 0.7 * g[0, 0] + 1.3 * g[0, 1], 0.7 * a[0, 0] + 1.3 * a[0, 1]
    # the demonstration is the point 0 of a Gaussian with mean A^-1 g and covariance A^-1
    expected = stats.multivariate_normal(np.linalg.solve(total_a, total_g), np.linalg.inv(total_a)).logpdf(np.zeros(4))
    assert log_likelihood(_quadratic(g, a), weights)[0] == pytest.approx(expected)


def test_where_it_is_not_concave_the_likelihood_is_minus_infinity() -> None:
    g, a = np.zeros((1, 2, 2)), np.array([[np.diag([1.0, -1.0]), np.eye(2)]])
    assert log_likelihood(_quadratic(g, a), features.weights_from({"lane": 1.0}))[0] == -np.inf
    assert np.isfinite(log_likelihood(_quadratic(g, a), features.weights_from({"lane": 1.0}), dummy=2.0)[0])


def test_the_dummy_feature_leads_from_a_start_without_likelihood_to_the_maximum() -> None:
    rng = np.random.default_rng(5)
    scale = np.diag([1.0, 1.0 / features.STEERING_SCALE])
    bent = scale @ np.diag([1.0, -3.0]) @ scale  # with weights 1 and 1 the sum is not positive definite
    a = np.broadcast_to(np.stack([bent, scale @ scale]), (80, 2, 2, 2))
    true = 0.5 * a[0, 0] + 4.0 * a[0, 1]
    # gradients such that the demonstration scatters about the optimum as the truth says
    u = rng.multivariate_normal(np.zeros(2), np.linalg.inv(true), size=80)
    g = -np.einsum("ikmn,in->ikm", a, u)
    learned = learn(_quadratic(g, a), use=("lane", "boundary"))
    assert learned.converged
    assert learned.dummy == 0.0
    at = (
        np.abs(learned.weights - features.weights_from({"lane": 0.5, "boundary": 4.0}))
        / np.maximum(learned.standard_errors, 1e-9)
    )[:2]
    assert (at < 4).all()


def test_wanted_features_have_no_negative_weight() -> None:
    rng = np.random.default_rng(5)
    a = np.broadcast_to(np.stack([0.01 * np.eye(2), np.eye(2)]), (50, 2, 2, 2))
    g = np.stack([np.broadcast_to([1.0, 0.0], (50, 2)), rng.normal((2.0, 0.0), size=(50, 2))], axis=1)
    g_full = _quadratic(g, a)
    free = learn(g_full, use=("lane", "boundary"))
    assert free.weights[features.LANE] < 0
    full = Expansion(g_full.gradient + 0, g_full.hessian.copy(), g_full.scale)
    for k in range(2, features.COUNT):  # the other features do something too
        full.hessian[:, k] = -np.diag(rng.uniform(0.5, 1.5, 2))
        full.gradient[:, k] = rng.normal(size=(50, 2))
    wanted = learn_wanted(full, learn(full))
    assert (wanted.weights >= 0).all()
    assert wanted.converged


def test_a_learned_reward_is_written_as_plain_json():
    """Also where the search for the weights ends with a truth value of numpy's."""
    ones = np.ones(features.COUNT)
    learned = LearnedReward(ones, ones, np.eye(features.COUNT), np.float64(-1.0), 3, 0.0, np.True_)
    assert json.loads(json.dumps(learned.to_json()))["converged"] is True
