"""Causes of some drivers: how many, who, and that nobody's membership is judged by what decided it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import some_drivers as sd
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.models.effects import slots
from tests.helpers.followers import DRIVERS, followers

START = np.array([0.01, 0.01])
LATE = np.arange(DRIVERS) % 5 < 2
NOISE = 0.1  # m


def late(who: np.ndarray) -> w.Windows:
    """Return windows of drivers of whom some are late by 0.8 s, measured with noise."""
    by_lane = ro.PLAIN.copy()
    by_lane[:, slots.DELAY] = 0.8
    on_time, behind = (followers(one, np.random.default_rng(4))[0] for one in (ro.PLAIN, by_lane))
    seen = np.where(who[on_time.driver][:, None, None], behind.seen, on_time.seen)
    seen[:, w.X] += np.random.default_rng(4).normal(0.0, NOISE, (len(seen), seen.shape[2]))
    return replace(on_time, seen=seen)


@pytest.fixture(name="windows", scope="module")
def make_windows():
    return late(LATE)


@pytest.fixture(name="base", scope="module")
def make_base(windows):
    return fit_drivers(windows, ro.PLAIN.copy(), START, rounds=8)


@pytest.fixture(name="two", scope="module")
def make_two(windows, base):
    with_it = replace(base, by_lane=base.by_lane.copy())
    with_it.by_lane[:, slots.DELAY] = 0.8
    both = sd.of_two_kinds(with_it, base)
    return fit_drivers(windows.without(~LATE[windows.driver]), both.by_lane, START, rounds=8)


@given(st.floats(0.05, 0.95), st.integers(0, 1000))
def test_the_share_of_those_who_surely_have_it_is_found(share, seed):
    has_it = np.random.default_rng(seed).random(400) < share
    found = sd.mixture(np.where(has_it, 30.0, -30.0))
    assert found.share == pytest.approx(has_it.mean(), abs=1e-3)
    np.testing.assert_array_equal(sd.has(np.where(has_it, 30.0, -30.0), found.share), has_it)
    # As of draws from two kinds, where each driver surely says of which it is.
    half = 1.96 * np.sqrt(found.share * (1.0 - found.share) / 400)
    assert found.ci95 == pytest.approx((found.share - half, found.share + half), abs=0.01)


@given(st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=30))
def test_a_mixture_is_no_less_likely_than_all_or_nobody(gains):
    gain = np.array(gains)
    slack = 1e-3 * len(gain)  # a share of all or of nobody is only nearly reached
    assert sd.mixture(gain).support >= max(0.0, 2.0 * gain.sum()) - slack


def test_drivers_without_it_are_driven_without_it_and_nobody_else(windows, two):
    rows = LATE[windows.driver]
    with_it, without = two.by_lane[: ro.ROWS], two.by_lane[ro.ROWS :]
    assert (with_it[:, slots.DELAY] == 0.8).all()
    assert not without[:, slots.DELAY].any()
    apart = ro.positions(windows.without(~rows), two.theta, two.by_lane)
    np.testing.assert_allclose(apart[rows], ro.positions(windows, two.theta, with_it)[rows], atol=1e-9)
    np.testing.assert_allclose(apart[~rows], ro.positions(windows, two.theta, without)[~rows], atol=1e-9)
    # Magnitudes that know of no two kinds are for both.
    either = ro.positions(windows.without(~rows), two.theta, with_it)
    np.testing.assert_array_equal(either, ro.positions(windows, two.theta, with_it))


def test_some_who_are_late_are_told_from_those_who_are_not(windows, base, two):
    found = sd.some_who_differ(windows, base, base)
    assert found is not None
    assert found.name == "reaction_delay"
    assert found.share == pytest.approx(0.4, abs=0.1)
    assert (found.has == LATE).mean() > 0.9
    told = sd.by_their_windows(windows, two, found.share).seen[:, w.WITHOUT, 0] == 0.0
    assert (told == LATE[windows.driver]).mean() > 0.9


@pytest.mark.parametrize("everybody", [True, False])
def test_where_all_are_alike_there_are_no_some(everybody):
    windows = late(np.full(DRIVERS, everybody))
    base = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=8)
    assert sd.some_who_differ(windows, base, base) is None


def test_what_decides_is_not_what_is_judged_by_it(windows, two):
    first = sd.by_their_other_windows(windows, two, 0.4).seen[:, w.WITHOUT, 0]
    assert ((first == 0.0) == LATE[windows.driver]).mean() > 0.8
    # A window that comes to be somebody else's decides of the driver's others, not of itself.
    seen, other = windows.seen.copy(), late(~LATE).seen
    changed = np.flatnonzero(windows.driver == 3)[1]
    seen[changed] = other[changed]
    second = sd.by_their_other_windows(replace(windows, seen=seen), two, 0.4).seen[:, w.WITHOUT, 0]
    assert (second[changed] == first[changed]).all()
    same = windows.driver != 3
    np.testing.assert_array_equal(second[same], first[same])
