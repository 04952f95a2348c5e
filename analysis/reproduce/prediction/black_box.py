"""Extra trees on the first second, as bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.model_selection import GroupKFold, cross_val_predict

from idm_sumo.calibration.kernel import to_search
from idm_sumo.evaluation.metrics import recorded_from_start
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction.basis import plain
from idm_sumo.recordings import columns as c
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

from ..drivers import Drivers
from .learned import Learned, window_ade

Floats = npt.NDArray[np.float64]
TREES, SMALLEST_LEAF = 60, 5
FOLDS = 5


def explained(learned: Learned, fits: pd.DataFrame, drivers: Drivers) -> pd.DataFrame:
    """Return how much of the parameters the first second explains.

    Extra trees predict each fitted parameter from the first second, in five folds by driver and in search
    coordinates. At or below 0 the first second explains nothing.

    Parameters
    ----------
    learned : Learned
        The predictor and its windows.
    fits : pandas.DataFrame
        Oracle calibrations of the drivers.
    drivers : Drivers
        Training drivers.

    Returns
    -------
    pandas.DataFrame
        ``parameter, r2, drivers``; NaN with fewer than two drivers.
    """
    theta = fits[list(IDMParameters._fields)].to_numpy(np.float64)
    seen = learned.first_seconds(drivers).to_numpy(np.float64)
    usable = np.isfinite(theta).all(axis=1) & np.isfinite(seen).all(axis=1)
    keys = drivers.keys()[usable].groupby([c.PERIOD, c.VEHICLE]).ngroup().to_numpy()
    parts = min(FOLDS, len(np.unique(keys)))
    if parts < 2:
        return pd.DataFrame({"parameter": IDMParameters._fields, "r2": np.nan})
    z, inputs = (
        to_search(theta[usable]),
        plain(seen[usable], learned.predictor.pooled_, learned.predictor.desired_speed_),
    )
    model = ExtraTreesRegressor(TREES, min_samples_leaf=SMALLEST_LEAF, random_state=0)
    found = cross_val_predict(model, inputs, z, groups=keys, cv=GroupKFold(parts))
    r2 = 1.0 - ((z - found) ** 2).sum(axis=0) / np.maximum(((z - z.mean(axis=0)) ** 2).sum(axis=0), 1e-12)
    return pd.DataFrame({"parameter": IDMParameters._fields, "r2": r2, "drivers": len(z)})


def black_box_ade(learned: Learned, test: Drivers, *, with_leader: bool) -> Floats:
    """Return the ADE of a pooled rollout corrected by trees.

    Parameters
    ----------
    learned : Learned
        Windows to learn from, and the pooled set.
    test : Drivers
        Windows to correct.
    with_leader : bool
        Whether the trees also know the leader's future path.

    Returns
    -------
    float64, shape (windows,)
        ADE of the test windows (m).
    """
    model = ExtraTreesRegressor(TREES, min_samples_leaf=SMALLEST_LEAF, max_features=0.5, random_state=0)
    features, targets, _ = _inputs(learned.windows, learned, with_leader)
    model.fit(features, targets)
    features, _, driven = _inputs(test, learned, with_leader)
    found = []
    for scenes, trajectories, part in zip(test.scenes, driven, test.parts(model.predict(features)), strict=True):
        steps = np.arange(trajectories.x.shape[1])
        whole = np.array([np.interp(steps, _moments(scenes), [0.0, *row]) for row in part]).reshape(len(scenes), -1)
        found.append(window_ade(scenes, replace(trajectories, x=trajectories.x + whole)))
    return np.concatenate(found)


def _moments(scenes: Scenes) -> npt.NDArray[np.int64]:
    return np.append(np.arange(0, scenes.window.horizon, 10), scenes.window.horizon)


def _inputs(drivers: Drivers, learned: Learned, with_leader: bool) -> tuple[Floats, Floats, list[Trajectories]]:
    """Return inputs, targets (m every second) and the pooled rollout."""
    driven = drivers.drive(learned.predictor.pooled_)
    features = [_plain(s, learned) for s in drivers.scenes]
    targets = [
        (recorded_from_start(s, s.x) - t.x)[:, _moments(s)[1:]] for s, t in zip(drivers.scenes, driven, strict=True)
    ]
    if with_leader:
        paths = [_leaders_path(s, t) for s, t in zip(drivers.scenes, driven, strict=True)]
        features = [np.column_stack(both) for both in zip(features, paths, strict=True)]
    return np.concatenate(features), np.concatenate(targets), driven


def _plain(scenes: Scenes, learned: Learned) -> Floats:
    predictor = learned.predictor
    return plain(predictor.observe(scenes).to_numpy(np.float64), predictor.pooled_, predictor.desired_speed_)


def _leaders_path(scenes: Scenes, driven: Trajectories) -> Floats:
    """Return pooled rollout and leader's rear (m) every second.

    Both are relative to the start; without a leader the rear is 150 m ahead.
    """
    at = _moments(scenes)[1:]
    own = driven.x[:, at] - driven.x[:, :1]
    return np.column_stack([own, own + np.minimum(driven.gap[:, at], 150.0)])
