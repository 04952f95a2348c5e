"""OpenACC: platoons on test tracks and roads, 10 frames a second, metres.

Lines that begin with ``#``, then a table with ``Time`` and for each vehicle, the first one leading, ``SpeedN`` (m/s)
and ``EN, NN`` (m); ``IVSN`` is the gap, bumper to bumper, between vehicle N and the next. A track may be a ring, so
that positions are the distance driven: the speeds, summed. A leader's front is the gap and its length ahead.

Source: M. Makridis et al., openACC, Joint Research Centre of the European Commission, 2020 (CC BY 4.0).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.readers import pairs
from idm_sumo.recordings.readers.header import Header, header_of
from idm_sumo.recordings.readers.layout import Layout, Opened, plain
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import DEFAULT
from idm_sumo.runtime.errors import InputError

LENGTH = 4.5  # m, of a car whose length is not told
_SPEED, _GAP = re.compile(r"speed(\d{1,3})"), re.compile(r"ivs(\d{1,3})")
_LENGTH = re.compile(r"^#\s*length\s*[,:=]\s*(\d{1,3}(?:\.\d{1,9})?)\b", re.IGNORECASE | re.MULTILINE)


def read(opened: Opened, columns: Mapping[str, str]) -> tuple[Recording, Accounting]:
    """Read every vehicle but the first as the follower of the one before.

    Parameters
    ----------
    opened : Opened
    columns : mapping of str to str
        Not used: how many columns there are depends on the platoon.
    """
    skipped, header = _table_start(opened)
    names = {plain(name): name for name in header.names}
    gaps = sorted(int(found[1]) for name in names if (found := _GAP.fullmatch(name)))
    speeds = {int(found[1]) for name in names if (found := _SPEED.fullmatch(name))}
    if "time" not in names or not gaps:
        raise InputError(f"{opened.source}: is of the layout of OpenACC, but column Time or IVS1 is missing")
    if missing := [f"Speed{n + 1}" for n in gaps if n + 1 not in speeds]:
        raise InputError(f"{opened.source}: is of the layout of OpenACC, but column {missing[0]} is missing")
    wanted = {"time": names["time"]} | {f"ivs{n}": names[f"ivs{n}"] for n in gaps}
    wanted |= {f"speed{n + 1}": names[f"speed{n + 1}"] for n in gaps}
    raw = replace(opened, header=header).columns(wanted)
    told = _LENGTH.search(opened.start[:skipped])
    length = float(told[1]) if told else LENGTH
    opened.ledger.total = 0  # counted again as rows of pairs
    table = pd.concat([_pair(raw, n, length) for n in gaps], ignore_index=True)
    opened.ledger.notes += [
        f"a platoon of {len(gaps) + 1} vehicles: {len(gaps)} pairs, {len(raw)} moments each; positions are the speeds "
        "summed, the gaps are the recorded ones",
        f"length of the vehicles: {length:g} m, " + ("as the file says" if told else "assumed"),
    ]
    return pairs.to_recording(table, opened.ledger, road=opened.road or DEFAULT, source=opened.source)


def _pair(raw: pd.DataFrame, leader: int, length: float) -> pd.DataFrame:
    time, speed = raw["time"].to_numpy(np.float64), raw[f"speed{leader + 1}"].to_numpy(np.float64)
    spacing = raw[f"ivs{leader}"].to_numpy(np.float64)
    position = pairs.driven(time, speed)
    return pd.DataFrame({
        "follower": leader + 1, "leader": leader, "t": time, "x_follower": position,
        "x_leader": position + spacing + length, "leader_length": length, "spacing": spacing, "v_follower": speed,
    })  # fmt: skip


def _table_start(opened: Opened) -> tuple[int, Header]:
    """Return where the table begins in the first text, and its header."""
    lines = opened.start.splitlines(keepends=True)
    above = next((k for k, line in enumerate(lines) if plain(line.split(",")[0]) == "time"), None)
    if above is None:
        raise InputError(
            f"{opened.source}: is of the layout of OpenACC, but has no line of columns that begins with Time"
        )
    head = header_of("".join(lines[above:]), opened.source)
    return sum(map(len, lines[:above])), replace(head, names=head.spelt, above=above)


def recognise(opened: Opened) -> bool:
    """Whether a table of a platoon follows lines that begin with ``#``, or begins the file."""
    lines = opened.start.splitlines()
    head = next((line for line in lines if plain(line.split(",")[0]) == "time"), "")
    names = {plain(name) for name in head.split(",")}
    marked = lines[:1] and lines[0].lstrip('"').startswith(("#", "Specifications"))
    return "ivs1" in names or ("speed1" in names and bool(marked)) or bool(lines and lines[0].startswith("#Location"))


LAYOUT = Layout(name="OpenACC", read=read, recognise=recognise)
