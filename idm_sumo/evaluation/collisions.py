"""Contacts of modelled vehicles with recorded traffic, and their fault.

Recorded vehicles cannot react to a modelled vehicle that deviates from its recorded path, so
some contacts are not the model's fault. This is the rule:

**What is a contact.** The modelled vehicle and a recorded vehicle, as rectangles of their length
and width turned by their heading, overlap. The recorded vehicle that the model replaces is taken
out of the traffic. A pair that overlaps when the simulation starts (measured positions and assumed
sizes have errors) counts only after it has been apart. The *first* contact of a simulation decides,
since what comes after would not have happened. Of several at the same step, one at the model's fault is taken.

**Which edge.** Seen along and across the modelled vehicle, the pair came to overlap along one
direction last. Both motions are linear between two steps, the other vehicle moves at its recorded
velocity. If that direction was lengthwise, the modelled vehicle's ``front`` or ``rear`` was hit,
depending on where the other's middle is; otherwise its ``side``.

**Whose fault.**

* ``front``: the model's, since it drove into the other vehicle. Except where the other cut in: if,
  ``REACTION_TIME`` before, it was not in the way of the modelled vehicle's present lateral position.
* ``rear``: not the model's, since a replayed vehicle struck it from behind. Except where the modelled
  vehicle cut in, by the same measure.
* ``side``: not the model's if the other vehicle moved sideways towards it faster than the reverse, as
  a recorded vehicle does that changes into the lane. Otherwise the model's.

The paper reports "the collisions where the model vehicle is at fault" and gives no rule. In scenes
with ``leader_source == "twin"`` the only other vehicle is the recorded vehicle's leader, at its
follower's lateral position and with an assumed size. Counts from them are a lower bound.
"""

from __future__ import annotations

from math import hypot

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.evaluation.rectangles import overlap, rectangle, separation
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.threads import in_threads
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import Trajectories

REACTION_TIME = 1.0  # s, time that a follower needs to react to a cut-in
REACTION_STEPS = round(REACTION_TIME / FRAME_STEP)

ACROSS = 1.5  # rad, about a right angle: no vehicle of a recording is turned that far
ROUNDING = 1e-6  # m, far more than rounding errors of positions

NONE, FRONT, REAR, SIDE = range(4)
EDGES = ("", "front", "rear", "side")


def first_contacts(scenes: Scenes, trajectories: Trajectories) -> pd.DataFrame:
    """Return each modelled vehicle's first contact and its fault.

    Parameters
    ----------
    scenes : Scenes
        Windows of the drivers.
    trajectories : Trajectories
        One row a driver of ``scenes``, from the start of the simulation.

    Returns
    -------
    pandas.DataFrame
        One row a driver: ``collision``, ``at_fault`` (bool), ``contact_time_s`` (s after the start, NaN
        without contact), ``contact_with`` (vehicle number, 0 without contact and for a leader known by its
        headway only) and ``contact_edge`` (``front``, ``rear``, ``side`` or empty).
    """
    n, t = len(scenes), scenes.traffic
    step, row, edge, fault = (np.zeros(n, dtype=np.int64) for _ in range(4))
    cell, lanes = _first_cells(scenes)
    code, names = pd.factorize(t.vehicle)
    reach = float(np.hypot(t.length, 0.5 * t.width).max(initial=0.0))
    own = pd.Index(names).get_indexer(pd.Index(scenes.vehicle))
    in_threads(
        _first_contacts, n,
        trajectories.x, trajectories.y, trajectories.heading, scenes.length, scenes.width, own, cell, lanes, t.frames,
        t.offsets, t.x, t.y, t.heading, t.speed, t.length, t.width, code, len(names), reach,
        step, row, edge, fault,
    )  # fmt: skip
    hit = edge != NONE
    return pd.DataFrame({
        "collision": hit,
        "at_fault": fault.astype(bool),
        "contact_time_s": np.where(hit, step * FRAME_STEP, np.nan),
        "contact_with": _numbers_of(t.vehicle, row, hit),
        "contact_edge": np.array(EDGES)[edge],
    })  # fmt: skip


