"""pNEUMA: a city centre from drones; told, and refused.

A row a vehicle: its number, type and then latitude, longitude, speed, accelerations and time in turns. There are
neither lanes nor leaders nor lengths, and streets cross, so that who follows whom cannot be told from the file alone.

Source: E. Barmpounakis, N. Geroliminis, On the new era of urban traffic monitoring, Transportation Research C 2020.
"""

from __future__ import annotations

from collections.abc import Mapping

from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers.layout import Layout, Opened
from idm_sumo.recordings.readers.layouts import DOORS
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Refuse the file and say what is missing.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str

    Raises
    ------
    InputError
        Always.
    """
    raise InputError(
        f"{opened.source}: is of the layout of pNEUMA, which has no lanes, leaders or lengths: who follows whom must "
        f"be found on a map first; then {DOORS}"
    )


def recognise(opened: Opened) -> bool:
    """Whether the first columns are those of the set, whatever follows."""
    start = opened.start[:200].replace(" ", "").lower()
    return start.startswith(("track_id;type;traveled_d", "track_id,type,traveled_d"))


LAYOUT = Layout(name="pNEUMA", read=read, recognise=recognise)
