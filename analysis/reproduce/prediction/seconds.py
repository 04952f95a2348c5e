"""Accuracy of prediction against the seconds observed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation.metrics import displacement
from idm_sumo.prediction import ResidualPredictor, drive_residual, recent
from idm_sumo.prediction.recent import past
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes, Window
from idm_sumo.simulation.rollout import Trajectories, drive_idm

from ..drivers import Drivers
from ..settings import Settings
from ..source import Source
from .intervals import resampled_drivers, share_closed
from .learned import Learned, fits_or, residual_of, some_drivers
from .share import FEWEST_FOLDS

Floats = npt.NDArray[np.float64]

SECONDS = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
FITTED = (5.0, 10.0, 20.0)  # observations that are long enough for a fit
STEP = 60  # frames between windows
MOST_DRIVERS = 100  # largest number of drivers of a period, drawn at random
THINNED = 2  # predictors for less than a second are trained on every second window
RESIDUAL, OWN_PAST, POOLED, ORACLE = "idm_residual", "idm_own_past", "idm_pooled", "idm_oracle"
COLUMNS = (
    "observed_s",
    "method",
    "ade_m",
    "fde_m",
    "share",
    "share_low",
    "share_high",
    "drivers",
    "number",
)


def table(source: Source, settings: Settings, learned: Learned) -> pd.DataFrame:
    """Return accuracy by method and time observed.

    All rows drive the same test windows, which begin where the longest observation ends. Of a period with more
    than 100 drivers so many are drawn. ``idm_residual`` is fitted to training windows observed for as long.
    ``idm_own_past`` has parameters fitted to the driver's own observed past only.

    Parameters
    ----------
    source : Source
        Recordings, split into training and test.
    settings : Settings
        Settings of the run.
    learned : Learned
        The predictors and their windows.

    Returns
    -------
    pandas.DataFrame
        ADE, FDE and share of the way from pooled to oracle; empty if no driver is recorded for long enough.
    """
    test = _watched(source, settings)
    if test is None:
        return pd.DataFrame(columns=list(COLUMNS))
    frames = test.scenes[0].window.observed
    seconds = [s for s in SECONDS if _frames(s) <= frames]
    found: dict[tuple[str, float], list[Trajectories]] = {
        (POOLED, np.nan): _driven(test, [np.tile(learned.predictor.pooled_, (len(s), 1)) for s in test.scenes]),
        (ORACLE, np.nan): _driven(test, [_fits(recent(s, 1), learned) for s in test.scenes]),
    }
    for s in seconds:
        residual = _residual(source, settings, learned, _frames(s))
        if residual is not None:
            shown = [recent(one, residual.observed_) for one in test.scenes]
            found[RESIDUAL, s] = [drive_residual(one, residual.predict(one)) for one in shown]
    for s in (s for s in FITTED if s in seconds):
        found[OWN_PAST, s] = _driven(test, [_fits(past(one, _frames(s))[0], learned) for one in test.scenes])
    return _rows(test, found)


def _frames(seconds: float) -> int:
    return round(seconds / FRAME_STEP)


def _watched(source: Source, settings: Settings) -> Drivers | None:
    """Return test windows that follow the longest possible observation.

    It takes at least two seconds.
    """
    for seconds in (s for s in reversed(SECONDS) if s >= 2.0):
        try:
            found, _ = source.drivers(source.test, "test", Window(_frames(seconds), settings.horizon, every=STEP))
        except InputError:
            continue
        rng = np.random.default_rng(settings.seed)
        return replace(found, scenes=tuple(some_drivers(s, rng, MOST_DRIVERS) for s in found.scenes))
    return None


def _residual(source: Source, settings: Settings, learned: Learned, frames: int) -> ResidualPredictor | None:
    """Return a residual fitted to so many observed frames.

    None if no training driver was observed for as long or can be driven.
    """
    whole = learned.residual
    if frames == whole.observed_:
        return whole
    try:
        windows = _training(source, settings, learned, frames)
        other = residual_of(learned.predictor, ridges=(whole.ridge_,), folds=FEWEST_FOLDS)
        return other.fit(windows)
    except InputError:
        return None


def _training(source: Source, settings: Settings, learned: Learned, frames: int) -> list[Scenes]:
    if frames < learned.residual.observed_:
        return [recent(s.subset(np.arange(0, len(s), THINNED)), frames) for s in learned.windows.scenes]
    found, _ = source.drivers(source.train, "train", Window(frames, settings.horizon, every=STEP))
    rng = np.random.default_rng(settings.seed)
    return [some_drivers(s, rng) for s in found.scenes]


def _driven(test: Drivers, theta: list[Floats]) -> list[Trajectories]:
    follows = [recent(s, 1) for s in test.scenes]
    return [drive_idm(s, t, desired_speed=test.desired_speed) for s, t in zip(follows, theta, strict=True)]


def _fits(scenes: Scenes, learned: Learned) -> Floats:
    return fits_or(scenes, learned.predictor.pooled_, learned.predictor.desired_speed)


def _rows(test: Drivers, found: dict[tuple[str, float], list[Trajectories]]) -> pd.DataFrame:
    keys = test.keys()
    follows = [recent(s, 1) for s in test.scenes]
    by_driver = {}
    for what, driven in found.items():
        off = np.concatenate([displacement(s, t) for s, t in zip(follows, driven, strict=True)])
        errors = pd.DataFrame({"ade_m": off.mean(axis=1), "fde_m": off[:, -1]})
        by_driver[what] = errors.groupby([keys[c.PERIOD], keys[c.VEHICLE]]).mean()
    ends = {name: own["ade_m"] for (name, _), own in by_driver.items() if name in (POOLED, ORACLE)}
    rows = []
    for (name, seconds), own in by_driver.items():
        ade = pd.DataFrame({**ends, name: own["ade_m"]})
        rows.append({"observed_s": seconds, "method": name, "fde_m": own["fde_m"].mean(), **share_closed(ade, name),
                     **_on_one_second(by_driver[RESIDUAL, 1.0]["ade_m"] - own["ade_m"]),
                     "drivers": len(own), "number": len(keys)})  # fmt: skip
    return pd.DataFrame(rows)


def _on_one_second(gain: pd.Series) -> dict[str, float]:
    """Return the gain (m) over one second, with its interval."""
    values = gain.to_numpy(np.float64)
    low, high = np.quantile(values[resampled_drivers(len(values))].mean(axis=1), [0.025, 0.975])
    return {"on_1s_m": values.mean(), "on_1s_low_m": low, "on_1s_high_m": high}
