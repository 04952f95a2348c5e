"""Recorded traffic as rows that SUMO can place."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes
from idm_sumo.sumo.network import RoadNetwork
from idm_sumo.sumo.replay.scene import compass

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

EDGE = 1e-9  # m, how far inside its lane a front that lies on the lane's edge is put


class TrafficRows(NamedTuple):
    """The traffic of scenes as SUMO takes it.

    Attributes
    ----------
    label : int64, shape (rows,)
        Number that names the vehicle in SUMO: its own, or the window's whose leader it is.
    lane : int64, shape (rows,)
        Main lane it belongs to.
    frame : int64, shape (rows,)
        Absolute frame; -1 for the leader of a window that is not among the scenes.
    x, y, angle, length, width : float64, shape (rows,)
        See :meth:`idm_sumo.sumo.replay.scene.SumoScene.place`.
    """

    label: Integers
    lane: Integers
    frame: Integers
    x: Floats
    y: Floats
    angle: Floats
    length: Floats
    width: Floats

    def of(self, rows: Integers) -> tuple[list[str], list[float], list[float], list[float], list[float], list[float]]:
        """Return some rows as :meth:`SumoScene.place` takes them.

        Parameters
        ----------
        rows : int64, shape (n,)
            Numbers of the rows.

        Returns
        -------
        names, x, y, angle, length, width : list
            Arguments of :meth:`idm_sumo.sumo.replay.scene.SumoScene.place`.
        """
        x, y, angle, length, width = (column[rows].tolist() for column in self[3:])
        return list(map(str, self.label[rows].tolist())), x, y, angle, length, width


def traffic_rows(scenes: Scenes) -> TrafficRows:
    """Return the traffic of ``scenes`` as SUMO takes it.

    Every vehicle keeps its recorded place, except that a front bumper beyond the outer edges
    of the main lanes is put on that edge, and one exactly on an edge 1e-9 m inside its lane.
    SUMO so assigns to each vehicle the lane that :meth:`idm_sumo.roads.Road.lane_at` does. A leader of
    which only the headway is known has no lateral place; it drives in the middle of its
    follower's lane.

    Parameters
    ----------
    scenes : Scenes
        Of one period.

    Returns
    -------
    TrafficRows
        In the order of the scenes' traffic.

    Raises
    ------
    InputError
        If the scenes belong to several periods.
    """
    scenes.check_one_period()  # a simulation has one clock
    t = scenes.traffic
    cell = np.repeat(np.arange(len(t.offsets) - 1), np.diff(t.offsets))
    group, frame = np.divmod(cell, t.frames)
    if scenes.leader_source == LEADER_FROM_LANE:
        label, lane, frame = t.vehicle, group + 1, frame + t.first_frame
        y = inside_lane(scenes.road, t.y, lane)
    else:
        window = scenes.cell // t.frames
        lane_of, first_of = np.full(group.max(initial=0) + 1, 1), np.full(group.max(initial=0) + 1, -t.frames)
        in_use = window < len(lane_of)
        lane_of[window[in_use]], first_of[window[in_use]] = scenes.lane[in_use], scenes.first_frame[in_use]
        label, lane, frame = group, lane_of[group], np.maximum(frame + first_of[group], -1)
        y = scenes.road.lane_center(lane)
    return TrafficRows(label, lane, frame, t.x, y, compass(t.heading), t.length, t.width)


def check_on_network(sumo: Any, rows: TrafficRows, net: RoadNetwork) -> None:
    """Refuse traffic beyond the ends of the network.

    SUMO would accept such a vehicle, but no other vehicle would see it.

    Parameters
    ----------
    sumo : module
        As of :func:`idm_sumo.sumo.session.simulation`.
    rows : TrafficRows
    net : RoadNetwork

    Raises
    ------
    InputError
        Names the first such vehicle.
    """
    start, end = net.reach(sumo)
    if (outside := (rows.x < start) | (rows.x > end)).any():
        row = int(np.argmax(outside))
        raise InputError(
            f"vehicle {rows.label[row]}, frame {rows.frame[row]}: x = {rows.x[row]:.0f} m is off the network, "
            f"which goes from {start:.0f} to {end:.0f} m; check units (metres)"
        )


def inside_lane(road: Road, y: npt.ArrayLike, lane: npt.ArrayLike) -> Floats:
    """Return the lateral position in a lane nearest to ``y``.

    Parameters
    ----------
    road : Road
    y : array_like
        Lateral position (m).
    lane : array_like of int
        Main lane, 1 leftmost.

    Returns
    -------
    float64
        m.
    """
    center, half = road.lane_center(lane), 0.5 * road.lane_width(lane) - EDGE
    return np.asarray(np.clip(y, center - half, center + half))
