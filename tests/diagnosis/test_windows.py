"""Windows of car-following: what a driver did and saw."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.smoother import local_cubic
from idm_sumo.recordings.smoothing import WINDOW
from tests.helpers.builders import Car, recording

FRAMES = 250
BRAKES = 60  # frame of its own


def seen_of(*cars: Car) -> dict[int, w.Floats]:
    """What the first window of each driver shows, by vehicle."""
    cut = w.cut_windows(recording(*cars), local_cubic(WINDOW), local_cubic(WINDOW), np.random.default_rng(0))
    return {int(cut.vehicle[driver]): cut.seen[n] for n, driver in enumerate(cut.driver)}


@pytest.fixture(scope="module")
def followers() -> dict[int, w.Floats]:
    """Two who follow in a lane each: one brakes hard for 1.5 s, another came later."""
    step = np.arange(FRAMES)
    speed = 12.0 - 2.5 * 0.1 * np.clip(step - BRAKES, 0, 15)
    braking = np.concatenate([[0.0], np.cumsum(speed[:-1])]) * 0.1
    return seen_of(
        Car(1, x=braking, speed=speed, lane=3, frames=FRAMES),
        Car(2, x=40.0 + braking, speed=speed, lane=3, frames=FRAMES),
        Car(3, x=0.0, lane=2, first_frame=31, frames=FRAMES), Car(4, x=30.0, lane=2, first_frame=31, frames=FRAMES),
    )  # fmt: skip


def test_the_time_since_the_entry_is_known_of_who_came_while_it_was_recorded(followers):
    assert np.isnan(followers[1][w.SINCE_ENTRY]).all()
    np.testing.assert_allclose(followers[3][w.SINCE_ENTRY], followers[3][w.TIME] - 3.0)


def test_hard_braking_is_remembered_and_a_steady_drive_has_none(followers):
    since, clock = followers[1][w.SINCE_BRAKING], followers[1][w.TIME]
    end = 0.1 * (BRAKES + 15)
    after = clock > end + 2.0
    assert after.any()
    np.testing.assert_allclose(since[after], clock[after] - end, atol=1.0)
    assert (since[clock < 0.1 * BRAKES - 1.0] > 1e5).all()
    assert (followers[3][w.SINCE_BRAKING] > 1e5).all()


def test_of_many_windows_whole_blocks_of_neighbours_are_drawn():
    cars = [Car(1 + n, x=30.0 * n, lane=1 + lane, frames=FRAMES) for lane in range(2) for n in range(lane, 80, 2)]
    whole, some = (
        w.cut_windows(
            recording(*cars), local_cubic(WINDOW), local_cubic(WINDOW), np.random.default_rng(3), **most
        ) for most in ({}, {"most": 30})
    )  # fmt: skip
    assert 30 <= len(some.seen) < 30 + 5 * 2
    assert len(whole.seen) > 60
    place = np.searchsorted(whole.vehicle, some.vehicle)
    for block in np.unique(whole.platoon[place]):
        assert np.isin(whole.vehicle[whole.platoon == block], some.vehicle).all()
    both = np.concatenate([whole.seen[np.isin(whole.driver, place)], some.seen]).reshape(2, len(some.seen), -1)
    np.testing.assert_array_equal(both[0], both[1])
    assert sum(some.excluded.values()) - sum(whole.excluded.values()) == whole.drivers - some.drivers
