import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.traffic import NOBODY, build_traffic, leader_row, sort_into_cells
from tests.helpers.builders import Car, recording

positions = st.integers(0, 30).map(float)  # coarse, so that fronts coincide


def sorted_traffic(rows, cells=4):
    """Build cells from ``(cell, x, vehicle)``."""
    cell, x, vehicle = (np.array(column) for column in zip(*rows, strict=True))
    columns = {name: x.astype(float) if name == "x" else np.zeros(len(x))
               for name in ("x", "y", "heading", "speed", "length", "width")}  # fmt: skip
    return sort_into_cells(cell.astype(np.int64), cells, columns, vehicle.astype(np.int64), 0, cells)


@given(
    st.lists(st.tuples(st.integers(0, 3), positions, st.integers(1, 6)), min_size=1, max_size=25),
    st.integers(0, 3), positions, st.integers(1, 6),
)  # fmt: skip
def test_leader_row_is_the_nearest_front_ahead(rows, cell, front, own):
    traffic = sorted_traffic(rows)
    found = leader_row(traffic.offsets, traffic.x, traffic.vehicle, cell, front, own)
    ahead = [x for in_cell, x, vehicle in rows if in_cell == cell and x > front and vehicle != own]
    if not ahead:
        assert found == NOBODY
    else:
        assert traffic.x[found] == min(ahead)
        assert traffic.vehicle[found] != own
        assert traffic.offsets[cell] <= found < traffic.offsets[cell + 1]


def test_cells_are_lanes_and_frames():
    traffic = build_traffic(recording(
        Car(7, x=50.0, lane=2, first_frame=5, frames=3), Car(8, x=20.0, lane=2, first_frame=6, frames=3),
        Car(9, x=0.0, lane=5, first_frame=5, frames=1),
    ))  # fmt: skip

    def vehicles(lane, frame):
        cell = traffic.cell(lane, frame)
        return traffic.vehicle[traffic.offsets[cell] : traffic.offsets[cell + 1]].tolist()

    assert (traffic.first_frame, traffic.frames) == (5, 4)
    assert vehicles(2, 5) == [7]
    assert vehicles(2, 6) == [8, 7]  # upstream first
    assert vehicles(2, 8) == [8]
    assert vehicles(5, 5) == [9]
    assert vehicles(5, 6) == vehicles(1, 5) == []
    assert traffic.offsets[-1] == 7
    assert len(traffic.offsets) == US101.main_lanes * 4 + 1


def test_unknown_sizes_are_those_of_the_median_car():
    traffic = build_traffic(recording(Car(1, length=np.nan, width=np.nan)))
    assert traffic.length == pytest.approx(US101.car_length)
    assert traffic.width == pytest.approx(US101.car_width)


def test_the_lane_is_the_one_the_front_lies_in_whatever_its_label():
    y = US101.lane_center(3) + np.linspace(0.0, US101.widths[0], 40)
    traffic = build_traffic(recording(Car(1, y=y, lane=3)))
    lanes = np.repeat(np.arange(1, 6), traffic.frames)[np.diff(traffic.offsets) > 0]
    assert np.bincount(lanes, minlength=6).tolist() == [0, 0, 20, 20, 0, 0]


@given(
    st.lists(st.tuples(st.integers(0, 3), positions, st.integers(1, 6)), min_size=1, max_size=25),
    st.sets(st.integers(1, 6)),
)
def test_without_some_vehicles_is_built_without_them(rows, gone):
    thinned = sorted_traffic(rows).without(sorted(gone))
    left = [row for row in rows if row[2] not in gone]
    cells = [(thinned.offsets[k], thinned.offsets[k + 1]) for k in range(4)]
    found = sorted((k, x, v) for k, (a, b) in enumerate(cells)
                   for x, v in zip(thinned.x[a:b], thinned.vehicle[a:b], strict=True))  # fmt: skip
    assert found == sorted(left)
