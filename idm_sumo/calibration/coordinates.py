"""Search coordinates: the parameters as the fits move them."""

from __future__ import annotations

from math import exp

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.models import idm

Floats = npt.NDArray[np.float64]

PARAMETERS = 5
T_UNIT, D_UNIT = 1.0, 2.5  # s, m: make a step in every search coordinate weigh about the same
UNITS = np.array([T_UNIT, D_UNIT, D_UNIT])


def to_search(parameters: npt.ArrayLike) -> Floats:
    """Return the search coordinates of parameters.

    Accelerations act by proportion. The desired gap is linear in the other three, so what they
    trade against each other is a straight valley, which in logarithms would be bent.

    Parameters
    ----------
    parameters : array_like, shape (..., 5)
        ``a, b, T, d0, d1`` in SI units.

    Returns
    -------
    float64, shape (..., 5)
        ``log(a), log(b), T, d0, d1``, scaled.
    """
    values = np.asarray(parameters, dtype=np.float64)
    return np.concatenate([np.log(values[..., :2]), values[..., 2:] / UNITS], axis=-1)


def from_search(z: npt.ArrayLike) -> Floats:
    """Return the parameters at search coordinates.

    Parameters
    ----------
    z : array_like, shape (..., 5)

    Returns
    -------
    float64, shape (..., 5)
        ``a, b, T, d0, d1`` in SI units, exactly at a bound where the coordinate is on one.
    """
    at = np.asarray(z, dtype=np.float64)
    values = np.concatenate([np.exp(at[..., :2]), at[..., 2:] * UNITS], axis=-1)
    return np.asarray(np.clip(values, np.array(idm.LOWER), np.array(idm.UPPER)))


@njit(cache=True, error_model="numpy")
def parameters_at(z):  # type: ignore[no-untyped-def]
    """Return the parameters at search coordinates; compiled.

    Parameters
    ----------
    z : float64, shape (5,)

    Returns
    -------
    a, b, T, d0, d1 : float
        SI units; not clipped to the bounds.
    """
    return exp(z[0]), exp(z[1]), z[2] * T_UNIT, z[3] * D_UNIT, z[4] * D_UNIT


def slopes_at(z: npt.ArrayLike) -> Floats:
    """Return the parameters' derivatives by their search coordinates.

    Parameters
    ----------
    z : array_like, shape (..., 5)

    Returns
    -------
    float64, shape (..., 5)
    """
    at = np.asarray(z, dtype=np.float64)
    return np.concatenate([np.exp(at[..., :2]), np.broadcast_to(UNITS, (*at.shape[:-1], 3))], axis=-1)


LOWER, UPPER = to_search(idm.LOWER), to_search(idm.UPPER)
