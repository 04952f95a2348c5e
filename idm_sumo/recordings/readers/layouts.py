"""The layouts that can be read, by their columns, and what to say of a file in none of them."""

from __future__ import annotations

from collections.abc import Iterable

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
PAIR_NUMBERS = (*PAIRS, *PAIR_LENGTHS, "v_follower", "a_follower")
FCD = ("time", "id", "x", "y", "speed")
FCD_NUMBERS = ("time", "x", "y", "angle", "speed", "acceleration", "length", "width")
FCD_TEXTS = ("id", "lane")

FOREIGN = {
    "highD": {"frame", "id", "xVelocity", "laneId"},
    "TGSIM": {"id", "time", "xloc-kf", "yloc-kf"},
    "pNEUMA": {"track_id", "traveled_d", "avg_speed"},
    "I-24 MOTION": {"_id", "timestamp", "x_position"},
    "OpenACC": {"#Location"},
}  # well-known data sets, by columns that only they have
DOORS = (
    f"bring it into pairs (CSV or Parquet: {', '.join(PAIRS)}, {' or '.join(PAIR_LENGTHS)}; 0.1 s apart) "
    f"or our own columns (CSV or Parquet, SI: {', '.join(c.ALL)})"
)


def bare(name: str) -> str:
    """Return the name of an FCD attribute without the element that SUMO's tables put before it."""
    return name.removeprefix("timestep_").removeprefix("vehicle_")


def is_own(names: Iterable[str]) -> bool:
    """Whether columns are those of a :class:`~idm_sumo.recordings.recording.Recording`."""
    return {*c.KEYS, c.X, c.Y} <= set(names)


def is_fcd(names: Iterable[str]) -> bool:
    """Whether columns are those of a table that SUMO writes of floating car data."""
    return set(FCD) <= {bare(name) for name in names}


def is_pairs(names: Iterable[str]) -> bool:
    """Whether columns are those of leader-follower pairs."""
    return set(PAIRS) <= set(names) and bool(set(PAIR_LENGTHS) & set(names))


def need(names: list[str], source: str, *, spelt: list[str]) -> None:
    """Raise if columns are not enough of NGSIM's to make a recording.

    Raises
    ------
    InputError
        Names the nearest layout, the column it misses, and the two layouts that anything can be brought into.
    """
    missing = _missing_of_ngsim(names)
    if missing:
        raise unknown_layout(spelt, source)


def unknown_layout(names: list[str], source: str, *, known: str = "") -> InputError:
    """Return the error for a file in none of the layouts that can be read.

    Parameters
    ----------
    names : list of str
        Its columns, or what stands where they belong.
    source : str
    known : str, keyword-only
        The data set, where it is known already.
    """
    known = known or next((name for name, of in FOREIGN.items() if of <= set(names)), "")
    found = one_line(", ".join(names[:8]))[:90] + (", ..." if len(names) > 8 else "")
    layout, missing = _nearest(names)
    look = f"looks like {known}, a layout not read yet" if known else "unknown layout"
    return InputError(
        f"{source}: {look} (found {found}); nearest is {layout}: column {', '.join(missing)} missing; {DOORS}"
    )


def _missing_of_ngsim(names: list[str]) -> list[str]:
    missing = [name for name in ("Vehicle_ID", "Local_X", "Local_Y") if name not in names]
    return missing if {"Frame_ID", "step", "Global_Time"} & set(names) else [*missing, "Frame_ID"]


def _nearest(names: list[str]) -> tuple[str, list[str]]:
    """Return the layout that shares most columns, and those it misses."""
    pairs = [name for name in PAIRS if name not in names]
    if not set(PAIR_LENGTHS) & set(names):
        pairs.append(PAIR_LENGTHS[0])
    missing = {
        "pairs": pairs, "NGSIM": _missing_of_ngsim(names),
        "SUMO FCD": [name for name in FCD if name not in {bare(each) for each in names}],
        "our own columns": [name for name in c.ALL if name not in names],
    }  # fmt: skip
    needed = {"NGSIM": 4, "pairs": 6, "SUMO FCD": 5, "our own columns": len(c.ALL)}
    layout = max(missing, key=lambda name: 1 - len(missing[name]) / needed[name])
    return layout, missing[layout]
