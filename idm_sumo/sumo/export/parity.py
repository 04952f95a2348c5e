"""Comparison of SUMO with our kernel, frame by frame.

Both drive an exported type behind the recorded leader.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration import integrators
from idm_sumo.calibration.problem import Problem, prepare
from idm_sumo.recordings import columns as c
from idm_sumo.scenes.windows import Scenes
from idm_sumo.sumo.export import run_recipe
from idm_sumo.sumo.export.native import drive_natively, drive_on_our_network
from idm_sumo.sumo.export.translation import sumo_parameters
from idm_sumo.sumo.export.vtypes import DriverType, type_element

Floats = npt.NDArray[np.float64]


def parity(
    drivers: pd.DataFrame,
    scenes: Scenes,
    *,
    integration: str = "euler",
    without_d1: str = "refit",
    desired_speed: float | None = None,
    on_our_network: bool = False,
) -> pd.DataFrame:
    """Compare SUMO with our kernel over drivers' windows.

    Parameters
    ----------
    drivers : pandas.DataFrame
        One row a window of ``scenes``, as given to :func:`~idm_sumo.sumo.export.routes.export_routes`.
    scenes : Scenes
    integration : {"euler", "ballistic"}
    without_d1 : {"refit", "linearised", "none", "exact"}
        As of :func:`~idm_sumo.sumo.export.routes.export_routes`. ``"exact"``: five parameters, the jam distance is
        set through libsumo every step.
    desired_speed : float, optional
        m/s; by default the road's speed limit.
    on_our_network : bool
        Drive on the road's network, one driver a main lane at a time, and not on straight roads, all at once.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, first_frame, largest_mm`` (the largest distance over the window),
        ``frame`` (of the window, where it is largest).

    Raises
    ------
    InputError
        If the drivers are impossible or SUMO does not insert one.
    """
    on = d.key_columns(drivers)
    named = drivers.assign(**{c.PERIOD: drivers[c.PERIOD].astype(str)})
    table = d.check_drivers(scenes.keys().merge(named, on=on, how="left", validate="1:1"))
    fitted = d.has_parameters(table)
    scenes, table = scenes.subset(fitted), table[fitted].reset_index(drop=True)
    problem = prepare(scenes, desired_speed=desired_speed)
    if without_d1 == "exact":
        run_recipe.check_integration(integration)
        theta = table[list(d.PARAMETERS)].to_numpy(dtype=np.float64)
    else:
        theta, _ = sumo_parameters(table, without_d1, problem.desired_speed, integration, "drivers")
    types = types_of(theta, problem, scenes.length, scenes.width)
    if on_our_network:
        native, _ = drive_on_our_network(
            problem, types, scenes.road, scenes.lane, integration=integration, d1=theta[:, 4]
        )
    else:
        native, _ = drive_natively(problem, types, integration=integration, d1=theta[:, 4])
    ours, _ = integrators.drive(problem, theta, integration)
    apart = np.abs(native - ours)
    worst = apart.argmax(axis=1)
    return scenes.keys().assign(largest_mm=1e3 * apart.max(axis=1), frame=worst + scenes.start)


def types_of(parameters: Floats, problem: Problem, length: Floats, width: Floats, **extra: str) -> list[Element]:
    """Return the exported ``<vType>`` of every driver.

    Parameters
    ----------
    parameters : float64, shape (n, 4) or (n, 5)
        ``a, b, T, d0`` first (SI units).
    problem : Problem
        It holds the desired speeds.
    length, width : float64, shape (n,)
        m.
    **extra : str
        Attributes that take precedence over the usual ones.

    Returns
    -------
    list of Element
    """
    types = []
    for i, (a, b, T, d0) in enumerate(np.asarray(parameters)[:, :4].tolist()):
        limit = float(problem.desired_speed[i])
        driver = DriverType(f"type{i}", a, b, T, d0, limit, float(length[i]), float(width[i]), 0)
        types.append(type_element(driver, None, **extra))
    return types
