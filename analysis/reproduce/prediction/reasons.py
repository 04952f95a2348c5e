"""Why averaging fitted parameters fails, and what prediction can reach."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import hierarchical, pooled
from idm_sumo.calibration.identifiability import UNDETERMINED_SHARE, identify
from idm_sumo.calibration.kernel import LOWER, UPPER, slopes_at, to_search
from idm_sumo.calibration.problem import prepare
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import KNNPredictor
from idm_sumo.recordings import columns as c

from .. import tables
from ..drivers import Drivers
from ..source import Source
from ..study import Study
from . import seconds as prediction_seconds
from . import share as prediction_share
from .black_box import explained
from .intervals import share_closed
from .learned import fits_or

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

PARAMETERS = list(IDMParameters._fields)
NORMAL_95 = 1.96
LIBRARY_DRIVERS = 40  # test drivers whose neighbours are evaluated
HINDSIGHT_DRIVERS = 40  # drivers with one set fitted to all their windows


def prediction_tables(source: Source, study: Study) -> dict[str, pd.DataFrame]:
    """Return the tables on prediction by their file's name.

    Parameters
    ----------
    source : Source
        Recordings, split into training and test.
    study : Study
        Training and test drivers.

    Returns
    -------
    dict of str to pandas.DataFrame
        Tables by name.
    """
    windows = prediction_share.test_windows(source, study.settings)
    return {
        **prediction_share.tables(windows, study.settings, study.learned, study.neighbours),
        "prediction_explained": explained(study.learned, study.train_fits, study.train),
        "prediction_reasons": reasons(study, windows),
        "prediction_seconds": prediction_seconds.table(source, study.settings, study.learned),
    }


def reasons(study: Study, windows: Drivers) -> pd.DataFrame:
    """Return numbers for the report's sentences.

    Parameters
    ----------
    study : Study
        Training and test drivers.
    windows : Drivers
        Windows at entry and along the test drivers' way.

    Returns
    -------
    pandas.DataFrame
        ``what, value``.
    """
    found = directions(study.test, study.test_fits) | averaging(study) | cleaner_library(study)
    found |= hindsight(windows, study.learned.predictor.pooled_, study.settings.seed)
    return pd.DataFrame({"what": list(found), "value": list(found.values())})


def directions(drivers: Drivers, fits: pd.DataFrame) -> dict[str, Any]:
    """Return how many directions in parameter space a window determines.

    A direction is determined if its 95 % interval is at most half as wide as the range between the bounds, as
    for single parameters.

    Parameters
    ----------
    drivers : Drivers
        Drivers.
    fits : pandas.DataFrame
        Their oracle calibrations, one row a window.

    Returns
    -------
    dict
        Means over the drivers, and the flattest direction.
    """
    fitted = fits[PARAMETERS].to_numpy(np.float64)
    known, width, flattest = np.isfinite(fitted).all(axis=1), [], []
    parts = zip(drivers.scenes, drivers.parts(fitted), drivers.parts(known.astype(np.float64)), strict=True)
    for scenes, theta, kept in parts:
        use = kept.astype(np.bool_)
        z = to_search(theta[use])
        identification = identify(prepare(scenes.subset(use), desired_speed=drivers.desired_speed), z)
        to_box = 1.0 / (slopes_at(z) * (UPPER - LOWER))
        values, vectors = np.linalg.eigh(identification.covariance * to_box[:, :, None] * to_box[:, None, :])
        width.append(2.0 * NORMAL_95 * np.sqrt(np.maximum(values, 0.0)))
        flattest.append(vectors[:, :, -1])
    widths, along = np.concatenate(width), np.concatenate(flattest)
    loading = (along**2).mean(axis=0)
    first, second = np.argsort(-loading)[:2]
    together = float(np.mean(along[:, first] * along[:, second] > 0.0))
    return {
        "directions determined": float((widths <= UNDETERMINED_SHARE).sum(axis=1).mean()),
        "share of directions not determined": float((widths > UNDETERMINED_SHARE).mean()),
        "share of drivers with a direction not determined": float((widths[:, -1] > UNDETERMINED_SHARE).mean()),
        "flattest direction, first": PARAMETERS[first],
        "flattest direction, second": PARAMETERS[second],
        "share of the flattest direction in the first": float(loading[first]),
        "share of the flattest direction in the second": float(loading[second]),
        "share of drivers in whom both grow together": together,
    }


def averaging(study: Study) -> dict[str, float]:
    """Return the cost of averaging the parameters of neighbours.

    It is measured on the neighbours themselves and on the driver to be predicted, beside one set that is fitted to
    the same neighbours' rollouts together.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    dict of str to float
        ADE (m) and distances between the sets.
    """
    codes, theta = study.library
    rows = np.flatnonzero(np.isfinite(study.train_fits[PARAMETERS].to_numpy(np.float64)).all(axis=1))
    model = KNNPredictor(min(study.settings.neighbours, len(theta))).fit(codes, theta)
    rng = np.random.default_rng(study.settings.seed)
    chosen = np.sort(rng.choice(len(study.test), min(LIBRARY_DRIVERS, len(study.test)), replace=False))
    seen = study.test.code(study.settings.observed).iloc[chosen]
    inputs = seen[list(model.features or [])]
    near = np.sort(
        model.pipeline_[-1].kneighbors(model.pipeline_[:-1].transform(inputs.to_numpy()), return_distance=False), axis=1
    )
    errors, joint, away = [], [], []
    for which in near:
        windows, own = _only(study.train, rows[which]), theta[which]
        together = pooled(windows.scenes, desired_speed=study.settings.desired_speed)
        joint.append(np.asarray(together))
        sets = (own, own.mean(axis=0), together, study.pooled)
        errors.append([_ade(windows, parameters).mean() for parameters in sets])
        away.append(np.linalg.norm((to_search(own.mean(axis=0)) - to_search(own)) / (UPPER - LOWER), axis=1).mean())
    test = _only(study.test, chosen)
    means = np.mean(errors, axis=0)
    moves = tables.flat_directions(study).groupby("share")["increase"].median()
    return {
        "neighbours' own parameters, on themselves: ADE (m)": means[0],
        "neighbours' average, on themselves: ADE (m)": means[1],
        "one set fitted to the neighbours, on themselves: ADE (m)": means[2],
        "pooled, on the neighbours: ADE (m)": means[3],
        "distance of the average from the neighbours (box)": float(np.mean(away)),
        "longest move along the flattest direction (box)": float(moves.index[-1]),
        "that move costs, median driver: ADE (m)": float(moves.iloc[-1]),
        "neighbours' average, on the driver: ADE (m)": _ade(test, model.predict(inputs)).mean(),
        "one set fitted to the neighbours, on the driver: ADE (m)": _ade(test, np.array(joint)).mean(),
        "pooled, on the same drivers: ADE (m)": _ade(test, study.pooled).mean(),
        "drivers whose neighbours were looked at": float(len(chosen)),
    }


def cleaner_library(study: Study) -> dict[str, float]:
    """Return the paper's prediction with two libraries of fits.

    One holds free fits, the other fits drawn to the population.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    dict of str to float
        ADE (m).
    """
    s = study.settings
    drawn, _ = hierarchical(study.train.scenes, population=study.population, desired_speed=s.desired_speed)
    theta = drawn[PARAMETERS].to_numpy(np.float64)
    known = np.isfinite(theta).all(axis=1)
    model = KNNPredictor(min(s.neighbours, int(known.sum()))).fit(study.train.code()[known], theta[known])
    seen = study.test.code(s.observed)
    return {
        "averaged neighbours, free fits: ADE (m)": _ade(study.test, study.neighbours(seen, s.neighbours)).mean(),
        "averaged neighbours, fits drawn to the population: ADE (m)": _ade(study.test, model.predict(seen)).mean(),
        "pooled, on the same windows: ADE (m)": _ade(study.test, study.pooled).mean(),
    }


def hindsight(windows: Drivers, one_for_all: IDMParameters, seed: int) -> dict[str, float]:
    """Return what one lasting parameter set a driver can reach.

    It is fitted in hindsight to all windows of the driver's way, so that no prediction of lasting parameters can do
    better. The rest of the way to the oracle, which is fitted window by window, is variation within a driver.

    Parameters
    ----------
    windows : Drivers
        Windows along the drivers' way.
    one_for_all : IDMParameters
        The pooled set.
    seed : int
        For the draw of drivers.

    Returns
    -------
    dict of str to float
        Share of the way from pooled to oracle, with its interval; empty without drivers of several windows.
    """
    keys = windows.keys()
    several = keys.groupby([c.PERIOD, c.VEHICLE]).filter(lambda own: len(own) > 1)
    drivers = several[[c.PERIOD, c.VEHICLE]].drop_duplicates().to_numpy()
    if not len(drivers):
        return {}
    rng = np.random.default_rng(seed)
    rows = []
    for k in np.sort(rng.choice(len(drivers), min(HINDSIGHT_DRIVERS, len(drivers)), replace=False)):
        own = ((keys[c.PERIOD] == drivers[k][0]) & (keys[c.VEHICLE] == drivers[k][1])).to_numpy()
        one = _only(windows, np.flatnonzero(own))
        speed = windows.desired_speed
        oracle = fits_or(one.scenes[0], one_for_all, speed)
        together = pooled(one.scenes, desired_speed=speed)
        sets: dict[str, Any] = {"idm_pooled": one_for_all, "idm_oracle": oracle, "hindsight": together}
        rows.append({name: _ade(one, theta).mean() for name, theta in sets.items()})
    share = share_closed(pd.DataFrame(rows), "hindsight")
    return {
        "one set a driver in hindsight: share": share["share"],
        "one set a driver in hindsight: share, low": share["share_low"],
        "one set a driver in hindsight: share, high": share["share_high"],
        "drivers in hindsight": float(len(rows)),
    }


def _only(drivers: Drivers, rows: Integers) -> Drivers:
    """Return some windows; ``rows`` are in order."""
    kept = np.zeros(len(drivers))
    kept[rows] = 1
    parts = zip(drivers.scenes, drivers.parts(kept), strict=True)
    return replace(drivers, scenes=tuple(s.subset(k.astype(bool)) for s, k in parts if k.any()))


def _ade(drivers: Drivers, theta: npt.ArrayLike) -> Floats:
    driven = drivers.drive(theta)
    return np.concatenate([displacement(s, t).mean(axis=1) for s, t in zip(drivers.scenes, driven, strict=True)])
