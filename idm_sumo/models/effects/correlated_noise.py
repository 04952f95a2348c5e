r"""Drivers are not smooth: their acceleration wanders.

.. math:: d\eta = -\eta\,dt/\tau + \sigma\sqrt{2/\tau}\,dW

It explains no bias, so it is modelled (the covariance of the residuals, the noise of the null twins) and not named.
"""

from __future__ import annotations

from math import exp, sqrt

from numba import njit

from idm_sumo.models.effects.record import Effect


@njit(cache=True, error_model="numpy")
def wander(value: float, normal: float, spread: float, memory: float, step: float) -> float:
    r"""Return the noise (m/s²) ``step`` seconds later: the exact step of an Ornstein-Uhlenbeck process."""
    kept = exp(-step / memory)
    return kept * value + spread * sqrt(1.0 - kept * kept) * normal


EFFECT = Effect(
    name="correlated_noise",
    summary="acceleration wanders, without any bias",
    parameters=(),
    must_see=(),
    confusable_with=(),
    source="Treiber, Kesting and Helbing (2006), Physica A 360",
    sumo="EIDM's sigmaerror, sigmagap, sigmaleader",
)
