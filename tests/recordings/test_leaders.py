import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.leaders import leader_from_headway, row_ahead, row_of
from idm_sumo.roads.us101 import US101
from tests.helpers.builders import Car, recording

POSITIONS = st.lists(
    st.tuples(st.integers(0, 600), st.integers(1, 5)), min_size=1, max_size=12, unique_by=lambda place: place[0]
)


@given(places=POSITIONS)
@settings(max_examples=60, deadline=None)
def test_row_ahead_is_the_nearest_front_in_the_lane(places: list[tuple[int, int]]) -> None:
    rec = recording(*(Car(i, x=float(x), lane=lane, frames=2) for i, (x, lane) in enumerate(places, 1)))
    table = rec.table
    for row, ahead in enumerate(row_ahead(table)):
        me = table.loc[row]
        others = table[(table[c.FRAME] == me[c.FRAME]) & (table[c.LANE] == me[c.LANE]) & (table[c.X] > me[c.X])]
        assert ahead == (others[c.X].idxmin() if len(others) else -1)


def test_row_of_finds_the_same_frame_only() -> None:
    table = recording(Car(1, frames=3), Car(2, first_frame=3, frames=3)).table
    assert row_of(table, np.full(6, 2)).tolist() == [-1, -1, 3, 3, 4, 5]
    assert (row_of(table, np.zeros(6, dtype=np.int64)) == -1).all()


def test_leader_is_found_where_the_headway_ends() -> None:
    rec = recording(
        Car(1, x=0.0, lane=2, headway=30.05, frames=3),
        Car(2, x=30.0, lane=2, headway=50.0, frames=3),  # nobody there
        Car(3, x=30.0, lane=5, frames=3),  # abreast of 2, but three lanes off
    )
    assert leader_from_headway(rec.table, across=US101.widths[0]).tolist() == [2, 2, 2, 0, 0, 0, 0, 0, 0]
