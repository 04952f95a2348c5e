r"""Desired speed that differs, in one lane, in all, or from lane to lane.

.. math:: v_0 \to v_0 (1+\delta r)

where r is 1, or, across n lanes, (lane - 1)/(n - 1): nothing in the leftmost lane, all of it in the rightmost.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter


@njit(cache=True, error_model="numpy")
def in_lane(lane: float, share: float, of_lane: float, across: float) -> float:
    r"""Return :math:`1+\delta r` in the lane (0: in every lane), else 1: a factor of the desired speed."""
    if share == 0.0 or (of_lane != 0.0 and lane != of_lane):
        return 1.0
    return 1.0 + share * (rank(lane, across) if across > 1.0 else 1.0)


@njit(cache=True, error_model="numpy")
def rank(lane, across):  # type: ignore[no-untyped-def]
    """Return 0 for the leftmost lane (1) to 1 for the rightmost of so many; of one lane or an array of them."""
    return np.minimum(np.maximum((lane - 1.0) / (across - 1.0), 0.0), 1.0)


EFFECT = Effect(
    name="desired_speed",
    summary="wants another speed than the limit",
    parameters=(
        Parameter("delta", "1", slots.DESIRED_SPEED, -0.5, 1.0, 0.1),
        Parameter("lane", "number", slots.DESIRED_SPEED_LANE, 0.0, 8.0, 0.0),
        Parameter("n", "number", slots.DESIRED_SPEED_ACROSS, 0.0, 8.0, 0.0),
    ),
    must_see=("lane",),
    confusable_with=("location", "speed_dependent_headway"),
    source="Treiber and Kesting (2013), Traffic Flow Dynamics, ch. 11",
    sumo="speedFactor of the vType, or the lane's speed",
)
