"""Insertion of vehicles that wait at a closed loop's entrance."""

from __future__ import annotations

from typing import Any

import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.recordings import columns as c
from idm_sumo.sumo.closed_loop.demand import LANE_INDEX, POSITION
from idm_sumo.sumo.export.vtypes import number

PATIENCE = 1.0  # s a vehicle waits for a gap that is safe at its recorded speed


class Entrance:
    """Inserts waiting vehicles at their leader's speed.

    Where simulated traffic is slower at the entrance than the recorded one was, no gap is safe at the recorded
    speed, and waiting for one would leave the road empty.

    Parameters
    ----------
    demand : pandas.DataFrame
        As of :func:`idm_sumo.sumo.closed_loop.demand.demand_of`.
    """

    def __init__(self, demand: pd.DataFrame) -> None:
        columns = (demand[name].tolist() for name in (c.VEHICLE, d.DEPART, LANE_INDEX, POSITION))
        self._wanted = {str(vehicle): rest for vehicle, *rest in zip(*columns, strict=True)}
        self._readmitted: set[str] = set()

    def admit(self, sumo: Any, now: float) -> None:
        """Insert vehicles that have waited for ``PATIENCE``.

        Parameters
        ----------
        sumo : module
            As of :func:`idm_sumo.sumo.session.simulation`.
        now : float
            Time of the simulation (s).
        """
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
