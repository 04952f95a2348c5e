"""Numbers for vehicles that have names."""

from __future__ import annotations

from typing import Any

import pandas as pd

from idm_sumo.recordings.coercion import LARGEST
from idm_sumo.runtime.errors import one_line

SHOWN = 3


def vehicle_numbers(names: pd.Series, notes: list[str], source: str) -> dict[Any, int]:
    """Return the number of each vehicle: its name where that is one, else the next free number.

    Parameters
    ----------
    names : pandas.Series
        As the source spells them; none is missing.
    notes : list of str
        Gets a line that says which numbers were given.
    source : str
        Name for messages.
    """
    unique = list(pd.unique(names.astype(object)))
    text = {name: _plain(name) for name in unique}
    given = {name: int(word) for name, word in text.items() if _is_number(word)}
    free = max(given.values(), default=0)
    others = [name for name in unique if name not in given]
    number = given | {name: free + place for place, name in enumerate(others, 1)}
    if others:
        some = ", ".join(f"{one_line(text[name])[:40]} = {number[name]}" for name in others[:SHOWN])
        notes.append(f"{len(others)} vehicles have a name, not a number; they got the next free ones ({some})")
    return number


def _plain(name: Any) -> str:
    """Return a name as text; numbers that came as floats without their zeros."""
    return str(int(name)) if isinstance(name, float) and name.is_integer() else str(name)


def _is_number(name: str) -> bool:
    """Whether an id is a number that is written in one way only and fits every layout."""
    return len(name) < 16 and name.isdecimal() and name != "0" and name == str(int(name)) and int(name) < LARGEST
