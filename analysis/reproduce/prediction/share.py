"""How far prediction closes the gap from pooled to oracle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.prediction import ResidualPredictor, drive_residual
from idm_sumo.recordings import columns as c
from idm_sumo.simulation.rollout import Trajectories

from ..drivers import Drivers
from ..settings import Settings
from ..source import Source
from . import for_whom
from .black_box import black_box_ade
from .coverage import coverage_of
from .intervals import share_closed
from .learned import Learned, fits_or, residual_of, stays_in_lane, window_ade

Floats = npt.NDArray[np.float64]

TEST_STEP = 60
FEWEST_FOLDS = 2  # of a predictor whose spread is not used


def test_windows(source: Source, settings: Settings) -> Drivers:
    """Return windows at entry and every six seconds after.

    Parameters
    ----------
    source : Source
        Recordings, split into training and test.
    settings : Settings
        Settings of the run.

    Returns
    -------
    Drivers
        Windows of the test drivers.
    """
    return source.drivers(source.test, "test", replace(settings.window, every=TEST_STEP))[0]


def tables(
    test: Drivers, settings: Settings, learned: Learned, neighbours: Callable[[pd.DataFrame, int], Floats]
) -> dict[str, pd.DataFrame]:
    """Return the tables on windows along the test drivers' way.

    Parameters
    ----------
    test : Drivers
        Windows of :func:`test_windows`.
    settings : Settings
        Settings of the run.
    learned : Learned
        The predictor and its windows.
    neighbours : callable
        The paper's prediction from driving codes and a number of neighbours.

    Returns
    -------
    dict of str to pandas.DataFrame
        By name: shares closed by method and kind of windows, coverage of the intervals by method and time, distances
        after some seconds, and gains by group of windows.
    """
    pooled = learned.predictor.pooled_
    seen = learned.first_seconds(test)
    theta = learned.predictor.predict(seen)
    driven = {"idm_pooled": test.drive(pooled), "idm_rollout": test.drive(theta)}
    driven["idm_residual"] = drive_by(learned.residual, test)
    driven["idm_residual_ahead"] = drive_by(_smoothed_ahead(learned), test)
    driven["idm_prediction"] = test.drive(neighbours(test.code(settings.observed), settings.neighbours))
    driven["idm_oracle"] = test.drive(np.concatenate([fits_or(s, pooled, settings.desired_speed) for s in test.scenes]))
    errors = {
        name: np.concatenate([window_ade(s, t) for s, t in zip(test.scenes, found, strict=True)])
        for name, found in driven.items()
    }
    for name, with_leader in (("black_box_first_second", False), ("black_box_with_leaders_path", True)):
        errors[name] = black_box_ade(learned, test, with_leader=with_leader)
    at_fault = {name: test.score(found)["at_fault"].to_numpy() for name, found in driven.items()}
    return {
        "prediction_share": _shares(test, errors, at_fault),
        "prediction_coverage": coverage_of(learned, test, driven),
        "prediction_distances": for_whom.distances(test, driven),
        "prediction_for_whom": for_whom.table(test, seen, errors),
    }


def drive_by(residual: ResidualPredictor, drivers: Drivers) -> list[Trajectories]:
    """Drive windows by the pooled IDM and a predicted residual.

    Parameters
    ----------
    residual : ResidualPredictor
        Fitted.
    drivers : Drivers
        Windows.

    Returns
    -------
    list of Trajectories
        One a period, by the kernel.
    """
    return [drive_residual(s, residual.predict(s)) for s in drivers.scenes]


def _smoothed_ahead(learned: Learned) -> ResidualPredictor:
    """Return the residual with the future in its observed second.

    The recording's smoothing looks up to a second ahead.
    """
    other = residual_of(learned.predictor, past_only=False, ridges=(learned.residual.ridge_,), folds=FEWEST_FOLDS)
    return other.fit(list(learned.windows.scenes))


def _shares(test: Drivers, errors: dict[str, Floats], at_fault: dict[str, npt.NDArray[np.bool_]]) -> pd.DataFrame:
    """Return the share closed by method and kind of windows.

    Intervals are paired bootstrap intervals over drivers.
    """
    keys = test.keys()
    entry = (keys["first_frame"] == keys.groupby([c.PERIOD, c.VEHICLE])["first_frame"].transform("min")).to_numpy()
    rows, every, stays = [], np.ones(len(keys), dtype=bool), np.concatenate([stays_in_lane(s) for s in test.scenes])
    kinds = {"entry": entry, "every 6 s": every, "entry, in lane": entry & stays, "every 6 s, in lane": stays}
    for kind, which in kinds.items():
        if not which.any():
            continue
        by_driver = pd.DataFrame(errors)[which].groupby([keys[c.PERIOD][which], keys[c.VEHICLE][which]]).mean()
        for name in errors:
            hits = int((at_fault[name] & ~at_fault["idm_pooled"])[which].sum()) if name in at_fault else np.nan
            rows.append(
                {
                    "windows": kind,
                    "method": name,
                    **share_closed(by_driver, name),
                    "drivers": len(by_driver),
                    "number": int(which.sum()),
                    "at_fault_beyond_pooled": hits,
                }
            )
    return pd.DataFrame(rows)
