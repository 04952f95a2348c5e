"""Leaders that SUMO names, and where ours differ."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.simulation.rollout import perceive
from idm_sumo.sumo import network
from idm_sumo.sumo.replay.scene import SumoScene
from idm_sumo.sumo.replay.traffic_rows import TrafficRows, check_on_network, traffic_rows
from idm_sumo.sumo.session import simulation

Integers = npt.NDArray[np.int64]

LOOK_AHEAD = 2000.0  # m, more than the network is long

# Why SUMO names another leader. The first two happen where the leader is on the next edge.
STRADDLES = "reaches into the lane from beside, its front is not in it"
HAS_LEFT = "has left the lane, but not SUMO's list of vehicles that reach into it"
OVERLAP = "overlaps with another; SUMO orders them by their rears"
EQUAL = "is exactly beside another"
TOO_FAR = "is beyond the look-ahead"
UNSEEN = "is not seen by SUMO"


def leader_by_getleader(sumo: Any, name: str) -> tuple[str | None, float]:
    """Return the leader and gap of ``vehicle.getLeader``.

    Parameters
    ----------
    sumo : module
        As of :func:`idm_sumo.sumo.session.simulation`.
    name : str
        Name of the follower.

    Returns
    -------
    name : str or None
        The leader within ``LOOK_AHEAD``.
    gap : float
        m, infinite without a leader.
    """
    answer = sumo.vehicle.getLeader(name, LOOK_AHEAD)
    if not answer or not answer[0]:
        return None, np.inf
    return answer[0], answer[1]


def leader_in_lane(sumo: Any, name: str, strip: tuple[str, ...]) -> str | None:
    """Return the vehicle whose front is next ahead in lane.

    For vehicles placed as points. ``vehicle.getLeader`` decides where the leader is on the
    same edge. For a leader on an edge further downstream SUMO first asks a list of vehicles that
    overlap the edge's end, which is kept in the order of arrival and lags a step behind lane
    changes. There the lanes ahead are asked instead.

    Parameters
    ----------
    sumo : module
        As of :func:`idm_sumo.sumo.session.simulation`.
    name : str
        Name of the follower.
    strip : tuple of str
        The follower's lane, as of :meth:`idm_sumo.sumo.network.RoadNetwork.strip`.

    Returns
    -------
    str or None
        Name of the leader.
    """
    here = sumo.vehicle.getLaneID(name)
    ahead, _ = leader_by_getleader(sumo, name)
    if ahead is not None and sumo.vehicle.getLaneID(ahead) == here:
        return ahead
    if here not in strip:
        return ahead  # within a junction, on a lane beside its own
    for piece in strip[strip.index(here) + 1 :]:
        if vehicles := sumo.lane.getLastStepVehicleIDs(piece):
            return str(vehicles[0])  # SUMO lists them from upstream
    return None


class PerceptionCheck(NamedTuple):
    """Result of :func:`compare_perception`.

    Attributes
    ----------
    compared : int
        How often a vehicle was asked for its leader.
    differences : pandas.DataFrame
        One row where SUMO and our perception disagree: ``frame, vehicle, lane, x``, ``ours``
        and ``sumo`` (numbers of the leaders, 0 for none) and ``cause``, which describes
        SUMO's leader, or ours where SUMO names none.
    largest_gap_difference : float
        Over all cases in which both name the same leader (m).
    """

    compared: int
    differences: pd.DataFrame
    largest_gap_difference: float


def compare_perception(
    scenes: Scenes, *, as_points: bool = False, every: int = 1, progress: Progress = silent
) -> PerceptionCheck:
    """Compare the leaders that SUMO and our perception name.

    Parameters
    ----------
    scenes : Scenes
        Its whole traffic is played, whichever vehicles are modelled.
    as_points : bool
        Place the vehicles and find the leader as the replay does; no difference is expected.
        By default vehicles have their sizes, and ``vehicle.getLeader`` alone is asked, as a user
        of SUMO would do.
    every : int
        Play and compare every so many frames.
    progress : Progress
        Called with the frames done and their total.

    Returns
    -------
    PerceptionCheck

    Raises
    ------
    InputError
        If the recording does not hold the vehicles ahead.
    """
    if scenes.leader_source != LEADER_FROM_LANE:
        raise InputError(
            f"period {scenes.one_period}: the recording does not hold the leaders, so SUMO cannot see them"
        )
    traffic, found, compared, largest = traffic_rows(scenes), [], 0, 0.0
    frames = np.arange(scenes.traffic.first_frame, scenes.traffic.first_frame + scenes.traffic.frames, every)
    by_frame = np.argsort(traffic.frame, kind="stable")
    bounds = np.searchsorted(traffic.frame[by_frame], [frames, frames + 1])
    net = network.of(scenes.road)
    with simulation(net=net.file) as sumo:
        check_on_network(sumo, traffic, net)
        scene = SumoScene(sumo, net, as_points=as_points)
        strips = [net.strip(lane + 1) for lane in range(scenes.road.main_lanes)] if as_points else None
        for done, (begin, end) in enumerate(bounds.T.tolist()):
            rows = by_frame[begin:end]
            scene.place(*traffic.of(rows))
            sumo.simulationStep()
            differing, gap_difference = _compare_frame(sumo, scenes, traffic, rows, strips)
            found += differing
            compared, largest = compared + len(rows), max(largest, gap_difference)
            progress("perception", done + 1, len(frames))
    columns = ["frame", "vehicle", "lane", "x", "ours", "sumo", "cause"]
    return PerceptionCheck(compared, pd.DataFrame(found, columns=columns), largest)


def _compare_frame(
    sumo: Any, scenes: Scenes, traffic: TrafficRows, rows: Integers, strips: list[tuple[str, ...]] | None
) -> tuple[list[tuple[Any, ...]], float]:
    """Return one frame's differences and largest gap difference (m)."""
    t, found, largest = scenes.traffic, [], 0.0
    row_of = dict(zip(map(str, t.vehicle[rows].tolist()), rows.tolist(), strict=True))
    for name, row in row_of.items():
        lane, frame = int(traffic.lane[row]), int(traffic.frame[row])
        ours, gap = perceive(int(t.cell(lane, frame)), t.x[row], t.vehicle[row], t.offsets, t.x, t.length, t.vehicle)
        leader, stated_gap = leader_by_getleader(sumo, name)
        if strips is not None:
            leader = leader_in_lane(sumo, name, strips[lane - 1])
        theirs = NOBODY if leader is None else row_of[leader]
        if ours != theirs:
            numbers = (0 if who == NOBODY else int(t.vehicle[who]) for who in (ours, theirs))
            cause = _cause(scenes, traffic, row, ours, theirs)
            found.append((frame, int(name), lane, float(t.x[row]), *numbers, cause))
        elif ours != NOBODY and strips is None:
            largest = max(largest, abs(gap - stated_gap))
    return found, largest


def _cause(scenes: Scenes, traffic: TrafficRows, row: int, ours: int, theirs: int) -> str:
    """Say why SUMO's leader ``theirs`` is not ``ours``."""
    t = scenes.traffic
    if theirs == NOBODY:
        return TOO_FAR if t.x[ours] - t.x[row] > LOOK_AHEAD else UNSEEN
    if traffic.lane[theirs] != traffic.lane[row]:
        lane = traffic.lane[row]
        reach = 0.5 * (float(scenes.road.lane_width(lane)) + t.width[theirs])
        straddles = abs(traffic.y[theirs] - scenes.road.lane_center(lane)) < reach
        return STRADDLES if straddles else HAS_LEFT
    if t.x[theirs] in (t.x[row], t.x[ours]):
        return EQUAL
    return OVERLAP
