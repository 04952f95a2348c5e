"""Other lanes: trucks and motorcycles beside, brake lights, crowds, who is beside the gap, and how fast they are."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from idm_sumo.diagnosis.other_lanes import MOTORCYCLE, OtherLanes
from idm_sumo.models.effects.leader_class import TRUCK
from idm_sumo.recordings import columns as c


def frame(**others: object) -> pd.DataFrame:
    """Return one frame: a driver at 100 m in lane 2 as the first row, and one other vehicle."""
    other = {c.X: 110.0, c.LANE: 3, c.CLASS: 2, c.ACCELERATION: 0.0, **others}
    rows = [{c.X: 100.0, c.LANE: 2, c.CLASS: 2, c.ACCELERATION: 0.0}, other]
    known = {c.FRAME: 7, c.VEHICLE: [1, 2], c.PERIOD: pd.Categorical(["p", "p"]), c.SPEED: [12.0, 8.0]}
    return pd.DataFrame(rows).assign(**known)


def beside(**others: object) -> OtherLanes:
    return OtherLanes(frame(**others))


def test_a_truck_counts_only_in_an_adjacent_lane_and_only_alongside():
    assert beside(**{c.CLASS: TRUCK}).trucks()[0] == 1
    for nothing in ({c.CLASS: 2}, {c.CLASS: TRUCK, c.LANE: 4}, {c.CLASS: TRUCK, c.LANE: 2}, {c.CLASS: TRUCK, c.X: 90.0},
                    {c.CLASS: TRUCK, c.X: 130.0}):  # fmt: skip
        assert beside(**nothing).trucks()[0] == 0


def test_brake_lights_are_seen_two_lanes_over_but_not_in_the_own_lane_or_behind():
    for lane in (1, 3, 4):
        assert beside(**{c.LANE: lane, c.ACCELERATION: -1.5}).braking()[0] == 1
    for nothing in ({c.LANE: 2}, {c.LANE: 5}, {c.X: 95.0}, {c.X: 145.0}):
        assert beside(**{c.ACCELERATION: -1.5, **nothing}).braking()[0] == 0
    assert beside(**{c.ACCELERATION: -0.5}).braking()[0] == 0


def test_a_crowd_is_who_is_near_in_one_adjacent_lane_and_unknown_without_one():
    for x in (65.0, 135.0):
        assert beside(**{c.X: x}).crowd(1)[0] == 1
    for nothing in ({c.X: 55.0}, {c.X: 145.0}):
        assert beside(**nothing).crowd(1)[0] == 0
    assert beside().crowd(-1)[1] == 1
    assert np.isnan(beside().crowd(-1)[0])
    assert np.isnan(beside(**{c.LANE: 4}).crowd(1)).all()


def test_who_is_alongside_overlaps_in_an_adjacent_lane():
    for x in (96.0, 104.0):
        assert beside(**{c.X: x}).abreast()[0] == 1
    for nothing in ({c.X: 106.0}, {c.X: 94.0}, {c.X: 100.0, c.LANE: 2}, {c.X: 100.0, c.LANE: 4}):
        assert beside(**nothing).abreast()[0] == 0
    both = pd.concat(
        [frame(**{c.X: 101.0}), frame(**{c.X: 99.0}).iloc[1:].assign(**{c.VEHICLE: 3, c.LANE: 1})], ignore_index=True
    )
    np.testing.assert_array_equal(OtherLanes(both).abreast(), [2, 1, 1])


def test_the_nearest_beside_is_ahead_or_behind_in_an_adjacent_lane():
    for x in (86.0, 97.0, 100.0, 114.0):
        assert beside(**{c.X: x}).nearest()[0] == pytest.approx(x - 100.0)
    for nothing in ({c.X: 84.0}, {c.X: 116.0}, {c.X: 110.0, c.LANE: 2}, {c.X: 110.0, c.LANE: 4}):
        assert np.isnan(beside(**nothing).nearest()[0])
    third = frame(**{c.X: 96.0}).iloc[1:].assign(**{c.VEHICLE: 3, c.LANE: 1})
    assert OtherLanes(pd.concat([frame(**{c.X: 107.0}), third], ignore_index=True)).nearest()[0] == pytest.approx(-4.0)
    table = frame(**{c.X: 101.0})
    table[c.FRAME] = [7, 8]
    assert np.isnan(OtherLanes(table).nearest()).all()


def test_other_frames_do_not_count():
    table = frame(**{c.CLASS: TRUCK})
    table[c.FRAME] = [7, 8]
    np.testing.assert_array_equal(OtherLanes(table).trucks(), 0.0)


def test_the_slower_adjacent_lane_is_the_one_that_holds_back():
    assert beside().slower_speed()[0] == 8.0
    assert beside().slower_speed()[1] == 12.0
    assert np.isnan(beside(**{c.X: 135.0}).slower_speed()).all()
    third = pd.concat([frame(), frame().iloc[:1].assign(**{c.VEHICLE: 3, c.LANE: 1, c.SPEED: 6.0})], ignore_index=True)
    assert OtherLanes(third).slower_speed()[0] == 6.0


def test_the_next_one_is_ahead_in_an_adjacent_lane_and_the_slower_of_two_holds_back():
    for x in (100.0, 110.0, 159.0):
        assert beside(**{c.X: x}).slower_next_speed()[0] == 8.0
    for nothing in ({c.X: 99.0}, {c.X: 161.0}, {c.LANE: 2}, {c.LANE: 4}):
        assert np.isnan(beside(**nothing).slower_next_speed()[0])
    assert np.isnan(beside().slower_next_speed()[1])
    farther = frame(**{c.X: 130.0}).iloc[1:].assign(**{c.VEHICLE: 3, c.SPEED: 2.0})
    assert OtherLanes(pd.concat([frame(), farther], ignore_index=True)).slower_next_speed()[0] == 8.0
    other_side = farther.assign(**{c.LANE: 1})
    assert OtherLanes(pd.concat([frame(), other_side], ignore_index=True)).slower_next_speed()[0] == 2.0


def test_the_faster_adjacent_lane_is_the_other_one():
    assert beside().faster_speed()[0] == 8.0
    assert np.isnan(beside(**{c.X: 135.0}).faster_speed()).all()
    third = pd.concat([frame(), frame().iloc[:1].assign(**{c.VEHICLE: 3, c.LANE: 1, c.SPEED: 6.0})], ignore_index=True)
    assert OtherLanes(third).faster_speed()[0] == 8.0


def test_beside_the_gap_is_who_drives_between_the_own_front_and_the_leaders_rear():
    gap = np.array([12.0, 12.0])
    for x in (106.0, 116.0):
        assert beside(**{c.X: x}).beside_gap(gap)[0] == 1
    for nothing in ({c.X: 104.0}, {c.X: 118.0}, {c.X: 110.0, c.LANE: 2}, {c.X: 110.0, c.LANE: 4}):
        assert beside(**nothing).beside_gap(gap)[0] == 0
    assert beside(**{c.X: 106.0}).beside_gap(np.full(2, np.nan))[0] == 0


def test_a_motorcycle_counts_in_an_adjacent_lane_ahead_and_behind():
    for x in (86.0, 114.0):
        assert beside(**{c.X: x, c.CLASS: MOTORCYCLE}).motorcycles()[0] == 1
    for nothing in ({c.X: 84.0}, {c.X: 116.0}, {c.X: 110.0, c.LANE: 2}, {c.X: 110.0, c.LANE: 4}):
        assert beside(**{c.CLASS: MOTORCYCLE, **nothing}).motorcycles()[0] == 0
    assert beside().motorcycles()[0] == 0
