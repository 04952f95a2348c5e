"""Drivers drawn to their population, in the driver table.

Ten seconds give back a trajectory, not the driver: many fits end at a bound of the search, and a vehicle
type at a bound blocks a road. Drawn to the population (:mod:`idm_sumo.calibration.hierarchical`), a driver
keeps what its window says of it, and takes the rest from the others.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration.hierarchical import FEWEST_DRIVERS, hierarchical
from idm_sumo.calibration.without_d1 import REFIT, REFIT_ADE, REFIT_INTEGRATION
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import PARAMETERS

NAMES = list(PARAMETERS)
DRAWN = [f"{name}_drawn" for name in NAMES]
DRAWN_SHARE = "drawn_share"  # 0 where the window alone decides, 1 where it says nothing


def drawn_columns(scenes: Scenes, desired_speed: npt.ArrayLike | None = None) -> pd.DataFrame:
    """Draw every driver to the population of all.

    Parameters
    ----------
    scenes : Scenes
    desired_speed : array_like, shape (windows,) or (), optional
        m/s; by default the road's speed limit.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, first_frame``; ``a_drawn, b_drawn, T_drawn, d0_drawn, d1_drawn`` (SI); ``drawn_share``.
        NaN without a fit, and for all if fewer than ten windows can be fitted.
    """
    table = scenes.keys()
    try:
        found, _ = hierarchical(scenes, desired_speed=desired_speed)
    except InputError:  # too few drivers to be a population
        return table.assign(**dict.fromkeys([*DRAWN, DRAWN_SHARE], np.nan))
    table[DRAWN] = found[NAMES].to_numpy()
    return table.assign(**{DRAWN_SHARE: found["drawn"].to_numpy()})


def as_drawn(drivers: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return a driver table whose parameters are the drawn ones.

    Parameters
    ----------
    drivers : pandas.DataFrame
        With the columns of :func:`drawn_columns`.
    source : str
        How messages name them.

    Returns
    -------
    pandas.DataFrame
        Without the refits of the fitted parameters, and without the drivers that could not be drawn.

    Raises
    ------
    InputError
        If the columns are missing or empty.
    """
    if not set(DRAWN) <= set(drivers) or drivers[DRAWN].isna().all(axis=None):
        raise InputError(
            f"{source}: no driver is drawn to its population (columns {DRAWN[0]} ... {DRAWN[-1]}); "
            f"`idm-sumo calibrate` writes them for recordings with {FEWEST_DRIVERS} drivers and more"
        )
    refits = [name for name in drivers if name in (*REFIT, REFIT_ADE, REFIT_INTEGRATION)]
    known = drivers[drivers[DRAWN].notna().all(axis=1)].drop(columns=refits).reset_index(drop=True)
    return known.assign(**{name: known[drawn] for name, drawn in zip(NAMES, DRAWN, strict=True)})
