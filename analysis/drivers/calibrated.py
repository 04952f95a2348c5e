"""``calibrate``: the drivers of one recording."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from idm_sumo.calibration import calibrate
from idm_sumo.calibration.drawn import drawn_columns
from idm_sumo.calibration.search import Search
from idm_sumo.calibration.table import GAUSS_NEWTON_SEARCH
from idm_sumo.calibration.whole import fit_whole_drivers
from idm_sumo.calibration.without_d1 import refit_table, without_d1_costs
from idm_sumo.prediction.driving_code import driving_code
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import Scenes, Window

from .source import Drivers, Source, beside, modelled


@dataclass(frozen=True)
class Calibration:
    """What is fitted, and how.

    Attributes
    ----------
    window : Window
    periods : tuple of str
        Recording periods; all without any.
    objective : str
        What is minimised.
    search : Search
    desired_speed : float, str or None
        m/s, "auto", or None for the speed limit.
    all_windows : bool
        One set for each driver from all of its windows.
    """

    window: Window
    periods: tuple[str, ...] = ()
    objective: str = "ade"
    search: Search = GAUSS_NEWTON_SEARCH
    desired_speed: float | str | None = None
    all_windows: bool = False


def calibrated(source: Source, how: Calibration, *, jobs: int = 1, progress: Progress = silent) -> Drivers:
    """Fit every driver of a recording.

    Parameters
    ----------
    source : Source
    how : Calibration
    jobs : int
        Processes.
    progress : Progress

    Raises
    ------
    InputError
        If the recording cannot be read, or holds nobody to fit.
    """
    found = modelled(source, how.window, how.periods)
    return found.with_table(driver_table(found.scenes, how, jobs=jobs, progress=progress))


def driver_table(scenes: Scenes, how: Calibration, *, jobs: int = 1, progress: Progress = silent) -> pd.DataFrame:
    """Return the fits with what export and prediction need beside them.

    Parameters
    ----------
    scenes : Scenes
    how : Calibration
    jobs : int
        Processes.
    progress : Progress
    """
    fits = calibrate(
        scenes,
        objective=how.objective,
        search=how.search,
        desired_speed=how.desired_speed,
        jobs=jobs,
        progress=_named("calibrating", progress),
    )
    if how.all_windows:
        first = ~fits.duplicated(["period", "vehicle"]).to_numpy()
        fits = fit_whole_drivers(fits, scenes, _named("drivers", progress))
        scenes = scenes.subset(first)
    table = beside(fits, drawn_columns(scenes, fits["desired_speed_m_s"]))
    if not how.all_windows:  # the refit without d1 is one of a single window
        table = beside(table, refit_table(table, scenes))
        table = beside(table, without_d1_costs(table, scenes))
    return beside(table, driving_code(scenes))


def _named(stage: str, report: Progress) -> Progress:
    """Return a progress that reports under another name."""
    return lambda _, done, total: report(stage, done, total)
