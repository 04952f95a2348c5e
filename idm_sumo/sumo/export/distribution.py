"""Calibrated drivers as one ``vTypeDistribution`` for any network."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.roads import DEFAULT, Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.sumo.export.run_recipe import EULER, in_words
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
from idm_sumo.sumo.plain_paths import check_name

Floats = npt.NDArray[np.float64]

FASTEST = 70.0  # m/s, maxSpeed where the road's limit times the speed factor shall be the desired speed
NAME = "calibrated"
EVERY = "every"  # every driver with parameters; otherwise those that are well determined
DRIVERS = ("determined", EVERY)
MEDIANS = ("T", "d0")  # shown where the drivers that are kept may not stand for all


@dataclass(frozen=True)
class Distribution:
    """What was written.

    Attributes
    ----------
    file : Path
    types : int
        Vehicle types in it.
    drivers : int
        Drivers that they stand for.
    notes : tuple of str
        Who was left out and why, and what a reader should know besides.
    """

    file: Path
    types: int
    drivers: int
    notes: tuple[str, ...]


def export_distribution(
    drivers: pd.DataFrame,
    path: Path | str,
    *,
    which: str = DRIVERS[0],
    without_d1: str | None = None,
    representatives: int | None = None,
    name: str = NAME,
    seed: int = 0,
    road: Road = DEFAULT,
    source: str = "drivers",
) -> Distribution:
    """Write a ``vTypeDistribution`` that represents the population.

    The types are individual drivers, never averages: parameters of a driver belong together, and
    the mean of badly determined ones describes no driver. Drivers whose fit ended on a bound
    or without success are left out where the table says so, unless every driver is asked for;
    the result tells how many.

    Parameters
    ----------
    drivers : pandas.DataFrame
        With ``length_m, width_m, vehicle_class`` where known.
    path : Path or str
        An additional file, ``FILE.add.xml``.
    which : {"determined", "every"}
        Whether only well-determined drivers are taken, or every driver that has parameters.
    without_d1 : {"refit", "linearised", "none"}, optional
        As of :func:`idm_sumo.sumo.export.routes.export_routes`.
    representatives : int, optional
        So many drivers, the ones nearest to the centres of k-means over the standardised
        logarithms of ``a, b, T, d0``, with their clusters' shares as probabilities; by
        default every driver with the same probability, the empirical distribution.
    name : str
        The distribution's name, used as ``type="calibrated"`` of a vehicle or flow.
    seed : int
        Seed of k-means.
    road : Road, optional
        Where the drivers were recorded; its limit and assumed sizes stand in for missing columns.
    source : str
        How messages name the drivers.

    Returns
    -------
    Distribution

    Raises
    ------
    InputError
        If SUMO cannot read the file's name, the drivers are impossible, or fewer than ``representatives``.
    """
    check_name(Path(path))
    table, without = with_parameters(drivers, source)
    table, way, way_notes = chosen_without_d1(table, None, without_d1, EULER)
    speeds = desired_speeds(table, road, source)
    theta, notes = sumo_parameters(table, way, speeds, EULER, source)
    good = well_determined(table) if which != EVERY else np.ones(len(table), dtype=bool)
    left_out = _left_out(table, good)
    table, theta, factors = table[good].reset_index(drop=True), theta[good], speeds[good] / road.speed_limit
    if table.empty or (representatives is not None and not 1 <= representatives <= len(table)):
        raise InputError(
            f"{source}: {len(table)} well-determined drivers cannot give {representatives or 'any'} types"
            + "".join(f"; {note}" for note in left_out)
        )
    rows, shares = _represent(theta[:, :4], representatives, seed)
    root = Element("additional")
    step = in_words(EULER)
    root.append(Comment(f" {step.replace('--', '')} "))  # no double hyphen within a comment
    distribution = SubElement(root, "vTypeDistribution", id=identifier(name))
    # Names of their own: the same drivers may be in the route file, and SUMO refuses two types of one name.
    names = [identifier(name, own) for own in identifiers(table)]
    for row, share in zip(rows, shares, strict=True):
        driver = driver_type(table.iloc[row], names[row], theta[row], FASTEST, road)
        type_element(driver, distribution, probability=number(share), speedFactor=number(factors[row]))
    with new_file(path) as part:
        save(root, part)
    return Distribution(Path(path), len(rows), len(table), (*without, *left_out, *way_notes, *notes, step))


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


def _left_out(table: pd.DataFrame, good: npt.NDArray[np.bool_]) -> tuple[str, ...]:
    """Return how many drivers are not well determined.

    Why, and whether the others stand for them.
    """
    if good.all():
        return ()
    status = table[d.STATUS] if d.STATUS in table else pd.Series(d.OK, index=table.index)
    reasons = status.where(status != d.OK, "a parameter at its bound")[~good].value_counts()
    why = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
    names = [name for name in MEDIANS if name in table]
    kept = ", ".join(f"{name} {table.loc[good, name].median():.2f} (all: {table[name].median():.2f})" for name in names)
    medians = f"; medians of the others: {kept}" if good.any() and kept else ""
    return (
        f"{(~good).sum()} of {len(table)} drivers are left out ({why}){medians}; "
        '`--which every` (`which="every"`) takes all of them',
    )


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
