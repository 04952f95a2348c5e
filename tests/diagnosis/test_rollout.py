"""Rollouts of windows: the linear response is the derivative, the fit finds the drivers, replicates show nothing planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Noises, draw
from idm_sumo.diagnosis.fit import fit_drivers, for_rollouts
from idm_sumo.diagnosis.noise import QUIET
from idm_sumo.diagnosis.replicates import make_replicate, refit
from idm_sumo.models.effects import Stimuli, extended_acceleration, slots
from idm_sumo.models.effects.reaction_delay import acted_on
from tests.helpers.followers import DRIVERS, EACH, followers


@pytest.fixture(name="plain", scope="module")
def make_plain():
    return followers(ro.PLAIN, np.random.default_rng(4))


def test_who_changes_lanes_has_no_usual_one(plain):
    windows, _ = plain
    seen = windows.seen.copy()
    seen[windows.driver == 3, w.LANE] = 2.0
    seen[windows.driver == 5, w.LANE, : w.LEAD + 60] = 4.0
    seen[windows.driver == 6, w.LANE, w.LEAD : w.LEAD + 10] = 4.0  # a few frames are no change
    expected = np.ones(DRIVERS)
    expected[[3, 5]] = 2, 0
    np.testing.assert_array_equal(replace(windows, seen=seen).usual_lane, expected)


def test_true_drivers_end_where_they_were_recorded(plain):
    windows, theta = plain
    np.testing.assert_allclose(ro.positions(windows, theta, ro.PLAIN), windows.target, atol=1e-6)


def by_hand(windows: w.Windows, theta: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Return the compared positions of rollouts one step at a time, by the acceleration that replay uses."""
    out = np.empty((len(windows.seen), windows.seen.shape[2] - w.LEAD))
    for i, seen in enumerate(windows.seen):
        x, v = seen[w.X, w.LEAD], seen[w.V, w.LEAD]
        past = np.stack([seen[w.REAR] - seen[w.X], seen[w.V], seen[w.V] - seen[w.SPEED]], axis=1)
        out[i, 0], where = x, seen[w.X].copy()
        for k in range(seen.shape[1] - 1):
            row = seen[:, k]
            if k >= w.LEAD:
                past[k], where[k] = (row[w.REAR] - x, v, v - row[w.SPEED]), x
            if row[w.SINCE] == 0.0 and m[slots.NEW_LEADER_KNOWN]:
                for j in range(k):
                    past[j, 0] = row[w.REAR] - 0.1 * (k - j) * row[w.SPEED] - where[j]
                    past[j, 2] = past[j, 1] - row[w.SPEED]
            if k < w.LEAD:
                continue
            gap, speed, rate = acted_on(past, k, m, 0.1)
            see = Stimuli(
                x, row[w.TIME], row[w.ACCELERATION], row[w.KIND], row[w.OWN_KIND], row[w.LANE], row[w.SECOND] - x,
                row[w.SECOND_SPEED], row[w.ADJACENT], x - row[w.BEHIND], row[w.JUMP], row[w.SINCE], row[w.ACCEPTED], row[w.UNTIL_CUT_IN],
                row[w.UNTIL_OWN], row[w.MEAN_SPEED], row[w.NEXT_BESIDE],
                row[w.ACCELERATION_OF_LATE],
            )  # fmt: skip
            own = theta[windows.driver[i]]
            a = extended_acceleration(speed, rate, gap, see, (*own[:4], 0.0), own[4], m)
            x, v = x + 0.05 * (v + max(v + 0.1 * a, 0.0)), max(v + 0.1 * a, 0.0)
            out[i, k + 1 - w.LEAD] = x
    return out[:, w.EVERY :: w.EVERY]


def with_another_leader(windows: w.Windows, frame: int) -> w.Windows:
    """Return the windows with a new leader, 4 m nearer and 1 m/s slower, from a frame on."""
    seen = windows.seen.copy()
    seen[:, w.REAR, frame:] -= 4.0 + 0.1 * np.arange(seen.shape[2] - frame)
    seen[:, w.SPEED, frame:] -= 1.0
    seen[:, w.SINCE, frame:] = 0.1 * np.arange(seen.shape[2] - frame)
    return replace(windows, seen=seen)


