from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import driver_table as d
from idm_sumo.models import idm
from idm_sumo.runtime.errors import InputError


def drivers(**columns: object) -> pd.DataFrame:
    """Three sound drivers, with some columns replaced."""
    table = pd.DataFrame({
        "period": "0750-0805", "vehicle": [11, 12, 13], "a": [1.0, 1.5, 0.8], "b": [1.5, 2.0, 1.0],
        "T": [1.2, 0.9, 1.6],
        "d0": [2.0, 2.5, 3.0], "d1": [0.0, 1.0, 3.0], "depart_s": [0.0, 1.0, 2.0], "lane": [1, 2, 3],
        "x_m": [5.0, 5.0, 5.0],
        "y_m": [-1.8, -5.5, -9.1], "speed_m_s": [12.0, 11.0, 10.0], "length_m": 4.7, "width_m": 1.9, "vehicle_class": 2,
    })  # fmt: skip
    return table.assign(**columns)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_what_is_written_is_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"drivers{suffix}"
    table = drivers(a=[np.pi / 3, 1.5, 0.8])
    if suffix == ".csv":
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path)
    pd.testing.assert_frame_equal(d.read_drivers(path), table, check_dtype=False)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"a": [1.0, np.nan, 1.0]}, ("row 1", "vehicle 12", "a = nan", "0.1 to 6")),
        ({"T": [1.0, 1.0, np.inf]}, ("row 2", "T = inf")),
        ({"b": [1.0, "fast", 1.0]}, ("row 1", "b = fast")),
        ({"d0": [0.0, 1.0, 1.0]}, ("row 0", "vehicle 11", "d0 = 0", "0.1 to 10")),
        ({"d1": [0.0, 1.0, -0.1]}, ("row 2", "d1 = -0.1")),
        ({"a": [1.0, 1.0, 60.0]}, ("row 2", "a = 60")),
        ({"vehicle": [11, 11, 13]}, ("row 1", "vehicle 11", "twice")),
        ({"vehicle": [11, 11.5, 13]}, ("row 1", "vehicle = 11.5", "whole")),
        ({"vehicle": [11, None, 13]}, ("row 1", "vehicle")),
        ({"period": ["a", None, "a"]}, ("row 1", "period")),
    ],
)
def test_an_impossible_driver_is_named_in_one_line(columns: dict[str, object], words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as caught:
        d.check_drivers(drivers(**columns), source="some.csv")
    message = str(caught.value)
    assert message.startswith("some.csv: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_bounds_themselves_are_possible_even_after_a_trip_through_text() -> None:
    table = drivers(a=idm.UPPER.a * (1 + 1e-12), b=idm.LOWER.b * (1 - 1e-12), d1=0.0)
    checked = d.check_drivers(table)
    assert (checked["a"] == idm.UPPER.a).all()
    assert (checked["b"] == idm.LOWER.b).all()


def test_windows_of_one_vehicle_are_told_apart_by_their_first_frame() -> None:
    table = drivers(vehicle=11, first_frame=[0, 100, 200])
    assert len(d.check_drivers(table)) == 3
    with pytest.raises(InputError, match="twice"):
        d.check_drivers(drivers(vehicle=11, first_frame=[0, 100, 100]))


def test_a_driver_whose_status_says_why_may_have_no_parameters() -> None:
    none = {name: [1.0, np.nan, 1.0] for name in d.PARAMETERS}
    table = d.check_drivers(drivers(status=["ok", "too few frames", "ok"], **none))
    assert d.has_parameters(table).tolist() == [True, False, True]
    with pytest.raises(InputError, match="row 1"):
        d.check_drivers(drivers(status="ok", **none))
    with pytest.raises(InputError, match="row 1"):  # some parameters are not none
        d.check_drivers(drivers(status=["ok", "too few frames", "ok"], a=[1.0, np.nan, 1.0]))


def test_a_missing_column_is_named() -> None:
    with pytest.raises(InputError, match="column 'T' is missing"):
        d.check_drivers(drivers().drop(columns="T"))
    with pytest.raises(InputError, match="column 'lane' is missing"):
        d.check_departures(drivers().drop(columns="lane"))


def test_no_drivers_at_all() -> None:
    with pytest.raises(InputError, match="has no drivers"):
        d.check_drivers(drivers().head(0))


@pytest.mark.parametrize(
    ("columns", "word"),
    [
        ({"lane": [1, 9, 3]}, "lane = 9"), ({"lane": [1, 2.5, 3]}, "lane = 2.5"),
        ({"x_m": [1.0, np.nan, 3.0]}, "x_m = nan"),
        ({"speed_m_s": [1.0, -2.0, 3.0]}, "speed_m_s = -2"), ({"depart_s": [0.0, -1.0, 2.0]}, "depart_s = -1"),
        ({"length_m": [4.0, 0.0, 4.0]}, "length_m = 0"), ({"vehicle_class": [2, 7, 2]}, "vehicle_class = 7"),
    ],
)  # fmt: skip
def test_an_impossible_departure_is_named(columns: dict[str, object], word: str) -> None:
    with pytest.raises(InputError, match=r"row 1 .*vehicle 12") as caught:
        d.check_departures(drivers(**columns))
    assert word in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"), [("a.parquet", b"no parquet"), ("a.csv", b'"open quote\n1,2'), ("b.csv", b"")]
)
def test_a_file_that_is_no_table(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        d.read_drivers(tmp_path / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        d.read_drivers(tmp_path / "drivers.parquet")
