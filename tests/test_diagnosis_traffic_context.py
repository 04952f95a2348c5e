"""What a driver has around it: trucks beside, brake lights in other lanes."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo import columns as c
from idm_sumo.diagnosis.traffic_context import braking_beside, crowd_beside, look_around, trucks_beside
from idm_sumo.effects.leader_class import TRUCK
from idm_sumo.reading import read_recording
from tests import planting


def beside(**others: object) -> pd.DataFrame:
    """Return one frame: a driver at 100 m in lane 2 as the first row, and one other vehicle."""
    other = {c.X: 110.0, c.LANE: 3, c.CLASS: 2, c.ACCELERATION: 0.0, **others}
    rows = [{c.X: 100.0, c.LANE: 2, c.CLASS: 2, c.ACCELERATION: 0.0}, other]
    return pd.DataFrame(rows).assign(**{c.FRAME: 7, c.VEHICLE: [1, 2], c.PERIOD: pd.Categorical(["p", "p"])})


def test_a_truck_counts_only_in_an_adjacent_lane_and_only_alongside():
    assert trucks_beside(beside(**{c.CLASS: TRUCK}))[0] == 1
    for nothing in ({c.CLASS: 2}, {c.CLASS: TRUCK, c.LANE: 4}, {c.CLASS: TRUCK, c.LANE: 2}, {c.CLASS: TRUCK, c.X: 90.0},
                    {c.CLASS: TRUCK, c.X: 130.0}):  # fmt: skip
        assert trucks_beside(beside(**nothing))[0] == 0


def test_brake_lights_are_seen_two_lanes_over_but_not_in_the_own_lane_or_behind():
    for lane in (1, 3, 4):
        assert braking_beside(beside(**{c.LANE: lane, c.ACCELERATION: -1.5}))[0] == 1
    for nothing in ({c.LANE: 2}, {c.LANE: 5}, {c.X: 95.0}, {c.X: 145.0}):
        assert braking_beside(beside(**{c.ACCELERATION: -1.5, **nothing}))[0] == 0
    assert braking_beside(beside(**{c.ACCELERATION: -0.5}))[0] == 0


def test_a_crowd_is_who_is_near_in_one_adjacent_lane_and_unknown_without_one():
    for x in (65.0, 135.0):
        assert crowd_beside(beside(**{c.X: x}), 1)[0] == 1
    for nothing in ({c.X: 55.0}, {c.X: 145.0}):
        assert crowd_beside(beside(**nothing), 1)[0] == 0
    assert crowd_beside(beside(), -1)[1] == 1
    assert np.isnan(crowd_beside(beside(), -1)[0])
    assert np.isnan(crowd_beside(beside(**{c.LANE: 4}), 1)).all()


def test_the_follower_is_known_by_its_class(tmp_path):
    written = planting.write(
        planting.simulate(planting.plan(3, effect=None, drivers=60, minutes=1.0, trucks=0.5)), tmp_path / "r.parquet"
    )
    table = (recording := read_recording(written).recording).table
    ahead = look_around(recording)
    last = table[c.X].to_numpy() == table.groupby([c.FRAME, c.LANE])[c.X].transform("min").to_numpy()
    assert (ahead.follower_kind[last] == 0.0).all()
    assert set(ahead.follower_kind[~last]) == {1.0, 2.0, 3.0} & set(table[c.CLASS])
    np.testing.assert_array_equal(ahead.follower_kind == 0.0, ahead.follower_front == -np.inf)


def test_other_frames_do_not_count():
    table = beside(**{c.CLASS: TRUCK})
    table[c.FRAME] = [7, 8]
    np.testing.assert_array_equal(trucks_beside(table), 0.0)
