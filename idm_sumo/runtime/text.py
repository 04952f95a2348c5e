"""Numbers as people read them: in tables, sentences and messages."""

from __future__ import annotations

import math
from collections.abc import Iterable

MOST_RANGES = 8  # of a list of numbers in one line


def number(value: float, digits: int = 3, missing: str = "–") -> str:
    """Return a number with so many significant digits, whole units never rounded away.

    Parameters
    ----------
    value : float
    digits : int
        Significant digits of what is not whole. A number with more digits before its point keeps them
        all, so that a thousand is ``1000`` and not ``1e+03``.
    missing : str
        What stands for NaN.
    """
    if math.isnan(value):
        return missing
    if float(value).is_integer() or abs(value) >= 10.0 ** (digits - 1):
        return f"{value:.0f}"
    return f"{value:.{digits}g}"


def ranges(numbers: Iterable[int]) -> str:
    """Return whole numbers in one short line, neighbours joined: ``1-4, 7, 9-12``."""
    runs: list[list[int]] = []
    for whole in sorted({int(one) for one in numbers}):
        if runs and whole == runs[-1][-1] + 1:
            runs[-1][1:] = [whole]
        else:
            runs.append([whole])
    parts = ["-".join(map(str, run)) for run in runs[:MOST_RANGES]]
    return ", ".join(parts) + (", ..." if len(runs) > MOST_RANGES else "") if parts else "none"
