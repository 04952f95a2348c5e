r"""Asymmetry: positive acceleration is weaker than the IDM's, braking is not.

.. math:: \dot v \to (1-\gamma)\,\dot v \quad\text{where } \dot v > 0
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter


@njit(cache=True, error_model="numpy")
def weakened(acceleration: float, share: float) -> float:
    r"""Return :math:`(1-\gamma)\dot v` (m/s²) of a positive acceleration, a negative one as it is."""
    return acceleration * (1.0 - share) if acceleration > 0.0 else acceleration


EFFECT = Effect(
    name="acceleration_asymmetry",
    summary="accelerates more weakly than it brakes",
    parameters=(Parameter("gamma", "1", slots.ASYMMETRY, -0.9, 0.9, 0.3),),
    must_see=(),
    confusable_with=("lane_change_relaxation", "hysteresis", "perception_threshold"),
    source="Newell (1965); Yeo and Skabardonis (2009), Understanding stop-and-go traffic",
)
