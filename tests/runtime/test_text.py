"""Numbers and lists of numbers as people read them."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.runtime.text import number, ranges


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (1000.0, "1000"),
        (1234.5, "1234"),
        (999.6, "1000"),
        (12.345, "12.3"),
        (0.01234, "0.0123"),
        (3.0, "3"),
        (float("nan"), "–"),
    ],
)
def test_numbers_are_written_out(value: float, shown: str) -> None:
    assert number(value) == shown


@given(st.floats(-1e9, 1e9), st.integers(1, 6))
def test_no_number_loses_whole_units_or_its_digits(value: float, digits: int) -> None:
    text = number(value, digits)
    assert "e+" not in text
    assert (
        abs(float(text) - value) <= max(0.5 * abs(value) * 10.0 ** (1 - digits), 0.0) or abs(float(text) - value) <= 0.5
    )
    assert re.fullmatch(r"-?[\d.]+(e-\d+)?", text)


@given(st.sets(st.integers(1, 60), min_size=1))
def test_ranges_name_every_number_until_the_line_is_full(numbers: set[int]) -> None:
    parts = ranges(numbers).split(", ")
    named = set()
    for part in parts:
        if part != "...":
            low, _, high = part.partition("-")
            named |= set(range(int(low), int(high or low) + 1))
    assert named == numbers or (parts[-1] == "..." and named < numbers and len(parts) == 9)


def test_ranges_of_nothing() -> None:
    assert ranges([]) == "none"
