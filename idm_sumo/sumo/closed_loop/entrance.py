"""Who waits at the entrance of a closed loop, and how it gets in."""

from __future__ import annotations

from typing import Any

import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.recordings import columns as c
from idm_sumo.sumo.closed_loop.demand import LANE_INDEX, POSITION
from idm_sumo.sumo.export.vtypes import number

PATIENCE = 1.0  # s a vehicle waits for a gap that is safe at its recorded speed


class Entrance:
    """Lets those in who could not enter at their recorded speed: as slow as the vehicle ahead of them.

    Where simulated traffic is slower at the entrance than the recorded one was, no gap is safe at the recorded
    speed, and waiting for one would starve the road.
    """

    def __init__(self, demand: pd.DataFrame) -> None:
        columns = (demand[name].tolist() for name in (c.VEHICLE, d.DEPART, LANE_INDEX, POSITION))
        self._wanted = {str(vehicle): rest for vehicle, *rest in zip(*columns, strict=True)}
        self._readmitted: set[str] = set()

    def admit(self, sumo: Any, now: float) -> None:
        """Look at who waits after a step."""
        for name in sumo.simulation.getPendingVehicles():
            if name in self._readmitted:
                continue
            depart, lane, position = self._wanted[name]
            if now - depart < PATIENCE:
                continue
            self._readmitted.add(name)
            route, kind = sumo.vehicle.getRouteID(name), sumo.vehicle.getTypeID(name)
            sumo.vehicle.remove(name)
            where = {"departLane": str(lane), "departPos": number(position)}
            sumo.vehicle.add(name, route, kind, depart="now", departSpeed="last", **where)
