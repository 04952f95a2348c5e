"""Tables of calibrated drivers, read from files and checked once."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow as pa

from idm_sumo.models import idm
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.coercion import EARTH, FRAMES, LARGEST, numbers
from idm_sumo.roads import DEFAULT, Road
from idm_sumo.runtime import inputs, parquet
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.limits import DESIRED_SPEED as DESIRED_SPEEDS
from idm_sumo.simulation.driver_parameters import DESIRED_SPEED as DESIRED_SPEED
from idm_sumo.simulation.driver_parameters import FIRST_FRAME as FIRST_FRAME
from idm_sumo.simulation.driver_parameters import KEYS as KEYS
from idm_sumo.simulation.driver_parameters import PARAMETERS as PARAMETERS
from idm_sumo.simulation.driver_parameters import key_columns as key_columns

ROAD = b"idm_sumo_road"  # metadata of a Parquet: the road, where it is not the default
STATUS, OK = "status", "ok"  # what became of the fit; absent in tables made by hand
HAS = "has_what_some_have"  # 1 if a driver has those causes of an extended model, too, that only some have, else 0
TOLERANCE = 1e-9  # relative, of a bound: a table may have been through text

# Where, when and as what a driver enters, as `idm_sumo.calibration.departures.departures` writes it.
DEPART, LANE, X, Y, SPEED = "depart_s", "lane", "x_m", "y_m", "speed_m_s"
LENGTH, WIDTH, CLASS = "length_m", "width_m", "vehicle_class"
DEPARTURE = (DEPART, LANE, X, Y, SPEED, LENGTH, WIDTH, CLASS)
LONGEST_RUN = 1e7  # s, four months
_RANGES = {
    DEPART: (0.0, LONGEST_RUN), LANE: (1, 8), X: (-EARTH, EARTH), Y: (-EARTH, EARTH), SPEED: (0.0, 70.0),
    LENGTH: (0.5, 40.0), WIDTH: (0.3, 5.0), CLASS: (0, 3),
}  # fmt: skip
# Columns that hold numbers beside those that are checked one by one, by their beginnings and endings.
NUMBERED = ("ade_", *(f"{name}_" for name in PARAMETERS))
UNITS = ("_m", "_s", "_m_s", "_sd")
_WHOLE = (c.VEHICLE, FIRST_FRAME, LANE, CLASS, HAS)


def read_drivers(path: Path | str) -> pd.DataFrame:
    """Read a driver table from a file and check it.

    Parameters
    ----------
    path : Path or str
        ``drivers.parquet`` or ``.csv`` as ``idm-sumo calibrate`` writes it.

    Returns
    -------
    pandas.DataFrame
        See :func:`check_drivers`.

    Raises
    ------
    InputError
        If the file is missing or no table, or a value in it is impossible.
    """
    advice = "`idm-sumo calibrate RECORDING -o FILE` writes one"
    source = inputs.existing_file(path, advice)
    if source.suffix.lower() == ".csv":
        table = _of_csv(inputs.read_text(source, advice), source)
    else:
        table = parquet.to_frame(parquet.read_table(source, advice=f"not a driver table; {advice}"))
    return check_drivers(table, source=str(source))


def _of_csv(text: str, source: Path) -> pd.DataFrame:
    """Return the table of a CSV with equally long rows."""
    try:
        rows = [row for row in csv.reader(text.splitlines()) if row]
    except csv.Error as error:
        raise InputError(f"{source}: not a driver table ({error}); use the CSV of `idm-sumo calibrate`") from None
    names = [name.strip() for name in rows[0]] if rows else []
    for place, name in enumerate(names):
        if not name or name in names[:place]:
            raise InputError(f"{source}: column {place + 1} is named {name!r}; give every column a name of its own")
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise InputError(f"{source}: row {number} has {len(row)} columns where {len(names)} are needed; mend it")
    try:
        return pd.read_csv(io.StringIO(text), dtype={c.PERIOD: str}, skipinitialspace=True, low_memory=False)
    except (ValueError, OverflowError) as error:  # pandas' own errors are ValueErrors
        raise InputError(f"{source}: not a driver table ({error}); use the CSV of `idm-sumo calibrate`") from None


def check_drivers(table: pd.DataFrame, *, source: str = "drivers") -> pd.DataFrame:
    """Check that a driver table can be driven.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns ``period, vehicle, a, b, T, d0, d1`` (SI), any others beside.
    source : str
        How messages name the table.

    Returns
    -------
    pandas.DataFrame
        The table, with whole numbers and floats as such.

    Raises
    ------
    InputError
        For a missing column, text in a number, a parameter that is NaN or outside
        :data:`idm_sumo.models.idm.LOWER` and ``UPPER``, or a driver that is there twice. A driver
        whose ``status`` says why it has no parameters may be without all five
        (:func:`has_parameters`).
    """
    if table.columns.has_duplicates:
        raise InputError(f"{source}: column {table.columns[table.columns.duplicated()][0]!r} is there twice; keep one")
    _need(table, (*KEYS, *PARAMETERS), source)
    if table.empty:
        raise InputError(f"{source}: has no drivers; see the status column that `idm-sumo calibrate` wrote")
    table = table.reset_index(drop=True)
    if (unnamed := table[c.PERIOD].isna()).any():
        raise InputError(f"{source}: row {_first(unnamed)}: {c.PERIOD} is missing; give every driver its period")
    table = table.assign(**{c.PERIOD: table[c.PERIOD].astype(str)})
    bounds = {name: (getattr(idm.LOWER, name), getattr(idm.UPPER, name)) for name in PARAMETERS}
    table = _numeric(table, source)
    table = _checked(table, {c.VEHICLE: (0, LARGEST)}, source)
    table = _checked(table, bounds, source, exempt=_without_fit(table))
    if FIRST_FRAME in table:
        table = _checked(table, {FIRST_FRAME: (-FRAMES, FRAMES)}, source)
    if DESIRED_SPEED in table:
        driven = table[DESIRED_SPEED].isna() & _without_fit(table)
        table = _checked(table, {DESIRED_SPEED: DESIRED_SPEEDS}, source, exempt=driven)
    if HAS in table:
        table = _checked(table, {HAS: (0, 1)}, source)
    if (twice := table.duplicated(key_columns(table))).any():
        raise InputError(f"{source}: {_where(table, _first(twice))} is there twice; keep one row a driver")
    return table


def check_departures(table: pd.DataFrame, *, source: str = "drivers") -> pd.DataFrame:
    """Check that every departure in a driver table is possible.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns ``period, vehicle`` and those of :data:`DEPARTURE`: s, lane 1 to 8, m, m,
        m/s, m, m, class 0 to 3 as in :mod:`idm_sumo.recordings.columns`.
    source : str
        How messages name the table.

    Returns
    -------
    pandas.DataFrame
        The table, with its departures as numbers.

    Raises
    ------
    InputError
        For a missing column, or a value that is NaN or impossible; names row and column.
    """
    _need(table, (*KEYS, *DEPARTURE), source)
    return _checked(table.reset_index(drop=True), _RANGES, source)


def has_parameters(table: pd.DataFrame) -> npt.NDArray[np.bool_]:
    """Return which drivers of a checked table have parameters.

    Parameters
    ----------
    table : pandas.DataFrame

    Returns
    -------
    bool, shape (rows,)
    """
    return np.asarray(table[PARAMETERS[0]].notna())


def _without_fit(table: pd.DataFrame) -> pd.Series:
    """Return the rows without parameters whose status says why."""
    if STATUS not in table:
        return pd.Series(False, index=table.index)
    return (table[STATUS] != OK) & table[list(PARAMETERS)].isna().all(axis=1)


def _need(table: pd.DataFrame, names: tuple[str, ...], source: str) -> None:
    if missing := [name for name in names if name not in table.columns]:
        raise InputError(f"{source}: column {missing[0]!r} is missing; needed are {', '.join(names)}")


def _checked(
    table: pd.DataFrame, ranges: dict[str, tuple[float, float]], source: str, exempt: pd.Series | None = None
) -> pd.DataFrame:
    """Return the table with checked numbers in some columns.

    ``ranges`` holds each column's lowest and highest value; rows that are ``exempt`` are not checked.
    """
    typed = {}
    for name, (low, high) in ranges.items():
        values = pd.to_numeric(table[name], errors="coerce").astype("float64")
        slack = TOLERANCE * max(abs(low) if np.isfinite(low) else 0.0, abs(high) if np.isfinite(high) else 0.0)
        bad = ~np.isfinite(values) | (values < low - slack) | (values > high + slack)
        if name in _WHOLE:
            bad |= values != values.round()
        if exempt is not None:
            bad &= ~exempt
        if bad.any():
            row = _first(bad)
            span = f"a number from {low:g} to {high:g}" if np.isfinite([low, high]).any() else "a finite number"
            whole = "whole number" if name in _WHOLE else "number"
            raise InputError(
                f"{source}: {_where(table, row)}: {name} = {table[name].iloc[row]} is impossible; "
                f"give {span.replace('number', whole)}"
            )
        typed[name] = values.astype("int64") if name in _WHOLE else values.clip(low, high)
    return table.assign(**typed)


def _numeric(table: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return the table with numbers where ours has numbers.

    What is no number is refused.
    """
    ours = [name for name in table.columns if str(name).startswith(NUMBERED) or str(name).endswith(UNITS)]
    return table.assign(**{name: numbers(table[name], name, source) for name in ours})


