import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.roads.straight import lanes_between, lanes_of_labels, straight_road
from idm_sumo.runtime.errors import InputError


def test_lanes_between_markings() -> None:
    lanes = lanes_between([1.0, -1.0, -3.0, -5.5, -9.0], [0.0, -3.0, -6.0])
    assert lanes.number.tolist() == [0, 1, 2, 2, 0]
    np.testing.assert_allclose(lanes.offset, [0.0, 0.5, 1.5, -1.0, 0.0])
    assert lanes.widths == (3.0, 3.0)


@given(st.integers(1, 6), st.floats(2.6, 5.0), st.booleans())
def test_labels_from_either_side_give_lanes_from_the_left(count: int, width: float, from_right: bool) -> None:
    lane = np.repeat(np.arange(1, count + 1), 50)
    label = count + 1 - lane if from_right and count > 1 else lane
    lanes = lanes_of_labels(-width * lane, label, "test")
    np.testing.assert_array_equal(lanes.number, lane)
    np.testing.assert_allclose(lanes.offset, 0.0, atol=1e-9)
    if count > 1:
        np.testing.assert_allclose(lanes.widths, width)


def test_a_lane_without_vehicles_is_between_its_neighbours() -> None:
    label = np.repeat([1, 3], 50)
    lanes = lanes_of_labels(-3.5 * label, label, "test")
    assert lanes.number.tolist() == label.tolist()
    assert lanes.widths == pytest.approx((3.5, 3.5, 3.5))


@pytest.mark.parametrize("width", [1.0, 12.0])
def test_lanes_in_other_units_are_refused(width: float) -> None:
    label = np.repeat([1, 2, 3], 10)
    with pytest.raises(InputError, match="check units and lane numbers"):
        lanes_of_labels(-width * label, label, "test")


def test_no_lane_at_all_is_refused() -> None:
    with pytest.raises(InputError, match="no row has a lane"):
        lanes_of_labels([0.0], [0], "test")


def test_who_is_beside_has_a_side_lane() -> None:
    road = straight_road("test", (3.5, 3.0), length=100.0, speed_limit=30.0, beside=True)
    assert (road.main_lanes, road.last_lane) == (2, 3)