@pytest.mark.parametrize(("frame", "soon"), [(w.LEAD - 3, 1), (w.LEAD + 40, 4)])
def test_a_new_leaders_past_counts_where_it_is_known(plain, frame, soon):
    windows, theta = plain
    windows = with_another_leader(windows.of_drivers(np.arange(4)), frame)
    late, known = np.zeros((2, slots.COUNT))
    late[slots.DELAY] = known[slots.DELAY] = 0.8
    known[slots.NEW_LEADER_KNOWN] = 1.0
    one, other = (np.tile(m, (9, 1)) for m in (late, known))
    beside = ro.positions_otherwise(windows, theta[:4], [one, other])
    np.testing.assert_allclose(beside[:, :, 0], by_hand(windows, theta[:4], late), atol=1e-9)
    np.testing.assert_allclose(beside[:, :, 1], by_hand(windows, theta[:4], known), atol=1e-9)
    np.testing.assert_array_equal(ro.positions(windows, theta[:4], other), beside[:, :, 1])
    assert (beside[:, soon, 1] < beside[:, soon, 0]).all()  # who knows of it brakes sooner


@pytest.mark.parametrize(
    ("delay", "known", "in_rate", "loop"),
    [(0.0, 0.0, 0.0, 0.2), (0.37, 0.0, 0.0, 0.0), (0.37, 0.6, 0.0, 0.2), (0.37, 1.0, 0.8, 0.0)],
)
def test_rollouts_side_by_side_are_those_of_replay(delay, known, in_rate, loop):
    m = np.zeros(slots.COUNT)
    m[[slots.DELAY, slots.OWN_SPEED_KNOWN, slots.OWN_SPEED_IN_RATE, slots.BAND, slots.HYSTERESIS, slots.ASYMMETRY]] = (
        delay,
        known,
        in_rate,
        0.3,
        loop,
        0.1,
    )
    m[[slots.PLACE, slots.PLACE_BEGIN, slots.PLACE_END, slots.SPEED_HEADWAY, slots.PIVOT_SPEED]] = -0.2, 50, 90, 0.1, 9
    windows, theta = followers(ro.PLAIN, np.random.default_rng(9))
    windows = windows.of_drivers(np.arange(4))
    theta = theta[:4]
    beside = np.stack([theta, 1.1 * theta, theta], axis=2)
    start = np.array([[0.0, 0.0, 0.4], [0.0, 0.0, -0.3]])
    found = ro.positions_beside(windows, beside, np.tile(m, (9, 1)), start)
    np.testing.assert_allclose(found[:, :, 0], by_hand(windows, theta, m), atol=1e-9)
    np.testing.assert_allclose(found[:, :, 1], by_hand(windows, 1.1 * theta, m), atol=1e-9)
    assert (np.abs(found[:, :, 2] - found[:, :, 0])[:, 0] > 0.05).all()
    np.testing.assert_array_equal(ro.positions(windows, theta, np.tile(m, (9, 1))), found[:, :, 0])


@pytest.mark.parametrize("beside", [1, 2, 3, 8, 9, 12])
def test_any_number_of_rollouts_are_each_alone(plain, beside):
    windows, theta = plain
    windows, theta = windows.of_drivers(np.arange(3)), theta[:3]
    of_each = theta[:, :, None] * np.linspace(0.9, 1.1, beside)
    start = np.linspace(0.0, 0.5, 2 * beside).reshape(2, beside)
    together = ro.positions_beside(windows, of_each, ro.PLAIN, start)
    for n in range(beside):
        alone = ro.positions_beside(windows, of_each[:, :, n : n + 1], ro.PLAIN, start[:, n : n + 1])
        np.testing.assert_allclose(together[:, :, n], alone[:, :, 0], atol=1e-9)


def test_a_model_of_one_lane_acts_there_alone(plain):
    windows, theta = plain
    seen = windows.seen.copy()
    seen[windows.driver == 2, w.LANE] = 3.0
    only = ro.PLAIN.copy()
    only[3, slots.PLACE], only[3, slots.PLACE_END] = -0.3, 1e3
    moved = ro.positions(replace(windows, seen=seen), theta, only) - windows.target
    np.testing.assert_array_equal((np.abs(moved) > 0.1).any(axis=1), windows.driver == 2)


def change_by_a_pulse(windows: w.Windows, theta: np.ndarray, m: np.ndarray, small: float) -> np.ndarray:
    """Return by how much the fifth pulse moves the compared positions, per m/s²."""
    push = np.zeros((len(windows.seen), w.HORIZON))
    push[:, 4 * ro.BIN : 5 * ro.BIN] = small
    moved, _ = ro.drive(windows.seen, windows.driver, theta, m, np.zeros(2), push, w.LEAD)
    return (moved[:, w.EVERY :: w.EVERY] - ro.positions(windows, theta, m)) / small


def test_response_to_pulses_is_the_derivative_of_the_rollout(plain):
    windows, theta = plain
    response, _ = ro.respond(windows.seen, windows.driver, theta, ro.PLAIN)
    np.testing.assert_allclose(response[:, :, 4], change_by_a_pulse(windows, theta, ro.PLAIN, 1e-4), atol=2e-3)


