"""What the data say: leverage has a limit, a rare effect is not its own noise, drawn drivers know nothing of the recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import fit as fitting
from idm_sumo.diagnosis import law
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.bins import numbered, pulse_means, response_by_bin
from idm_sumo.diagnosis.chance import Noises, draw
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.look import Subject, guard, score
from idm_sumo.diagnosis.noise import QUIET
from idm_sumo.diagnosis.replicates import drawn_anew, start_behind
from idm_sumo.models import laws
from idm_sumo.models.effects import slots
from tests.helpers.followers import followers

START = np.array([1e-4, 1e-4])


@given(arrays(np.int64, (3, 20), elements=st.integers(-1, 4)), st.integers(0, 2**31))
def test_responses_by_bin_are_those_to_the_field_there(number, seed):
    rng = np.random.default_rng(seed)
    value, response = rng.standard_normal(number.shape), rng.standard_normal((3, 2, 20 // ro.BIN))
    found = np.zeros((3, 2, 6))
    response_by_bin(response, number, value, found)
    for k in range(5):
        field = pulse_means(np.where(number == k, value, 0.0))
        np.testing.assert_allclose(found[:, :, k], (response @ field[:, :, None])[:, :, 0], atol=1e-12)
    assert not found[:, :, 5].any()


@given(
    arrays(np.float64, 30, elements=st.floats(-2.0, 12.0)),
    st.lists(st.integers(0, 1000), min_size=2, max_size=8, unique=True),
)
def test_bins_are_those_of_a_sorted_search(values, edges):
    edges = np.sort(np.array(edges)) / 100.0
    place = np.searchsorted(edges, values, side="right") - 1
    np.testing.assert_array_equal(numbered(values, edges), np.where(place < len(edges) - 1, place, -1))


def test_bins_hold_their_lower_edge_and_nothing_outside():
    edges = np.array([0.0, 1.0, 3.0])
    assert numbered(np.array([-0.1, 0.0, 0.99, 1.0, 3.0, np.nan]), edges).tolist() == [-1, 0, 0, 1, -1, -1]


def test_one_window_that_explodes_is_held_back_and_the_others_stay():
    columns = np.random.default_rng(0).uniform(0.5, 1.0, (50, 4, 2))
    columns[7, :, 0] *= 1e6
    columns[:, :, 1] = 0.0
    tamed = rg.tamed(columns)
    usual = np.delete(np.arange(50), 7)
    np.testing.assert_array_equal(tamed[usual], columns[usual])
    assert np.abs(tamed[7]).max() < 4.0
    np.testing.assert_allclose(tamed[7, :, 0] / tamed[7, 0, 0], columns[7, :, 0] / columns[7, 0, 0])


def test_errors_of_a_window_count_less_in_proportion_to_what_it_answers_beyond_the_usual():
    response = np.random.default_rng(3).uniform(0.9, 1.1, (60, 24, 24))
    response[7] *= 10.0
    response[8] *= 20.0
    counts = rg.calm(response)
    usual = np.delete(np.arange(60), [7, 8])
    np.testing.assert_array_equal(counts[usual], 1.0)
    np.testing.assert_allclose(counts[7:9], [rg.MOST_ANSWERED / 10.0, rg.MOST_ANSWERED / 20.0], rtol=0.02)


def test_a_rare_effect_is_not_its_own_noise():
    part = np.zeros((200, 1))
    part[:8] = 5.0
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((200, 1)) * np.sqrt(part)
    u = 3.0 * part + noise
    evidence = ev.Evidence(
        [rg.Regressor("leader_class")], u, np.zeros((3, 1)), part.sum(0)[None], part, np.arange(200) // 5
    )
    alone = replace(evidence, u=noise)
    assert evidence.clustered(np.eye(1)) == pytest.approx(alone.clustered(np.eye(1)))


def test_the_form_is_taken_out_of_all_but_laws_of_the_moment():
    names = [
        "acceleration_asymmetry",
        "speed_dependent_headway",
        rg.GUARD + "0",
        "location",
        rg.LOCAL + "reaction_delay",
    ]
    regressors = [rg.Regressor(name) for name in names]
    root = np.random.default_rng(3).standard_normal((5, 12))
    gram = root @ root.T
    free = guard(regressors, gram)
    form, others = [0, 1, 2], [3, 4]
    np.testing.assert_allclose((free.T @ gram)[np.ix_(others, form)], 0.0, atol=1e-9)
    np.testing.assert_array_equal(free[:, form], np.eye(5)[:, form])
    # Scores that the form alone makes leave nothing.
    np.testing.assert_allclose((gram[:, 2] @ free)[others], 0.0, atol=1e-9)


def test_drawn_drivers_are_of_the_population_and_start_where_they_would():
    windows, _ = followers(ro.PLAIN, np.random.default_rng(4))
    fit = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=6)
    many = replace(fit, own=np.tile(fit.mean, (4000, 1)))
    drawn = drawn_anew(
        many, draw(replace(windows, vehicle=np.arange(4000)), Noises(QUIET, QUIET), np.random.default_rng(2))
    )
    np.testing.assert_allclose(drawn.own.mean(axis=0), fit.mean, atol=0.05)
    np.testing.assert_allclose(np.cov(drawn.own.T)[2, 2], fit.spread[2, 2], rtol=0.1)
    longer = replace(fit, own=fit.own + np.array([0.0, 0.0, 0.2, 0.0, 0.0]))
    assert (start_behind(windows, fit, longer) > 0.0).all()
    np.testing.assert_array_equal(start_behind(windows, fit, fit), 0.0)


@pytest.mark.parametrize(("slot", "size"), [(slots.HYSTERESIS, 0.2), (slots.BAND, 0.6)])
def test_the_score_vanishes_at_the_planted_size_and_points_to_it_from_below(slot, size):
    planted = ro.PLAIN.copy()
    planted[:, slot] = size
    windows, _ = followers(planted, np.random.default_rng(5))
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    name = {slots.HYSTERESIS: "hysteresis", slots.BAND: "perception_threshold"}[slot]
    half = planted.copy()
    half[:, slot] = 0.5 * size
    steps = [
        ev.local_scores(ev.look_here(subject, fit_drivers(windows, by_lane, START, rounds=8)))[name]
        for by_lane in (half, planted)
    ]
    below, there = (step.score / step.information for step in steps)
    assert below > 0.15 * size
    assert abs(there) < 0.1 * size


def test_what_all_drivers_share_is_no_effect_where_it_is_a_little_off(monkeypatch):
    """A tenth of a second off in the time in which a safe speed is reached looks like effects that cannot be."""
    windows, _ = followers(law.of(laws.KRAUSS, 0.9), np.random.default_rng(5))
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    with monkeypatch.context() as off:
        off.setattr(fitting, "SHARED", {})
        fit = fit_drivers(windows, law.of(laws.KRAUSS), START, rounds=8)
        seen = standard_errors(subject, fit)
    assert standard_errors(subject, fit) < 0.6 * seen


def standard_errors(subject, fit):
    """Return those of an acceleration asymmetry, free of nothing but the population."""
    regressors, found = score(subject, subject.windows, fit)
    n = [regressor.name for regressor in regressors].index("acceleration_asymmetry")
    return abs(found.u[:, n].sum()) / np.sqrt(found.gram[n, n])