def _first(marked: pd.Series) -> int:
    return int(np.flatnonzero(marked.to_numpy())[0])


def _where(table: pd.DataFrame, row: int) -> str:
    """Return a row's number, counted from 0, and its driver."""
    return f"row {row} (period {table[c.PERIOD].iloc[row]}, vehicle {table[c.VEHICLE].iloc[row]})"


def write_drivers(table: pd.DataFrame, path: Path, road: Road) -> None:
    """Write a driver table as Parquet that knows its road.

    The road is kept if it is not the default.

    Parameters
    ----------
    table : pandas.DataFrame
        Driver table.
    path : Path
    road : Road
    """
    if road == DEFAULT:
        table.to_parquet(path, index=False, write_page_checksum=True)
        return
    arrow = pa.Table.from_pandas(table, preserve_index=False)
    kept = {**(arrow.schema.metadata or {}), ROAD: json.dumps(road.to_dict()).encode()}
    parquet.write_table(arrow.replace_schema_metadata(kept), path)


def road_of_drivers(path: Path | str) -> Road:
    """Return the road that a driver table was calibrated on.

    The default where the table does not tell.

    Parameters
    ----------
    path : Path


    Raises
    ------
    InputError
        If what is kept of it is damaged.
    """
    path = Path(path)
    if path.suffix.lower() == ".csv":
        return DEFAULT
    kept = (parquet.read_table(path, lambda names: names[:1]).schema.metadata or {}).get(ROAD)
    if kept is None:
        return DEFAULT
    try:
        return Road.from_dict(inputs.parse_json(kept, f"{path}: the road kept in it"))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: the road kept in it is damaged ({error}); calibrate again") from None
