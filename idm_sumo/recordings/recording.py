"""`Recording`: the one table of trajectories, the same for observed and simulated vehicles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.coercion import BOUNDS, FRAMES, HIGHEST_SPEED, LARGEST, numbers, whole
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError, shown

DTYPES = {
    c.PERIOD: "category", c.VEHICLE: "int64", c.FRAME: "int64", c.TIME: "float64",
    c.X: "float64", c.Y: "float64", c.SPEED: "float64", c.ACCELERATION: "float64",
    c.HEADING: "float64", c.LENGTH: "float64", c.WIDTH: "float64", c.CLASS: "int8",
    c.LANE: "int8", c.LEADER: "int64", c.HEADWAY: "float64",
}  # fmt: skip

# A surrogate's file holds this, and so do the notes of every recording made from it.
SURROGATE_NOTICE = "Surrogate recording: simulated with SUMO in NGSIM's layout. Not measured."


POSITIVE = (float(np.nextafter(0.0, 1.0)), np.inf)
RANGES: Mapping[str, tuple[float, float]] = {
    **BOUNDS, c.SPEED: (0.0, HIGHEST_SPEED), c.CLASS: (0, c.TRUCK), c.LENGTH: POSITIVE, c.WIDTH: POSITIVE,
    c.HEADWAY: POSITIVE,
}  # fmt: skip
NULLABLE = (c.LENGTH, c.WIDTH, c.HEADWAY)

NOT_COUNTED = Accounting(total=0, used=0)


@dataclass(frozen=True, repr=False)
class Recording:
    """Trajectories of many vehicles, one row a vehicle and frame, in SI units.

    Attributes
    ----------
    table : pandas.DataFrame
        Columns of :mod:`idm_sumo.recordings.columns`, sorted by period, vehicle and frame.
    road : Road
        What it was recorded on.
    source : str
        Where it came from, for titles and manifests.
    notes : tuple of str
        What was assumed because the source did not say (lane from lateral position, ...).
    has_leader_rows : bool
        Whether the vehicles ahead are themselves in the table. If not, all that is known
        of a leader is ``headway``, seen from the recorded follower.
    is_smooth : bool
        Whether positions, speeds and accelerations are reconstructed and must not be smoothed again.
    leader_lengths : mapping of (str, int) to float
        Lengths (m) of leaders that have no rows, by period and number, where the source tells them.
    accounting : Accounting
        What became of the rows it was made from, by reading and cleaning; all zero for a table made by hand.
    vehicles : pandas.DataFrame or None
        What cleaning says of every vehicle (:func:`idm_sumo.recordings.cleaning.clean`); None before.
    """

    table: pd.DataFrame
    road: Road
    source: str = ""
    notes: tuple[str, ...] = field(default=())
    has_leader_rows: bool = True
    is_smooth: bool = False
    leader_lengths: Mapping[tuple[str, int], float] = field(default_factory=dict)
    accounting: Accounting = NOT_COUNTED
    vehicles: pd.DataFrame | None = None

    def __repr__(self) -> str:
        """Return one line: where from, periods, vehicles and rows."""
        periods = ", ".join(self.periods)
        return (
            f"<Recording {self.source or 'made by hand'}: {self.vehicle_count:,} vehicles, "
            f"{len(self.table):,} rows, period {periods}>"
        )

    @classmethod
    def from_table(
        cls,
        table: pd.DataFrame,
        *,
        road: Road,
        source: str = "",
        notes: tuple[str, ...] = (),
        has_leader_rows: bool = True,
    ) -> Recording:
        """Check a table's values, sort it and wrap it.

        Parameters
        ----------
        table : pandas.DataFrame
            Columns of :mod:`idm_sumo.recordings.columns`, in any order, in SI units.
        road : Road
            What it was recorded on; its lanes are those that the table may name.
        source, notes, has_leader_rows
            See :class:`Recording`.

        Raises
        ------
        InputError
            If a column is missing or a value is impossible; names column and first row.
        """
        missing = [name for name in c.ALL if name not in table.columns]
        if missing:
            raise InputError(
                f"{source or 'recording'}: column {missing[0]!r} is missing; a Recording needs {', '.join(c.ALL)}"
            )
        if table.empty:
            raise InputError(
                f"{source or 'recording'}: no rows left to work on; see `idm-sumo inspect` for why rows were dropped"
            )
        ordered = _typed(table, source or "recording").sort_values(list(c.KEYS), kind="stable", ignore_index=True)
        _check_values(ordered, road, source or "recording")
        if (duplicated := ordered.duplicated(list(c.KEYS))).any():
            row = ordered[duplicated].iloc[0]
            raise InputError(
                f"{source or 'recording'}: vehicle {row[c.VEHICLE]} has frame {row[c.FRAME]} twice in "
                f"period {row[c.PERIOD]}"
            )
        return cls(ordered, road, source, notes, has_leader_rows)

    @property
    def periods(self) -> list[str]:
        """Labels of the recording periods, in order of their first time."""
        first = self.table.groupby(c.PERIOD, observed=True)[c.TIME].min().sort_values(kind="stable")
        return [str(label) for label in first.index]

    def of_period(self, *wanted: str) -> Recording:
        """Return the part that was recorded in one period, or in several.

        Raises
        ------
        InputError
            If there is no such period.
        """
        periods = self.periods
        if absent := [period for period in wanted if period not in periods]:
            raise InputError(f"{self.source or 'recording'}: no period {absent[0]!r}; it has {', '.join(periods)}")
        if set(wanted) == set(periods):
            return self  # and no copy of it
        part = self.with_table(self.table[self.table[c.PERIOD].isin(wanted)].reset_index(drop=True))
        if self.vehicles is None:
            return part
        return replace(part, vehicles=self.vehicles[self.vehicles[c.PERIOD].isin(wanted)].reset_index(drop=True))

    def with_table(self, table: pd.DataFrame, *notes: str) -> Recording:
        """Return the same recording with another table (same columns) and further notes.

        The accounting is kept only with the number of rows, which it is about.
        """
        accounting = self.accounting if len(table) == len(self.table) else NOT_COUNTED
        return replace(self, table=table, notes=self.notes + notes, accounting=accounting)

    @property
    def eligible(self) -> pd.DataFrame:
        """Vehicles that may be modelled, ``period, vehicle``: those cleaning has nothing against; before it, all."""
        if self.vehicles is None:
            return self.table[[c.PERIOD, c.VEHICLE]].drop_duplicates(ignore_index=True)
        return self.vehicles[self.vehicles["reason"] == ""].reset_index(drop=True)

    @property
    def ineligible(self) -> pd.DataFrame:
        """Vehicles that are traffic only, ``period, vehicle, reason``."""
        if self.vehicles is None:
            return pd.DataFrame({c.PERIOD: pd.Series(dtype=str), c.VEHICLE: pd.Series(dtype=int), "reason": ""})
        chosen = self.vehicles["reason"] != ""
        return self.vehicles.loc[chosen, [c.PERIOD, c.VEHICLE, "reason"]].reset_index(drop=True)

    @property
    def is_measured(self) -> bool:
        """Whether it was recorded on a road; the surrogate was not, and its notes say so."""
        return SURROGATE_NOTICE not in self.notes

    @property
    def vehicle_count(self) -> int:
        """Number of vehicles, those of different periods counted apart."""
        return len(self.table.drop_duplicates([c.PERIOD, c.VEHICLE]))


def _typed(table: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return the columns of a recording with their types; a whole number that would wrap is refused."""
    columns: dict[str, Any] = {}
    for name, dtype in DTYPES.items():
        if dtype == "category":
            columns[name] = _labels(table[name], source)
        elif dtype == "float64":
            columns[name] = numbers(table[name], name, source)
        else:
            ends = np.iinfo(dtype)
            low, high = (-FRAMES, FRAMES) if name == c.FRAME else (max(ends.min, -LARGEST), min(ends.max, LARGEST))
            columns[name] = whole(table[name], name, source, low=int(low), high=int(high)).astype(dtype)
    return pd.DataFrame(columns)


