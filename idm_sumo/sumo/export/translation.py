"""From driver table rows to what SUMO vehicle types hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ElementTree, indent

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration import without_d1 as w
from idm_sumo.recordings import columns as c
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes
from idm_sumo.sumo.export.vtypes import DriverType, identifier

Floats = npt.NDArray[np.float64]

WITHOUT_D1 = ("refit", "linearised", "none")
# SUMO's schema of each file by its root. Without the attributes `--xml-validation always` refuses additional files.
SCHEMAS = {
    "routes": "routes_file.xsd", "additional": "additional_file.xsd", "sumoConfiguration": "sumoConfiguration.xsd",
}  # fmt: skip
XSI = "http://www.w3.org/2001/XMLSchema-instance"


def with_parameters(drivers: pd.DataFrame, source: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the checked drivers that have parameters.

    Parameters
    ----------
    drivers : pandas.DataFrame
        See :func:`idm_sumo.calibration.driver_table.check_drivers`.
    source : str
        How messages name the drivers.

    Returns
    -------
    table : pandas.DataFrame
    notes : tuple of str
        How many drivers were left out.

    Raises
    ------
    InputError
        If the drivers are impossible or none has parameters.
    """
    table = d.check_drivers(drivers, source=source)
    has = d.has_parameters(table)
    if not has.any():
        raise InputError(f"{source}: no driver has parameters; see its status column")
    note = (f"{(~has).sum()} drivers have no parameters (see their status) and are left out",) if not has.all() else ()
    return table[has].reset_index(drop=True), note


def desired_speeds(table: pd.DataFrame, road: Road, source: str) -> Floats:
    """Return every driver's desired speed.

    Parameters
    ----------
    table : pandas.DataFrame
        Drivers; their column ``desired_speed_m_s`` counts, if there is one.
    road : Road
        Its speed limit is everybody's without that column.
    source : str
        How messages name the drivers.

    Returns
    -------
    float64, shape (drivers,)
        m/s.

    Raises
    ------
    InputError
        If one is not positive; names the row.
    """
    return checked_speeds(table, table.get(d.DESIRED_SPEED, road.speed_limit), source)


