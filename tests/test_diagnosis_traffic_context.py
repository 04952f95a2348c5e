"""What a driver has around it: trucks beside, brake lights in other lanes."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo import columns as c
from idm_sumo.diagnosis.traffic_context import braking_beside, trucks_beside
from idm_sumo.effects.leader_class import TRUCK


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


def test_other_frames_do_not_count():
    table = beside(**{c.CLASS: TRUCK})
    table[c.FRAME] = [7, 8]
    np.testing.assert_array_equal(trucks_beside(table), 0.0)
