"""Sets of parameters in a driver table."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.calibration.drawn import DRAWN, NAMES, as_drawn, without_refits
from idm_sumo.calibration.identifiability import at_bound
from idm_sumo.calibration.pooled import pooled
from idm_sumo.calibration.whole import WHOLE, WHOLE_ADE, as_whole, names_for
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes

POOLED = [f"{name}_pooled" for name in NAMES]
DRAWN_SET, ALL_WINDOWS, FITTED, ONE_FOR_ALL = "drawn", "whole", "fitted", "pooled"


def pooled_columns(scenes: Scenes, desired_speed: float | None = None) -> pd.DataFrame:
    """Return one set for all drivers, in each row.

    Parameters
    ----------
    scenes : Scenes
    desired_speed : float, optional
        m/s; by default the road's speed limit.

    Returns
    -------
    pandas.DataFrame
        ``a_pooled, b_pooled, T_pooled, d0_pooled, d1_pooled`` (SI units); NaN if no window can be fitted.
    """
    try:
        one = pooled(scenes, desired_speed=desired_speed)
    except InputError:  # nobody to be fitted
        return pd.DataFrame(float("nan"), index=range(len(scenes)), columns=POOLED)
    return pd.DataFrame([list(one)] * len(scenes), columns=POOLED)


def usual_set(drivers: pd.DataFrame) -> str:
    """Return the set for traffic that reacts.

    It is the drawn one where there is one, else that of all windows.

    Parameters
    ----------
    drivers : pandas.DataFrame
        Predicted drivers have neither: theirs are the fitted ones.

    Returns
    -------
    str
    """
    has = set(DRAWN) <= set(drivers) and bool(drivers[DRAWN].notna().any(axis=None))
    if has:
        return DRAWN_SET
    return ALL_WINDOWS if set(WHOLE) <= set(drivers) else FITTED


def with_set(drivers: pd.DataFrame, which: str, source: str) -> pd.DataFrame:
    """Return a driver table with the parameters of a set.

    Parameters
    ----------
    drivers : pandas.DataFrame
    which : {"drawn", "whole", "fitted", "pooled"}
    source : str
        How messages name the drivers.

    Returns
    -------
    pandas.DataFrame

    Raises
    ------
    InputError
        If the table has no such set.
    """
    if which == DRAWN_SET:
        return as_drawn(drivers, source)
    if which == FITTED:
        return drivers
    if which == ALL_WINDOWS:
        if not set(WHOLE) <= set(drivers):
            raise InputError(f"{source}: column {WHOLE[0]!r} is missing; `idm-sumo calibrate` writes it")
        return as_whole(drivers)
    if not set(POOLED) <= set(drivers) or drivers[POOLED].isna().any(axis=None):
        raise InputError(
            f"{source}: has no pooled parameters (columns {POOLED[0]} ... {POOLED[-1]}); "
            "`idm-sumo calibrate` writes them"
        )
    table = without_refits(drivers)
    return table.assign(**{name: table[one] for name, one in zip(NAMES, POOLED, strict=True)})


def with_law(drivers: pd.DataFrame, law: str, source: str) -> tuple[pd.DataFrame, str]:
    """Return drivers whose parameters are those of another law.

    Who is at a bound of the search is not known, and gets the others' medians.

    Parameters
    ----------
    drivers : pandas.DataFrame
        With the columns of :func:`idm_sumo.calibration.whole.whole_columns`, for that law and for the IDM.
    law : {"krauss", "eidm"}
    source : str
        How messages name them.

    Returns
    -------
    drivers : pandas.DataFrame
        Those that could be fitted; ``d1`` is 0.
    price : str
        What the law costs, in a sentence.

    Raises
    ------
    InputError
        If the columns are missing or empty.
    """
    names = list(names_for(law))
    if not set(names) <= set(drivers) or drivers[names].isna().all(axis=None):
        raise InputError(f"{source}: has no types of {law}; write it with `idm-sumo calibrate --law {law}`")
    known = without_refits(drivers[drivers[names[0]].notna()]).reset_index(drop=True)
    theta = np.column_stack([known[names[:4]].to_numpy(np.float64), np.zeros(len(known))])
    unknown = at_bound(theta)[:, :4].any(axis=1)
    if not unknown.all():
        theta[unknown] = np.median(theta[~unknown], axis=0)
    means = known[[names[4], WHOLE_ADE]].mean()
    price = (
        f"{law}: {means.iloc[0]:.2f} m from the recording on average over all windows, the IDM {means.iloc[1]:.2f} m; "
        f"{int(unknown.sum())} of {len(known)} drivers are at a bound and drive as the others' median"
    )
    return known.assign(**dict(zip(NAMES, theta.T, strict=True))), price
