"""``calibrate``: the drivers of one recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import calibrate
from idm_sumo.calibration.drawn import drawn_columns, one_a_driver
from idm_sumo.calibration.parameter_sets import pooled_columns
from idm_sumo.calibration.search import Search
from idm_sumo.calibration.table import GAUSS_NEWTON_SEARCH
from idm_sumo.calibration.whole import IDM, fit_whole_drivers, whole_columns
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
        Without ``every`` a driver has one row, of its first window; its vehicle type is fitted to all of its windows,
        which follow each other.
    periods : tuple of str
        Recording periods; all without any.
    objective : str
        What is minimised.
    search : Search
    desired_speed : float, str or None
        m/s, "auto", or None for the speed limit.
    all_windows : bool
        One set for each driver from all of its windows.
    laws : tuple of str
        SUMO's models, beside the IDM, of which vehicle types are fitted.
    """

    window: Window
    periods: tuple[str, ...] = ()
    objective: str = "ade"
    search: Search = GAUSS_NEWTON_SEARCH
    desired_speed: float | str | None = None
    all_windows: bool = False
    laws: tuple[str, ...] = ()


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
    windows = replace(how.window, every=how.window.every or how.window.horizon)
    found = modelled(source, windows, how.periods)
    return found.with_table(driver_table(found.scenes, how, jobs=jobs, progress=progress))


def driver_table(windows: Scenes, how: Calibration, *, jobs: int = 1, progress: Progress = silent) -> pd.DataFrame:
    """Return the fits with what export and prediction need beside them.

    Parameters
    ----------
    windows : Scenes
        All windows of the drivers.
    how : Calibration
    jobs : int
        Processes.
    progress : Progress
    """
    one_each = how.window.every is None
    scenes = _first_windows(windows) if one_each and not how.all_windows else windows
    fits = calibrate(
        scenes,
        objective=how.objective,
        search=how.search,
        desired_speed=how.desired_speed,
        jobs=jobs,
        progress=_named("calibrating", progress),
    )
    if how.all_windows:
        fits = fit_whole_drivers(fits, scenes, _named("drivers", progress))
        scenes = _first_windows(scenes)
    drawn = drawn_columns(windows, _desired(fits, windows))
    if len(drawn) != len(fits):
        drawn = one_a_driver(drawn)
    table = beside(fits, drawn, pooled_columns(scenes, float(fits["desired_speed_m_s"].max())))
    if not how.all_windows:  # the refit without d1 is one of a single window
        table = beside(table, refit_table(table, scenes))
        table = beside(table, without_d1_costs(table, scenes))
    if one_each or how.all_windows:
        for law in (IDM, *how.laws):
            table = beside(table, whole_columns(fits, windows, _named(f"{law} types", progress), law=law))
    return beside(table, driving_code(scenes))


def _desired(fits: pd.DataFrame, windows: Scenes) -> npt.NDArray[np.float64]:
    """Return every window's desired speed (m/s): that of its driver."""
    keys = ["period", "vehicle"]
    own = fits.groupby(keys, observed=True)["desired_speed_m_s"].max().rename("v0").reset_index()
    return np.asarray(windows.keys()[keys].merge(own, on=keys, how="left")["v0"], dtype=np.float64)


def _first_windows(scenes: Scenes) -> Scenes:
    """Return each driver's first window."""
    return scenes.subset(~scenes.keys().duplicated(["period", "vehicle"]).to_numpy())


def _named(stage: str, report: Progress) -> Progress:
    """Return a progress that reports under another name."""
    return lambda _, done, total: report(stage, done, total)
