"""From a row of a driver table to what a SUMO vehicle type can hold."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ElementTree, indent

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration import without_d1 as j
from idm_sumo.recordings import columns as c
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.export.vtypes import DriverType, identifier

Floats = npt.NDArray[np.float64]

JAM_DISTANCE = ("refit", "linearised", "none")


def with_parameters(drivers: pd.DataFrame, source: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the checked drivers that have parameters, and how many have none."""
    table = d.check_drivers(drivers, source=source)
    has = d.has_parameters(table)
    if not has.any():
        raise InputError(f"{source}: no driver has parameters; see its status column")
    note = (f"{(~has).sum()} drivers have no parameters (see their status) and are left out",) if not has.all() else ()
    return table[has].reset_index(drop=True), note


def desired_speeds(table: pd.DataFrame, desired_speed: float | None, road: Road, source: str) -> Floats:
    """Return the desired speed (m/s) of every driver: as given, of the table, or the road's limit."""
    given = table.get(d.DESIRED_SPEED, road.speed_limit) if desired_speed is None else desired_speed
    return checked_speeds(table, given, source)


def checked_speeds(table: pd.DataFrame, given: npt.ArrayLike, source: str) -> Floats:
    """Return given desired speeds (m/s), one a driver.

    Raises
    ------
    InputError
        If one is not positive; names the row.
    """
    speeds = np.broadcast_to(np.asarray(given, dtype=np.float64), (len(table),)).copy()
    if (bad := ~(np.isfinite(speeds) & (speeds > 0.0))).any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(f"{source}: row {row}: {d.DESIRED_SPEED} = {speeds[row]:g} is impossible; give a speed in m/s")
    return speeds


def sumo_parameters(
    table: pd.DataFrame, jam_distance: str, desired_speed: npt.ArrayLike, integration: str, source: str
) -> tuple[Floats, tuple[str, ...]]:
    """Return ``a, b, T, d0, 0`` of every driver, shape ``(n, 5)``, and what to know of them.

    Raises
    ------
    InputError
        If a driver's ``d1`` cannot be replaced in the way asked for, or the choice is unknown.
    """
    theta = table[list(d.PARAMETERS)].to_numpy(dtype=np.float64)
    if jam_distance == "exact":
        raise InputError(
            "jam_distance: 'exact' is no vehicle type, it is set every step; use " + ", ".join(JAM_DISTANCE)
        )
    if jam_distance not in JAM_DISTANCE:
        raise InputError(f"jam_distance: {jam_distance!r} is unknown; use one of {', '.join(JAM_DISTANCE)}")
    has_d1 = theta[:, 4] > 0.0
    if jam_distance == "none" or not has_d1.any():
        dropped = (f"d1 of {has_d1.sum()} drivers was dropped without a replacement",) if has_d1.any() else ()
        return theta * [1.0, 1.0, 1.0, 1.0, 0.0], dropped
    remedy = f"{source}: needs the column {{}}: add it with `idm-sumo calibrate`, or choose another --jam-distance"
    if jam_distance == "linearised":
        if j.MEAN_SPEED not in table:
            raise InputError(remedy.format(j.MEAN_SPEED))
        return j.linearise(theta, table[j.MEAN_SPEED], desired_speed), ()
    if missing := [name for name in j.REFIT if name not in table]:
        raise InputError(remedy.format(missing[0]))
    as_drivers = table.drop(columns=list(d.PARAMETERS)).rename(columns=dict(zip(j.REFIT, d.PARAMETERS, strict=False)))
    fitted = d.check_drivers(as_drivers.assign(d1=0.0), source=f"{source} (refit)")
    other = set(table.get(j.REFIT_INTEGRATION, pd.Series([integration]))) - {integration}
    notes = (f"refitted under {', '.join(sorted(other))}, exported for {integration}",) if other else ()
    return fitted[list(d.PARAMETERS)].to_numpy(dtype=np.float64), notes


def identifiers(table: pd.DataFrame) -> list[str]:
    """Return one name a row: period and vehicle, and the first frame where a vehicle has several windows."""
    several = table.duplicated([c.PERIOD, c.VEHICLE], keep=False)
    frames = table[d.FIRST_FRAME] if d.FIRST_FRAME in table else pd.Series("", index=table.index)
    return [
        identifier(period, vehicle, frame) if twice else identifier(period, vehicle)
        for period, vehicle, frame, twice in zip(table[c.PERIOD], table[c.VEHICLE], frames, several, strict=True)
    ]


def driver_type(row: Any, name: str, theta: Floats, maximum_speed: float, road: Road) -> DriverType:
    """Return the type of one driver; sizes are those the road assumes where the table has none."""
    length, width = row.get(d.LENGTH, road.car_length), row.get(d.WIDTH, road.car_width)
    kind = int(row.get(d.CLASS, 0))
    a, b, T, d0 = map(float, theta[:4])
    return DriverType(name, a, b, T, d0, maximum_speed, float(length), float(width), kind)


def save(root: Element, path: Path) -> None:
    """Write XML to be read by people too."""
    indent(root, space="    ")
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
