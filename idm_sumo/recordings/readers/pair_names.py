"""The names that people give the columns of leader-follower pairs, and what stands for a missing one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings.coercion import numbers
from idm_sumo.recordings.readers.layout import plain
from idm_sumo.recordings.readers.layouts import PAIR_NUMBERS

_LEADER = ("leader", "lead", "lv", "preceding", "l")
_FOLLOWER = ("follower", "following", "fv", "fav", "sv", "ego", "f")
LENGTH = 4.5  # m, of a leader whose length nobody told
MILLISECONDS = 5.0  # a clock that advances by more than this from row to row is in ms


def _of(things: Sequence[str], whose: Sequence[str]) -> tuple[str, ...]:
    """Return the spellings of a thing and whose it is, either way round, with and without underscore."""
    return tuple(
        name for thing in things for one in whose for name in (f"{thing}_{one}", f"{one}_{thing}", f"{thing}{one}")
    )


SPELLINGS: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "local_time", "time_s", "t_s", "time_index", "timestamp"),
    "follower": ("follower", "following", *_of(("id",), _FOLLOWER), *_of(("vehicle_id",), ("follower", "following"))),
    "leader": ("leader", "preceding", *_of(("id",), _LEADER), *_of(("vehicle_id",), ("leader", "preceding"))),
    "x_follower": _of(("x", "position", "pos", "loc"), _FOLLOWER),
    "x_leader": _of(("x", "position", "pos", "loc"), _LEADER),
    "v_follower": _of(("v", "speed", "vel", "velocity"), _FOLLOWER),
    "a_follower": _of(("a", "acceleration", "acc"), _FOLLOWER),
    "leader_length": _of(("length", "len"), _LEADER),
    "follower_length": _of(("length", "len"), _FOLLOWER),
    "spacing": ("spacing", "gap", "space_gap", "spatial_gap", "net_gap", "bumper_gap", "ivs", "distance_gap"),
    "headway": ("headway", "space_headway", "spatial_headway", "distance_headway", "dhw"),
    "case": ("case", "case_id", "trajectory_id", "pair_id", "event_id", "episode_id", "trip_id"),
    "period": ("period",),
}


def pair_columns(names: Sequence[str]) -> dict[str, str]:
    """Return the file's name of each column of pairs, or nothing if they are not enough.

    Needed are the time and, beside the follower's position or speed, how far ahead the leader is: by its position and
    length, by the gap between bumpers, or by the headway between fronts.

    Parameters
    ----------
    names : sequence of str
        As the file spells them.
    """
    spelt: dict[str, str] = {}
    for name in names:
        spelt.setdefault(plain(name), name)
    found = {new: next(spelt[one] for one in every if one in spelt)
             for new, every in SPELLINGS.items() if set(every) & set(spelt)}  # fmt: skip
    there = set(found)
    placed = {"x_follower", "x_leader"} <= there and bool(there & {"leader_length", "spacing"})
    ahead = bool(there & {"x_follower", "v_follower"}) and bool(there & {"spacing", "headway"})
    whose = {"follower", "leader"} <= there or "case" in there or bool(there & {"v_follower", "x_leader"})
    return found if "t" in there and whose and (placed or ahead) else {}


def completed(raw: pd.DataFrame, notes: list[str], source: str) -> pd.DataFrame:
    """Return pairs with every column that a recording is made from.

    Parameters
    ----------
    raw : pandas.DataFrame
        Columns by the names of :data:`SPELLINGS`.
    notes : list of str
        Gets a line for everything that was not told.
    source : str
        What messages call the file.

    Raises
    ------
    InputError
        If a cell that must be a number is none; names its row.
    """
    raw = raw.assign(**{name: numbers(raw[name], name, source) for name in raw.columns if name in PAIR_NUMBERS})
    raw = _in_seconds(raw, notes)
    if "follower" not in raw or "leader" not in raw:
        case = raw["case"] if "case" in raw else pd.Series(1, raw.index)
        number = pd.Series(pd.factorize(case)[0] + 1, raw.index)
        raw = raw.assign(follower=number, leader=number + int(number.max()))
        notes.append(
            "vehicles are numbered by case: the follower of the first is 1; leaders follow after all followers"
        )
    elif "case" in raw and "period" not in raw:
        raw = raw.assign(period="case " + raw["case"].astype(str).str.removesuffix(".0"))
    if "x_follower" not in raw:
        position = np.empty(len(raw))
        keys = ["period", "follower", "leader"] if "period" in raw else ["follower", "leader"]
        for rows in raw.groupby(keys, sort=False).indices.values():
            rows = rows[np.argsort(raw["t"].to_numpy()[rows], kind="stable")]
            position[rows] = driven(raw["t"].to_numpy(np.float64)[rows], raw["v_follower"].to_numpy(np.float64)[rows])
        raw = raw.assign(x_follower=position)
        notes.append("positions are the followers' speeds, summed")
    return _with_leader(raw, notes)


def _with_leader(raw: pd.DataFrame, notes: list[str]) -> pd.DataFrame:
    if "leader_length" not in raw and "spacing" in raw and "headway" in raw:
        raw = raw.assign(leader_length=raw["headway"] - raw["spacing"])
    if "leader_length" not in raw and "x_leader" not in raw:
        raw = raw.assign(leader_length=LENGTH)
        notes.append(f"lengths of leaders are not told; {LENGTH:g} m is taken")
    if "x_leader" not in raw:
        ahead = raw["headway"] if "headway" in raw else raw["spacing"] + raw["leader_length"]
        raw = raw.assign(x_leader=raw["x_follower"] + ahead)
    return raw


def _in_seconds(raw: pd.DataFrame, notes: list[str]) -> pd.DataFrame:
    steps = np.diff(np.unique(raw["t"].dropna().to_numpy(np.float64)))
    if not len(steps) or np.median(steps) < MILLISECONDS:
        return raw
    notes.append("the time advances by more than 5 from row to row: it is taken for milliseconds")
    return raw.assign(t=raw["t"] / 1000.0)


def driven(time: npt.NDArray[np.float64], speed: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the distance (m) driven at speeds (m/s) at times (s), by trapezoids; shape ``(rows,)``."""
    gaps = np.isnan(speed)
    known = np.interp(time, time[~gaps], speed[~gaps]) if gaps.any() and not gaps.all() else speed
    return np.concatenate([[0.0], np.cumsum(0.5 * (known[1:] + known[:-1]) * np.diff(time))])
