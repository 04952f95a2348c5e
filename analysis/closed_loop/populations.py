"""Parameters of the vehicles of a closed loop.

They are calibrated, predicted or pooled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import calibrate, pooled
from idm_sumo.calibration.drawn import as_drawn, drawn_columns, one_a_driver
from idm_sumo.calibration.driver_table import DESIRED_SPEED, FIRST_FRAME, HAS, read_drivers
from idm_sumo.calibration.parameter_sets import with_law
from idm_sumo.calibration.whole import IDM, OTHER_LAWS, WHOLE, as_whole, whole_columns
from idm_sumo.calibration.without_d1 import MEAN_SPEED, REFIT, mean_speeds, refit_table
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import predict_drivers
from idm_sumo.prediction.driving_code import FEATURES, driving_code
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.sumo.export.translation import checked_speeds, desired_speeds, sumo_parameters, with_parameters

Floats = npt.NDArray[np.float64]

PARAMETERS = list(IDMParameters._fields)
CALIBRATED = ("drivers", "drawn", "predicted", "pooled")  # populations that need the drivers of the recording
OBSERVED, NEIGHBOURS = 10, 8
EVERY_WINDOW = Window(every=Window().horizon)
LEAST_LIBRARY = 2


@dataclass(frozen=True)
class Drivers:
    """The drivers of one period.

    Attributes
    ----------
    scenes : Scenes
    table : pandas.DataFrame
        Calibrated drivers with finite parameters, one row each, with what SUMO needs for the jam distance.
    predicted : pandas.DataFrame or None
        The same drivers as predicted from one second, each without its own row of the library.
    pooled : IDMParameters
    origin : str
        Where the calibration comes from.
    """

    scenes: Scenes
    table: pd.DataFrame
    predicted: pd.DataFrame | None
    pooled: IDMParameters
    origin: str


def drivers_of(
    recording: Recording,
    path: Path | None,
    *,
    refit: bool = False,
    laws: Sequence[str] = (),
    progress: Progress = silent,
) -> Drivers:
    """Calibrate the drivers of a period, or read them.

    Parameters
    ----------
    recording : Recording
        One period, as read.
    path : Path or None
        A driver table.
    refit : bool
        Whether drivers calibrated here are fitted once more without ``d1``, which SUMO lacks; else it is linearised.
    laws : sequence of str
        SUMO's models that drivers calibrated here are fitted by, too.

    Raises
    ------
    InputError
        If no driver can be calibrated, or the table holds none of this period.
    """
    progress("calibrating", 0, 4)
    cleaned = smooth(clean(recording))
    scenes = build_scenes(cleaned, Window())
    if not len(scenes):
        raise InputError(
            f"{recording.source}: no vehicle is recorded for {Window().frames} frames in a row on the main lanes"
        )
    one_for_all = pooled(scenes)
    progress("calibrating", 1, 4)
    table = _read(path, scenes) if path else _calibrated(scenes, build_scenes(cleaned, EVERY_WINDOW), refit, laws)
    progress("calibrating", 3, 4)
    library = table if set(FEATURES.values()) <= set(table) else None
    predicted = None
    if library is not None and len(library) >= LEAST_LIBRARY:
        predicted = predict_drivers(scenes, library, observed=OBSERVED, neighbours=NEIGHBOURS)
        predicted = predicted.assign(**{MEAN_SPEED: scenes.speed[:, :OBSERVED].mean(axis=1)})
    progress("calibrating", 4, 4)
    return Drivers(scenes, table, predicted, one_for_all, "calibrated in this run" if path is None else path.name)


def _calibrated(scenes: Scenes, windows: Scenes, refit: bool, laws: Sequence[str]) -> pd.DataFrame:
    """Fit every driver; add its code and what replaces d1.

    Drawn to the population it is by all of its windows.
    """
    fits = calibrate(scenes)
    drawn = one_a_driver(drawn_columns(windows, float(fits[DESIRED_SPEED].max())))
    fits = fits.merge(drawn.drop(columns=FIRST_FRAME), on=[c.PERIOD, c.VEHICLE])
    for law in (IDM, *laws) if laws else ():
        columns = whole_columns(fits, windows, law=law)
        fits = fits.join(columns[[name for name in columns if name not in fits]])
    fitted = np.isfinite(fits[PARAMETERS].to_numpy()).all(axis=1)
    codes = driving_code(scenes)
    table = fits.join(codes[[name for name in codes if name not in fits]])[fitted].reset_index(drop=True)
    some = scenes.subset(np.flatnonzero(fitted))
    if not refit:
        return table.assign(**{MEAN_SPEED: mean_speeds(some)})
    keys = [c.PERIOD, c.VEHICLE, "first_frame"]
    refits = refit_table(table, some)
    return table.merge(refits[[*keys, *(name for name in refits if name not in table)]], on=keys)


def _read(path: Path, scenes: Scenes) -> pd.DataFrame:
    """Return the drivers of one period from a table.

    Of several windows of a driver the first counts. Types fitted to all windows are taken where the table has them,
    as `idm-sumo export` does.
    """
    table, _ = with_parameters(read_drivers(path), str(path))
    period = scenes.one_period
    own = table[table[c.PERIOD].astype(str) == period].drop_duplicates([c.PERIOD, c.VEHICLE]).reset_index(drop=True)
    if own.empty:
        there = ", ".join(sorted(table[c.PERIOD].astype(str).unique()))
        raise InputError(f"{path}: has no driver of period {period}; it has {there}")
    _check_recording(own, scenes, path)
    return as_whole(own) if set(WHOLE) <= set(own) else own


def _check_recording(own: pd.DataFrame, scenes: Scenes, path: Path) -> None:
    """Raise if a table's drivers have numbers of this recording, but none begins where it has it."""
    if FIRST_FRAME not in own:
        return
    begins = pd.Series(scenes.first_frame, index=scenes.vehicle)
    shared = own[own[c.VEHICLE].isin(begins.index)]
    if len(shared) and not (begins[shared[c.VEHICLE]].to_numpy() == shared[FIRST_FRAME].to_numpy()).any():
        raise InputError(
            f"{path}: belongs to another recording: no driver begins in the frame in which this one has it; calibrate "
            "this recording (of `surrogate` the same --minutes and --seed)"
        )


