"""What comes back of one recording."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from idm_sumo.roads import Road


@dataclass(frozen=True)
class Result:
    """What comes back of one recording.

    Attributes
    ----------
    table : pandas.DataFrame
        One row a driver.
    road : Road
        What they were recorded on.
    row : dict
        What is said of the recording.
    files : dict of str to bytes
        Further files that are kept with it.
    """

    table: pd.DataFrame
    road: Road
    row: dict[str, Any]
    files: dict[str, bytes] = field(default_factory=dict)
