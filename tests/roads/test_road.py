"""A road as a value: lanes of any widths, side lanes, and US-101's official numbers."""

import ast
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.roads import US101, Road, SideLane, road_at
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.errors import InputError

WIDTHS = st.lists(st.floats(2.0, 5.0), min_size=1, max_size=12).map(tuple)


def road(widths: tuple[float, ...] = (3.5, 3.0), side_lanes: tuple[SideLane, ...] = ()) -> Road:
    return Road("test", widths, length=1000.0, speed_limit=30.0, side_lanes=side_lanes)


@given(WIDTHS)
def test_the_middle_of_a_lane_lies_in_that_lane(widths):
    lanes = np.arange(1, len(widths) + 1)
    assert (road(widths).lane_at(road(widths).lane_center(lanes)) == lanes).all()


@given(WIDTHS)
def test_lanes_lie_side_by_side_between_the_markings(widths):
    one, lanes = road(widths), np.arange(1, len(widths) + 1)
    assert one.markings[0] == 0.0
    assert one.width == pytest.approx(sum(widths))
    assert -np.diff(one.markings) == pytest.approx(widths)
    assert one.lane_width(lanes).tolist() == list(widths)
    assert one.lane_center(lanes) == pytest.approx(0.5 * (one.markings[1:] + one.markings[:-1]))


@given(WIDTHS, st.floats(-100.0, 20.0))
def test_a_position_lies_between_the_markings_of_its_lane_or_beyond_the_road(widths, y):
    one = road(widths)
    lane = int(one.lane_at(y))
    left, right = one.markings[lane - 1], one.markings[lane]
    assert right < y <= left or not one.on_main_lanes(y)


@given(st.floats(2.0, 5.0), st.integers(1, 12))
def test_lanes_of_one_width_have_no_rounding_of_their_own(width, lanes):
    one, number = road((width,) * lanes), np.arange(1, lanes + 1)
    assert (one.lane_center(number) == -(number - 0.5) * width).all()
    assert (one.markings[1:] == -number * width).all()


def test_a_marking_belongs_to_the_lane_right_of_it_and_beyond_the_road_counts_the_outermost_lane():
    assert road().lane_at([0.0, -3.5, 1.0, -6.5, -99.0]).tolist() == [1, 2, 1, 2, 2]
    assert road().on_main_lanes([0.0, -6.4, -6.5, 0.1]).tolist() == [True, True, False, False]


def test_a_side_lane_holds_the_places_beside_its_stretch():
    ramp = SideLane(3, "on-ramp", start=100.0, end=200.0, width=4.0)
    one = road(side_lanes=(ramp,))
    assert one.lane_of([50.0, 150.0, 200.0, 250.0], -7.0).tolist() == [2, 3, 3, 2]
    assert one.lane_of(150.0, -6.0) == 2
    assert one.lane_center(3) == -8.5
    assert one.lane_width(3) == 4.0
    assert one.last_lane == 3
    assert one.on_ramps == (ramp,)
    assert one.off_ramps == ()
    assert one.ramp_places == (200.0,)


def test_a_number_that_no_lane_has_has_no_place():
    one = road(side_lanes=(SideLane(5, "off-ramp", start=10.0),))
    assert np.isnan(one.lane_center([3, 4])).all()
    assert np.isnan(one.lane_width(0))


def test_us101_is_as_the_programme_documents_it():
    assert US101.main_lanes == 5
    assert US101.length == pytest.approx(2100 * 0.3048)
    assert US101.lane_width(np.arange(1, 9)) == pytest.approx(12 * 0.3048)
    assert US101.ramp_places == pytest.approx((578 * 0.3048, 1276 * 0.3048))
    assert US101.speed_limit == pytest.approx(55 * 1609.344 / 3600)
    beside = -66 * FOOT  # middle of the sixth strip
    assert US101.lane_of(np.array([100, 577, 579, 1275, 1277, 2000]) * FOOT, beside).tolist() == [7, 7, 6, 6, 8, 8]
    assert US101.lane_at(-np.arange(6, 60, 12) * FOOT).tolist() == [1, 2, 3, 4, 5]
    assert road_at("us-101") is US101


def test_a_road_is_a_value_that_can_be_kept_and_sent():
    assert pickle.loads(pickle.dumps(US101)) == US101
    assert Road.from_dict(json.loads(json.dumps(US101.to_dict()))) == US101
    assert {US101: 1}[US101] == 1
    assert road() != US101
    assert repr(US101) == "<Road us-101: 5 lanes + 3 side lanes, 640 m>"


def test_the_desired_speed_is_the_limit_unless_one_is_given():
    assert road().desired_speed() == 30.0
    assert road().desired_speed(25.0) == 25.0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"widths": ()}, "no main lane"),
        ({"widths": (3.5, 0.0)}, "width of lane 2"),
        ({"length": -1.0}, "length"),
        ({"speed_limit": float("inf")}, "speed_limit"),
        ({"side_lanes": (SideLane(2, "auxiliary"),)}, "above 2"),
        ({"side_lanes": (SideLane(3, "on-ramp"), SideLane(3, "off-ramp"))}, "different numbers"),
    ],
)
def test_what_cannot_be_a_road_is_refused_by_name(change, says):
    values = {"name": "bad", "widths": (3.5, 3.5), "length": 1000.0, "speed_limit": 30.0}
    with pytest.raises(InputError, match=says):
        Road(**{**values, **change})


def _names(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = [alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names]
    modules = [str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return {*imported, *(module.rpartition(".")[2] for module in modules)}


def test_only_the_surrogate_knows_that_a_road_is_us101():
    root = Path(__file__).parents[2]
    knowing = {
        path.relative_to(root).parts[:3]
        for folder in ("idm_sumo", "analysis")
        for path in (root / folder).rglob("*.py")
        if _names(path) & {"US101", "us101"}
    }
    assert knowing == {("idm_sumo", "roads", "__init__.py"), ("idm_sumo", "sumo", "surrogate")}
