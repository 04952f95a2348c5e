"""Calibration of each driver over all of its windows together.

Ten seconds give back those seconds, not the driver: another set of parameters would drive them nearly as well. All
windows of a driver together leave fewer such sets, so vehicle types for traffic that reacts are made of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import integrators, status
from idm_sumo.calibration.chunks import CHUNK, with_needed_traffic
from idm_sumo.calibration.identifiability import at_bound, names_of
from idm_sumo.calibration.pooled import pooled
from idm_sumo.calibration.problem import prepare
from idm_sumo.calibration.status import OK
from idm_sumo.calibration.table import full_ade
from idm_sumo.calibration.type_fit import fit_types
from idm_sumo.calibration.without_d1 import (
    MEAN_SPEED,
    REFIT,
    REFIT_INTEGRATION,
    linearise,
    mean_speeds,
)
from idm_sumo.models import idm
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import DESIRED_SPEED, PARAMETERS

Integers = npt.NDArray[np.int64]

WHOLE = ("a_whole", "b_whole", "T_whole", "d0_whole")  # fitted to all windows with d1 = 0, as SUMO drives
WHOLE_ADE = "whole_ade_m"  # mean over those windows, under SUMO's integration
WINDOWS = "windows"  # column: how many windows of the driver its parameters were fitted to
INTEGRATION = "euler"  # SUMO's default
IDM, KRAUSS, EIDM = "idm", "krauss", "eidm"
LAWS = {IDM: INTEGRATION, KRAUSS: KRAUSS, EIDM: EIDM}  # of vehicle types, and the scheme that drives by each
OTHER_LAWS = tuple(law for law in LAWS if law != IDM)


class _Piece(NamedTuple):
    """Some drivers' windows, and where each driver's begin.

    ``begin`` has shape ``(drivers + 1,)``.
    """

    drivers: slice
    scenes: Scenes
    begin: Integers


def names_for(law: str) -> tuple[str, ...]:
    """Return the columns of a law's vehicle types.

    Parameters
    ----------
    law : {"idm", "krauss", "eidm"}

    Returns
    -------
    tuple of str
        Four parameters and their error.
    """
    if law == IDM:
        return (*WHOLE, WHOLE_ADE)
    return (*(f"{name}_{law}" for name in PARAMETERS[:4]), f"{law}_ade_m")


def whole_columns(
    drivers: pd.DataFrame, scenes: Scenes, progress: Progress = silent, *, law: str = IDM
) -> pd.DataFrame:
    """Fit vehicle types to all windows of each driver.

    Parameters
    ----------
    drivers : pandas.DataFrame
        One row a driver: ``period, vehicle``, parameters to start from, ``desired_speed_m_s``.
    scenes : Scenes
        Windows of these drivers, in the order of the rows, those of a driver one after the other.
    progress : Progress
        Called with the drivers done and their total.
    law : {"idm", "krauss", "eidm"}
        SUMO's model that the types are of.

    Returns
    -------
    pandas.DataFrame
        ``a_whole, b_whole, T_whole, d0_whole`` (SI; of another law as :func:`names_for` says) with the smallest mean
        error over all windows that can be fitted, without ``d1`` and under SUMO's integration; ``whole_ade_m``, that
        error; ``windows``, their number. NaN and 0 for drivers without such a window.
    """
    names, scheme = list(names_for(law)), LAWS[law]
    table = pd.DataFrame(np.nan, drivers.index, names).assign(**{WINDOWS: 0})
    row = pd.MultiIndex.from_frame(drivers[[c.PERIOD, c.VEHICLE]]).get_indexer(
        pd.MultiIndex.from_frame(scenes.keys()[[c.PERIOD, c.VEHICLE]])
    )
    speed = drivers[DESIRED_SPEED].to_numpy(np.float64)
    usable = np.concatenate([_usable(part, speed[row[piece]]) for piece, part in _parts(scenes)])
    rows, counts = np.unique(row[usable], return_counts=True)
    for piece in _pieces(scenes.subset(np.flatnonzero(usable)), counts):
        here = rows[piece.drivers]
        windows = np.diff(piece.begin)
        theta = drivers[list(PARAMETERS)].to_numpy(np.float64)[here]
        theta = np.where(np.isnan(theta), idm.TEXTBOOK, theta)
        problem = prepare(piece.scenes, desired_speed=np.repeat(speed[here], windows))
        pace = np.add.reduceat(mean_speeds(piece.scenes), piece.begin[:-1]) / windows
        own = linearise(theta, pace, speed[here])
        found = fit_types(problem, piece.begin, own, integration=scheme)
        each = integrators.ades(problem, np.repeat(found, windows, axis=0), scheme)
        error = np.add.reduceat(each, piece.begin[:-1]) / windows
        table.loc[table.index[here], names] = np.column_stack([found[:, :4], error])
        table.loc[table.index[here], WINDOWS] = windows
        progress("calibration", piece.drivers.stop, len(rows))
    return table


def _parts(scenes: Scenes) -> Iterator[tuple[slice, Scenes]]:
    for first in range(0, len(scenes), CHUNK):
        piece = slice(first, min(first + CHUNK, len(scenes)))
        yield piece, with_needed_traffic(scenes.subset(np.arange(piece.start, piece.stop)))


def _usable(scenes: Scenes, desired_speed: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return which windows tell how their driver follows."""
    problem = prepare(scenes, desired_speed=desired_speed)
    recorded = scenes.speed[:, scenes.start : scenes.start + scenes.window.horizon + 1]
    return np.asarray(status.statuses(problem, recorded).astype(str) == OK)


