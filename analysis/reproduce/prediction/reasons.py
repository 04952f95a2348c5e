"""Why averaging fitted parameters fails, and what a prediction could reach at most: numbers for the report's sentences."""

from __future__ import annotations

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
from idm_sumo.roads import road

from .. import tables
from ..drivers import Drivers
from ..source import Source
from ..study import Study
from . import seconds as prediction_seconds
from . import share as prediction_share
from .share import fits_or, share_closed

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

PARAMETERS = list(IDMParameters._fields)
NORMAL_95 = 1.96
LIBRARY_DRIVERS = 40  # whose neighbours are looked at
HINDSIGHT_DRIVERS = 40  # who get one set for all their windows


def prediction_tables(source: Source, study: Study) -> dict[str, pd.DataFrame]:
    """Return the tables of what predicting is worth, by the name of their file."""
    windows = prediction_share.test_windows(source, study.settings)
    share, coverage = prediction_share.tables(windows, study.settings, study.learned, study.neighbours)
    return {
        "prediction_share": share, "prediction_coverage": coverage,
        "prediction_explained": prediction_share.explained(study.learned, study.train_fits, study.train),
        "prediction_reasons": reasons(study, windows),
        "prediction_seconds": prediction_seconds.table(source, study.settings, study.learned),
    }  # fmt: skip


def reasons(study: Study, windows: Drivers) -> pd.DataFrame:
    """Return one row a number: ``what, value``. ``windows`` are the test drivers' all along their way."""
    found = directions(study.test, study.test_fits) | averaging(study) | cleaner_library(study)
    found |= hindsight(windows, study.learned.predictor.pooled_, study.settings.seed)
    return pd.DataFrame({"what": list(found), "value": list(found.values())})


def directions(drivers: Drivers, fits: pd.DataFrame) -> dict[str, Any]:
    """Return how many of the five directions in the box of parameters a window determines, and what the flattest is.

    A direction is determined if its 95 % interval is no wider than half of the box, as for single parameters.
    """
    fitted = fits[PARAMETERS].to_numpy(np.float64)
    known, width, flattest = np.isfinite(fitted).all(axis=1), [], []
    parts = zip(drivers.scenes, drivers.parts(fitted), drivers.parts(known.astype(np.float64)), strict=True)
    for scenes, theta, kept in parts:
        use = kept.astype(np.bool_)
        z = to_search(theta[use])
        identification = identify(prepare(scenes.subset(use)), z)
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
        "flattest direction, first": PARAMETERS[first], "flattest direction, second": PARAMETERS[second],
        "share of the flattest direction in the first": float(loading[first]),
        "share of the flattest direction in the second": float(loading[second]),
        "share of drivers in whom both grow together": together,
    }  # fmt: skip


def averaging(study: Study) -> dict[str, float]:
    """Return what averaging the parameters of neighbours costs the neighbours themselves, and the driver they are to foretell.

    Beside it: one set fitted to the same neighbours' rollouts together.
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
    """Return the ADE of the paper's prediction with a library of free fits and with one drawn to the population."""
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
    """Return what knowing the driver could be worth: one set a driver, fitted in hindsight to all windows of its way.

    Nothing that gives a driver lasting parameters can do better; the rest of the way to the oracle, which is fitted window by
    window, is the same driver in another window.
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
        oracle = fits_or(one.scenes[0], one_for_all, road.SPEED_LIMIT)
        sets: dict[str, Any] = {"idm_pooled": one_for_all, "idm_oracle": oracle, "hindsight": pooled(one.scenes)}
        rows.append({name: _ade(one, theta).mean() for name, theta in sets.items()})
    share = share_closed(pd.DataFrame(rows), "hindsight")
    return {
        "one set a driver in hindsight: share": share["share"],
        "one set a driver in hindsight: share, low": share["share_low"],
        "one set a driver in hindsight: share, high": share["share_high"],
        "drivers in hindsight": float(len(rows)),
    }


def _only(drivers: Drivers, rows: Integers) -> Drivers:
    """Return the windows at rows, which are in order."""
    kept = np.zeros(len(drivers))
    kept[rows] = 1
    parts = zip(drivers.scenes, drivers.parts(kept), strict=True)
    return Drivers(tuple(s.subset(k.astype(bool)) for s, k in parts if k.any()))


def _ade(drivers: Drivers, theta: npt.ArrayLike) -> Floats:
    driven = drivers.drive(theta)
    return np.concatenate([displacement(s, t).mean(axis=1) for s, t in zip(drivers.scenes, driven, strict=True)])
