"""Drivers drawn to their population, in the driver table.

Ten seconds give back a trajectory, not the driver: many fits end at a bound of the search, and a vehicle
type at a bound blocks a road. Drawn to the population (:mod:`idm_sumo.calibration.hierarchical`), a driver
keeps what its window says of it, and takes the rest from the others. A driver whose window leads to a bound all
the same is not known: it is the population's median driver.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import identifiability
from idm_sumo.calibration.driver_table import OK, STATUS
from idm_sumo.calibration.hierarchical import FEWEST_DRIVERS, hierarchical
from idm_sumo.calibration.without_d1 import REFIT, REFIT_ADE, REFIT_INTEGRATION
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import PARAMETERS

NAMES = list(PARAMETERS)
DRAWN = [f"{name}_drawn" for name in NAMES]
DRAWN_SHARE = "drawn_share"  # 0 where the window alone decides, 1 where it says nothing
AT_BOUND = "at_bound"


def drawn_columns(scenes: Scenes, desired_speed: npt.ArrayLike | None = None) -> pd.DataFrame:
    """Draw every driver to the population of all.

    Parameters
    ----------
    scenes : Scenes
        Of several windows of a driver all count.
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
        found, population = hierarchical(scenes, desired_speed=desired_speed, by_driver=True)
    except InputError:  # too few drivers to be a population
        return table.assign(**dict.fromkeys([*DRAWN, DRAWN_SHARE], np.nan))
    theta, share = found[NAMES].to_numpy(copy=True), found["drawn"].to_numpy(copy=True)
    unknown = _at_bound(theta)
    theta[unknown], share[unknown] = population.typical(), 1.0
    table[DRAWN] = theta
    return table.assign(**{DRAWN_SHARE: share})


def one_a_driver(drawn: pd.DataFrame) -> pd.DataFrame:
    """Return one row a driver.

    Parameters
    ----------
    drawn : pandas.DataFrame
        Of :func:`drawn_columns`; the windows of a driver that can be fitted have the same parameters.

    Returns
    -------
    pandas.DataFrame
        In the order of the drivers.
    """
    return drawn.groupby([c.PERIOD, c.VEHICLE], sort=False, observed=True).first().reset_index()


def _at_bound(theta: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return who is at a bound.

    A ``d1`` of 0 is none.
    """
    bound = identifiability.at_bound(theta)
    bound[:, 4] &= theta[:, 4] > 1.0
    return np.asarray(bound.any(axis=1))


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
        Without the refits of the fitted parameters, and without the drivers that could not be drawn. Status and
        bounds were those of the fit and say nothing of these.

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
    known = without_refits(drivers[drivers[DRAWN].notna().all(axis=1)]).reset_index(drop=True)
    return known.assign(**{name: known[drawn] for name, drawn in zip(NAMES, DRAWN, strict=True)})


def without_refits(drivers: pd.DataFrame) -> pd.DataFrame:
    """Drop what belongs to the fitted parameters.

    Parameters
    ----------
    drivers : pandas.DataFrame

    Returns
    -------
    pandas.DataFrame
        Without the refits that do without ``d1``; status and bounds say nothing any more.
    """
    table = drivers.drop(columns=[name for name in drivers if name in (*REFIT, REFIT_ADE, REFIT_INTEGRATION)])
    return table.assign(**{name: value for name, value in ((STATUS, OK), (AT_BOUND, "")) if name in table})
