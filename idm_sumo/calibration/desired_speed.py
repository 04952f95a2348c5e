"""The desired speed of drivers, estimated from their recording."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from idm_sumo.calibration.pooled import usable_windows
from idm_sumo.calibration.problem import only, prepare
from idm_sumo.calibration.solver import STARTS, design_of_starts, fit_all
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

AUTO = "auto"
WINDOWS = 200  # at most, that are fitted to find it
FASTEST = 2.0  # times the highest speed driven: a desired speed beyond is not seen in a recording
GRID = 12  # speeds between which it is searched first
PRECISE = 0.005  # relative


def estimate_desired_speeds(scenes: Scenes) -> Floats:
    """Estimate the desired speed of every driver.

    A sixth parameter, which one window hardly determines and all windows together do: the one
    desired speed with which the drivers, each with its own best parameters, stay nearest to
    their recorded vehicles (least mean ADE). Nobody wants less than it drives, so it is at least
    the highest speed of the driver's window. Of many windows 200 evenly spaced ones are used.

    Parameters
    ----------
    scenes : Scenes

    Returns
    -------
    float64, shape (windows,)
        m/s. The road's speed limit, at least, where no window can be fitted.
    """
    speed = scenes.speed[:, scenes.start : scenes.start + scenes.window.horizon + 1]
    driven = np.nan_to_num(speed).max(axis=1, initial=0.0)
    problem = prepare(scenes)
    usable = np.flatnonzero(usable_windows(problem, scenes) & (driven > 0.0))
    if not len(usable):
        return np.asarray(np.maximum(driven, scenes.road.speed_limit))
    some = usable[np.unique(np.linspace(0, len(usable) - 1, WINDOWS).astype(np.int64))]
    part, starts = only(problem, some), design_of_starts(STARTS)

    def error(log_speed: float) -> float:
        limit = np.maximum(np.exp(log_speed), driven[some])
        _, value, _ = fit_all(part._replace(desired_speed=limit), np.arange(len(some)), starts)
        return float(np.mean(value))

    grid = np.log(np.geomspace(np.median(driven[some]), FASTEST * driven[some].max(), GRID))
    best = int(np.argmin([error(one) for one in grid]))
    between = grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)]
    found = minimize_scalar(error, bounds=between, method="bounded", options={"xatol": PRECISE})
    return np.asarray(np.maximum(np.exp(found.x), driven))
