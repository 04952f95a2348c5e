r"""Adjacent-lane friction: a driver slows beside a slower lane.

.. math:: \dot v \to \dot v - k \max(0, v - v_{adj})

Here :math:`v_{adj}` is the mean speed of the vehicles nearby in the slower adjacent lane or, with
:math:`\phi = 1`, the speed of the slower one of the next vehicles ahead in the adjacent lanes.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values

BESIDE = 30.0  # m, ahead and behind: vehicles within it are nearby
AHEAD = 60.0  # m, largest distance of the next vehicle ahead


@njit(cache=True, error_model="numpy")
def friction(speed: float, adjacent_speed: float, strength: float) -> float:
    r"""Return the acceleration due to a slower adjacent lane.

    Parameters
    ----------
    speed, adjacent_speed : float
        Own speed and that of the adjacent lane (m/s); NaN for an empty lane.
    strength : float
        Magnitude :math:`k` (1/s).

    Returns
    -------
    float
        :math:`-k\max(0, v-v_{adj})` (m/s²), zero beside an empty lane.
    """
    return -strength * (speed - adjacent_speed) if adjacent_speed < speed else 0.0


def _beside(see: Moments) -> Floats:
    return -np.nan_to_num(np.maximum(see.speed - see.adjacent_speed, 0.0))


def _beside_next(see: Moments) -> Floats:
    return -np.nan_to_num(np.maximum(see.speed - see.next_adjacent_speed, 0.0))


def _size(values: Values, _one: Median) -> str:
    return f"{abs(5.0 * values['k']):.2f} m/s² beside a lane that is 5 m/s slower"


EFFECT = Effect(
    name="adjacent_lane_friction",
    summary="slows beside a slower lane",
    parameters=(
        Parameter("k", "1/s", slots.FRICTION, -0.3, 0.5, 0.05),
        Parameter("phi", "1", slots.FRICTION_NEXT, 0.0, 1.0, 0.0),
    ),
    required_stimuli=("adjacent_speed", "next_adjacent_speed"),
    confusable_with=("location", "desired_speed"),
    source="Liu, Schroeder, Thomson, Wang, Rouphail and Yin (2011), Cartage friction between freeway lanes",
    forms=(
        Form(slots.FRICTION, _beside),
        Form(slots.FRICTION, _beside_next, fixed=((slots.FRICTION_NEXT, 1.0),)),
    ),
    told=(
        Telling(
            "k",
            more="slow down beside a slower lane",
            less="speed up beside a slower lane",
            when="where the next lane is slower",
            size=_size,
            advice="Leave stretches beside a queue out of calibration, or keep the next lane's speed in the model.",
            situation={"adjacent_speed": 5.0, "next_adjacent_speed": 5.0},
        ),
    ),
)
