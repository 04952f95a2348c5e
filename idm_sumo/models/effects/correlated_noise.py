r"""Correlated noise: the acceleration varies at random.

.. math:: d\eta = -\eta\,dt/\tau + \sigma\sqrt{2/\tau}\,dW

The noise explains no bias. So a diagnosis models it (as the covariance of the residuals and the
noise of the null replicates) and does not name it as a cause.
"""

from __future__ import annotations

from math import exp, sqrt

from numba import njit

from idm_sumo.models.effects.record import Effect


@njit(cache=True, error_model="numpy")
def wander(value: float, normal: float, spread: float, memory: float, step: float) -> float:
    r"""Return the noise one time step later.

    The exact step of an Ornstein-Uhlenbeck process.

    Parameters
    ----------
    value : float
        Noise :math:`\eta` before the step (m/s²).
    normal : float
        A standard normal random draw.
    spread : float
        Standard deviation :math:`\sigma` (m/s²).
    memory : float
        Correlation time :math:`\tau` (s).
    step : float
        Time step (s).

    Returns
    -------
    float
        Noise after the step (m/s²).
    """
    kept = exp(-step / memory)
    return kept * value + spread * sqrt(1.0 - kept * kept) * normal


EFFECT = Effect(
    name="correlated_noise",
    summary="acceleration varies at random, without any bias",
    parameters=(),
    required_stimuli=(),
    confusable_with=(),
    source="Treiber, Kesting and Helbing (2006), Physica A 360",
    sumo="EIDM's sigmaerror, sigmagap, sigmaleader",
)
