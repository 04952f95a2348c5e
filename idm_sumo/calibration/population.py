"""The population of drivers: a log-normal distribution of their parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.models import idm

Floats = npt.NDArray[np.float64]

SHIFT = np.array([0.0, 0.0, 0.0, 0.0, 1.0])  # m, of d1, which may be 0
LOWER, UPPER = np.log(np.array(idm.LOWER) + SHIFT), np.log(np.array(idm.UPPER) + SHIFT)
LEAST_VARIANCE, MOST_VARIANCE = 0.02**2, 3.0**2  # of the population, in logarithms: keeps its covariance regular


class Population(NamedTuple):
    """Log-normal distribution of drivers.

    Attributes
    ----------
    mean : float64, shape (5,)
        Of ``log(a, b, T, d0, d1 + 1 m)``.
    covariance : float64, shape (5, 5)
    drivers : int
        How many it was learnt from.
    rounds : int
        Of EM until it settled.
    """

    mean: Floats
    covariance: Floats
    drivers: int
    rounds: int

    def typical(self) -> idm.IDMParameters:
        """Return the median driver, to assume of unknown drivers."""
        return idm.IDMParameters(*to_parameters(self.mean).tolist())


def to_parameters(u: npt.ArrayLike) -> Floats:
    """Return the parameters of logarithms.

    Parameters
    ----------
    u : array_like, shape (..., 5)
        ``log(a, b, T, d0, d1 + 1 m)``.

    Returns
    -------
    float64, shape (..., 5)
        ``a, b, T, d0, d1`` in SI units, within the bounds.
    """
    values = np.exp(np.asarray(u, dtype=np.float64)) - SHIFT
    return np.asarray(np.clip(values, np.array(idm.LOWER), np.array(idm.UPPER)))