def _numbers_of(
    vehicle: npt.NDArray[np.int64], row: npt.NDArray[np.int64], hit: npt.NDArray[np.bool_]
) -> npt.NDArray[np.int64]:
    """Return the vehicle numbers of rows, 0 without contact."""
    numbers = np.zeros(len(row), dtype=np.int64)
    numbers[hit] = vehicle[row[hit]]
    return numbers


def _first_cells(scenes: Scenes) -> tuple[npt.NDArray[np.int64], int]:
    """Return each simulation's first cell and the number of lanes.

    The first cell is that of the leftmost lane at the start. All lanes are searched, not only adjacent
    ones: a slanting truck reaches far, and a car without perception may drift anywhere.
    """
    if scenes.leader_source == LEADER_FROM_LANE:
        return scenes.cells(1, scenes.start), scenes.road.main_lanes
    return scenes.cell + scenes.start, 1


@njit(cache=True)
def touched_edge(before, now, other_before, other_now) -> int:  # type: ignore[no-untyped-def]
    """Return which edge of the modelled vehicle was hit.

    The direction along which the rectangles came to overlap last decides. If they were not apart along
    either, the one along which they overlap less does.

    Parameters
    ----------
    before, now : tuple of float
        Rectangles of the modelled vehicle one step before and at the contact.
    other_before, other_now : tuple of float
        Those of the other vehicle.

    Returns
    -------
    int
        ``FRONT``, ``REAR`` or ``SIDE``.
    """
    along = separation(now, other_now, now[2], now[3])
    across = separation(now, other_now, -now[3], now[2])
    along_closed = _closing_time(separation(before, other_before, before[2], before[3]), along)
    across_closed = _closing_time(separation(before, other_before, -before[3], before[2]), across)
    if across_closed > along_closed or (across_closed == along_closed and across > along):
        return SIDE
    ahead = (other_now[0] - now[0]) * now[2] + (other_now[1] - now[1]) * now[3]
    return FRONT if ahead > 0.0 else REAR


@njit(cache=True)
def _closing_time(before: float, now: float) -> float:
    """Return when between two steps a distance became negative.

    From 0 to 1; 0 if it was negative before.
    """
    return before / (before - now) if before > 0.0 else 0.0


@njit(cache=True)
def is_at_fault(
    edge: int,
    sideways: float,
    other_sideways: float,
    to_the_left: bool,
    was_in_the_way: bool,
    other_was_in_the_way: bool,
) -> bool:
    """Return whether the modelled vehicle is at fault.

    The rule is that of this module.

    Parameters
    ----------
    edge : int
        Edge of the modelled vehicle that was hit.
    sideways, other_sideways : float
        Velocities across the road (m/s, positive to the left).
    to_the_left : bool
        Whether the other's middle lies to the left.
    was_in_the_way, other_was_in_the_way : bool
        Whether the modelled vehicle was in the other's path, and the reverse, ``REACTION_TIME`` before.

    Returns
    -------
    bool
        Whether the modelled vehicle is at fault.
    """
    if edge == REAR:
        return not was_in_the_way
    if edge == FRONT:
        return other_was_in_the_way
    side = 1.0 if to_the_left else -1.0
    return side * sideways >= -side * other_sideways


@njit(cache=True)
def _judge(x, y, heading, k, length, width, other, other_velocity, other_was_in_the_way):  # type: ignore[no-untyped-def]
    """Return edge and fault of a contact at step ``k``.

    ``other`` is a rectangle that moves at ``other_velocity``.
    """
    dt = FRAME_STEP
    now = rectangle(x[k], y[k], heading[k], length, width)
    before = rectangle(x[k - 1], y[k - 1], heading[k - 1], length, width)
    other_before = (
        other[0] - other_velocity[0] * dt, other[1] - other_velocity[1] * dt, other[2], other[3], other[4], other[5]
    )  # fmt: skip
    edge = touched_edge(before, now, other_before, other)
    then = max(0, k - REACTION_STEPS)
    earlier = rectangle(x[then], y[then], heading[then], length, width)
    in_the_way = separation(earlier, other, 0.0, 1.0) < 0.0
    sideways = (now[1] - before[1]) / dt
    to_the_left = other[1] > now[1]
    return edge, is_at_fault(edge, sideways, other_velocity[1], to_the_left, in_the_way, other_was_in_the_way)


