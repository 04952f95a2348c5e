"""The compiled rollout against the two-dimensional one, and its derivatives against finite differences."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from idm_sumo.calibration import kernel
from idm_sumo.calibration.objective import CODES, LOSSES
from idm_sumo.calibration.problem import prepare
from idm_sumo.models import idm
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.builders import Car, recording
from tests.helpers.known_drivers import known_drivers, scenes_of

V0 = US101.speed_limit
parameters = st.tuples(*(st.floats(low + 1e-3, high) for low, high in zip(idm.LOWER, idm.UPPER, strict=True)))


@pytest.fixture(scope="module")
def known():
    return known_drivers(40, noise=0.1, seed=5)


def partials(v, rate, gap, a, b, T, d0, d1):
    """Return the derivatives by speed, gap, a, b, T, d0, d1."""
    by = idm.acceleration_partials(v, rate, gap, a, idm.closing_weight(a, b), T, d0, d1, 1 / V0)
    return np.array(by) / [1, 1, a, b, 1, 1, 1]


@given(parameters, st.floats(0.05, 30.0), st.floats(-10.0, 10.0), st.floats(0.1, 200.0))
def test_partials_are_the_derivatives_of_the_acceleration(theta, v, rate, gap):
    def acceleration(x):
        return idm.acceleration(x[0], x[0] - (v - rate), x[1], *x[2:], V0)

    at = np.array([v, gap, *theta])
    got = partials(v, rate, gap, *theta)
    for j, value in enumerate(got):
        h = 1e-6 * max(abs(at[j]), 0.1)
        up, down = at.copy(), at.copy()
        up[j] += h
        down[j] -= h
        right, left = (acceleration(up) - acceleration(at)) / h, (acceleration(at) - acceleration(down)) / h
        # At a kink the derivative is one-sided; elsewhere both sides agree with it.
        nearest = min(abs(value - right), abs(value - left))
        assert nearest <= 1e-3 * max(abs(right), abs(left), abs(value), 1.0)


@pytest.mark.parametrize(
    ("v", "rate", "gap", "why"),
    [(10.0, 5.0, 0.5, "emergency braking"), (10.0, 2.0, idm.SMALLEST_GAP, "smallest gap")],
)
def test_where_braking_is_clipped_no_parameter_matters(v, rate, gap, why):
    assert idm.acceleration(v, rate, gap, *idm.TEXTBOOK, V0) == -idm.EMERGENCY_BRAKING, why
    assert not np.any(partials(v, rate, gap, *idm.TEXTBOOK)), why


def test_a_leader_that_pulls_away_leaves_no_dynamic_term_and_the_free_road_only_a():
    # v T + v dv / (2 sqrt(a b)) = 10 (1 - 8 / 2) < 0.
    pulls_away = partials(10.0, -8.0, 20.0, 1.0, 1.0, 1.0, 2.0, 1.0)
    assert pulls_away[3] == pulls_away[4] == 0.0
    assert pulls_away[5] < 0.0
    alone = partials(10.0, 10.0, np.inf, 1.0, 1.0, 1.0, 2.0, 1.0)
    assert alone[2] == pytest.approx(1 - (10 / V0) ** 4, rel=1e-12)
    assert not np.any(np.array(alone)[[1, 3, 4, 5, 6]])


@given(parameters)
def test_search_coordinates_return_the_parameters(theta):
    assert kernel.from_search(kernel.to_search(theta)) == pytest.approx(np.array(theta), rel=1e-9, abs=1e-9)
    assert kernel.parameters_at(kernel.to_search(theta)) == pytest.approx(theta, rel=1e-9, abs=1e-9)


def test_one_dimension_is_as_good_as_two(known):
    scenes, theta = known
    rng = np.random.default_rng(0)
    start = scenes.start
    y = scenes.y + rng.uniform(-1.5, 1.5, (len(scenes), 1)) * np.exp(-np.arange(scenes.y.shape[1]) / 20)
    turned = np.broadcast_to(rng.uniform(-0.06, 0.06, (len(scenes), 1)), y.shape).copy()
    lateral = scenes_with(scenes, y, turned)
    driven = drive_idm(lateral, theta)
    full = np.hypot(driven.x[:, 1:] - lateral.x[:, start + 1 :], driven.y[:, 1:] - lateral.y[:, start + 1 :]).mean(
        axis=1
    )
    off = np.abs(kernel.costs(prepare(lateral), kernel.to_search(theta)[:, None], 0.0)[:, 0] - full)
    assert np.abs(driven.y[:, -1] - lateral.y[:, -1]).max() < np.abs(y[:, start]).max()  # they really steered
    assert np.median(off) < 0.001
    assert off.max() < 0.02


def scenes_with(scenes, y, heading):
    from dataclasses import replace

    return replace(scenes, y=y, heading=heading)


def test_along_a_straight_lane_it_is_the_same_rollout(known):
    scenes, theta = known
    driven = drive_idm(scenes, theta)
    ade = np.abs(driven.x[:, 1:] - scenes.x[:, scenes.start + 1 :]).mean(axis=1)
    assert kernel.costs(prepare(scenes), kernel.to_search(theta)[:, None], 0.0)[:, 0] == pytest.approx(ade, abs=1e-9)


def test_the_leader_is_the_one_ahead_of_where_it_drives_now():
    """Two cars ahead in the lane and one behind: slow and fast drivers end between different ones."""
    cars = recording(
        Car(1, x=60.0, lane=3, speed=12.0, frames=140), Car(2, x=75.0, lane=3, speed=8.0, frames=140),
        Car(3, x=120.0, lane=3, speed=15.0, frames=140), Car(4, x=20.0, lane=3, speed=14.0, frames=140),
    )  # fmt: skip
    scenes = build_scenes(cars, Window())
    for theta in ((6.0, 6.0, 0.1, 0.1, 0.0), (0.1, 6.0, 5.0, 10.0, 10.0), tuple(idm.TEXTBOOK)):
        driven = drive_idm(scenes, theta)
        ade = np.hypot(driven.x[:, 1:] - scenes.x[:, 10:], driven.y[:, 1:] - scenes.y[:, 10:]).mean(axis=1)
        z = np.broadcast_to(kernel.to_search(theta), (len(scenes), 1, 5)).copy()
        assert kernel.costs(prepare(scenes), z, 0.0)[:, 0] == pytest.approx(ade, abs=2e-3)


@settings(max_examples=60, deadline=None)
@given(parameters, st.integers(0, 39), st.sampled_from(sorted(CODES)), st.sampled_from(sorted(LOSSES)))
@example((6.0, 0.25, 0.109375, 0.109375, 0.0625), 0, "ade", "huber")
def test_gradients_are_finite_differences(known, theta, driver, objective, loss):
    scenes, _ = known
    problem = prepare(scenes.subset(np.array([driver])), objective=objective, loss=loss)
    z = kernel.to_search(theta)[None]
    values, gradient, normal = kernel.costs_and_derivatives(problem, z, 0.1)
    assume(np.isfinite(values).all())
    # Small: among clips and kinks a rollout bends sharply. Where it is unstable (thousands of metres a unit) smaller
    # still.
    h = 1e-7 if np.abs(gradient).max() < 100.0 else 1e-9
    steps = h * np.concatenate([np.eye(5), -np.eye(5)])
    around = kernel.costs(problem, (z[:, None] + steps).copy(), 0.1)[0]
    right, left = (around[:5] - values[0]) / h, (values[0] - around[5:]) / h
    scale = 1e-2 * np.maximum(np.maximum(np.abs(right), np.abs(left)), 1e-2)
    inside = np.minimum(right, left) - scale <= gradient[0]  # at a kink: between the one-sided ones
    assert np.all(inside & (gradient[0] <= np.maximum(right, left) + scale))
    assert np.all(np.linalg.eigvalsh(normal[0]) > -1e-9 * np.abs(normal).max())


def test_sensitivities_survive_standing_still_and_a_change_of_leader():
    """Brake to a stop behind a standing car, which then vanishes: clamp at 0, then a jump of the leader."""
    t = 0.1 * np.arange(110)
    leader_x, leader_speed = np.full((1, 110), 60.0), np.zeros((1, 110))
    leader_x[0, 70:] = 200.0
    x = np.minimum(8.0 * t, 40.0)[None]
    problem = prepare(scenes_of(x, np.full((1, 110), 8.0), leader_x, leader_speed, Window()))
    z = kernel.to_search((1.5, 2.0, 1.0, 3.0, 1.0))
    errors, slopes = kernel.sensitivities(problem, z[None])
    for j in range(5):
        h = np.eye(5)[j] * 1e-6
        up, down = (kernel.sensitivities(problem, (z + side * h)[None])[0] for side in (1, -1))
        assert slopes[0, j] == pytest.approx((up - down)[0] / 2e-6, rel=2e-3, abs=2e-3)
    assert errors.shape == (1, 100)


def test_lanes_agree_with_one_at_a_time(known):
    problem = prepare(known[0])
    z = kernel.LOWER + np.random.default_rng(1).uniform(size=(11, 5)) * (kernel.UPPER - kernel.LOWER)
    together = kernel.costs_of_designs(problem, z, 0.0)
    for s in range(11):
        alone, _, _ = kernel.costs_and_derivatives(problem, np.tile(z[s], (40, 1)), 0.0)
        assert together[:, s] == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize(
    ("wrong", "names"),
    [
        ({"objective": "fde"}, "objective"),
        ({"loss": "cauchy"}, "loss"),
        ({"desired_speed": 0.0}, "desired_speed"),
        ({"desired_speed": np.ones(3)}, "desired_speed"),
        ({"mask": np.ones((2, 2), dtype=bool)}, "mask"),
    ],
)
def test_user_mistakes_are_named(known, wrong, names):
    with pytest.raises(InputError, match=names):
        prepare(known[0], **wrong)