def _labels(values: pd.Series, source: str) -> pd.Categorical[str]:
    if isinstance(values.dtype, pd.CategoricalDtype) and not values.isna().any():
        return pd.Categorical(values)
    for row, cell in enumerate(values.tolist(), 1):
        if not isinstance(cell, str | int | float) or cell != cell:
            raise InputError(f"{source}: row {row}, column {c.PERIOD}: {shown(cell)} is no label; give a text")
    return pd.Categorical(values.astype(str))


def _check_values(table: pd.DataFrame, road: Road, source: str) -> None:
    """Raise for a value that no recording of the road holds; names the first column that has one, and its row."""
    ranges = {**RANGES, c.LANE: (1, road.last_lane)}
    for name in (name for name in DTYPES if name in ranges):
        values, (low, high) = table[name].to_numpy(), ranges[name]
        with np.errstate(invalid="ignore"):
            good = (values >= low) & (values <= high)
        if name in NULLABLE:
            good |= np.isnan(values)
        if not good.all():
            row = table.iloc[int((~good).argmax())]
            where = f"vehicle {row[c.VEHICLE]}, frame {row[c.FRAME]}, period {row[c.PERIOD]}"
            raise InputError(f"{source}: {where}: {name} = {row[name]} is impossible; check units and columns")
