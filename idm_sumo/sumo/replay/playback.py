"""A whole recording in SUMO; no vehicle is modelled."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.sumo import network
from idm_sumo.sumo.network import RoadNetwork
from idm_sumo.sumo.replay.scene import SumoScene, compass
from idm_sumo.sumo.session import simulation


class Played(NamedTuple):
    """What SUMO returned of a recording.

    Attributes
    ----------
    vehicles, frames, rows : int
        How many were played; a row is a vehicle at a frame.
    largest_deviation : float
        Between the recorded positions and those read back from SUMO (m).
    off_lane : int
        Rows at which SUMO found the vehicle on no lane.
    other_lane : int
        Rows at which the lane SUMO assigned, by position, is not the labelled one.
    """

    vehicles: int
    frames: int
    rows: int
    largest_deviation: float
    off_lane: int
    other_lane: int


def play(recording: Recording, *, progress: Progress = silent) -> Played:
    """Play one period of a recording in SUMO, ramps included.

    Parameters
    ----------
    recording : Recording
        One period; it need not be cleaned.
    progress : Progress
        Called with the frames done and their total.

    Returns
    -------
    Played

    Raises
    ------
    InputError
        If there are several periods, or SUMO or the network cannot be loaded.
    """
    if len(recording.periods) > 1:
        some = ", ".join(recording.periods[:3])
        raise InputError(
            f"{recording.source or 'recording'}: periods {some} share vehicle numbers; play them one by one"
        )
    road = recording.road
    table = recording.table.sort_values(c.FRAME, kind="stable", ignore_index=True)
    frame = table[c.FRAME].to_numpy()
    starts = np.flatnonzero(np.diff(frame, prepend=frame[0] - 1))
    names = table[c.VEHICLE].astype(str).tolist()
    wanted = table[[c.X, c.Y]].to_numpy(np.float64)
    angle = compass(table[c.HEADING])
    length, width = table[c.LENGTH].fillna(road.car_length), table[c.WIDTH].fillna(road.car_width)
    columns = [values.tolist() for values in (wanted[:, 0], wanted[:, 1], angle, length.to_numpy(), width.to_numpy())]
    returned, lane = np.empty_like(wanted), np.empty(len(table), dtype=np.int64)
    net = network.of(road)
    lane_of = cache(net.recorded_lane)
    with simulation(net=net.file) as sumo:
        scene = SumoScene(sumo, net, as_points=False, routes=_routes(net, table))
        for done, (begin, end) in enumerate(zip(starts, [*starts[1:], len(table)], strict=True)):
            present = names[begin:end]
            scene.place(present, *(values[begin:end] for values in columns))
            sumo.simulationStep()
            returned[begin:end] = net.seen(sumo, present)
            lane[begin:end] = [_lane_of(sumo, name, lane_of) for name in present]
            progress("playing in SUMO", done + 1, len(starts))
    return Played(
        vehicles=table[c.VEHICLE].nunique(), frames=len(starts), rows=len(table),
        largest_deviation=float(np.abs(returned - wanted).max()), off_lane=int((lane == 0).sum()),
        other_lane=int(((lane != 0) & (lane != table[c.LANE].to_numpy())).sum()),
    )  # fmt: skip


def _routes(net: RoadNetwork, table: Any) -> dict[str, tuple[str, ...]]:
    """Return the routes of the vehicles seen on a ramp."""
    routes = {}
    on_ramp, off_ramp = ([ramp.number for ramp in ramps] for ramps in (net.road.on_ramps, net.road.off_ramps))
    for vehicle, lanes in table.groupby(c.VEHICLE)[c.LANE]:
        came, went = lanes.isin(on_ramp).any(), lanes.isin(off_ramp).any()
        if came or went:
            routes[str(vehicle)] = net.route(net.origins[int(came)], net.destinations[int(went)])
    return routes


def _lane_of(sumo: Any, name: str, lane_of: Callable[[str, int], int]) -> int:
    """Return the recording's number of a vehicle's lane in SUMO.

    It is 0 for a vehicle that is on no lane.
    """
    edge, _, index = sumo.vehicle.getLaneID(name).rpartition("_")
    return lane_of(edge, int(index)) if edge else 0
