"""Accuracy of prediction against the seconds observed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation.metrics import displacement
from idm_sumo.prediction import MovingHorizon, RolloutPredictor, first_second, recent
from idm_sumo.prediction.moving_horizon import past
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes, Window
from idm_sumo.simulation.rollout import drive_idm

from ..drivers import Drivers
from ..settings import Settings
from ..source import Source
from .intervals import resampled_drivers, share_closed
from .learned import Learned, fits_or, some_drivers

Floats = npt.NDArray[np.float64]

SECONDS = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
FITTED = (5.0, 10.0, 20.0)  # observations that are long enough for a fit
STEP = 60  # frames between windows
MOST_DRIVERS = 100  # largest number of drivers of a period, drawn at random
THINNED = 2  # predictors for less than a second are trained on every second window
SHORT_FOLDS = 2  # folds of these predictors, whose spread is not used
WATCHED, OWN_PAST, POOLED, ORACLE = "idm_watched", "idm_own_past", "idm_pooled", "idm_oracle"
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
    "strength",
)


def table(source: Source, settings: Settings, learned: Learned) -> pd.DataFrame:
    """Return accuracy by method and time observed.

    All rows drive the same test windows, which begin where the longest observation ends. Of a period with more
    than 100 drivers so many are drawn. ``idm_watched`` is the moving-horizon estimate, and below a second a
    predictor fitted to so few frames. ``idm_own_past`` has parameters fitted to the driver's own observed past only.

    Parameters
    ----------
    source : Source
        Recordings, split into training and test.
    settings : Settings
        Settings of the run.
    learned : Learned
        The predictor and its windows.

    Returns
    -------
    pandas.DataFrame
        ADE, FDE and share of the way from pooled to oracle; empty if no driver is recorded for long enough.
    """
    test = _watched(source, source.test, "test", settings)
    if test is None:
        return pd.DataFrame(columns=list(COLUMNS))
    watcher = _watcher(source, settings, learned)
    frames = test.scenes[0].window.observed
    seconds = [s for s in SECONDS if _frames(s) <= frames]
    found: dict[tuple[str, float], list[Floats]] = {
        (POOLED, np.nan): [np.tile(learned.predictor.pooled_, (len(s), 1)) for s in test.scenes],
        (ORACLE, np.nan): [_fits(recent(s, 1), learned) for s in test.scenes],
    }
    for s in seconds:
        found[WATCHED, s] = _predicted(test, watcher, learned, _frames(s))
    for s in (s for s in FITTED if s in seconds):
        found[OWN_PAST, s] = [_fits(past(one, _frames(s))[0], learned) for one in test.scenes]
    return _rows(test, found).assign(strength=watcher.strength_)


def _frames(seconds: float) -> int:
    return round(seconds / FRAME_STEP)


def _watched(source: Source, side: dict[str, frozenset[int]], name: str, settings: Settings) -> Drivers | None:
    """Return windows that follow the longest possible observation.

    It takes at least two seconds.
    """
    for seconds in (s for s in reversed(SECONDS) if s >= 2.0):
        try:
            found, _ = source.drivers(side, name, Window(_frames(seconds), settings.horizon, every=STEP))
        except InputError:
            continue
        rng = np.random.default_rng(settings.seed)
        return replace(found, scenes=tuple(some_drivers(s, rng, MOST_DRIVERS) for s in found.scenes))
    return None


def _watcher(source: Source, settings: Settings, learned: Learned) -> MovingHorizon:
    """Learn the weight of the past from training drivers.

    The predictor left them out.
    """
    train = _watched(source, source.train, "training", settings)
    watcher = MovingHorizon(learned.predictor, seed=settings.seed)
    try:
        return watcher.fit([] if train is None else list(train.scenes))
    except InputError:  # no driver was observed for long enough or can be driven, so the past gets no weight
        watcher.strength_ = 0.0
        return watcher


def _predicted(test: Drivers, watcher: MovingHorizon, learned: Learned, frames: int) -> list[Floats]:
    if frames >= learned.predictor.observed_:
        return [watcher.predict(s, frames) for s in test.scenes]
    whole = learned.predictor
    short = RolloutPredictor(whole.ridge, SHORT_FOLDS, whole.desired_speed, whole.seed, whole.pooled_)
    short.fit([recent(s.subset(np.arange(0, len(s), THINNED)), frames) for s in learned.windows.scenes])
    return [short.predict(first_second(recent(s, frames))) for s in test.scenes]


def _fits(scenes: Scenes, learned: Learned) -> Floats:
    return fits_or(scenes, learned.predictor.pooled_, learned.predictor.desired_speed)


def _rows(test: Drivers, found: dict[tuple[str, float], list[Floats]]) -> pd.DataFrame:
    keys = test.keys()
    follows = [recent(s, 1) for s in test.scenes]
    by_driver = {}
    for what, theta in found.items():
        driven = (drive_idm(s, t, desired_speed=test.desired_speed) for s, t in zip(follows, theta, strict=True))
        off = np.concatenate([displacement(s, t) for s, t in zip(follows, driven, strict=True)])
        errors = pd.DataFrame({"ade_m": off.mean(axis=1), "fde_m": off[:, -1]})
        by_driver[what] = errors.groupby([keys[c.PERIOD], keys[c.VEHICLE]]).mean()
    ends = {name: own["ade_m"] for (name, _), own in by_driver.items() if name in (POOLED, ORACLE)}
    rows = []
    for (name, seconds), own in by_driver.items():
        ade = pd.DataFrame({**ends, name: own["ade_m"]})
        rows.append({"observed_s": seconds, "method": name, "fde_m": own["fde_m"].mean(), **share_closed(ade, name),
                     **_on_one_second(by_driver[WATCHED, 1.0]["ade_m"] - own["ade_m"]),
                     "drivers": len(own), "number": len(keys)})  # fmt: skip
    return pd.DataFrame(rows)


def _on_one_second(gain: pd.Series) -> dict[str, float]:
    """Return the gain (m) over one second, with its interval."""
    values = gain.to_numpy(np.float64)
    low, high = np.quantile(values[resampled_drivers(len(values))].mean(axis=1), [0.025, 0.975])
    return {"on_1s_m": values.mean(), "on_1s_low_m": low, "on_1s_high_m": high}
