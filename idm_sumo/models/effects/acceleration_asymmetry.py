r"""Acceleration asymmetry: accelerations are weaker than the IDM's.

.. math:: \dot v \to (1-\gamma)\,\dot v \quad\text{where } \dot v > 0

Braking stays as it is.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values


@njit(cache=True, error_model="numpy")
def weakened(acceleration: float, share: float) -> float:
    r"""Return the acceleration with its positive part weakened.

    Parameters
    ----------
    acceleration : float
        Acceleration :math:`\dot v` (m/s²).
    share : float
        Magnitude :math:`\gamma`.

    Returns
    -------
    float
        :math:`(1-\gamma)\dot v` where positive, else :math:`\dot v` (m/s²).
    """
    return acceleration * (1.0 - share) if acceleration > 0.0 else acceleration


def _lost(see: Moments) -> Floats:
    return np.minimum(-see.acceleration, 0.0)


def _size(values: Values, _one: Median) -> str:
    return f"{1.0 - values['gamma']:.0%} of the model's acceleration"


EFFECT = Effect(
    name="acceleration_asymmetry",
    summary="accelerates more weakly than it brakes",
    parameters=(Parameter("gamma", "1", slots.ASYMMETRY, -0.9, 0.9, 0.3),),
    required_stimuli=(),
    confusable_with=("lane_change_relaxation", "hysteresis", "perception_threshold"),
    source="Newell (1965); Yeo and Skabardonis (2009), Understanding stop-and-go traffic",
    forms=(Form(slots.ASYMMETRY, _lost),),
    told=(
        Telling(
            "gamma",
            more="accelerate more weakly than the model, and brake as it does",
            less="accelerate more strongly than the model, and brake as it does",
            when="whenever they accelerate",
            size=_size,
            advice="Calibrate on windows that hold both braking and accelerating.",
        ),
    ),
)
