"""Calibrated drivers as SUMO vehicle types, routes and configuration."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration.departures import DESTINATION, THROUGH
from idm_sumo.calibration.departures import departures as departures_of
from idm_sumo.calibration.whole import IDM
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import DEFAULT, Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_files
from idm_sumo.scenes.windows import Scenes
from idm_sumo.sumo import network
from idm_sumo.sumo.export import run_recipe
from idm_sumo.sumo.export.companions import Companions
from idm_sumo.sumo.export.extended_types import Expressed, express
from idm_sumo.sumo.export.net_file import checked_net
from idm_sumo.sumo.export.translation import (
    chosen_without_d1,
    desired_speeds,
    driver_type,
    identifiers,
    save,
    sumo_parameters,
    with_parameters,
)
from idm_sumo.sumo.export.vtypes import number, type_element
from idm_sumo.sumo.network import RoadNetwork
from idm_sumo.sumo.plain_paths import check_name

Floats = npt.NDArray[np.float64]

# m/s: at maxSpeed itself SUMO's check of the lane ahead refuses a departure, by a rounding error.
BELOW_MAXIMUM = 0.01
BETWEEN_PERIODS = 60.0  # s, where labels do not tell when the next period begins


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes
    ----------
    route_file, config_file, net_file : Path
    vehicles : pandas.DataFrame
        ``period, vehicle, id, depart_s`` (s of the simulation), in the order of the file.
    notes : tuple of str
        What a reader should know of it.
    """

    route_file: Path
    config_file: Path
    net_file: Path
    vehicles: pd.DataFrame
    notes: tuple[str, ...]


def export_routes(
    drivers: pd.DataFrame,
    path: Path | str,
    *,
    departures: pd.DataFrame | Recording | Scenes | Sequence[Scenes] | None = None,
    without_d1: str | None = None,
    integration: str = "euler",
    net_file: Path | str | None = None,
    model: ExtendedModel | None = None,
    law: str = IDM,
    road: Road = DEFAULT,
    source: str = "drivers",
) -> Exported:
    """Write vehicle types, vehicles, configuration and network.

    One vehicle type a driver with its vehicle, the ``.sumocfg`` that runs them, and a copy of the network.

    Parameters
    ----------
    drivers : pandas.DataFrame
        See :func:`idm_sumo.calibration.driver_table.check_drivers`. Their desired speed is the column
        ``desired_speed_m_s``, without one the speed limit.
    path : Path or str
        ``FILE.rou.xml``; beside it ``FILE.sumocfg`` and ``FILE.net.xml`` are written.
    departures : pandas.DataFrame, Recording, Scenes or sequence of Scenes, optional
        When, where and as what the drivers enter (:mod:`idm_sumo.calibration.departures`); by default
        the drivers' own columns.
    without_d1 : {"refit", "linearised", "none"}, optional
        What stands for ``d1``, which SUMO's IDM lacks: the columns of
        :func:`idm_sumo.calibration.without_d1.refit_table`, made here where ``departures`` are the scenes of the
        calibration; the tangent at ``mean_speed_m_s``; nothing. By default the refit where it is there or can be
        made, else the tangent, and a note says so.
    integration : {"euler", "ballistic"}
        What the configuration asks of SUMO.
    net_file : Path or str, optional
        Another build of the road's network, say with another speed limit; by default the one in the package.
    model : ExtendedModel, optional
        Effects beyond the IDM. Those that SUMO's types can hold go into them
        (:mod:`idm_sumo.sumo.export.extended_types`); notes and a comment in the file name the others.
    law : {"idm", "krauss", "eidm"}
        SUMO's model that the parameters are of (:func:`idm_sumo.calibration.parameter_sets.with_law`).
    road : Road, optional
        Road that the drivers enter; its network takes them.
    source : str
        How messages name the drivers.

    Returns
    -------
    Exported

    Raises
    ------
    InputError
        If SUMO cannot read the file's name, a driver or a departure is impossible, a vehicle has no lane on the
        network, the network is missing or its limit below the desired speed. Then nothing is written.
    """
    run_recipe.check_integration(integration)
    check_name(Path(path))
    table, fit_notes = with_parameters(drivers, source)
    table = table.assign(**{d.DESIRED_SPEED: desired_speeds(table, road, source)})
    net = network.of(road)
    net_path = checked_net(net, net_file, float(table[d.DESIRED_SPEED].max()))
    table = _with_departures(table, departures, source)
    table, way, way_notes = chosen_without_d1(table, departures, without_d1, integration)
    theta, notes = sumo_parameters(table, way, table[d.DESIRED_SPEED].to_numpy(), integration, source)
    table, speed_notes = _not_above(table)
    table = table.assign(depart=_simulation_times(table), id=identifiers(table), **_places(net, table, source))
    order = np.lexsort((table["id"], table["depart"]))
    if model is None:
        model = ExtendedModel(TEXTBOOK, float(table[d.DESIRED_SPEED].max()))
    held = express(model, table, theta, table[d.DESIRED_SPEED].to_numpy(dtype=np.float64))
    root = _routes(net, table.iloc[order], held.of(order), law)
    files = _write(Path(path), root, net_path, integration)
    vehicles = table.iloc[order][[c.PERIOD, c.VEHICLE, "id", "depart"]].rename(columns={"depart": d.DEPART})
    return Exported(*files, vehicles.reset_index(drop=True), fit_notes + way_notes + notes + speed_notes + held.notes)