@njit(cache=True)
def _was_in_the_way(  # type: ignore[no-untyped-def]
    ego, code, first_cell, lanes, frames, then,
    offsets, other_x, other_y, other_heading, other_length, other_width, other_code,
):  # fmt: skip
    """Return whether a vehicle was in the way before.

    That is, whether it was laterally where the modelled vehicle is now.
    """
    for lane in range(lanes):
        cell = first_cell + lane * frames + then
        for j in range(offsets[cell], offsets[cell + 1]):
            if other_code[j] == code:
                earlier = rectangle(other_x[j], other_y[j], other_heading[j], other_length[j], other_width[j])
                return separation(earlier, ego, 0.0, 1.0) < 0.0
    return False


@njit(cache=True)
def first_row_from(x, low, high, least):  # type: ignore[no-untyped-def]
    """Return the first sorted row not behind a position.

    Parameters
    ----------
    x : float64, shape (rows,)
        Front bumpers (m), sorted within ``low:high``.
    low, high : int
        Range of rows.
    least : float
        Position (m).

    Returns
    -------
    int
        Row, or ``high`` if all are behind.
    """
    while low < high:
        middle = (low + high) >> 1
        if x[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def may_touch(x, y, heading, length, width, other_x, other_y, other_heading, other_length, other_width):  # type: ignore[no-untyped-def]
    """Return whether two rectangles can overlap at all.

    By bounds of how far each reaches across and along the road from its front bumper's middle, without a
    sine: nearly all pairs are apart by more, and need none.

    Parameters
    ----------
    x, y, heading, length, width : float
        Front bumper's middle (m), heading (rad) and size (m).
    other_x, other_y, other_heading, other_length, other_width : float
        Those of the other one.

    Returns
    -------
    bool
        False only if they are apart.
    """
    turn, other_turn, breadth = abs(heading), abs(other_heading), 0.5 * (width + other_width) + ROUNDING
    if max(turn, other_turn) > ACROSS:  # its rear may be ahead of its front
        return True
    if abs(other_y - y) > turn * length + other_turn * other_length + breadth:
        return False
    corners = 0.5 * (turn * width + other_turn * other_width) + ROUNDING
    return not (other_x - x > other_length + corners or x - other_x > length + corners)


@njit(cache=True, nogil=True)
def _first_contacts(  # type: ignore[no-untyped-def]
    first, last, x, y, heading, length, width, own, first_cell, lanes, frames,
    offsets, other_x, other_y, other_heading, other_speed, other_length, other_width, other_code, others, reach,
    step, row, edge, fault,
):  # fmt: skip
    for i in range(first, last):
        since_start = np.full(others, -1)  # last step of an overlap that has lasted since the start, step 0
        mine = hypot(length[i], 0.5 * width[i]) + reach
        for k in range(x.shape[1]):
            for lane in range(lanes):
                cell = first_cell[i] + lane * frames + k
                j = first_row_from(other_x, offsets[cell], offsets[cell + 1], x[i, k] - mine)
                while j < offsets[cell + 1] and other_x[j] <= x[i, k] + mine:
                    if other_code[j] == own[i] or not may_touch(
                        x[i, k], y[i, k], heading[i, k], length[i], width[i],
                        other_x[j], other_y[j], other_heading[j], other_length[j], other_width[j],
                    ):  # fmt: skip
                        j += 1
                        continue
                    ego = rectangle(x[i, k], y[i, k], heading[i, k], length[i], width[i])
                    other = rectangle(other_x[j], other_y[j], other_heading[j], other_length[j], other_width[j])
                    if overlap(ego, other):
                        if since_start[other_code[j]] == k - 1:
                            since_start[other_code[j]] = k
                        elif not fault[i]:
                            velocity = (other_speed[j] * other[2], other_speed[j] * other[3])
                            there = _was_in_the_way(
                                ego, other_code[j], first_cell[i], lanes, frames, max(0, k - REACTION_STEPS),
                                offsets, other_x, other_y, other_heading, other_length, other_width, other_code,
                            )  # fmt: skip
                            found, guilty = _judge(
                                x[i], y[i], heading[i], k, length[i], width[i], other, velocity, there
                            )
                            if edge[i] == NONE or guilty:
                                step[i], row[i], edge[i], fault[i] = k, j, found, guilty
                    j += 1
            if edge[i] != NONE:
                break
