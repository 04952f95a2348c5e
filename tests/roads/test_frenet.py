import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.roads.frenet import line_through

TURN = np.linspace(0.0, 1.2, 40)
BEND = line_through(np.column_stack([300 * np.sin(TURN), 300 * (1 - np.cos(TURN))]))


@given(st.floats(-50.0, BEND.length + 50.0), st.floats(-20.0, 20.0))
def test_places_come_back(s: float, offset: float) -> None:
    x, y = BEND.at(s, offset)
    found = BEND.project([x], [y])
    np.testing.assert_allclose([found.s[0], found.offset[0]], [s, offset], atol=1e-6)


def test_a_circle_has_its_length_and_headings() -> None:
    np.testing.assert_allclose(BEND.length, 300 * 1.2, rtol=1e-3)
    np.testing.assert_allclose(BEND.heading([0.0, BEND.length]), [0.0, 1.2], atol=0.02)


def test_left_of_the_line_is_positive() -> None:
    line = line_through([[0.0, 0.0], [10.0, 0.0]])
    found = line.project([5.0, 5.0], [2.0, -3.0])
    np.testing.assert_allclose(found.s, 5.0)
    np.testing.assert_allclose(found.offset, [2.0, -3.0])


def test_points_too_near_to_each_other_are_left_out() -> None:
    assert len(line_through([[0, 0], [0.1, 0], [5, 0], [10, 0]], apart=1.0).points) == 3
