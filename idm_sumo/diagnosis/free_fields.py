"""Accelerations that belong to no effect: one along each covariate, to find what the catalogue does not hold."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import numbered

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FREE = "free:"  # begins the name of such an atom; the covariate follows
BLOCKS = 4  # of the road, and of the recording, in the rectangles of place and time

# Covariate, and the edges between which the acceleration is free.
EDGES: dict[str, tuple[float, ...]] = {
    "rear_gap": (-1e9, 6.0, 12.0, 25.0),
    "since_change": (-1e-9, 4.0, 10.0, 20.0),
    "until_own_change": (-1e-9, 3.0, 8.0),
    "until_cut_in": (-1e-9, 3.0, 8.0),
    "leader_acceleration": (-20.0, -1.0, -0.3, 0.3, 1.0, 20.0),
    "adjacent_difference": (-40.0, -5.0, -2.0, 2.0, 5.0, 40.0),
    "second_gap_change": (-30.0, -2.0, -0.7, 0.7, 2.0, 30.0),
    "trucks_beside": (0.5, 99.0),
    "braking_beside": (0.5, 99.0),
    "unrest": (0.0, 0.4, 0.7, 1.0, 9.0),
}
TURNS = (-20.0, -0.4, 0.4, 20.0)  # m/s²: the leader brakes, keeps its speed, accelerates


def covariates(windows: w.Windows, state: Floats) -> dict[str, Floats]:
    """Return the covariates by frame, shape ``(windows, horizon)``; SI units, NaN or far away where unknown."""
    seen = windows.seen[:, w.LEAD : -1]
    x, v = state[:, :, ro.BASE_X], state[:, :, ro.BASE_V]
    return {
        "rear_gap": np.where(np.isfinite(seen[:, :, w.BEHIND]), seen[:, :, w.X] - seen[:, :, w.BEHIND], 1e6),
        "since_change": seen[:, :, w.SINCE],
        "until_own_change": seen[:, :, w.UNTIL_OWN],
        "until_cut_in": seen[:, :, w.UNTIL_CUT_IN],
        "leader_acceleration": seen[:, :, w.ACCELERATION],
        "adjacent_difference": v - seen[:, :, w.ADJACENT],
        "second_gap_change": np.where(
            np.isfinite(seen[:, :, w.SECOND]), seen[:, :, w.SPEED] - seen[:, :, w.SECOND_SPEED], 1e6
        ),
        "trucks_beside": seen[:, :, w.TRUCKS_BESIDE],
        "braking_beside": seen[:, :, w.BRAKING_BESIDE],
        "unrest": seen[:, :, w.UNREST],
        "position": x,
        "time": seen[:, :, w.TIME],
        "lane": seen[:, :, w.LANE],
    }


Label = tuple[str, float, float]  # covariate, and the edges between which the acceleration is free


def families(
    windows: w.Windows, state: Floats, place: Floats, time: Floats, lanes: Floats
) -> Iterator[tuple[list[Label], Integers]]:
    """Yield the labels of the fields along each covariate, and which of them each frame is in (-1: none)."""
    known = covariates(windows, state)
    for name, edges in EDGES.items():
        labels = [(name, low, high) for low, high in itertools.pairwise(edges)]
        yield labels, numbered(known[name], np.array(edges))
    xs, ts = np.linspace(place[0], place[-1], BLOCKS + 1), np.linspace(time[0], time[-1], BLOCKS + 1)
    i, j = numbered(known["position"], xs), numbered(known["time"], ts)
    yield (
        [(f"position and time {a} {b}", a, b) for a in range(BLOCKS) for b in range(BLOCKS)],
        np.where((i >= 0) & (j >= 0), i * BLOCKS + j, -1),
    )
    turn = numbered(known["leader_acceleration"], np.array(TURNS))
    names = ("leader brakes", "leader keeps its speed", "leader accelerates")
    yield (
        [(f"time while the {name}", float(a), float(b)) for name in names for a, b in itertools.pairwise(ts)],
        np.where((j >= 0) & (turn >= 0), turn * BLOCKS + j, -1),
    )
    if len(lanes) > 1:
        lane = np.searchsorted(lanes, known["lane"])
        yield [("lane", float(number), float(number)) for number in lanes], lane
        blocks = list(itertools.pairwise(ts))
        yield (
            [(f"time in lane {int(number)}", float(a), float(b)) for number in lanes for a, b in blocks],
            np.where(j >= 0, lane * BLOCKS + j, -1),
        )
