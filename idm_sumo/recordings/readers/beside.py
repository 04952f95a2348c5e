"""Files that belong beside a recording: what they tell, or that they are not there."""

from __future__ import annotations

from typing import NamedTuple

import pandas as pd

from idm_sumo.recordings.readers.layout import Opened
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import BROKEN, open_plain


class Companion(NamedTuple):
    """A file beside a recording.

    Attributes
    ----------
    table : pandas.DataFrame
        Its columns; none if it is not there.
    notes : list of str
        Says so.
    """

    table: pd.DataFrame
    notes: list[str]


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
            return Companion(pd.read_csv(stream, skipinitialspace=True), [])
    except (ValueError, *BROKEN) as error:
        raise InputError(f"{path}: cannot be read ({str(error).splitlines()[0]})") from None


def number_in(beside: Companion, name: str, otherwise: float) -> float:
    """Return the number in a column's first row, or another where there is none."""
    if name not in beside.table or beside.table.empty:
        return otherwise
    value = pd.to_numeric(beside.table[name], errors="coerce").iloc[0]
    return float(value) if pd.notna(value) else otherwise