def _with_departures(table: pd.DataFrame, departures: Any, source: str) -> pd.DataFrame:
    """Return the drivers with the columns of their departures."""
    if departures is None:
        return d.check_departures(table, source=source)
    entries = departures if isinstance(departures, pd.DataFrame) else departures_of(departures)
    entries = d.check_departures(entries.assign(period=entries[c.PERIOD].astype(str)), source=f"{source} (departures)")
    on = [name for name in d.key_columns(table) if name in entries]
    if isinstance(departures, Recording):  # a recording's first frame is not the window's
        on = [c.PERIOD, c.VEHICLE]
    names = [name for name in (*d.DEPARTURE, DESTINATION) if name in entries]
    merged = table.drop(columns=names, errors="ignore").merge(entries[[*on, *names]], on=on, how="left", validate="m:1")
    if (absent := merged[d.DEPART].isna()).any():
        row = merged[absent].iloc[0]
        raise InputError(
            f"{source}: vehicle {row[c.VEHICLE]} of period {row[c.PERIOD]} has no departure; "
            "leave it out, or give the recording it is in"
        )
    return d.check_departures(merged, source=source)


def _not_above(table: pd.DataFrame) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the table with departures below the types' maximum speed.

    SUMO would refuse the whole file for a faster departure.
    """
    slower = table[d.SPEED].clip(upper=table[d.DESIRED_SPEED] - BELOW_MAXIMUM)
    count = int((table[d.SPEED] > slower).sum())
    note = (f"{count} vehicles depart just below their maxSpeed, not as fast as recorded",) if count else ()
    return table.assign(**{d.SPEED: slower}), note


def _simulation_times(table: pd.DataFrame) -> Floats:
    """Return departures (s) in one simulation.

    The periods follow in their order; the first vehicle departs at 0.
    """
    times, shift, end = table[d.DEPART].to_numpy(dtype=np.float64).copy(), None, 0.0
    opening: float | None = None
    for period in sorted(table[c.PERIOD].unique()):
        here, clock = (table[c.PERIOD] == period).to_numpy(), _opening(period)
        if shift is None:
            shift = -times[here].min()
        elif opening is not None and clock is not None:
            shift += clock - opening
        else:
            shift = end + BETWEEN_PERIODS - times[here].min()
        opening = clock
        times[here] += shift
        end = times[here].max()
    return np.asarray(np.round(np.maximum(times, 0.0), 3))


def _opening(period: str) -> float | None:
    """Return when a period begins (s after midnight), if known.

    Labels such as ``0750-0805`` tell it.
    """
    start = period.split("-")[0]
    return 3600.0 * int(start[:2]) + 60.0 * int(start[2:]) if len(start) == 4 and start.isdigit() else None


def _places(net: RoadNetwork, table: pd.DataFrame, source: str) -> dict[str, Any]:
    """Return edge, lane and position of the departures.

    Raises
    ------
    InputError
        Names the first vehicle that has no place on the network.
    """
    for row in table[[c.PERIOD, c.VEHICLE, d.X, d.LANE]].itertuples(index=False):
        try:
            net.place([row[2]], [row[3]])
        except InputError as error:
            raise InputError(f"{source}: vehicle {row[1]} of period {row[0]} has no lane: {error}") from None
    where = net.place(table[d.X].to_numpy(), table[d.LANE].to_numpy())
    return {"edge": where.edge, "lane_index": where.lane_index, "position": where.position}


def _routes(net: RoadNetwork, table: pd.DataFrame, held: Expressed, law: str) -> Element:
    """Return ``<routes>``: routes, types, vehicles by departure."""
    root = Element("routes")
    for note in held.notes:
        root.append(Comment(f" {note.replace('--', '- -')} "))  # no double hyphen within a comment
    ends = table[DESTINATION] if DESTINATION in table else pd.Series(THROUGH, index=table.index)
    if net.layout.off_ramp:
        ends = ends.where(table["edge"] != net.layout.off_ramp, net.layout.off_ramp)
    else:
        ends = pd.Series(net.destinations[0], index=table.index)
    names = {way: f"{way[0]}.to.{way[1]}" for way in dict.fromkeys(zip(table["edge"], ends, strict=True))}
    for way, name in names.items():
        SubElement(root, "route", id=name, edges=" ".join(net.route(str(way[0]), str(way[1]))))
    rows = [row for _, row in table.iterrows()]
    for row, values, fastest, extra in zip(rows, held.theta, held.maximum_speed.tolist(), held.extra, strict=True):
        type_element(driver_type(row, row["id"], values, fastest, net.road), root, law=law, **extra)
    for row, end in zip(rows, ends, strict=True):
        SubElement(
            root, "vehicle", id=row["id"], type=row["id"], route=names[row["edge"], end], depart=number(row["depart"]),
            departLane=str(row["lane_index"]), departPos=number(row["position"]), departSpeed=number(row[d.SPEED]),
            arrivalLane="current", arrivalSpeed="current",
        )  # fmt: skip
    return root


def _write(target: Path, root: Element, net: Path, integration: str) -> tuple[Path, Path, Path]:
    """Write routes, configuration and network: all or none."""
    beside = Companions.of(target, net)
    beside.refuse_others()
    copied = [] if beside.net_is_there else [beside.net]
    with new_files([target, beside.config, *copied]) as (routes, config, *copy):
        save(root, routes)
        save(run_recipe.configuration(beside.net.name, target.name, integration), config)
        beside.sign(config)
        for part in copy:
            shutil.copyfile(net, part)
    return target, beside.config, beside.net
