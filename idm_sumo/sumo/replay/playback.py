"""A whole recording in SUMO, as it was: every lane, every vehicle in its size, nobody modelled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import road
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.sumo.network import DESTINATIONS, OFF_RAMP, ON_RAMP, ORIGINS, recorded_lane, route
from idm_sumo.sumo.replay.stage import Stage, compass
from idm_sumo.sumo.session import simulation


class Played(NamedTuple):
    """What SUMO made of a recording.

    Attributes
    ----------
    vehicles, frames, rows : int
        How many were played; a row is a vehicle at a frame.
    largest_deviation : float
        m, between the recorded positions and those read back from SUMO.
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
    """Play one period of a recording in SUMO, auxiliary lane and ramps included.

    Parameters
    ----------
    recording : Recording
        One period; it needs not be cleaned.
    progress : Progress
        Told how many frames are done.

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
    table = recording.table.sort_values(c.FRAME, kind="stable", ignore_index=True)
    frame = table[c.FRAME].to_numpy()
    starts = np.flatnonzero(np.diff(frame, prepend=frame[0] - 1))
    names = table[c.VEHICLE].astype(str).tolist()
    wanted = table[[c.X, c.Y]].to_numpy(np.float64)
    angle = compass(table[c.HEADING])
    length, width = table[c.LENGTH].fillna(road.CAR_LENGTH), table[c.WIDTH].fillna(road.CAR_WIDTH)
    columns = [values.tolist() for values in (wanted[:, 0], wanted[:, 1], angle, length.to_numpy(), width.to_numpy())]
    returned, lane = np.empty_like(wanted), np.empty(len(table), dtype=np.int64)
    with simulation() as sumo:
        stage = Stage(sumo, as_points=False, routes=_routes(table))
        for done, (begin, end) in enumerate(zip(starts, [*starts[1:], len(table)], strict=True)):
            present = names[begin:end]
            stage.place(present, *(values[begin:end] for values in columns))
            sumo.simulationStep()
            returned[begin:end] = [sumo.vehicle.getPosition(name) for name in present]
            lane[begin:end] = [_lane_of(sumo, name) for name in present]
            progress("playing in SUMO", done + 1, len(starts))
    return Played(
        vehicles=table[c.VEHICLE].nunique(), frames=len(starts), rows=len(table),
        largest_deviation=float(np.abs(returned - wanted).max()), off_lane=int((lane == 0).sum()),
        other_lane=int(((lane != 0) & (lane != table[c.LANE].to_numpy())).sum()),
    )  # fmt: skip


def _routes(table: Any) -> dict[str, tuple[str, ...]]:
    """Return the routes of the vehicles that were seen on a ramp."""
    routes = {}
    for vehicle, lanes in table.groupby(c.VEHICLE)[c.LANE]:
        came, went = road.ON_RAMP_LANE in lanes.values, road.OFF_RAMP_LANE in lanes.values
        if came or went:
            routes[str(vehicle)] = route(ON_RAMP if came else ORIGINS[0], OFF_RAMP if went else DESTINATIONS[0])
    return routes


def _lane_of(sumo: Any, name: str) -> int:
    """Return the number of the lane, as NGSIM counts, that SUMO has a vehicle on; 0 for none."""
    edge, _, index = sumo.vehicle.getLaneID(name).rpartition("_")
    return recorded_lane(edge, int(index)) if edge else 0
