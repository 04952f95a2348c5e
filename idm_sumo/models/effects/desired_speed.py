r"""Desired speed that differs from the limit, by lane.

.. math:: v_0 \to v_0 (1+\delta r)

The rank :math:`r` is 1 or, across :math:`n` lanes, (lane - 1)/(n - 1): 0 in the leftmost lane and 1 in the rightmost.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import LANE, Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Telling, of_desired_speed

FALLS_OVER = 3  # lanes from which on a fall from lane to lane is more than one lane's


@njit(cache=True, error_model="numpy")
def in_lane(lane: float, share: float, of_lane: float, across: float) -> float:
    r"""Return the factor of the desired speed in a lane.

    Parameters
    ----------
    lane : float
        Own lane number, 1 for the leftmost.
    share : float
        Magnitude :math:`\delta`.
    of_lane : float
        Lane in which the effect acts; 0 for every lane.
    across : float
        Number of lanes :math:`n` across which it grows; 0 where all lanes are alike.

    Returns
    -------
    float
        :math:`1+\delta r` where the effect acts, else 1.
    """
    if share == 0.0 or (of_lane != 0.0 and lane != of_lane):
        return 1.0
    return 1.0 + share * (rank(lane, across) if across > 1.0 else 1.0)


@njit(cache=True, error_model="numpy")
def rank(lane, across):  # type: ignore[no-untyped-def]
    """Return the rank of a lane from left to right.

    Parameters
    ----------
    lane : float or float64 array
        Lane number, 1 for the leftmost.
    across : float
        Number of lanes, above 1.

    Returns
    -------
    float or float64 array
        0 for the leftmost lane to 1 for the rightmost.
    """
    return np.minimum(np.maximum((lane - 1.0) / (across - 1.0), 0.0), 1.0)


def _of_desired_speed(see: Moments) -> Floats:
    return see.by_desired_speed


def _across_lanes(see: Moments) -> Floats:
    if see.lanes < FALLS_OVER:
        return np.zeros_like(see.lane)
    return np.asarray(see.by_desired_speed * rank(see.lane, see.lanes))


EFFECT = Effect(
    name="desired_speed",
    summary="has another desired speed than the limit",
    parameters=(
        Parameter("delta", "1", slots.DESIRED_SPEED, -0.5, 1.0, 0.1),
        Parameter("lane", "number", slots.DESIRED_SPEED_LANE, 0.0, 8.0, 0.0),
        Parameter("n", "number", slots.DESIRED_SPEED_ACROSS, 0.0, 8.0, 0.0),
    ),
    required_stimuli=("lane",),
    confusable_with=("location", "speed_dependent_headway"),
    source="Treiber and Kesting (2013), Traffic Flow Dynamics, ch. 11",
    sumo="speedFactor of the vType, or the lane's speed",
    forms=(
        Form(slots.DESIRED_SPEED, _of_desired_speed, along=LANE, bounds=(slots.DESIRED_SPEED_LANE,)),
        Form(slots.DESIRED_SPEED, _across_lanes, of_recording=((slots.DESIRED_SPEED_ACROSS, "lanes"),)),
    ),
    between=True,
    told=(
        Telling(
            "delta",
            more="want to drive faster than the model's desired speed",
            less="want to drive slower than the model's desired speed",
            when="most clearly on a free road",
            size=of_desired_speed("delta"),
            advice="Calibrate with `--desired-speed auto`, or give the desired speed that was measured on a free road.",
            situation={"lane": 1.0},
        ),
    ),
)
