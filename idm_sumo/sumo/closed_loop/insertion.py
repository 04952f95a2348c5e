"""Delays with which SUMO inserts exported vehicles.

A departure that finds no gap waits; the delay is reported.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import parse

import numpy as np
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.sumo import session

PATIENCE = 600.0  # s after the last departure; a vehicle that is not in by then counts as never inserted


def departure_delays(config: Path | str) -> pd.DataFrame:
    """Run an exported configuration and return its insertion delays.

    Parameters
    ----------
    config : Path or str
        A ``.sumocfg`` of :func:`idm_sumo.sumo.export.routes.export_routes`.

    Returns
    -------
    pandas.DataFrame
        ``id, depart_s`` (as asked for), ``delay_s`` (0 in time, infinite if never inserted), in
        the order of the file.

    Raises
    ------
    InputError
        If SUMO refuses the configuration.
    """
    path = Path(config)
    inputs = parse(path).getroot()
    named = {one.tag: one.attrib["value"] for one in inputs.iterfind("input/*")}
    net, routes = (path.parent / named[name] for name in ("net-file", "route-files"))
    asked = {
        vehicle.attrib["id"]: float(vehicle.attrib["depart"]) for vehicle in parse(routes).getroot().iter("vehicle")
    }
    delays = dict.fromkeys(asked, np.inf)
    with session.simulation(["--configuration-file", str(path), "--no-warnings", "true"], net=net) as sumo:
        for _ in range(int((max(asked.values(), default=0.0) + PATIENCE) / FRAME_STEP)):
            sumo.simulationStep()
            for name in sumo.simulation.getDepartedIDList():
                delays[name] = sumo.vehicle.getDepartDelay(name)
            if np.isfinite(list(delays.values())).all() or not sumo.simulation.getMinExpectedNumber():
                break
    return pd.DataFrame({"id": list(asked), d.DEPART: list(asked.values()), "delay_s": list(delays.values())})
