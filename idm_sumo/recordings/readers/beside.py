"""Files that belong beside a recording: what they tell, or that they are not there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from idm_sumo.recordings.coercion import numbers
from idm_sumo.recordings.readers.layout import Opened
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import BROKEN, open_plain

LARGEST_NUMBER = 1e4  # frames a second, km/h or m: nothing that is told beside a recording is larger


class Companion(NamedTuple):
    """A file beside a recording.

    Attributes
    ----------
    table : pandas.DataFrame
        Its columns; none if it is not there.
    notes : list of str
        Says so.
    name : str
        Of the file.
    """

    table: pd.DataFrame
    notes: list[str]
    name: str = ""

    def by_key(self, key: str, column: str) -> pd.Series | None:
        """Return a column by the numbers of another one, None where one of them is not there.

        Raises
        ------
        InputError
            If a number is none, or there twice.
        """
        if not {key, column} <= set(self.table):
            return None
        keys = pd.Series(numbers(self.table[key], key, self.name))
        if (bad := keys.isna() | keys.duplicated()).any():
            row = int(bad.to_numpy().argmax())
            raise InputError(f"{self.name}: row {row + 1}, column {key}: is absent or there twice; give each once")
        return self.table[column].set_axis(keys)


def companion(opened: Opened, part: str, other: str) -> Companion:
    """Return the file whose name has ``other`` where the recording's has ``part``.

    Raises
    ------
    InputError
        If it is there and cannot be read.
    """
    name = opened.path.name
    path = opened.path.with_name(name.replace(part, other)) if part in name else opened.path
    if path == opened.path or not path.is_file():
        wanted = path.name if path != opened.path else f"NN{other}.csv"
        return Companion(pd.DataFrame(), [f"{wanted} is not beside the file: what it tells is taken from the tracks"])
    try:
        with open_plain(path) as stream:
            return Companion(pd.read_csv(stream, skipinitialspace=True), [], path.name)
    except (ValueError, *BROKEN) as error:
        raise InputError(f"{path}: cannot be read ({str(error).splitlines()[0]})") from None


def number_in(beside: Companion, name: str, otherwise: float) -> float:
    """Return the positive number in a column's first row, or another where there is none.

    Raises
    ------
    InputError
        If there is a text, or a number that is not positive and finite.
    """
    if name not in beside.table or beside.table.empty:
        return otherwise
    value = float(numbers(beside.table[name][:1], name, beside.name)[0])
    if np.isnan(value):
        return otherwise
    if not 0.0 < value <= LARGEST_NUMBER:
        raise InputError(f"{beside.name}: column {name}: {value:g} is impossible; give the file as it was published")
    return value


def markings_in(beside: Companion, name: str) -> list[float] | None:
    """Return the numbers that a column's first row lists, None where it is not there.

    Raises
    ------
    InputError
        If they are fewer than two, no numbers, or out of order.
    """
    if name not in beside.table or beside.table.empty:
        return None
    words = pd.Series(str(beside.table[name].iloc[0]).strip("; ").split(";"))
    edges = numbers(words, name, beside.name)
    if len(edges) < 2 or not (np.abs(edges) <= LARGEST_NUMBER).all() or not (np.diff(edges) > 0).all():
        raise InputError(f"{beside.name}: column {name}: give two markings or more, increasing (m)")
    return [float(edge) for edge in edges]
