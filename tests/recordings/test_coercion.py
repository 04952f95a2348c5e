import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.recordings.coercion import LARGEST, numbers, sizes, whole
from idm_sumo.runtime.errors import InputError

ANY = st.one_of(
    st.integers(), st.floats(), st.text(), st.booleans(), st.binary(), st.none(), st.lists(st.integers()),
    st.decimals(),
    st.dictionaries(st.text(), st.integers()),
)  # fmt: skip


@given(st.lists(ANY, min_size=1))
def test_any_cell_is_a_number_or_refused_with_its_row(cells: list[object]) -> None:
    said = ""
    try:
        found = numbers(pd.Series(cells, dtype=object), "x", "file")
        assert (found.dtype, len(found)) == (np.float64, len(cells))
    except InputError as error:
        said = str(error)
    assert not said or ("row " in said and said.isprintable())


@given(st.one_of(st.integers(), st.floats()))
def test_a_key_is_exact_or_refused(value: float) -> None:
    try:
        found = whole(pd.Series([value], dtype=object), "id", "file")[0]
    except InputError:
        assert not math.isfinite(value) or value != round(value) or abs(value) > LARGEST
    else:
        assert found == value


@pytest.mark.parametrize("cell", [2.5, np.nan, np.inf, 1e19, 2.0**53])
def test_fractions_and_what_no_layout_holds_are_no_keys(cell: float) -> None:
    with pytest.raises(InputError, match="row 2, column id"):
        whole(pd.Series([1.0, cell]), "id", "file")


def test_integers_beyond_64_bit_do_not_wrap() -> None:
    with pytest.raises(InputError, match="is impossible"):
        whole(pd.Series(np.array([2**63], dtype=np.uint64)), "id", "file")
    with pytest.raises(InputError, match=r"258 is impossible; give a whole number from -128 to 127"):
        whole(pd.Series([258]), "lane", "file", low=-128, high=127)


def test_sizes_that_no_vehicle_has_are_counted() -> None:
    notes: list[str] = []
    found = sizes(np.array([4.5, -1.0, 0.0, 99.0, np.nan]), "length", (0.0, 40.0), notes)
    assert np.isnan(found).tolist() == [False, True, True, True, True]
    assert notes[0].startswith("3 of 5 rows have a length that no vehicle has")