def checked_speeds(table: pd.DataFrame, given: npt.ArrayLike, source: str) -> Floats:
    """Return given desired speeds, one a driver.

    Parameters
    ----------
    table : pandas.DataFrame
        Drivers.
    given : array_like, shape (drivers,) or ()
        m/s.
    source : str
        How messages name the drivers.

    Returns
    -------
    float64, shape (drivers,)
        m/s.

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


def chosen_without_d1(
    table: pd.DataFrame, source: object, without_d1: str | None, integration: str
) -> tuple[pd.DataFrame, str, tuple[str, ...]]:
    """Decide what stands for ``d1`` where nobody says it.

    Parameters
    ----------
    table : pandas.DataFrame
        Drivers with parameters.
    source : object
        Scenes of the calibration, or a list of them, from which a refit is made; anything else cannot tell.
    without_d1 : str or None
        As asked for.
    integration : str
        Of the refit.

    Returns
    -------
    drivers : pandas.DataFrame
        With the columns of the refit if there is one.
    without_d1 : str
    notes : tuple of str
    """
    if set(w.REFIT) <= set(table) or without_d1 not in (None, "refit"):
        return table, without_d1 or "refit", ()
    parts = [source] if isinstance(source, Scenes) else source
    if isinstance(parts, Sequence) and parts and all(isinstance(part, Scenes) for part in parts):
        return _refitted(table, parts, integration), "refit", ()
    if without_d1 is not None or w.MEAN_SPEED not in table:
        return table, "refit", ()  # whose columns are missing then
    note = "d1, which SUMO lacks, is linearised at each driver's mean speed; give the calibration's scenes to refit it"
    return table, "linearised", (note,) if (table["d1"] > 0.0).any() else ()


def _refitted(table: pd.DataFrame, parts: Sequence[Scenes], integration: str) -> pd.DataFrame:
    """Return the drivers with a refit to their windows."""
    on = d.key_columns(table)
    keys = pd.MultiIndex.from_frame(table[on])
    some = [part.subset(np.asarray(pd.MultiIndex.from_frame(part.keys()[on]).isin(keys))) for part in parts]
    refits = w.refit_table(table, [part for part in some if len(part)], integration=integration)
    new = [name for name in refits if name not in table]
    return table.merge(refits[[*on, *new]], on=on, how="left", validate="1:1")


def sumo_parameters(
    table: pd.DataFrame, without_d1: str, desired_speed: npt.ArrayLike, integration: str, source: str
) -> tuple[Floats, tuple[str, ...]]:
    """Return every driver's IDM parameters without ``d1``.

    Parameters
    ----------
    table : pandas.DataFrame
        Drivers.
    without_d1 : {"refit", "linearised", "none"}
        What stands for ``d1``, as of :func:`idm_sumo.sumo.export.routes.export_routes`.
    desired_speed : array_like, shape (drivers,) or ()
        m/s.
    integration : {"euler", "ballistic"}
        What the types are exported for; a note says if they were refitted for another one.
    source : str
        How messages name the drivers.

    Returns
    -------
    theta : float64, shape (drivers, 5)
        ``a, b, T, d0, 0`` (SI units).
    notes : tuple of str
        What a reader should know of them.

    Raises
    ------
    InputError
        If a driver's ``d1`` cannot be replaced in the way asked for, or the choice is unknown.
    """
    theta = table[list(d.PARAMETERS)].to_numpy(dtype=np.float64)
    if without_d1 == "exact":
        raise InputError("without_d1: 'exact' is no vehicle type, it is set every step; use " + ", ".join(WITHOUT_D1))
    if without_d1 not in WITHOUT_D1:
        raise InputError(f"without_d1: {without_d1!r} is unknown; use one of {', '.join(WITHOUT_D1)}")
    has_d1 = theta[:, 4] > 0.0
    if without_d1 == "none" or not has_d1.any():
        dropped = (f"d1 of {has_d1.sum()} drivers was dropped without a replacement",) if has_d1.any() else ()
        return theta * [1.0, 1.0, 1.0, 1.0, 0.0], dropped
    remedy = f"{source}: needs the column {{}}: add it with `idm-sumo calibrate`, or choose another --without-d1"
    if without_d1 == "linearised":
        if w.MEAN_SPEED not in table:
            raise InputError(remedy.format(w.MEAN_SPEED))
        return w.linearise(theta, table[w.MEAN_SPEED], desired_speed), ()
    if missing := [name for name in w.REFIT if name not in table]:
        raise InputError(remedy.format(missing[0]))
    as_drivers = table.drop(columns=list(d.PARAMETERS)).rename(columns=dict(zip(w.REFIT, d.PARAMETERS, strict=False)))
    fitted = d.check_drivers(as_drivers.assign(d1=0.0), source=f"{source} (refit)")
    other = set(table.get(w.REFIT_INTEGRATION, pd.Series([integration]))) - {integration}
    notes = (f"refitted under {', '.join(sorted(other))}, exported for {integration}",) if other else ()
    return fitted[list(d.PARAMETERS)].to_numpy(dtype=np.float64), notes


def identifiers(table: pd.DataFrame) -> list[str]:
    """Return one name a row: period and vehicle.

    The first frame is added where a vehicle has several windows.

    Parameters
    ----------
    table : pandas.DataFrame
        Drivers.

    Returns
    -------
    list of str
    """
    several = table.duplicated([c.PERIOD, c.VEHICLE], keep=False)
    frames = table[d.FIRST_FRAME] if d.FIRST_FRAME in table else pd.Series("", index=table.index)
    return [
        identifier(period, vehicle, frame) if twice else identifier(period, vehicle)
        for period, vehicle, frame, twice in zip(table[c.PERIOD], table[c.VEHICLE], frames, several, strict=True)
    ]


def driver_type(row: Any, name: str, theta: Floats, maximum_speed: float, road: Road) -> DriverType:
    """Return the type of one driver.

    Parameters
    ----------
    row : pandas.Series
        Of the driver table; its sizes are used where it has them.
    name : str
        Name of the type.
    theta : float64, shape (5,)
        ``a, b, T, d0, 0`` (SI units).
    maximum_speed : float
        m/s.
    road : Road
        Its assumed sizes are used otherwise.

    Returns
    -------
    DriverType
    """
    length, width = row.get(d.LENGTH, road.car_length), row.get(d.WIDTH, road.car_width)
    kind = int(row.get(d.CLASS, 0))
    a, b, T, d0 = map(float, theta[:4])
    return DriverType(name, a, b, T, d0, maximum_speed, float(length), float(width), kind)


def save(root: Element, path: Path) -> None:
    """Write XML with indentation and SUMO's schema.

    Parameters
    ----------
    root : Element
        It gains the attributes that name its schema.
    path : Path
        File to write.
    """
    root.set("xmlns:xsi", XSI)
    root.set("xsi:noNamespaceSchemaLocation", f"http://sumo.dlr.de/xsd/{SCHEMAS[root.tag]}")
    indent(root, space="    ")
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
