"""Columns: each is the derivative of the rollouts by what it stands for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import columns as co
from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import first_guess
from idm_sumo.diagnosis.model import Placed, with_effects
from idm_sumo.models.effects import CATALOGUE
from tests.helpers.followers import DRIVERS, followers

START = np.array([1e-4, 1e-4])
LINEAR = [(effect.name, form) for effect in CATALOGUE for form in effect.forms if form.field and not form.along]


@pytest.fixture(scope="module")
def recorded():
    """Windows in which everything that an effect answers is to be seen, their fit, and their rollouts."""
    windows, theta = followers(ro.PLAIN, np.random.default_rng(5), lanes=3)
    seen = windows.seen.copy()
    seen[:, w.ADJACENT], seen[:, w.NEXT_BESIDE] = seen[:, w.SPEED] - 2.0, seen[:, w.SPEED] - 5.0
    seen[:, w.ACCELERATION_OF_LATE] = 0.1 - 0.3 * seen[:, w.ACCELERATION]
    seen[:, w.BEHIND] = seen[:, w.X] - 8.0
    seen[::2, w.KIND], seen[1::2, w.UNTIL_CUT_IN], seen[::3, w.UNTIL_OWN] = 3.0, 1.0, 2.0
    windows = replace(windows, seen=seen)
    fit = replace(first_guess(windows, ro.PLAIN.copy(), START), own=np.log(theta))
    return windows, fit, co.answer_of(windows, fit)


@pytest.mark.parametrize(("name", "form"), LINEAR, ids=[f"{name}-{n}" for n, (name, _) in enumerate(LINEAR)])
def test_a_linear_column_is_the_derivative_by_its_magnitude(recorded, name, form):
    windows, fit, answer = recorded
    plan = replace(co.plan_of(windows, fit, free=False), groups=(pl.Group(name, form),))
    column = co.columns(windows, fit, answer, plan)[:, :, 0]
    little = 1e-4
    moved = with_effects(fit, [Placed(name, form, {}, 0, little)], plan).by_lane
    change = (ro.positions(windows, fit.theta, moved) - ro.positions(windows, fit.theta, fit.by_lane)) / little
    assert np.abs(change).max() > 0.0
    assert np.abs(column - change).max() < 0.08 * np.abs(change).max()


def test_bins_of_a_place_add_up_to_the_whole_road(recorded):
    windows, fit, answer = recorded
    plan = co.plan_of(windows, fit, free=False)
    whole = next(g for g in plan.groups if g.axes and g.axes[0].name == "position" and not g.lane)
    of = co.columns(windows, fit, answer, plan)[:, :, whole.first : whole.first + whole.count]
    np.testing.assert_allclose(of.sum(axis=2), answer.response.sum(axis=2), atol=1e-9)


def test_an_effect_in_one_lane_has_the_windows_of_that_lane(recorded):
    windows, fit, answer = recorded
    plan = co.plan_of(windows, fit, free=False)
    of = co.columns(windows, fit, answer, plan)
    groups = [g for g in plan.groups if g.name == "hysteresis"]
    everywhere = groups[0]
    lanes = [g for g in groups if g.lane and g.form is everywhere.form]
    assert len(lanes) == 3
    np.testing.assert_allclose(sum(of[:, :, g.first] for g in lanes), of[:, :, everywhere.first])


@pytest.mark.parametrize("periods", [1, 2])
def test_time_scans_stay_within_a_period(recorded, periods):
    windows, fit, answer = recorded
    windows = replace(windows, period=np.array(["p", "q"])[np.arange(DRIVERS) % periods])
    plan = co.plan_of(windows, fit)
    timed = [g for g in plan.groups if any(axis.name == "time" for axis in g.axes)]
    assert any(g.is_free for g in timed)
    assert any(g.name for g in timed) is (periods == 1)
    if periods == 2:
        assert {g.period for g in timed} == {0, 1}
        of = co.columns(windows, fit, answer, plan)
        inside = windows.period[windows.driver] == "p"
        for group in timed:
            rows = inside if group.period == 1 else ~inside
            assert not of[rows][:, :, group.first : group.first + group.count].any()


def test_chunks_hold_whole_drivers(recorded):
    windows, _, _ = recorded
    rows = list(co.chunks(windows, most=10))
    assert [r.start for r in rows] == [0, *(r.stop for r in rows[:-1])]
    assert rows[-1].stop == len(windows.seen)
    for r in rows[:-1]:
        assert windows.driver[r.stop - 1] != windows.driver[r.stop]


@pytest.mark.parametrize("value", [0.6, 0.2])
def test_an_effect_in_the_model_is_compared_with_none(recorded, value):
    windows, fit, _ = recorded
    name, form = "reaction_delay", CATALOGUE[0].forms[0]
    plan = co.plan_of(windows, fit, free=False)
    late = with_effects(fit, [Placed(name, form, {}, 0, value)], plan)
    there = co.present_form(late, CATALOGUE[0])
    assert there is not None
    group = pl.Group(name, there, present=True)
    column = co.columns(windows, late, co.answer_of(windows, late), replace(plan, groups=(group,)))[:, :, 0]
    whole = ro.positions(windows, fit.theta, late.by_lane) - ro.positions(windows, fit.theta, fit.by_lane)
    np.testing.assert_allclose(column * value, whole, atol=1e-9)
