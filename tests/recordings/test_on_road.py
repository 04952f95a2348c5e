import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings.cleaning import JUMP, LEADER_JUMP, clean
from idm_sumo.recordings.on_road import check_foreign_lanes, check_lane_widths, check_on_road, foreign_edges
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from tests.helpers.builders import Car, recording


def test_a_twentieth_of_the_rows_may_lie_off_the_road() -> None:
    y = pd.Series(np.full(100, -9.0))
    check_on_road(pd.Series([*np.zeros(95), *np.full(5, 2000.0)]), y, US101, "x")
    with pytest.raises(InputError, match=r"6% of the rows do not lie on us-101"):
        check_on_road(pd.Series([*np.zeros(94), *np.full(6, 2000.0)]), y, US101, "x")


def test_lanes_of_another_width_are_refused() -> None:
    lanes = np.repeat([1, 2, 3, 4], 10)
    check_lane_widths(pd.DataFrame({"lane": lanes, "y": -3.5 * (lanes - 0.5)}), US101, "x", range(1, 6))
    with pytest.raises(InputError, match=r"3\.00 m apart where those of us-101 are 3\.66 m"):
        check_lane_widths(pd.DataFrame({"lane": lanes, "y": -3.0 * (lanes - 0.5)}), US101, "x", range(1, 6))


def test_edges_of_another_network_are_found_and_their_lanes_held_against_ours() -> None:
    assert foreign_edges(pd.Series(["entry_0", ":junction_0", "", None]), US101) == []
    lanes = pd.Series([f"e_{k}" for k in range(5)])
    assert foreign_edges(lanes, US101) == ["e"]
    check_foreign_lanes(lanes, pd.Series(-3.66 * np.arange(4.5, 0, -1)), ["e"], US101, "x")
    with pytest.raises(InputError, match=r"5 lanes 3\.20 m apart"):
        check_foreign_lanes(lanes, pd.Series(-3.2 * np.arange(4.5, 0, -1)), ["e"], US101, "x")


def test_a_vehicle_that_jumps_is_left_out_and_who_drives_behind_it_is_not_modelled() -> None:
    steps = np.arange(40.0)
    cleaned = clean(recording(Car(1, x=100.0 + steps + 200.0 * (steps > 20)), Car(2, x=50.0 + steps), Car(3, lane=1)))
    assert cleaned.accounting.dropped == {JUMP: 40}
    assert dict(cleaned.vehicles[["vehicle", "reason"]].to_numpy()) == {1: JUMP, 2: "wrong leader", 3: ""}


def test_a_follower_whose_only_known_leader_jumps_is_not_modelled() -> None:
    headway = 30.0 + 250.0 * (np.arange(40) == 20)
    some = recording(Car(1, headway=headway), Car(2, lane=1, headway=30.0), has_leader_rows=False)
    some.table["leader"] = 9
    assert clean(some).vehicles["reason"].tolist() == [LEADER_JUMP, ""]
