"""Where every row went: read + added = used + dropped, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pandas as pd


@dataclass(frozen=True)
class Accounting:
    """What became of the rows and vehicles of a recording.

    Attributes
    ----------
    total : int
        Rows that came in.
    used : int
        Rows that went on.
    dropped : dict of str to int
        Rows left out, by reason.
    vehicles : int
        Vehicles that went on (after cleaning: those that may be modelled).
    vehicles_dropped : dict of str to int
        Vehicles that did not, by reason.
    notes : tuple of str
        What else the reader of the figures should know.
    added : dict of str to int
        Rows that were made between those that came in, by reason.
    """

    total: int
    used: int
    dropped: dict[str, int] = field(default_factory=dict)
    vehicles: int = 0
    vehicles_dropped: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    added: dict[str, int] = field(default_factory=dict)

    def check(self) -> Accounting:
        """Return itself if the rows add up.

        Raises
        ------
        AssertionError
            If a row is unaccounted for: a defect of this program, never of the file.
        """
        came, went = self.total + sum(self.added.values()), self.used + sum(self.dropped.values())
        if came != went or min((*self.dropped.values(), *self.added.values()), default=0) < 0:
            raise AssertionError(
                f"{self.total} rows read, {self.used} used, but dropped: {self.dropped}, added: {self.added}"
            )
        return self

    def then(self, later: Accounting) -> Accounting:
        """Return the account of two stages in a row, this one first.

        Raises
        ------
        AssertionError
            If the second stage did not start with the rows that the first one left.
        """
        if self.used != later.total:
            raise AssertionError(f"{self.used} rows left one stage, {later.total} entered the next")
        return Accounting(
            total=self.total,
            used=later.used,
            dropped=_sum(self.dropped, later.dropped),
            vehicles=later.vehicles,
            vehicles_dropped=_sum(self.vehicles_dropped, later.vehicles_dropped),
            notes=self.notes + later.notes,
            added=_sum(self.added, later.added),
        ).check()


class Ledger:
    """Counts what is taken out of a table while it is worked on.

    Parameters
    ----------
    total : int
        Rows the work started with.
    """

    def __init__(self, total: int) -> None:
        self.total = total
        self.dropped: dict[str, int] = {}
        self.notes: list[str] = []
        self.added: dict[str, int] = {}
        self.layout = ""  # what the rows were read as, where a reader says it

    def count(self, reason: str, rows: int) -> None:
        """Book ``rows`` rows as dropped for ``reason``."""
        if rows:
            self.dropped[reason] = self.dropped.get(reason, 0) + int(rows)

    def add(self, reason: str, rows: int) -> None:
        """Book ``rows`` rows as made for ``reason``."""
        if rows:
            self.added[reason] = self.added.get(reason, 0) + int(rows)

    def drop(self, table: pd.DataFrame, bad: npt.NDArray[np.bool_] | pd.Series, reason: str) -> pd.DataFrame:
        """Return the table without the rows marked in ``bad`` (shape ``(rows,)``), and book them."""
        marked = np.asarray(bad, dtype=bool)
        self.count(reason, int(marked.sum()))
        return table[~marked] if marked.any() else table

    def close(self, used: int, *, vehicles: int, vehicles_dropped: dict[str, int] | None = None) -> Accounting:
        """Return the finished account, checked."""
        account = Accounting(
            self.total, used, dict(self.dropped), vehicles, dict(vehicles_dropped or {}), tuple(self.notes),
            dict(self.added),
        )  # fmt: skip
        return account.check()


def _sum(first: dict[str, int], second: dict[str, int]) -> dict[str, int]:
    return {reason: first.get(reason, 0) + second.get(reason, 0) for reason in [*first, *second]}