def parameters_for(
    population: str, drivers: Drivers, demand: pd.DataFrame, speeds: pd.Series
) -> tuple[Floats, Floats, int]:
    """Return the parameters of every vehicle of the demand.

    Parameters
    ----------
    population : str
        ``drivers``, ``drawn``, ``predicted``, ``pooled`` or the name of a law of vehicle types.
    drivers : Drivers
    demand : pandas.DataFrame
    speeds : pandas.Series
        Recorded mean speed (m/s) of every vehicle, at which a ``d1`` is linearised.

    Returns
    -------
    theta : ndarray, shape (vehicles, 5)
        ``a, b, T, d0, 0``.
    desired_speed : ndarray, shape (vehicles,)
        m/s; the speed limit for those with the pooled parameters.
    pooled : int
        Vehicles that have the pooled parameters, for want of their own; by a law the median driver's.

    Raises
    ------
    InputError
        If there is nothing to predict from, or nobody fitted by the law.
    """
    vehicle, road = demand[c.VEHICLE].to_numpy(), drivers.scenes.road
    limits = np.full(len(demand), road.speed_limit)
    keys = {c.PERIOD: drivers.scenes.one_period, c.VEHICLE: vehicle}
    everybody = pd.DataFrame(keys | drivers.pooled._asdict()).assign(**{MEAN_SPEED: speeds.reindex(vehicle).to_numpy()})
    theta, _ = sumo_parameters(everybody, "linearised", limits, "euler", "pooled")
    if population == "pooled":
        return theta, limits, len(demand)
    table = drivers.predicted if population == "predicted" else drivers.table
    if population == "drawn":
        table = as_drawn(drivers.table, drivers.origin)
    if population in OTHER_LAWS:
        table, _ = with_law(drivers.table, population, drivers.origin)
        theta[:, :4] = table[PARAMETERS[:4]].median()
    if table is None:
        raise InputError(
            f"--types {population}: the driver table has no driving codes; write it with `idm-sumo calibrate`"
        )
    if MEAN_SPEED not in table:
        table = table.assign(**{MEAN_SPEED: speeds.reindex(table[c.VEHICLE]).fillna(speeds.mean()).to_numpy()})
    way = "refit" if set(REFIT) <= set(table) else "linearised"
    own_limits = desired_speeds(table, road, population)
    own, _ = sumo_parameters(table, way, own_limits, "euler", population)
    known, row = _known_to(table, demand)
    theta[known], limits[known] = own[row], own_limits[row]
    return theta, limits, int((~known).sum())


def _known_to(table: pd.DataFrame, demand: pd.DataFrame) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.intp]]:
    """Return which vehicles a table has, and in which rows."""
    row = pd.Index(table[c.VEHICLE]).get_indexer(pd.Index(demand[c.VEHICLE]))
    return row >= 0, row[row >= 0]


def refitted_for(
    model: ExtendedModel, file: Path, demand: pd.DataFrame, period: str, calibrated: Floats
) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Return how an extended model drives every vehicle.

    Parameters, desired speed and partial causes are each driver's own, refitted with the causes, where
    the table beside the model has them. The other vehicles drive as ``calibrated``, without causes; by
    another law, of which that says nothing, as the model's median driver.

    Parameters
    ----------
    model : ExtendedModel
    file : Path
        Of the model; the table it names is beside it.
    demand : pandas.DataFrame
    period : str
    calibrated : ndarray, shape (vehicles, 5)

    Returns
    -------
    theta : ndarray, shape (vehicles, 5)
        ``a, b, T, d0, d1``.
    desired : ndarray, shape (vehicles,)
        Desired speeds (m/s).
    has : ndarray of bool, shape (vehicles,)
        Who has the causes that only some drivers have.

    Raises
    ------
    InputError
        If the table that the model names is missing or is none.
    """
    theta = calibrated.copy() if model.is_idm else np.tile(model.parameters, (len(demand), 1))
    limits, has = np.full(len(demand), model.desired_speed), model.has_partial_causes(demand[c.VEHICLE])
    if not model.drivers:
        return theta, limits, has
    beside = file.parent / model.drivers
    if not beside.is_file():
        raise InputError(f"{beside}: no such file, and {file} names it; keep what `idm-sumo diagnose` wrote together")
    table = read_drivers(beside)
    if DESIRED_SPEED not in table:
        raise InputError(f"{beside}: column {DESIRED_SPEED} is missing; write the table with `idm-sumo diagnose`")
    table = table.assign(**{DESIRED_SPEED: checked_speeds(table, table[DESIRED_SPEED], str(beside))})
    table = table[table[c.PERIOD] == period].drop_duplicates(c.VEHICLE)
    known, row = _known_to(table, demand)
    theta[known] = table[PARAMETERS].to_numpy()[row]
    limits[known] = table[DESIRED_SPEED].to_numpy()[row]
    if HAS in table:
        has[known] = table[HAS].to_numpy(dtype=bool)[row]
    return theta, limits, has


def mean_speed_of(recording: Recording) -> pd.Series:
    """Return every vehicle's recorded mean speed (m/s).

    Parameters
    ----------
    recording : Recording
    """
    return recording.table.groupby(c.VEHICLE)[c.SPEED].mean()
