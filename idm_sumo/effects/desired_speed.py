r"""Desired speed that differs, in one lane or in all.

.. math:: v_0 \to v_0 (1+\delta)
"""

from __future__ import annotations

from numba import njit

from idm_sumo.effects import slots
from idm_sumo.effects.record import Effect, Parameter


@njit(cache=True, error_model="numpy")
def in_lane(lane: float, share: float, of_lane: float) -> float:
    r"""Return :math:`1+\delta` in the lane (0: in every lane), else 1: a factor of the desired speed."""
    return 1.0 + share if share != 0.0 and (of_lane == 0.0 or lane == of_lane) else 1.0


EFFECT = Effect(
    name="desired_speed",
    summary="wants another speed than the limit",
    parameters=(
        Parameter("delta", "1", slots.DESIRED_SPEED, -0.5, 1.0, 0.1),
        Parameter("lane", "number", slots.DESIRED_SPEED_LANE, 0.0, 8.0, 0.0),
    ),
    must_see=("lane",),
    confusable_with=("location", "speed_dependent_headway"),
    source="Treiber and Kesting (2013), Traffic Flow Dynamics, ch. 11",
    sumo="speedFactor of the vType, or the lane's speed",
)