@pytest.mark.parametrize(("known", "in_rate"), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)])
def test_response_to_pulses_waits_for_a_delayed_driver(plain, known, in_rate):
    windows, theta = plain
    m = ro.PLAIN.copy()
    m[:, slots.DELAY], m[:, slots.OWN_SPEED_KNOWN], m[:, slots.OWN_SPEED_IN_RATE] = 0.6, known, in_rate
    response, _ = ro.respond(windows.seen, windows.driver, theta, m)
    np.testing.assert_allclose(response[:, :, 4], change_by_a_pulse(windows, theta, m, 1e-3), atol=0.02)


def test_the_edge_of_a_dead_band_is_no_wall(plain):
    windows, theta = plain
    m = ro.PLAIN.copy()
    m[:, slots.BAND] = 1.0
    response, _ = ro.respond(windows.seen, windows.driver, theta, m)
    change = change_by_a_pulse(windows, theta, m, 0.1)
    assert np.abs(response[:, -1, 4]).max() < 3.0 * np.abs(change[:, -1]).max()


@pytest.mark.parametrize("delay", [0.0, 0.4])
def test_models_side_by_side_are_each_alone(plain, delay):
    windows, theta = plain
    base = ro.PLAIN.copy()
    base[:, slots.DELAY] = delay
    models = [base.copy() for _ in range(6)]
    models[5][:, slots.SECOND_LEADER], models[5][:, slots.SECOND_SPEED_ONLY] = 0.3, 1.0
    models[4][:, slots.DELAY], models[4][:, slots.OWN_SPEED_KNOWN] = 0.5, 1.0
    models[3][:, slots.DELAY], models[3][:, [slots.OWN_SPEED_KNOWN, slots.OWN_SPEED_IN_RATE]] = 0.3, 1.0
    models[1][:, slots.DELAY], models[2][:, [slots.BAND, slots.BAND_TAKEN]] = 0.73, (0.5, 1.0)
    models[2][:, [slots.PLACE_HEADWAY, slots.PLACE_END]] = 0.5, 1e3
    models[3][:, [slots.HYSTERESIS, slots.PLACE, slots.PLACE_END]] = 0.2, -0.3, 1e3
    found = ro.positions_otherwise(windows, theta, models)
    for n, model in enumerate(models):
        np.testing.assert_allclose(found[:, :, n], ro.positions(windows, theta, model), atol=1e-9)
    assert ro.positions_otherwise(windows, theta, []).shape[2] == 0


def test_the_fit_finds_the_drivers(plain):
    windows, theta = plain
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=8)
    gap = np.abs(ro.positions(windows, fit.theta, ro.PLAIN) - windows.target)
    assert gap.mean() < 0.03
    assert np.corrcoef(np.log(theta[:, 2]), fit.own[:, 2])[0, 1] > 0.9
    others = for_rollouts(windows, fit)
    assert np.abs(ro.positions(windows, others.theta, ro.PLAIN) - windows.target).mean() < 0.05


def test_a_replicate_of_quiet_drivers_is_fitted_by_the_same_drivers(plain):
    windows, _ = plain
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=8)
    replicate = make_replicate(
        windows, fit, draw(windows, Noises(QUIET, QUIET), np.random.default_rng(0)), is_smooth=True
    )
    np.testing.assert_allclose(replicate.target, windows.target, atol=0.5)
    again = refit(replicate, fit)
    assert np.abs(again.own - fit.own).max() < 0.1


def test_a_planted_delay_is_larger_than_what_refitting_absorbs():
    m = ro.PLAIN.copy()
    m[:, slots.DELAY] = 0.6
    windows, _ = followers(m, np.random.default_rng(4))
    start = np.array([1e-4, 1e-4])
    plain_fit = fit_drivers(windows, ro.PLAIN.copy(), start, rounds=8)
    with_delay = fit_drivers(windows, m, start, rounds=8)

    def off(fit):
        return np.abs(ro.positions(windows, fit.theta, fit.by_lane) - windows.target).mean()

    assert off(with_delay) < 0.5 * off(plain_fit)
    # With another model than the driver's, the likelihood is not where the vehicles are nearest.
    nearest = for_rollouts(windows, plain_fit, known=True)
    assert off(nearest) < 0.95 * off(plain_fit)


def test_drivers_can_be_taken_apart(plain):
    windows, _ = plain
    part = windows.of_drivers(np.array([7, 3]))
    assert part.vehicle.tolist() == [8, 4]
    np.testing.assert_array_equal(part.seen[:EACH], windows.seen[7 * EACH : 8 * EACH])
    assert part.driver.tolist() == [0] * EACH + [1] * EACH
