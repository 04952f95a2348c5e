"""The covariance of parameters that prediction leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from idm_sumo.calibration.hierarchical import STEPS
from idm_sumo.calibration.kernel import PARAMETERS
from idm_sumo.calibration.population import LEAST_VARIANCE, LOWER, SHIFT, UPPER, Population
from idm_sumo.calibration.posterior import Part
from idm_sumo.calibration.problem import Problem

Floats = npt.NDArray[np.float64]

ROUNDS = 8
START = 0.5**2  # of the logarithms


def logarithms(theta: npt.ArrayLike) -> Floats:
    """Return the logarithms of parameters.

    Drivers are taken to be normally distributed in them.

    Parameters
    ----------
    theta : array_like, shape (..., 5)
        ``a, b, T, d0, d1`` in SI units.

    Returns
    -------
    float64, shape (..., 5)
        ``log(a, b, T, d0, d1 + 1 m)``, within the bounds of calibration.
    """
    return np.asarray(np.clip(np.log(np.asarray(theta, dtype=np.float64) + SHIFT), LOWER, UPPER))


def remaining_covariance(problems: Sequence[Problem], predicted: Sequence[Floats]) -> Floats:
    """Return the covariance about the predicted parameters.

    EM as in :mod:`idm_sumo.calibration.hierarchical`, each window with the mean that was predicted for it,
    so that what its ten seconds do not determine is not taken for a difference between drivers.

    Parameters
    ----------
    problems : sequence of Problem
    predicted : sequence of arrays, shape (windows, 5)
        Parameters ``a, b, T, d0, d1``.

    Returns
    -------
    float64, shape (5, 5)
        Of the drivers' logarithms.
    """
    parts, means = [Part.of(problem) for problem in problems], [logarithms(theta) for theta in predicted]
    for part, mean in zip(parts, means, strict=True):
        part.u = mean.copy()
    covariance = START * np.eye(PARAMETERS)
    for _ in range(ROUNDS):
        for part, mean in zip(parts, means, strict=True):
            part.draw(Population(mean, covariance, len(mean), 0), STEPS)
        off = np.concatenate([part.u - mean for part, mean in zip(parts, means, strict=True)])
        vague = np.linalg.inv(np.concatenate([part.hessian for part in parts])).mean(axis=0)
        covariance = off.T @ off / len(off) + vague + LEAST_VARIANCE * np.eye(PARAMETERS)
    return np.asarray(covariance)
