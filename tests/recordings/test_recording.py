import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import DTYPES, Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from tests.helpers.builders import Car, recording


def test_rows_are_sorted_and_typed() -> None:
    shuffled = recording(Car(2), Car(1)).table.sample(frac=1, random_state=0).astype({c.VEHICLE: float, c.PERIOD: str})
    table = Recording.from_table(shuffled, road=US101).table
    assert table[[c.VEHICLE, c.FRAME]].to_numpy().tolist() == sorted(table[[c.VEHICLE, c.FRAME]].to_numpy().tolist())
    assert {name: str(kind) for name, kind in table.dtypes.items()} == DTYPES


@pytest.mark.parametrize(
    ("column", "value"),
    [(c.X, np.nan), (c.Y, np.inf), (c.SPEED, -1.0), (c.SPEED, 71.0), (c.LENGTH, 0.0), (c.LANE, 9), (c.CLASS, 4),
     (c.HEADWAY, -3.0), (c.TIME, np.nan)],
)  # fmt: skip
def test_impossible_values_are_named(column: str, value: float) -> None:
    table = recording(Car(1), Car(7)).table
    table.loc[45, column] = value
    with pytest.raises(
        InputError, match=rf"file: vehicle 7, frame 6, period p1: {column} = .* is impossible"
    ) as caught:
        Recording.from_table(table, road=US101, source="file")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("column", [c.LENGTH, c.WIDTH, c.HEADWAY])
def test_what_was_not_recorded_is_nan(column: str) -> None:
    assert (
        Recording.from_table(recording(Car(1)).table.assign(**{column: np.nan}), road=US101).table[column].isna().all()
    )


def test_a_missing_column_is_named() -> None:
    with pytest.raises(InputError, match="file: column 'headway' is missing"):
        Recording.from_table(recording(Car(1)).table.drop(columns=c.HEADWAY), road=US101, source="file")


def test_a_frame_twice_is_named() -> None:
    table = recording(Car(1)).table
    with pytest.raises(InputError, match="vehicle 1 has frame 5 twice in period p1"):
        Recording.from_table(pd.concat([table, table.iloc[[4]]]), road=US101)


def test_no_rows_is_an_error() -> None:
    with pytest.raises(InputError, match="no rows left"):
        Recording.from_table(recording(Car(1)).table.head(0), road=US101)


def test_periods_in_order_of_time() -> None:
    late, early = recording(Car(1), period="a").table, recording(Car(1), Car(2), period="b").table
    late = late.assign(time=late[c.TIME] + 900)
    both = Recording.from_table(pd.concat([late.astype({c.PERIOD: str}), early.astype({c.PERIOD: str})]), road=US101)
    assert both.periods == ["b", "a"]
    assert both.vehicle_count == 3
    assert both.of_period("b").vehicle_count == 2
    with pytest.raises(InputError, match="no period 'c'; it has b, a"):
        both.of_period("c")
