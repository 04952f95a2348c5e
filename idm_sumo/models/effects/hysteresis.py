r"""Hysteresis: larger gaps while the leader accelerates than while it brakes.

.. math:: T \to T\big(1 + h \tanh(\dot v_l / 0.5\,\text{m/s}^2)\big)

with :math:`\dot v_l` the leader's acceleration of the moment, or (:math:`\phi = 1`) its mean of the last three seconds: who has seen that
traffic speeds up.
"""

from __future__ import annotations

from math import tanh

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.roads.road import FRAME_STEP

SATURATION = 0.5  # m/s^2
OF_LATE = 3.0  # s, of the mean acceleration
LATELY = round(OF_LATE / FRAME_STEP)  # the same in frames


@njit(cache=True, error_model="numpy")
def in_phase(leader_acceleration: float, share: float) -> float:
    r"""Return :math:`1+h\tanh(\dot v_l/0.5)`: a factor of the time headway."""
    return 1.0 + share * tanh(leader_acceleration / SATURATION) if share != 0.0 else 1.0


EFFECT = Effect(
    name="hysteresis",
    summary="keeps larger gaps when accelerating than when braking",
    parameters=(
        Parameter("h", "1", slots.HYSTERESIS, -0.8, 0.8, 0.12),
        Parameter("phi", "1", slots.HYSTERESIS_OF_LATE, 0.0, 1.0, 0.0),
    ),
    must_see=("leader_acceleration", "leader_acceleration_of_late"),
    confusable_with=("reaction_delay", "multi_leader_anticipation", "perception_threshold"),
    source="Treiterer and Myers (1974); Chen, Laval, Zheng and Ahn (2012), Transportation Research B 46",
)
