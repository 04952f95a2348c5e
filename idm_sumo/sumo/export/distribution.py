"""Calibrated drivers as one ``vTypeDistribution`` for any network."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.roads import DEFAULT, Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.sumo.export.run_recipe import EULER
from idm_sumo.sumo.export.translation import (
    chosen_without_d1,
    desired_speeds,
    driver_type,
    identifiers,
    save,
    sumo_parameters,
    with_parameters,
)
from idm_sumo.sumo.export.vtypes import identifier, number, type_element

Floats = npt.NDArray[np.float64]

FASTEST = 70.0  # m/s, maxSpeed where the road's limit alone shall be the desired speed
NAME = "calibrated"


def export_distribution(
    drivers: pd.DataFrame,
    path: Path | str,
    *,
    without_d1: str | None = None,
    representatives: int | None = None,
    name: str = NAME,
    maximum_speed: float = FASTEST,
    seed: int = 0,
    road: Road = DEFAULT,
    source: str = "drivers",
) -> Path:
    """Write a ``vTypeDistribution`` that represents the population.

    The types are individual drivers, never averages: parameters of a driver belong together, and
    the mean of badly determined ones describes no driver. Drivers whose fit ended on a bound
    or without success are left out where the table says so.

    Parameters
    ----------
    drivers : pandas.DataFrame
        With ``length_m, width_m, vehicle_class`` where known.
    path : Path or str
        An additional file, ``FILE.add.xml``.
    without_d1 : {"refit", "linearised", "none"}, optional
        As of :func:`idm_sumo.sumo.export.routes.export_routes`.
    representatives : int, optional
        So many drivers, the ones nearest to the centres of k-means over the standardised
        logarithms of ``a, b, T, d0``, with their clusters' shares as probabilities; by
        default every driver with the same probability, the empirical distribution.
    name : str
        The distribution's name, used as ``type="calibrated"`` of a vehicle or flow.
    maximum_speed : float
        m/s. By default so high that the desired speed is the lane's limit, as in the calibration.
    seed : int
        Seed of k-means.
    road : Road, optional
        Where the drivers were recorded; its limit and assumed sizes stand in for missing columns.
    source : str
        How messages name the drivers.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the drivers are impossible, or fewer than ``representatives``.
    """
    table, _ = with_parameters(drivers, source)
    table, way, _ = chosen_without_d1(table, None, without_d1, EULER)
    theta, _ = sumo_parameters(table, way, desired_speeds(table, None, road, source), EULER, source)
    good = well_determined(table)
    table, theta = table[good].reset_index(drop=True), theta[good]
    if table.empty or (representatives is not None and not 1 <= representatives <= len(table)):
        raise InputError(f"{source}: {len(table)} well-determined drivers cannot give {representatives or 'any'} types")
    rows, shares = _represent(theta[:, :4], representatives, seed)
    root = Element("additional")
    distribution = SubElement(root, "vTypeDistribution", id=identifier(name))
    # Names of their own: the same drivers may be in the route file, and SUMO refuses two types of one name.
    names = [identifier(name, own) for own in identifiers(table)]
    for row, share in zip(rows, shares, strict=True):
        driver = driver_type(table.iloc[row], names[row], theta[row], maximum_speed, road)
        type_element(driver, distribution, probability=number(share))
    with new_file(path) as part:
        save(root, part)
    return Path(path)


def well_determined(table: pd.DataFrame) -> npt.NDArray[np.bool_]:
    """Return which fits succeeded inside the bounds.

    Parameters
    ----------
    table : pandas.DataFrame
        Drivers; ``status`` and ``at_bound`` are looked at where the table has them.

    Returns
    -------
    bool, shape (drivers,)
    """
    good = np.ones(len(table), dtype=bool)
    if d.STATUS in table:
        good &= (table[d.STATUS] == d.OK).to_numpy()
    if "at_bound" in table:
        good &= table["at_bound"].map(_is_empty).to_numpy(dtype=bool)
    return good


def _is_empty(value: Any) -> bool:
    """Whether ``at_bound`` names no parameter."""
    return value is None or value != value or str(value).strip() in ("", "False", "0", "[]")


def _represent(values: Floats, representatives: int | None, seed: int) -> tuple[list[int], list[float]]:
    """Return rows that stand for all, and their shares."""
    if representatives is None or representatives == len(values):
        return list(range(len(values))), [1.0 / len(values)] * len(values)
    from sklearn.cluster import KMeans

    logs = np.log(values)
    spread = logs.std(axis=0)
    logs = (logs - logs.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    clusters = KMeans(representatives, n_init=10, random_state=seed).fit(logs)
    distance = clusters.transform(logs)
    distance[np.arange(len(logs)), clusters.labels_] -= 1e9  # only members represent a cluster
    rows = [int(row) for row in np.argmin(distance, axis=0)]
    return rows, [float(np.mean(clusters.labels_ == cluster)) for cluster in range(representatives)]
