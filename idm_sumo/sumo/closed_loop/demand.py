"""Recorded demand of a closed loop: departures and destinations.

Files are plain SUMO inputs, so that a run can be repeated with ``sumo`` or watched in ``sumo-gui``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration.departures import DESTINATION, LEAVING, THROUGH, departures
from idm_sumo.calibration.place_speeds import PlaceSpeeds
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo import network
from idm_sumo.sumo.closed_loop.approach import moved_upstream
from idm_sumo.sumo.export.translation import save
from idm_sumo.sumo.export.vtypes import number
from idm_sumo.sumo.network import Place, RoadNetwork

LATEST = 2.0  # s, more than a vehicle waits before it is let in at its leader's speed
FOLLOWS = 10.0  # s after the one before it in its lane; a vehicle that departs later has nobody to follow
SAFE = "collision leaderGap followerGap"  # what an insertion is checked for
EDGE, LANE_INDEX, POSITION = "edge", "lane_index", "position"


def demand_of(recording: Recording, *, approach: bool = False) -> pd.DataFrame:
    """Return the demand of one period, by departure.

    Parameters
    ----------
    recording : Recording
        One period with all its vehicles.
    approach : bool
        Whether later vehicles depart upstream of where they were recorded (:mod:`idm_sumo.sumo.closed_loop.approach`).

    Returns
    -------
    pandas.DataFrame
        Columns of :func:`idm_sumo.calibration.departures.departures`, with ``depart_s`` counted from the recording's
        first frame, and SUMO's ``edge, lane_index, position`` (m). Vehicles that are on the road in the first frame
        depart where they are.

    Raises
    ------
    InputError
        If the recording holds several periods or a few of the vehicles only, or a vehicle has no lane on the network.
    """
    if len(recording.periods) != 1:
        raise InputError(
            f"{recording.source}: a closed loop runs one period; "
            f"choose one of {', '.join(recording.periods)} with --period"
        )
    if not recording.has_leader_rows:
        raise InputError(
            f"{recording.source}: holds a few of the vehicles only, which is no demand; "
            "a closed loop needs all of them (give an official period, or `surrogate`)"
        )
    table = departures(recording).sort_values([d.DEPART, c.VEHICLE], kind="stable", ignore_index=True)
    table[d.DEPART] = np.round(table[d.DEPART] - table[d.DEPART].min(), 1)
    net = network.of(recording.road)
    if approach:
        table = moved_upstream(table, net)
    where = _places(net, table, recording.source)
    table = table.assign(**{EDGE: where.edge, LANE_INDEX: where.lane_index, POSITION: where.position})
    if not net.layout.off_ramp:
        return table.assign(**{DESTINATION: net.destinations[0]})
    on_ramp, off_ramp, weave = net.layout.on_ramp, net.layout.off_ramp, net.mainline.index(net.layout.weave)
    upstream = table[EDGE].isin((*net.mainline[: weave + 1], on_ramp, off_ramp))
    leaving = (table[EDGE] == off_ramp) | (upstream & (table[DESTINATION] == LEAVING))
    return table.assign(**{DESTINATION: np.where(leaving, LEAVING, THROUGH)})


def _places(net: RoadNetwork, table: pd.DataFrame, source: str) -> Place:
    """Return where the vehicles depart.

    The message of a failure names the first such vehicle.
    """
    try:
        return net.place(table[d.X].to_numpy(), table[d.LANE].to_numpy())
    except InputError:
        for vehicle, x, lane in zip(table[c.VEHICLE], table[d.X], table[d.LANE], strict=True):
            try:
                net.place([x], [lane])
            except InputError as error:
                raise InputError(f"{source}: vehicle {vehicle} has no lane on the network: {error}") from None
        raise


def write_routes(
    road: Road, demand: pd.DataFrame, types: Sequence[Element], path: Path, places: PlaceSpeeds | None = None
) -> None:
    """Write vehicle types, routes and vehicles.

    A vehicle that is on the road in the first frame is put there without a check of its gap. Later vehicles are
    inserted at their place as soon as their model finds the gap safe: at the speed of the vehicle ahead if they follow
    one, else at the recorded speed. Where simulated traffic is slower than the recorded one was, no gap would be safe
    at the recorded speed, and waiting for one would leave the road empty.

    Parameters
    ----------
    road : Road
    demand : pandas.DataFrame
        As of :func:`demand_of`.
    types : sequence of Element
        The ``<vType>`` of each vehicle, in the order of the demand.
    path : Path
        File to write.
    places : PlaceSpeeds, optional
        Speeds that no vehicle departs above.
    """
    root, net = Element("routes"), network.of(road)
    ways = list(zip(demand[EDGE], demand[DESTINATION], strict=True))
    for origin, destination in dict.fromkeys(ways):
        SubElement(root, "route", id=f"{origin}.to.{destination}", edges=" ".join(net.route(origin, destination)))
    demand = demand.assign(**{d.SPEED: _allowed(demand, road, places)})
    follows = demand.groupby([EDGE, LANE_INDEX])[d.DEPART].diff().le(FOLLOWS).to_numpy() & (demand[d.DEPART] > 0.0)
    names = (c.VEHICLE, d.DEPART, LANE_INDEX, POSITION, d.SPEED)
    rows = zip(*(demand[name].tolist() for name in names), strict=True)
    for row, kind, (origin, destination), behind in zip(rows, types, ways, follows, strict=True):
        vehicle, depart, lane, position, speed = row
        root.append(kind)
        limit = float(kind.get("maxSpeed", road.speed_limit))
        SubElement(
            root, "vehicle", id=str(vehicle), type=str(kind.get("id")), route=f"{origin}.to.{destination}",
            depart=number(depart), departLane=str(lane), departPos=number(position),
            departSpeed="last" if behind else number(min(speed, limit)), insertionChecks=SAFE if depart else "none",
        )  # fmt: skip
    save(root, path)


def _allowed(demand: pd.DataFrame, road: Road, places: PlaceSpeeds | None) -> npt.NDArray[np.float64]:
    """Return departure speeds (m/s) that SUMO accepts."""
    speed = np.asarray(demand[d.SPEED].clip(upper=road.speed_limit), dtype=np.float64)
    if places is None:
        return speed
    x, depart = demand[d.X].to_numpy(dtype=np.float64), demand[d.DEPART].to_numpy(dtype=np.float64)
    then = np.minimum(places.at(x, depart), places.at(x, depart + LATEST))
    return np.asarray(np.minimum(speed, np.floor(1000.0 * then) / 1000.0))  # signs have three decimals