def _pieces(scenes: Scenes, counts: Integers) -> Iterator[_Piece]:
    """Yield whole drivers, about ``CHUNK`` windows at a time."""
    ends = np.cumsum(counts)
    first = 0
    while first < len(counts):
        before = int(ends[first] - counts[first])
        last = max(first + 1, int(np.searchsorted(ends, before + CHUNK, side="right")))
        windows = np.arange(before, int(ends[last - 1]))
        part = with_needed_traffic(scenes.subset(windows))
        yield _Piece(slice(first, last), part, np.concatenate([[0], ends[first:last] - before]))
        first = last


def as_whole(drivers: pd.DataFrame) -> pd.DataFrame:
    """Return drivers whose types are those of all windows.

    Parameters
    ----------
    drivers : pandas.DataFrame
        With the columns of :func:`whole_columns`.

    Returns
    -------
    pandas.DataFrame
        The refit without ``d1`` is the one of all windows, and ``at_bound`` is about it; drivers without such a refit
        keep their own.
    """
    has = drivers[WHOLE[0]].notna().to_numpy()
    theta = np.column_stack([drivers[list(WHOLE)].to_numpy(np.float64), np.zeros(len(drivers))])
    linear = linearise(drivers[list(PARAMETERS)], drivers[MEAN_SPEED], drivers[DESIRED_SPEED])
    out = drivers.copy()
    for place, (name, whole) in enumerate(zip(REFIT, WHOLE, strict=True)):
        own = drivers[name] if name in drivers else linear[:, place]
        out[name] = np.where(has, drivers[whole], own)
    held = at_bound(theta) & [True, True, True, True, False]
    out["at_bound"] = pd.Series(names_of(held), index=drivers.index).where(has, drivers.get("at_bound", ""))
    return out.assign(**{REFIT_INTEGRATION: INTEGRATION})


def fit_whole_drivers(fits: pd.DataFrame, scenes: Scenes, progress: Progress = silent) -> pd.DataFrame:
    """Fit every driver to all of its windows together.

    Parameters
    ----------
    fits : pandas.DataFrame
        As :func:`idm_sumo.calibration.table.calibrate` returns for the same scenes.
    scenes : Scenes
        Several windows a driver.
    progress : Progress
        Called with the drivers done and their total.

    Returns
    -------
    pandas.DataFrame
        The row of each driver's first window, with the parameters that have the smallest mean ADE over those of its
        windows that can be fitted; ``ade_m`` is that mean, ``windows`` their number. Standard deviations are those of
        independent windows together; a parameter is undetermined if every window leaves it so.
    """
    groups = fits.groupby([c.PERIOD, c.VEHICLE], sort=False, observed=True).indices
    rows = []
    for done, every in enumerate(groups.values(), 1):
        rows.append(_one(fits, scenes, np.asarray(every)))
        progress("calibration", done, len(groups))
    return pd.DataFrame(rows).reset_index(drop=True).astype({c.VEHICLE: "int64"})


def _one(fits: pd.DataFrame, scenes: Scenes, every: np.ndarray[tuple[int], np.dtype[np.int64]]) -> pd.Series:
    """Return the row of one driver."""
    usable = every[(fits["status"].to_numpy()[every] == OK)]
    first = usable[0] if len(usable) else every[0]
    row = fits.iloc[int(first)].copy()
    row[WINDOWS] = len(usable)
    if len(usable) < 2:
        return row
    part, told = scenes.subset(usable), fits.iloc[usable]
    limit = told["desired_speed_m_s"].max()
    theta = pooled(part, desired_speed=float(limit))
    row[list(PARAMETERS)] = list(theta)
    row["ade_m"] = full_ade(part, np.tile(theta, (len(part), 1)), limit).mean()
    row["status"] = OK
    for name in PARAMETERS:
        row[f"{name}_sd"] = float(1.0 / np.sqrt((1.0 / told[f"{name}_sd"].clip(lower=1e-9) ** 2).sum()))
    row["undetermined"] = ",".join(_common(told["undetermined"]))
    row["at_bound"] = ",".join(_common(told["at_bound"]))
    return row


def _common(names: pd.Series) -> list[str]:
    """Return the names that all lists have, in order."""
    lists = [set(str(one).split(",")) for one in names]
    return [name for name in PARAMETERS if all(name in one for one in lists)]
