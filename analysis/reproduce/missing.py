"""Errors of all methods in scenes that lack vehicles.

The paper models 1,992 of 2,169 and 1,521 of 2,017 counted vehicles. If the others are missing from the replayed scene
too, a modelled vehicle follows the wrong leader.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation.metrics import summary
from idm_sumo.prediction import average_parameters
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import LEADER_FROM_LANE
from idm_sumo.simulation.rollout import drive_constant_velocity

from .drivers import Drivers
from .study import Study, fits_of

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

SHARES = (0.0, 0.05, 0.08, 0.15, 0.25, 0.35)
SEEDS = 3
KNOWN, REFITTED = "all vehicles known", "refitted in the thinned scene"
COLUMNS = ["missing_share", "seed", "parameters", "method", "ade_m", "ade_se_m", "ade_sd_m", "fde_m", "fde_se_m",
           "fde_to_ade", "collisions", "vehicles"]  # fmt: skip


@dataclass(frozen=True)
class Thinned:
    """A side of the study with vehicles missing.

    Attributes
    ----------
    drivers : Drivers
        Those that are not missing themselves.
    there : bool, shape (windows,)
        Which windows of the whole side they are.
    """

    drivers: Drivers
    there: Mask


def missing_vehicles(study: Study, progress: Progress = silent) -> pd.DataFrame:
    """Drive the test drivers in scenes that lack some vehicles.

    Parameters
    ----------
    study : Study
        Training and test drivers.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    pandas.DataFrame
        One row a share, seed, way to the parameters and method: :data:`COLUMNS`. ``ade_sd_m`` is the standard deviation
        over vehicles. Empty where a recording holds only some of the vehicles: of those nobody can be taken away.
    """
    if any(scenes.leader_source != LEADER_FROM_LANE for scenes in (*study.train.scenes, *study.test.scenes)):
        return pd.DataFrame(columns=COLUMNS)
    cases = [(share, seed) for share in SHARES for seed in range(1 if share == 0.0 else SEEDS)]
    rows: list[dict[str, object]] = []
    for number, (share, seed) in enumerate(cases):
        progress("missing vehicles", number, len(cases))
        rng = np.random.default_rng([study.settings.seed, seed, round(100 * share)])
        train, test = (_thin(side, share, rng) for side in (study.train, study.test))
        if not len(train.drivers) or not len(test.drivers):
            continue
        observed = study.settings.observed
        seen = study.test.code(observed)[test.there].reset_index(drop=True)
        ways = {KNOWN: (replace(study, test=test.drivers, test_fits=study.test_fits[test.there]), seen)}
        if share:
            ways[REFITTED] = (_refitted(study, train.drivers, test.drivers), test.drivers.code(observed))
        for way, (thinned, codes) in ways.items():
            found = _score(test.drivers, _methods(thinned, codes), constant_velocity=way == KNOWN)
            rows += [{"missing_share": share, "seed": seed, "parameters": way, **row} for row in found]
    progress("missing vehicles", len(cases), len(cases))
    return pd.DataFrame(rows, columns=COLUMNS)


def _thin(side: Drivers, share: float, rng: np.random.Generator) -> Thinned:
    """Take away a share of each period's vehicles."""
    scenes, there = [], []
    for one in side.scenes:
        recorded = np.unique(one.traffic.vehicle)
        gone = rng.choice(recorded, round(share * len(recorded)), replace=False)
        kept = ~np.isin(one.vehicle, gone)
        there.append(kept)
        if kept.any():
            scenes.append(replace(one.subset(kept), traffic=one.traffic.without(gone)))
    return Thinned(replace(side, scenes=tuple(scenes)), np.concatenate(there))


def _refitted(study: Study, train: Drivers, test: Drivers) -> Study:
    """Return the study with both sides fitted again."""
    s = study.settings
    return replace(study, train=train, test=test, train_fits=fits_of(train, s), test_fits=fits_of(test, s))


def _methods(study: Study, codes: pd.DataFrame) -> dict[str, Floats]:
    """Return parameters of the test drivers by three methods."""
    _, theta = study.library
    return {
        "idm_average": np.tile(average_parameters(theta), (len(codes), 1)),
        "idm_prediction": study.neighbours(codes, study.settings.neighbours),
        "idm_oracle": study.or_pooled(study.test_fits),
    }


def _score(drivers: Drivers, methods: dict[str, Floats], *, constant_velocity: bool) -> list[dict[str, object]]:
    """Return one row a method."""
    driven = {name: drivers.drive(theta) for name, theta in methods.items()}
    if constant_velocity:  # it has no parameters: one row is enough
        driven = {"constant_velocity": [drive_constant_velocity(scenes) for scenes in drivers.scenes]} | driven
    rows = []
    for name, trajectories in driven.items():
        scores = drivers.score(trajectories)
        figures = summary(scores)
        spread = float(scores.groupby(["period", "vehicle"], observed=True)["ade_m"].mean().std(ddof=1))
        ratio = figures["fde_m"] / figures["ade_m"] if figures["ade_m"] > 0 else np.nan
        rows.append({"method": name, **figures, "ade_sd_m": spread, "fde_to_ade": ratio})
    return rows


def by_share(table: pd.DataFrame) -> pd.DataFrame:
    """Return means over seeds, as the report shows them.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`missing_vehicles`.

    Returns
    -------
    pandas.DataFrame
        One row a share, way and method.
    """
    keys = ["missing_share", "parameters", "method"]
    figures = ["ade_m", "ade_sd_m", "fde_m", "fde_to_ade", "collisions", "vehicles"]
    return table.groupby(keys, sort=False)[figures].mean().reset_index()
