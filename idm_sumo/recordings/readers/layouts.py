"""The layouts that can be read, by their columns, and what to say of a file in none of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError, one_line

OFFICIAL = (
    "Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y", "Global_X", "Global_Y",
    "v_Length", "v_Width", "v_Class", "v_Vel", "v_Acc", "Lane_ID", "Preceding", "Following",
    "Space_Headway", "Time_Headway",
)  # fmt: skip
NUMBERS = (
    "Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y", "v_Length", "v_Width", "v_Class",
    "v_Vel", "v_Acc", "Lane_ID", "Preceding", "Space_Headway", "step",
)  # fmt: skip
LABELS = ("Location", "period", "scene")
PAIRS = ("follower", "leader", "t", "x_follower", "x_leader")
PAIR_LENGTHS = ("leader_length", "spacing")  # one of them tells the other
PAIR_NUMBERS = (*PAIRS, *PAIR_LENGTHS, "v_follower", "a_follower", "follower_length", "headway")
FCD = ("time", "id", "x", "y", "speed")
FCD_NUMBERS = ("time", "x", "y", "angle", "speed", "acceleration", "length", "width", "pos")
FCD_TEXTS = ("id", "lane", "type")

DOORS = (
    f"bring it into pairs (CSV or Parquet: {', '.join(PAIRS)}, {' or '.join(PAIR_LENGTHS)}; 0.1 s apart) "
    f"or our own columns (CSV or Parquet, SI: {', '.join(c.ALL)})"
)


class Lacking(NamedTuple):
    """What a file lacks of a layout.

    Attributes
    ----------
    missing : list of str
        Columns.
    needed : int
        How many columns the layout needs.
    """

    missing: list[str]
    needed: int


def bare(name: str) -> str:
    """Return the name of an FCD attribute without the element that SUMO's tables put before it."""
    return name.removeprefix("timestep_").removeprefix("vehicle_")


def is_own(names: Iterable[str]) -> bool:
    """Whether columns are those of a :class:`~idm_sumo.recordings.recording.Recording`."""
    return {*c.KEYS, c.X, c.Y} <= set(names)


def is_fcd(names: Iterable[str]) -> bool:
    """Whether columns are those of a table that SUMO writes of floating car data."""
    return set(FCD) <= {bare(name) for name in names}


def is_ngsim(names: Iterable[str]) -> bool:
    """Whether columns are enough of NGSIM's to make a recording."""
    return not _missing_of_ngsim(set(names))


def unknown_layout(names: list[str], source: str, *, others: Mapping[str, Lacking] | None = None) -> InputError:
    """Return the error for a file in none of the layouts that can be read.

    Parameters
    ----------
    names : list of str
        Its columns, or what stands where they belong.
    source : str
    others : mapping of str to Lacking, keyword-only
        What the file lacks of layouts beside those of this module.
    """
    found = one_line(", ".join(names[:8]))[:90] + (", ..." if len(names) > 8 else "")
    every = _lacking(names) | dict(others or {})
    layout = max(every, key=lambda name: 1 - len(every[name].missing) / every[name].needed)
    missing = ", ".join(every[layout].missing)
    return InputError(
        f"{source}: unknown layout (found {found}); nearest is {layout}: column {missing} missing; {DOORS}"
    )


def _missing_of_ngsim(names: Collection[str]) -> list[str]:
    missing = [name for name in ("Vehicle_ID", "Local_X", "Local_Y") if name not in names]
    return missing if {"Frame_ID", "step", "Global_Time"} & set(names) else [*missing, "Frame_ID"]


def _lacking(names: Collection[str]) -> dict[str, Lacking]:
    """Return for each layout of this module what is missing."""
    pairs = [name for name in PAIRS if name not in names]
    if not set(PAIR_LENGTHS) & set(names):
        pairs.append(PAIR_LENGTHS[0])
    fcd = [name for name in FCD if name not in {bare(each) for each in names}]
    own = [name for name in c.ALL if name not in names]
    return {
        "pairs": Lacking(pairs, len(PAIRS) + 1), "NGSIM": Lacking(_missing_of_ngsim(names), 4),
        "SUMO FCD": Lacking(fcd, len(FCD)), "our own columns": Lacking(own, len(c.ALL)),
    }  # fmt: skip
