r"""Deviation from the recorded vehicle, and plausibility of the driving.

All metrics are over the steps :math:`t = 1 \dots T` after the start, where the error is zero by
construction. The paper's sum begins at :math:`t = 0` and divides by :math:`T`, which gives the same
number. Positions are those of the front bumpers. Averages and standard errors are over *vehicles*,
never over frames, whose errors are not independent. Several windows of a vehicle are averaged first.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation.collisions import first_contacts
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.perception import leaders_along
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

Floats = npt.NDArray[np.float64]

CRITICAL_TIME_TO_COLLISION = 1.5  # s
HARD_ACCELERATION = 3.0  # m/s^2, above what is comfortable

# Defined for every vehicle. A NaN among them means a broken trajectory and makes the mean NaN.
ERRORS = ("ade_m", "fde_m", "speed_rmse_m_s")
CONDUCT = ("critical_ttc_share", "hard_acceleration_share", "jerk_rms_m_s3", "lane_departure_share")
OF_GAPS = ("min_gap_m", "gap_rmse_m")  # NaN for a vehicle that never has a leader


def displacement(scenes: Scenes, trajectories: Trajectories) -> Floats:
    """Return the distance between modelled and recorded front bumper.

    Parameters
    ----------
    scenes : Scenes
        Windows of the drivers.
    trajectories : Trajectories
        One row a driver of ``scenes``.

    Returns
    -------
    float64, shape (vehicles, T)
        Distance (m), from step 1 on.
    """
    x, y = recorded_from_start(scenes, scenes.x), recorded_from_start(scenes, scenes.y)
    return np.asarray(np.hypot(trajectories.x - x, trajectories.y - y)[:, 1:])


def score(scenes: Scenes, trajectories: Trajectories) -> pd.DataFrame:
    """Return the metrics of each driver and window.

    Parameters
    ----------
    scenes : Scenes
        Windows of the drivers.
    trajectories : Trajectories
        One row a driver of ``scenes``.

    Returns
    -------
    pandas.DataFrame
        ``period``, ``vehicle``, ``first_frame`` and

        ``ade_m``, ``fde_m``
            average and final displacement error.
        ``speed_rmse_m_s``
            root mean square difference of modelled and recorded speed.
        ``collision``, ``at_fault``, ``contact_time_s``, ``contact_with``, ``contact_edge``
            see :mod:`idm_sumo.evaluation.collisions`.
        ``min_gap_m``
            smallest gap to the vehicle ahead in the front's lane, negative inside another vehicle; NaN
            without any. Where the scenes hold only the recorded vehicle's leader, the gap to that one.
        ``critical_ttc_share``
            share of steps in which gap over approach rate is below 1.5 s, or the gap below 0.
        ``hard_acceleration_share``, ``jerk_rms_m_s3``
            of the differences of speed, which are zero at standstill even if the model demands braking.
        ``lane_departure_share``
            share of steps in which the front's middle is outside the lane of the start.
        ``gap_rmse_m``
            root mean square difference between modelled gap (as above) and recorded gap. The latter is to
            the recorded vehicle's own leader in its own lane, another vehicle once either has changed lanes.
            Over the steps in which both have a leader; NaN without any.
    """
    error = displacement(scenes, trajectories)
    speed_error = (trajectories.speed - recorded_from_start(scenes, scenes.speed))[:, 1:]
    errors = {"ade_m": error.mean(axis=1), "fde_m": error[:, -1], "speed_rmse_m_s": _root_mean_square(speed_error)}
    conduct = _gap_metrics(scenes, trajectories) | _motion_metrics(scenes, trajectories)
    return scenes.keys().assign(**errors).join(first_contacts(scenes, trajectories)).join(pd.DataFrame(conduct))


def summary(scores: pd.DataFrame) -> dict[str, float]:
    """Return the metrics of one method over all vehicles.

    Parameters
    ----------
    scores : pandas.DataFrame
        Rows of :func:`score`, of one or more periods.

    Returns
    -------
    dict of str to float
        Mean and standard error over vehicles of every metric (``ade_m``, ``ade_se_m``, ...; see
        :func:`standard_error_name`), ``collisions`` and ``contacts`` (vehicles with a collision at their
        fault; with any), ``critical_ttc_vehicles`` (with a critical time to collision at any step),
        ``vehicles`` and ``vehicles_with_leader``. A standard error of fewer than two vehicles is NaN.
    """
    metrics = [*ERRORS, *CONDUCT, *OF_GAPS]
    by_vehicle = scores.groupby([c.PERIOD, c.VEHICLE], observed=True, sort=False)
    means, counts = by_vehicle[metrics].mean(), by_vehicle[metrics].count()
    whole = counts.eq(by_vehicle.size(), axis="index")  # no NaN among the windows
    figures: dict[str, float] = {}
    for name in metrics:
        values = (means[name].dropna() if name in OF_GAPS else means[name].where(whole[name])).to_numpy()
        figures[name], figures[standard_error_name(name)] = _mean_and_error(values)
    figures["collisions"] = int(by_vehicle["at_fault"].any().sum())
    figures["contacts"] = int(by_vehicle["collision"].any().sum())
    figures["critical_ttc_vehicles"] = int((by_vehicle["critical_ttc_share"].max() > 0).sum())
    figures["vehicles"] = by_vehicle.ngroups
    figures["vehicles_with_leader"] = int(counts["min_gap_m"].gt(0).sum())
    return figures


def standard_error_name(metric: str) -> str:
    """Return the column of a metric's standard error.

    Parameters
    ----------
    metric : str
        Column of the metric.

    Returns
    -------
    str
        ``ade_m`` gives ``ade_se_m``, and a share ``..._share_se``.
    """
    for unit in ("_m_s3", "_m_s", "_m"):
        if metric.endswith(unit):
            return f"{metric.removesuffix(unit)}_se{unit}"
    return f"{metric}_se"


def _mean_and_error(values: Floats) -> tuple[float, float]:
    if len(values) == 0:
        return np.nan, np.nan
    error = float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else np.nan
    return float(values.mean()), error


def recorded_from_start(scenes: Scenes, values: Floats) -> Floats:
    """Return recorded values from the start over the horizon.

    Parameters
    ----------
    scenes : Scenes
        Windows of the drivers.
    values : float64, shape (vehicles, frames)
        A recorded quantity by frame of the window.

    Returns
    -------
    float64, shape (vehicles, T + 1)
        From the start of the simulation.
    """
    return values[:, scenes.start : scenes.start + scenes.window.horizon + 1]


def _root_mean_square(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(values**2, axis=1)))


def _gap_metrics(scenes: Scenes, trajectories: Trajectories) -> dict[str, Floats]:
    own = leaders_along(scenes, trajectories.x, trajectories.y, scenes.start)
    recorded = leaders_along(
        scenes, recorded_from_start(scenes, scenes.x), recorded_from_start(scenes, scenes.y), scenes.start
    )
    gap, recorded_gap = own.gap[:, 1:], recorded.gap[:, 1:]
    critical = is_critical(gap, trajectories.speed[:, 1:] - own.speed[:, 1:])
    smallest = gap.min(axis=1)
    both = np.isfinite(gap) & np.isfinite(recorded_gap)
    squared = np.where(both, np.subtract(gap, recorded_gap, where=both, out=np.zeros_like(gap)) ** 2, 0.0).sum(axis=1)
    count = both.sum(axis=1)
    mean_square = np.divide(squared, count, out=np.full(len(count), np.nan), where=count > 0)
    return {
        "min_gap_m": np.where(np.isfinite(smallest), smallest, np.nan),
        "critical_ttc_share": critical.mean(axis=1),
        "gap_rmse_m": np.sqrt(mean_square),
    }


def is_critical(gap: Floats, approach_rate: Floats) -> npt.NDArray[np.bool_]:
    """Return where the time to collision is critical.

    Parameters
    ----------
    gap : float64 array
        Gap (m).
    approach_rate : float64 array, shape of ``gap``
        Own speed minus the leader's (m/s).

    Returns
    -------
    bool array, shape of ``gap``
        Where gap over approach rate is below 1.5 s, or the gap is not positive.
    """
    return (gap <= 0.0) | (gap < CRITICAL_TIME_TO_COLLISION * approach_rate)


def _motion_metrics(scenes: Scenes, trajectories: Trajectories) -> dict[str, Floats]:
    acceleration = np.diff(trajectories.speed, axis=1) / FRAME_STEP
    jerk = np.diff(acceleration, axis=1) / FRAME_STEP
    off_center = np.abs(trajectories.y[:, 1:] - scenes.road.lane_center(scenes.lane)[:, None])
    return {
        "hard_acceleration_share": (np.abs(acceleration) > HARD_ACCELERATION).mean(axis=1),
        "jerk_rms_m_s3": _root_mean_square(jerk) if jerk.shape[1] else np.zeros(len(scenes)),
        "lane_departure_share": (off_center > 0.5 * scenes.road.lane_width(scenes.lane)[:, None]).mean(axis=1),
    }
