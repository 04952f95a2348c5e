"""The simulator that hides effects: its traffic is plausible, and each effect does what its name says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from tests.simulators.first import (
    CATALOGUE,
    FORMS,
    IN_SUMO,
    MODELS,
    OUTSIDE,
    SUMO_MODELS,
    achievable,
    plan,
    simulate,
    write,
)
from tests.simulators.first import behaviour as act
from tests.simulators.first.behaviour import credit, dead, headway
from tests.simulators.first.files import _preceding, measured, position_noise

SHORT = {"drivers": 150, "minutes": 3.0, "lanes": 3, "form": "usual"}
FEW = 40  # drivers for whom the true model is fitted


def gaps(planted):
    """Net gap, own speed and class ahead of every row with a leader."""
    vehicle, frame = np.nonzero(np.isfinite(planted.x))
    ahead, _ = _preceding(planted, vehicle, frame)
    some = ahead >= 0
    ahead, vehicle, frame = ahead[some], vehicle[some], frame[some]
    net = planted.x[ahead, frame] - planted.length[ahead] - planted.x[vehicle, frame]
    return net, planted.v[vehicle, frame], planted.kind[ahead], frame


@pytest.mark.parametrize("underlying", MODELS)
@pytest.mark.parametrize("density", ["light", "congested"])
def test_traffic_is_plausible(underlying, density):
    planted = simulate(plan(4, effect=None, underlying=underlying, density=density, **SHORT))
    net, speed, _, _ = gaps(planted)
    assert net.min() > 0.0
    assert 3.0 < np.nanmean(planted.v) < (30.0 if density == "light" else 15.0)
    assert 0.8 < np.median(net[speed > 3] / speed[speed > 3]) < (12.0 if density == "light" else 3.0)
    changes = (
        (np.diff(planted.lane.astype(int), axis=1) != 0) & (planted.lane[:, 1:] >= 0) & (planted.lane[:, :-1] >= 0)
    )
    assert changes.sum() >= 10
    assert np.nanmin(np.diff(planted.x, axis=1)) >= 0.0
    seen = np.isfinite(planted.x)
    assert np.all(np.diff(seen.astype(int), axis=1).clip(0).sum(axis=1) <= 1), "nobody comes back"
    first, last = seen.argmax(axis=1), seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1)
    everyone = np.arange(len(seen))
    assert planted.x[everyone, first][first > 0].max() < 5.0, "whoever appears comes in at the upstream end"
    assert planted.x[everyone, last][last < seen.shape[1] - 1].min() > 635.0, "whoever goes leaves downstream"


@pytest.mark.parametrize("underlying", ["idm", "SUMO mixed"])
def test_same_seed_same_recording(underlying):
    effect = "drawn" if underlying == "idm" else "time_of_day"
    given = {**SHORT, "minutes": 1.5, "underlying": underlying}
    once, again = (measured(simulate(plan(9, effect=effect, **given))) for _ in range(2))
    pd.testing.assert_frame_equal(once, again)


@pytest.mark.parametrize("underlying", SUMO_MODELS)
def test_traffic_that_sumo_drives_is_plausible(underlying):
    planted = simulate(plan(4, effect=None, underlying=underlying, density="congested", **SHORT))
    net, speed, _, _ = gaps(planted)
    assert len(planted.x) >= SHORT["drivers"]
    assert net.min() > 0.0
    assert 2.0 < np.nanmean(planted.v) < 15.0
    assert np.nanstd(planted.v) > 1.0, "waves run through"
    assert 0.8 < np.median(net[speed > 3] / speed[speed > 3]) < 3.0
    seen = np.isfinite(planted.x)
    assert np.all(np.diff(seen.astype(int), axis=1).clip(0).sum(axis=1) <= 1), "nobody comes back"


@pytest.mark.parametrize("effect", IN_SUMO)
def test_sumos_drivers_keep_the_headway_that_is_hidden(effect):
    given = {**SHORT, "minutes": 2.0, "underlying": "SUMO IDM", "density": "congested", "trucks": 0.15}
    chosen = plan(6, effect=effect, size="large", **given)
    before, after = (simulate(replace(chosen, effects=effects)) for effects in ({}, {effect: 0.5}))

    def headways(planted):
        net, speed, kind, frame = gaps(planted)
        seconds = 0.1 * frame
        acts = {
            "time_of_day": (seconds > chosen.time[0] + 10.0) & (seconds < chosen.time[1]), "leader_class": kind == 3,
            "speed_dependent_headway": speed > 11.0, "location": speed > 0.0,
        }[effect]  # fmt: skip
        some = acts & (speed > 3.0)
        return np.median(net[some] / speed[some])

    assert headways(after) > 1.04 * headways(before)


def test_what_sumos_drivers_cannot_have_is_said():
    with pytest.raises(ValueError, match="hysteresis: SUMO's drivers can have location"):
        simulate(plan(6, effect="hysteresis", size="large", **{**SHORT, "underlying": "SUMO IDM"}))


@pytest.mark.parametrize(
    ("kind", "next_to"),
    [("white", 0.0), ("correlated", np.exp(-0.1 / 0.6)), ("smoothed", (2.0 + np.cos(np.pi / 6.0)) / 3.0)],
)
def test_noise_is_as_planned(kind, next_to):
    noise = position_noise(np.random.default_rng(0), (400, 500), kind, 0.3)
    assert noise.std() == pytest.approx(0.3, rel=0.02)
    neighbours = (noise[:, 1:] * noise[:, :-1]).mean() / 0.09
    assert neighbours == pytest.approx(next_to, abs=0.02)


def test_trucks_keep_right_and_are_followed_at_more_distance_when_planted():
    base = plan(2, effect=None, underlying="idm", trucks=0.2, density="congested", **SHORT)
    plain, planted = simulate(base), simulate(replace(base, effects={"leader_class": 0.5}))
    assert set(plain.lane[plain.kind == 3][plain.lane[plain.kind == 3] >= 0]) <= {1, 2}
    behind = []
    for one in (plain, planted):
        net, speed, ahead, _ = gaps(one)
        moving = speed > 3
        time_gap = net / np.maximum(speed, 1.0)
        behind.append(np.median(time_gap[moving & (ahead == 3)]) / np.median(time_gap[moving & (ahead == 2)]))
    assert behind[1] > behind[0] + 0.1


def test_a_period_of_longer_headways_shows_in_time():
    base = plan(2, effect=None, underlying="idm", density="congested", drivers=400, minutes=4.0, lanes=3, form="usual",
                time=(100.0, 180.0))  # fmt: skip
    inside = []
    for one in (simulate(base), simulate(replace(base, effects={"time_of_day": 0.25}))):
        net, speed, _, frame = gaps(one)
        during = (frame > 1200) & (frame < 1800) & (speed > 3)
        inside.append(np.median((net / np.maximum(speed, 1))[during]))
    assert inside[1] > 1.08 * inside[0]


def test_the_forms_are_what_they_say():
    none = np.zeros(len(CATALOGUE) + len(OUTSIDE))
    assert credit(none, 10.0, 1.0, False) == 0.0
    some = none.copy()
    some[2] = 0.6
    assert credit(some, 10.0, 0.0, False) == pytest.approx(6.0)
    assert credit(some, 10.0, 30.0, True) == 0.0
    assert dead(0.3, 0.6, False) == 0.0
    assert dead(0.8, 0.6, False) == 0.8
    assert abs(dead(0.3, 0.6, True)) < 0.3
    assert headway(1.2, 8.0, none, False, 0.0, 0.0, True, False, 10.0, 0.0, False, False) == 1.2


# What is seen, what it must do to the acceleration of a driver 15 m behind at 10 m/s (closing in at 0.2 m/s), by
# effect.
DIRECTIONS = {
    "multi_leader_anticipation": ({act.SECOND_REACH: 125.0, act.SECOND_V: 5.0}, -1),
    "lane_change_relaxation": ({act.JUMP: 10.0, act.SINCE: 1.0}, 1),
    "leader_class": ({act.AHEAD_TRUCK: 1.0}, -1),
    "speed_dependent_headway": ({}, -1),
    "perception_threshold": ({}, 1),
    "hysteresis": ({act.AHEAD_ACC: 1.0, act.AHEAD_SLOW_ACC: 1.0}, -1),
    "adjacent_lane_friction": ({act.BESIDE_V: 5.0}, -1),
    "location": ({}, -1),
    "time_of_day": ({act.IN_TIME: 1.0}, -1),
    "memory": ({act.MEAN_V: 5.0}, -1),
    "follower_pressure": ({act.TAIL: 95.0}, 1),
    "courtesy_yielding": ({act.COURTEOUS: 1.0}, -1),
    "pre_insertion": ({act.PREPARING: 1.0}, -1),
    "throttle_wave": ({act.ANGLE: 1.5}, 1),
    "lane_enforcement": ({act.IN_TIME: 1.0, act.SPECIAL_LANE: 1.0}, -1),
    "beside_truck": ({act.TRUCK_BESIDE: 1.0}, -1),
    "brake_lights_across": ({act.BRAKING_ACROSS: 1.0}, -1),
    "weariness": ({act.UNREST: 1.0}, -1),
}


def response(model, form, changes, seen):
    """Acceleration at 10 m/s behind a gap of 15 m that closes by 0.2 m/s."""
    effects = np.zeros(len(act.INDEX))
    for name, size in changes.items():
        effects[act.INDEX[name]] = size
    sight = np.zeros(act.SEEN)
    sight[[act.BESIDE_V, act.SECOND_REACH, act.SECOND_V, act.TAIL]] = np.nan
    sight[[act.REAR, act.AHEAD_V, act.MEAN_V, act.SINCE]] = 115.0, 9.8, 15.0, 1e9
    for column, value in seen.items():
        sight[column] = value
    theta, where = np.array([30.0, 1.2, 1.2, 1.8, 2.0]), np.array([50.0, 150.0, 0.0, 1.0])
    return act.respond(model, form, effects, theta, 1.0, False, sight, where, 100.0, 10.0, 10.0, 15.0, 0.2)


@pytest.mark.parametrize("model", range(len(MODELS)))
@pytest.mark.parametrize("form", range(len(FORMS)))
@pytest.mark.parametrize("name", DIRECTIONS)
def test_an_effect_pushes_where_its_name_says(name, form, model):
    seen, direction = DIRECTIONS[name]
    if (name, form) == ("speed_dependent_headway", act.THIRD):  # shorter at speed
        direction = 1
    change = response(model, form, {name: 0.3}, seen) - response(model, form, {}, seen)
    assert direction * change > 0.0


@pytest.mark.parametrize("form", range(len(FORMS)))
def test_asymmetry_weakens_acceleration_and_leaves_braking(form):
    weak = {"acceleration_asymmetry": 0.3}
    far, near = {act.JUMP: 40.0, act.SINCE: 0.0}, {act.AHEAD_TRUCK: 1.0}
    for seen, more in ((far, {"lane_change_relaxation": 1.0}), (near, {"leader_class": 0.5})):
        plain, planted = response(0, form, more, seen), response(0, form, {**more, **weak}, seen)
        assert planted < plain if plain > 0 else planted == plain


CHANGED_ELSEWHERE = (
    "reaction_delay",
    "desired_speed",
    "vehicle_class",
    "measurement_artefact",
    "distraction",
    "late_for_a_while",
)


def test_every_effect_is_tried_somewhere():
    assert {*DIRECTIONS, *CHANGED_ELSEWHERE, "acceleration_asymmetry"} == {*CATALOGUE, *OUTSIDE}


@pytest.mark.parametrize("name", CHANGED_ELSEWHERE)
def test_what_needs_traffic_changes_the_measurements(name):
    small = {"drivers": 150, "minutes": 2.0, "lanes": 3, "trucks": 0.15, "time": (20.0, 100.0), "form": "usual"}
    base = plan(6, effect=None, underlying="idm", density="congested", **small)
    plain, planted = measured(simulate(base)), measured(simulate(replace(base, effects={name: 0.4})))
    assert len(plain) != len(planted) or not np.allclose(plain["Local_Y"], planted["Local_Y"])


def test_late_drivers_answer_late():
    base = plan(6, effect=None, underlying="idm", density="congested", **SHORT)
    quick, late = (simulate(replace(base, effects={"reaction_delay": s}), remember=True) for s in (0.0, 0.8))
    assert np.percentile(answers(quick), 25) < 0.5
    assert np.percentile(answers(late), 25) == pytest.approx(0.8, abs=0.15)


def answers(planted):
    """Return how long (s) after closing in each driver brakes: the lag of the strongest correlation."""
    lags = []
    for closing, speed in zip(planted.v - planted.sights[:, :, act.AHEAD_V], planted.v, strict=True):
        known = np.isfinite(closing) & np.isfinite(speed)
        if known.sum() > 250:
            dv, acc = closing[known], np.gradient(speed[known], 0.1)
            lags.append(np.argmin([np.corrcoef(dv[: len(dv) - k], acc[k:])[0, 1] for k in range(40)]) / 10)
    return lags


@pytest.mark.parametrize("underlying", MODELS)
def test_the_true_model_gains_what_its_effect_is_worth(underlying):
    base = plan(6, effect=None, underlying=underlying, density="congested", **SHORT)
    gains = []
    for size in (0.0, 0.3):
        planted = simulate(replace(base, effects={"hysteresis": size}), remember=True)
        gains.append(achievable(planted, drivers=FEW).share)
    assert gains[0] == 0.0
    assert gains[1] > 0.05


def test_of_two_effects_each_is_worth_something_beside_the_other():
    planted = simulate(plan(6, effect=("hysteresis", "location"), size="large", underlying="idm", density="congested",
        **SHORT),
                       remember=True)  # fmt: skip
    truth = achievable(planted, drivers=FEW)
    assert len(truth.without) == 2
    assert truth.extended < min(truth.without)
    assert max(truth.without) < truth.base


def test_without_noise_the_true_model_drives_what_was_driven():
    planted = simulate(plan(6, effect="hysteresis", size="mid", underlying="idm", driver_noise=0.0, sigma=0.0,
        density="congested", **SHORT),
                       remember=True)  # fmt: skip
    truth = achievable(planted, drivers=FEW)
    assert truth.extended < 0.05 < truth.base


@pytest.mark.parametrize(
    "effect",
    ["reaction_delay", "lane_change_relaxation", "time_of_day", "speed_dependent_headway", "adjacent_lane_friction"],
)
def test_without_noise_the_true_model_drives_what_a_third_form_drove(effect):
    given = {**SHORT, "form": "third", "underlying": "idm", "density": "congested", "driver_noise": 0.0, "sigma": 0.0}
    truth = achievable(simulate(plan(6, effect=effect, size="mid", **given), remember=True), drivers=FEW)
    assert truth.extended < min(0.05, 0.3 * truth.base)


def test_only_some_drivers_and_one_lane():
    base = plan(6, effect="hysteresis", size="large", share=0.3, **SHORT)
    planted = simulate(base)
    assert 0.2 < planted.affected.mean() < 0.4


@pytest.mark.parametrize(
    ("suffix", "road"),
    [(".txt", {}), (".parquet", {"length": 1200.0, "lanes": 5}), (".parquet", {"length": 400.0, "lanes": 2})],
)
def test_the_reader_takes_the_file_whole(tmp_path: Path, suffix, road):
    planted = simulate(plan(3, effect=None, **{**SHORT, **road}))
    assert gaps(planted)[0].min() > 0.0
    result = read_recording(write(planted, tmp_path / f"hidden{suffix}"), any_length=True)
    assert result.accounting.dropped == {}
    assert len(result.table) == np.isfinite(planted.x).sum()
    assert np.ptp(result.table["x"]) == pytest.approx(planted.plan.length, abs=15.0)
    cleaned = clean(result)
    assert cleaned.accounting.dropped == {}


def test_the_file_does_not_tell():
    planted = simulate(plan(3, effect="location", size="large", **SHORT))
    table = measured(planted)
    true = planted.v[table["Vehicle_ID"] - 2, table["Frame_ID"] - 13]
    off = table["v_Vel"] * 0.3048 - true
    assert 0.05 < off.std() < 2.0, "speeds come from measured positions, not from the simulator"
