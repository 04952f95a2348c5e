"""The simulator that hides effects: its traffic is plausible, and each effect does what its name says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.cleaning import clean
from idm_sumo.reading import read_recording
from tests.planting import CATALOGUE, OUTSIDE, plan, simulate, write
from tests.planting.behaviour import credit, dead, headway
from tests.planting.files import _preceding, measured, position_noise

SHORT = {"drivers": 150, "minutes": 3.0, "lanes": 3, "form": "usual"}


def gaps(planted):
    """Net gap, own speed and class ahead of every row with a leader."""
    vehicle, frame = np.nonzero(np.isfinite(planted.x))
    ahead, _ = _preceding(planted, vehicle, frame)
    some = ahead >= 0
    ahead, vehicle, frame = ahead[some], vehicle[some], frame[some]
    net = planted.x[ahead, frame] - planted.length[ahead] - planted.x[vehicle, frame]
    return net, planted.v[vehicle, frame], planted.kind[ahead], frame


@pytest.mark.parametrize("underlying", ["idm", "fvd"])
@pytest.mark.parametrize("density", ["moderate", "congested"])
def test_traffic_is_plausible(underlying, density):
    planted = simulate(plan(4, effect=None, underlying=underlying, density=density, **SHORT))
    net, speed, _, _ = gaps(planted)
    assert net.min() > 0.0
    assert 3.0 < np.nanmean(planted.v) < 25.0
    assert 0.8 < np.median(net[speed > 3] / speed[speed > 3]) < 3.0
    changes = (
        (np.diff(planted.lane.astype(int), axis=1) != 0) & (planted.lane[:, 1:] >= 0) & (planted.lane[:, :-1] >= 0)
    )
    assert changes.sum() >= 10
    assert np.nanmin(np.diff(planted.x, axis=1)) >= 0.0
    seen = np.isfinite(planted.x)
    assert np.all(np.diff(seen.astype(int), axis=1).clip(0).sum(axis=1) <= 1), "nobody comes back"


def test_same_seed_same_recording():
    once, again = (measured(simulate(plan(9, effect="drawn", **SHORT))) for _ in range(2))
    pd.testing.assert_frame_equal(once, again)


@pytest.mark.parametrize("kind", ["white", "correlated"])
def test_noise_is_as_planned(kind):
    noise = position_noise(np.random.default_rng(0), (400, 500), kind, 0.3)
    assert noise.std() == pytest.approx(0.3, rel=0.02)
    neighbours = (noise[:, 1:] * noise[:, :-1]).mean() / 0.09
    assert neighbours == pytest.approx(0.0 if kind == "white" else np.exp(-0.1 / 0.6), abs=0.02)


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


@pytest.mark.parametrize("name", [*CATALOGUE, *OUTSIDE])
def test_every_effect_changes_the_measurements(name):
    small = {"drivers": 150, "minutes": 2.0, "lanes": 3, "trucks": 0.15, "time": (20.0, 100.0), "form": "usual"}
    base = plan(6, effect=None, underlying="idm", density="congested", **small)
    plain, planted = measured(simulate(base)), measured(simulate(replace(base, effects={name: 0.4})))
    assert len(plain) != len(planted) or not np.allclose(plain["Local_Y"], planted["Local_Y"])


def test_only_some_drivers_and_one_lane():
    base = plan(6, effect="hysteresis", size="large", share=0.3, **SHORT)
    planted = simulate(base)
    assert 0.2 < planted.affected.mean() < 0.4


@pytest.mark.parametrize("suffix", [".txt", ".parquet"])
def test_the_reader_takes_the_file_whole(tmp_path: Path, suffix):
    planted = simulate(plan(3, effect=None, **SHORT))
    result = read_recording(write(planted, tmp_path / f"hidden{suffix}"))
    assert result.accounting.dropped == {}
    assert len(result.recording.table) == np.isfinite(planted.x).sum()
    cleaned = clean(result.recording)
    assert cleaned.accounting.dropped == {}
