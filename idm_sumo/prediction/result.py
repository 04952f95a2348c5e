"""Predicted drivers, as arrays and as a driver table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration.population import SHIFT
from idm_sumo.models.idm import LOWER, UPPER
from idm_sumo.prediction.spread import logarithms
from idm_sumo.simulation.driver_parameters import DESIRED_SPEED, PARAMETERS

Floats = npt.NDArray[np.float64]

LIKELY = 0.9  # of the drivers lie between the columns `*_low` and `*_high`


class Prediction(NamedTuple):
    """Predicted drivers: parameters and how uncertain they are.

    Attributes
    ----------
    theta : float64, shape (drivers, 5)
        ``a, b, T, d0, d1``.
    covariance : float64, shape (drivers, 5, 5)
        Of ``log(a, b, T, d0, d1 + 1 m)`` about them.
    status : str, shape (drivers,)
        "ok", or why it is the population's.
    desired_speed : float
        m/s, with which the predictor was fitted.
    keys : pandas.DataFrame or None
        ``period, vehicle, first_frame``, where the drivers are those of scenes.
    """

    theta: Floats
    covariance: Floats
    status: npt.NDArray[np.str_]
    desired_speed: float = np.nan
    keys: pd.DataFrame | None = None

    def __repr__(self) -> str:
        """Return one line: drivers, and those as the population."""
        return f"<Prediction: {len(self.theta):,} drivers, {int((self.status != 'ok').sum()):,} as the population>"

    def to_pandas(self) -> pd.DataFrame:
        """Return a driver table.

        Returns
        -------
        pandas.DataFrame
            ``period, vehicle, first_frame`` where known, ``a, b, T, d0, d1`` (SI), ``desired_speed_m_s``, ``status``,
            and the ends of the 90 % interval of every parameter (``a_low, a_high``, ...).
        """
        from scipy.stats import norm  # here: scipy.stats takes long to load

        table = pd.DataFrame(index=range(len(self.theta))) if self.keys is None else self.keys.reset_index(drop=True)
        table[list(PARAMETERS)] = self.theta
        table[DESIRED_SPEED] = self.desired_speed
        table["status"] = self.status
        half = norm.ppf(0.5 + 0.5 * LIKELY) * np.sqrt(np.einsum("njj->nj", self.covariance))
        middle = logarithms(self.theta)
        for end, sign in (("low", -1.0), ("high", 1.0)):
            limit = np.clip(np.exp(middle + sign * half) - SHIFT, np.array(LOWER), np.array(UPPER))
            table[[f"{name}_{end}" for name in PARAMETERS]] = limit
        return table
