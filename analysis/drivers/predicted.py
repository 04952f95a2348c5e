"""``predict``: the drivers of one recording from their first frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from idm_sumo.calibration.departures import departures
from idm_sumo.calibration.without_d1 import MEAN_SPEED
from idm_sumo.prediction import ResidualPredictor, RolloutPredictor, predict_drivers, recent
from idm_sumo.prediction.driver_prediction import (
    LEARNING_STEP,
    SECOND,
    drivers_of,
    predict_through_rollout,
    typical_desired_speed,
)
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes, Window

from .source import Drivers, Source, beside, modelled

KNN, ROLLOUT, RESIDUAL = METHODS = ("knn", "rollout", "residual")


@dataclass(frozen=True)
class Prediction:
    """What is seen of a driver, and by which method it is predicted.

    Attributes
    ----------
    window : Window
    periods : tuple of str
        Recording periods; all without any.
    method : {"knn", "rollout", "residual"}
    neighbours : int
        Drivers that KNN averages.
    seed : int
        Of everything random.
    """

    window: Window
    periods: tuple[str, ...] = ()
    method: str = KNN
    neighbours: int = 8
    seed: int = 1


def check_library(how: Prediction, given: bool) -> None:
    """Raise if a method needs calibrated drivers and none are given.

    Parameters
    ----------
    how : Prediction
    given : bool
        Whether they are.

    Raises
    ------
    InputError
    """
    if how.method == KNN and not given:
        raise InputError(
            "--drivers: the neighbours need calibrated drivers; `idm-sumo calibrate RECORDING -o FILE` writes them"
        )


def predicted(source: Source, how: Prediction, library: pd.DataFrame | None) -> Drivers:
    """Predict every driver of a recording.

    Parameters
    ----------
    source : Source
    how : Prediction
    library : pandas.DataFrame or None
        Calibrated drivers to learn from; without them the methods other than KNN learn from the recording.

    Raises
    ------
    InputError
        If the recording cannot be read, or there is nobody to predict or to learn from.
    """
    check_library(how, library is not None)
    foresee = _neighbours(how, library) if how.method == KNN else _through_rollout(source, how, library)
    found = modelled(source, how.window, how.periods)
    observed = pd.DataFrame({MEAN_SPEED: found.scenes.speed[:, : how.window.observed].mean(axis=1)})
    return found.with_table(beside(foresee(found.scenes), departures(found.scenes), observed))


def _neighbours(how: Prediction, library: pd.DataFrame | None) -> Callable[[Scenes], pd.DataFrame]:
    """Return the paper's prediction."""
    assert library is not None  # as checked
    return lambda scenes: predict_drivers(scenes, library, observed=how.window.observed, neighbours=how.neighbours)


def _through_rollout(source: Source, how: Prediction, library: pd.DataFrame | None) -> Callable[[Scenes], pd.DataFrame]:
    """Learn from the recording; return the prediction."""
    speed = None if library is None else typical_desired_speed(library)
    second = min(how.window.observed, SECOND)
    windows = modelled(source, Window(observed=how.window.observed, every=LEARNING_STEP), how.periods).scenes
    windows = windows if library is None else drivers_of(windows, library)
    predictor = RolloutPredictor(desired_speed=speed, seed=how.seed).fit(recent(windows, second))

    def parameters(scenes: Scenes) -> pd.DataFrame:
        return predict_through_rollout(recent(scenes, second), predictor).assign(first_frame=scenes.first_frame)

    if how.method == ROLLOUT:
        return parameters
    residual = ResidualPredictor(desired_speed=speed, seed=how.seed, one_for_all=predictor.pooled_).fit(windows)
    return lambda scenes: beside(parameters(scenes), residual.predict_left_out(scenes).to_pandas())
