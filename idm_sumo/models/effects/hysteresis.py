r"""Hysteresis: gaps are larger while the leader accelerates.

.. math:: T \to T\big(1 + h \tanh(\dot v_l / 0.5\,\text{m/s}^2)\big)

Here :math:`\dot v_l` is the leader's present acceleration or, with :math:`\phi = 1`, its mean over
the last three seconds.
"""

from __future__ import annotations

from math import tanh

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values
from idm_sumo.recordings.columns import FRAME_STEP

SATURATION = 0.5  # m/s^2, acceleration of the leader at which the hyperbolic tangent bends
OF_LATE = 3.0  # s, over which the leader's acceleration is averaged
LATELY = round(OF_LATE / FRAME_STEP)  # the same in frames


@njit(cache=True, error_model="numpy")
def in_phase(leader_acceleration: float, share: float) -> float:
    r"""Return the factor of the time headway.

    Parameters
    ----------
    leader_acceleration : float
        Acceleration of the leader :math:`\dot v_l` (m/s²).
    share : float
        Magnitude :math:`h`.

    Returns
    -------
    float
        :math:`1+h\tanh(\dot v_l/0.5)`.
    """
    return 1.0 + share * tanh(leader_acceleration / SATURATION) if share != 0.0 else 1.0


def _at_once(see: Moments) -> Floats:
    return see.by_headway * np.tanh(np.nan_to_num(see.leader_acceleration) / SATURATION)


def _of_late(see: Moments) -> Floats:
    return see.by_headway * np.tanh(np.nan_to_num(see.leader_acceleration_mean) / SATURATION)


def _size(values: Values, one: Median) -> str:
    braking, accelerating = (one.headway * (1.0 + sign * values["h"]) for sign in (-1.0, 1.0))
    return f"time headway {braking:.2f} s as the leader brakes, {accelerating:.2f} s as it accelerates"


EFFECT = Effect(
    name="hysteresis",
    summary="keeps larger gaps when accelerating than when braking",
    parameters=(
        Parameter("h", "1", slots.HYSTERESIS, -0.8, 0.8, 0.12),
        Parameter("phi", "1", slots.HYSTERESIS_OF_LATE, 0.0, 1.0, 0.0),
    ),
    required_stimuli=("leader_acceleration", "leader_acceleration_mean"),
    confusable_with=("reaction_delay", "multi_leader_anticipation", "perception_threshold"),
    source="Treiterer and Myers (1974); Chen, Laval, Zheng and Ahn (2012), Transportation Research B 46",
    forms=(
        Form(slots.HYSTERESIS, _at_once),
        Form(slots.HYSTERESIS, _of_late, fixed=((slots.HYSTERESIS_OF_LATE, 1.0),)),
    ),
    told=(
        Telling(
            "h",
            more="keep longer headways while their leader accelerates than while it brakes",
            less="keep shorter headways while their leader accelerates than while it brakes",
            when="through every wave of braking and accelerating",
            size=_size,
            advice="Calibrate on windows that hold a whole wave, braking and accelerating.",
        ),
    ),
)
