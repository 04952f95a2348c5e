"""Bootstrap intervals over drivers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

Floats = npt.NDArray[np.float64]
RESAMPLES = 2000


def share_closed(ade: pd.DataFrame, name: str) -> dict[str, float]:
    """Return a method's ADE, gain and share of the way.

    The gain is over the pooled set, the way leads from pooled to oracle.

    Parameters
    ----------
    ade : pandas.DataFrame
        ADE (m) by driver, one column a method.
    name : str
        Column of the method.

    Returns
    -------
    dict of str to float
        With 95 % bootstrap intervals over drivers.
    """
    draws = resampled_drivers(len(ade))
    pooled, oracle, own = (ade[which].to_numpy() for which in ("idm_pooled", "idm_oracle", name))
    gain, way = pooled - own, pooled - oracle
    gains, ways = gain[draws].mean(axis=1), way[draws].mean(axis=1)
    gain_ends, ends = np.quantile(gains, [0.025, 0.975]), np.quantile(gains / ways, [0.025, 0.975])
    return {
        "ade_m": own.mean(),
        "gain_m": gain.mean(),
        "gain_low_m": gain_ends[0],
        "gain_high_m": gain_ends[1],
        "share": gain.mean() / way.mean(),
        "share_low": ends[0],
        "share_high": ends[1],
    }


def resampled_drivers(drivers: int) -> npt.NDArray[np.int64]:
    """Return rows of drivers drawn with replacement.

    Parameters
    ----------
    drivers : int
        Number of drivers.

    Returns
    -------
    int64, shape (resamples, drivers)
        The same for all methods, so that differences are paired.
    """
    return np.random.default_rng(0).integers(drivers, size=(RESAMPLES, drivers))


def share_interval(inside: npt.NDArray[np.bool_], driver: npt.NDArray[np.int64]) -> tuple[float, float]:
    """Return a share's 95 % bootstrap interval over drivers.

    Parameters
    ----------
    inside : bool, shape (windows,)
        Whether the event occurred.
    driver : int64, shape (windows,)
        Label of each window's driver, from 0 on.

    Returns
    -------
    low, high : float
        Ends of the interval.
    """
    hits, windows = np.bincount(driver, inside), np.bincount(driver)
    draws = resampled_drivers(len(windows))
    low, high = np.quantile(hits[draws].sum(axis=1) / windows[draws].sum(axis=1), [0.025, 0.975])
    return float(low), float(high)
