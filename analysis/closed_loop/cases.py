"""Populations of a closed loop, written as SUMO's inputs."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration.driver_table import read_drivers
from idm_sumo.calibration.place_speeds import PlaceSpeeds, place_speeds
from idm_sumo.calibration.whole import IDM
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.prediction.residual_drive import ResidualDrivers
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.sumo import network
from idm_sumo.sumo.closed_loop.demand import demand_of
from idm_sumo.sumo.closed_loop.extended_loop import ModelDrivers
from idm_sumo.sumo.closed_loop.populations import DEFAULTS, SUBLANE, calibrated_types, default_types
from idm_sumo.sumo.closed_loop.residual_loop import Residuals
from idm_sumo.sumo.closed_loop.run import RunFiles, write_run
from idm_sumo.sumo.closed_loop.signs import SpeedSign, boundary_signs, place_signs

from .populations import Drivers, mean_speed_of, parameters_for, refitted_for
from .settings import EXTENDED, LOOPS, OF_LAWS, RESIDUAL, Case, Settings

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Traffic:
    """What the populations of a closed loop have in common.

    Attributes
    ----------
    recorded : Recording
        One period, or a part of it.
    demand : pandas.DataFrame
        As of :func:`idm_sumo.sumo.closed_loop.demand.demand_of`.
    drivers : Drivers or None
    signs : list of SpeedSign
        Speeds that the road imposes.
    places : PlaceSpeeds or None
        Desired speeds by place.
    """

    recorded: Recording
    demand: pd.DataFrame
    drivers: Drivers | None
    signs: list[SpeedSign]
    places: PlaceSpeeds | None


def traffic_of(settings: Settings, recorded: Recording, drivers: Drivers | None) -> Traffic:
    """Return demand and road of a recording.

    Parameters
    ----------
    settings : Settings
    recorded : Recording
        One period, or a part of it, smoothed, with all its vehicles.
    drivers : Drivers or None
        Of the period.
    """
    demand = demand_of(recorded, approach=True)
    signs = boundary_signs(recorded) if settings.downstream_speed else []
    places = None
    if settings.place_speeds:
        typical = TEXTBOOK if drivers is None else drivers.pooled
        places = place_speeds(recorded, typical, np.array(network.of(recorded.road).mainline_ends()))
        signs += place_signs(places, recorded.road)
    return Traffic(recorded, demand, drivers, signs, places)


def types_of(traffic: Traffic, population: str, lane_change: dict[str, str]) -> tuple[list[Element], Floats, int]:
    """Return every vehicle's type.

    Parameters
    ----------
    traffic : Traffic
    population : str
    lane_change : dict of str to str
        Of :func:`idm_sumo.sumo.closed_loop.populations.lane_change_attributes`.

    Returns
    -------
    types : list of Element
    theta : float64, shape (vehicles, 5)
        ``a, b, T, d0, 0``; empty for SUMO's own types.
    pooled : int
        Vehicles that have the pooled parameters, for want of their own.
    """
    if population in DEFAULTS or traffic.drivers is None:
        return default_types(traffic.demand, population, lane_change), np.empty((0, 5)), 0
    law = OF_LAWS.get(population, IDM)
    own = "drivers" if population in (*LOOPS, RESIDUAL) else OF_LAWS.get(population, population)
    theta, limits, pooled = parameters_for(own, traffic.drivers, traffic.demand, mean_speed_of(traffic.recorded))
    limit = traffic.recorded.road.speed_limit
    types = calibrated_types(traffic.demand, theta, lane_change, limits, speed_limit=limit, law=law)
    return types, theta, pooled


def files_of(settings: Settings, traffic: Traffic, name: str, types: list[Element], folder: Path) -> RunFiles:
    """Write SUMO's inputs of a population.

    Parameters
    ----------
    settings : Settings
    traffic : Traffic
    name : str
        Of the files.
    types : list of Element
        Of :func:`types_of`.
    folder : Path
    """
    options = SUBLANE.get(settings.lane_change_model, ())
    return write_run(
        folder, name, traffic.recorded, traffic.demand, types,
        signs=traffic.signs, places=traffic.places, options=options,
    )  # fmt: skip


def cases_of(settings: Settings, traffic: Traffic, lane_change: dict[str, str], part: Path) -> list[Case]:
    """Write the inputs of every population; return its runs.

    Parameters
    ----------
    settings : Settings
    traffic : Traffic
    lane_change : dict of str to str
    part : Path
        Folder of the results.
    """
    cases = []
    for population in settings.types:
        types, theta, pooled = types_of(traffic, population, lane_change)
        ours = None
        if population in LOOPS and settings.model is not None:
            ours = _ours(settings.model, population, traffic, theta)
        if population == RESIDUAL and settings.drivers is not None:
            ours = _with_residuals(settings.drivers, traffic)
        files = files_of(settings, traffic, population, types, part / "simulation")
        seeds = [0] if settings.seeds == 1 else range(settings.seed, settings.seed + settings.seeds)
        cases += [Case(population, seed, files, pooled, deepcopy(ours)) for seed in seeds]
    return cases


def _ours(file: Path, population: str, traffic: Traffic, calibrated: Floats) -> ModelDrivers:
    """Return the drivers of a population of our own loop.

    They drive with a model's causes, or by its law without them: the same drivers, those that were refitted with the
    causes, so that the two populations differ in the causes alone.
    """
    model, demand, recorded = ExtendedModel.read(file), traffic.demand, traffic.recorded
    if population != EXTENDED:
        model = replace(model, causes=())
    theta, limits, has = refitted_for(model, file, demand, recorded.periods[0], calibrated)
    return ModelDrivers(model, demand, theta, recorded.road, limits, has, traffic.places)


def _with_residuals(file: Path, traffic: Traffic) -> ModelDrivers:
    """Return drivers with predicted residuals; those of whom there is none drive by the pooled IDM alone."""
    demand, road, period = traffic.demand, traffic.recorded.road, traffic.recorded.periods[0]
    table = read_drivers(file)
    known = demand[[c.VEHICLE]].assign(**{c.PERIOD: period})[list(d.KEYS)]
    known = known[known[c.VEHICLE].isin(table.loc[table[c.PERIOD].astype(str) == period, c.VEHICLE])]
    drivers = ResidualDrivers.of_table(table, known.reset_index(drop=True), str(file))
    row = pd.Index(known[c.VEHICLE]).get_indexer(pd.Index(demand[c.VEHICLE])).astype(np.int64)
    model = drivers.model
    theta = np.tile(np.asarray(model.pooled, dtype=np.float64), (len(demand), 1))
    plain = ExtendedModel(model.pooled, model.desired_speed)
    return ModelDrivers(plain, demand, theta, road, places=traffic.places, residuals=Residuals(drivers, row))
