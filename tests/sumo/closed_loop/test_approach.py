"""Vehicles that depart upstream of the section: as many, in order, in time to arrive when they were recorded."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration.departures import DESTINATION, LEAVING, THROUGH
from idm_sumo.recordings import columns as c
from idm_sumo.roads.us101 import US101
from idm_sumo.sumo import network
from idm_sumo.sumo.closed_loop.approach import DISTANCE, moved_upstream
from idm_sumo.sumo.closed_loop.demand import demand_of
from tests.helpers.builders import Car, recording


def platoon() -> list[Car]:
    speeds = 8.0 + 4.0 * np.sin(np.arange(60))
    return [Car(n + 1, 5.0, 2 + n % 2, float(speeds[n]), first_frame=1 + 25 * n, frames=60) for n in range(60)]


def test_nobody_is_lost_and_lanes_keep_their_order() -> None:
    recorded = recording(*platoon(), Car(99, 300.0, 1, 10.0, frames=60))
    here, moved = demand_of(recorded), demand_of(recorded, approach=True)
    assert set(here[c.VEHICLE]) == set(moved[c.VEHICLE])
    assert moved[d.DEPART].min() >= 0.0
    assert moved[d.DEPART].is_monotonic_increasing
    for lane in (2, 3):
        before, after = (table[table[d.LANE] == lane] for table in (here, moved))
        assert before[c.VEHICLE].tolist() == after.sort_values([d.DEPART, d.X], ascending=[True, False])[
            c.VEHICLE].tolist()  # fmt: skip
    both = here.merge(moved, on=c.VEHICLE, suffixes=("", "_moved"))
    assert (both[d.X] - both[f"{d.X}_moved"]).between(0.0, DISTANCE).all()
    assert both.loc[both[c.VEHICLE] == 99, f"{d.X}_moved"].item() == 300.0


def test_who_leaves_by_the_off_ramp_still_does() -> None:
    x = np.arange(5.0, US101.off_ramps[0].start + 40.0)
    y = np.where(x < US101.off_ramps[0].start - 50.0, *(float(US101.lane_center(lane)) for lane in (5, 6)))
    leaving = Car(99, x, y=y, first_frame=200, frames=len(x))
    traffic = recording(*platoon(), leaving)
    recorded = traffic.with_table(traffic.table.assign(lane=US101.lane_of(traffic.table[c.X], traffic.table[c.Y])))
    for approach in (False, True):
        demand = demand_of(recorded, approach=approach).set_index(c.VEHICLE)
        assert demand.loc[99, DESTINATION] == LEAVING
        assert (demand.drop(index=99)[DESTINATION] == THROUGH).all()


def test_at_constant_speed_everybody_arrives_when_it_was_recorded() -> None:
    recorded = recording(*(Car(n + 1, 5.0, 3, 10.0, first_frame=1 + 30 * n, frames=60) for n in range(40)))
    here = demand_of(recorded)
    moved = moved_upstream(here, network.of(recorded.road)).set_index(c.VEHICLE)
    here = here.set_index(c.VEHICLE)
    arrives = moved[d.DEPART] + (here[d.X] - moved[d.X]) / 10.0
    late = here[d.DEPART] > 0.0
    pd.testing.assert_series_equal(arrives[late], here.loc[late, d.DEPART], check_names=False, atol=0.06)
    assert (here[d.X] - moved[d.X]).iloc[-1] == DISTANCE
