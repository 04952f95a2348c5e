"""Parameters and desired speeds as the rollouts read them.

From a driver table, whose rows are found by their keys, or from an array.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.models import idm
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

Floats = npt.NDArray[np.float64]

PARAMETERS = idm.IDMParameters._fields
DESIRED_SPEED = "desired_speed_m_s"  # v0, a column of the table, so that it travels with the parameters
FIRST_FRAME = "first_frame"  # of the calibration window; part of the key where it is given
KEYS = (c.PERIOD, c.VEHICLE)


def key_columns(drivers: pd.DataFrame) -> list[str]:
    """Return the columns that tell drivers apart.

    Parameters
    ----------
    drivers : pandas.DataFrame

    Returns
    -------
    list of str
        Period, vehicle and, if given, the window's first frame.
    """
    return [*KEYS, *([FIRST_FRAME] if FIRST_FRAME in drivers else [])]


def as_driven(
    scenes: Scenes, drivers: pd.DataFrame | npt.ArrayLike, desired_speed: npt.ArrayLike | None = None
) -> tuple[Floats, Floats]:
    """Return parameters and desired speed of every window.

    Parameters
    ----------
    scenes : Scenes
    drivers : pandas.DataFrame, or array_like of shape (windows, 5) or (5,)
        A driver table, whose rows are found by their keys, or ``a, b, T, d0, d1`` in SI units.
    desired_speed : array_like, shape (windows,) or (), optional
        m/s; by default the table's, else the speed limit of the scenes' road.

    Returns
    -------
    parameters : float64, shape (windows, 5)
    desired_speed : float64, shape (windows,)

    Raises
    ------
    InputError
        If a window has no driver in the table, or one without parameters.
    """
    n, given = len(scenes), desired_speed
    if isinstance(drivers, pd.DataFrame):
        theta = parameters_of(drivers, scenes)
        if (lost := np.isnan(theta).any(axis=1)).any():
            row = scenes.keys()[lost].iloc[0]
            raise InputError(
                f"drivers: vehicle {row[c.VEHICLE]} of period {row[c.PERIOD]} has no parameters, see its status; "
                "leave it out of the scenes"
            )
        given = desired_speeds_of(drivers, scenes, desired_speed)
    else:
        # No view: a read-only array is another type to numba.
        theta = np.array(np.broadcast_to(drivers, (n, len(PARAMETERS))), dtype=np.float64, order="C")
    return theta, np.array(np.broadcast_to(scenes.road.desired_speed(given), (n,)), dtype=np.float64)


def parameters_of(drivers: pd.DataFrame, scenes: Scenes) -> Floats:
    """Return ``a, b, T, d0, d1`` of every window's driver.

    Parameters
    ----------
    drivers : pandas.DataFrame
        ``period, vehicle, a, b, T, d0, d1``; ``first_frame`` where a vehicle has several windows.
    scenes : Scenes

    Returns
    -------
    float64, shape (windows, 5)
        NaN where nothing could be fitted.

    Raises
    ------
    InputError
        If a window has no driver in the table.
    """
    return _looked_up(drivers, scenes, list(PARAMETERS))


def desired_speeds_of(
    drivers: pd.DataFrame, scenes: Scenes, desired_speed: npt.ArrayLike | None = None
) -> npt.ArrayLike | None:
    """Return what drivers want to drive (m/s).

    Parameters
    ----------
    drivers : pandas.DataFrame
    scenes : Scenes
    desired_speed : array_like, shape (windows,) or (), optional
        m/s.

    Returns
    -------
    float64, shape (windows,), or as given, or None
        As given, else the table's, else None.

    Raises
    ------
    InputError
        If a window has no driver in the table.
    """
    if desired_speed is not None or DESIRED_SPEED not in drivers:
        return desired_speed
    return _looked_up(drivers, scenes, [DESIRED_SPEED])[:, 0]


def _looked_up(drivers: pd.DataFrame, scenes: Scenes, names: list[str]) -> Floats:
    """Return columns of each window's row, shape (windows, columns)."""
    on = key_columns(drivers)
    keys = scenes.keys()[on]
    named = drivers.assign(**{c.PERIOD: drivers[c.PERIOD].astype(str)})[[*on, *names]]
    merged = keys.merge(named, on=on, how="left", validate="m:1", indicator=True)
    if (absent := merged["_merge"] != "both").any():
        row = keys[absent].iloc[0]
        raise InputError(
            f"drivers: vehicle {row[c.VEHICLE]} of period {row[c.PERIOD]} is missing; "
            "calibrate it, or leave it out of the scenes"
        )
    return np.asarray(merged[names].to_numpy(dtype=np.float64))
