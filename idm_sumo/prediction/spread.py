"""How far drivers are from what was predicted of them: the covariance of parameters that remains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from idm_sumo.calibration.hierarchical import LEAST_VARIANCE, LOWER, SHIFT, STEPS, UPPER, Part, Population
from idm_sumo.calibration.kernel import PARAMETERS
from idm_sumo.calibration.problem import Problem

Floats = npt.NDArray[np.float64]

ROUNDS = 8
START = 0.5**2  # of the logarithms


def logarithms(theta: npt.ArrayLike) -> Floats:
    """Return ``log(a, b, T, d0, d1 + 1 m)``, in which drivers are taken to be normally distributed."""
    return np.asarray(np.clip(np.log(np.asarray(theta, dtype=np.float64) + SHIFT), LOWER, UPPER))


def remaining_covariance(problems: Sequence[Problem], predicted: Sequence[Floats]) -> Floats:
    """Return the covariance of the drivers' logarithms about their predicted ones, shape ``(5, 5)``.

    EM as in :mod:`idm_sumo.calibration.hierarchical`, each window with the mean that was predicted for it, so that what its
    ten seconds do not determine is not taken for a difference between drivers.

    Parameters
    ----------
    problems : sequence of Problem
    predicted : sequence of arrays, shape (windows, 5)
        Parameters ``a, b, T, d0, d1``.
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
