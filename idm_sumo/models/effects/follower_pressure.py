r"""Follower pressure: a close follower makes the driver accelerate.

.. math:: \dot v \to \dot v + c\,\max\big(0, 1 - d_{rear}/15\,\text{m}\big)
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values

REACH = 15.0  # m, rear gap from which on there is no pressure


@njit(cache=True, error_model="numpy")
def pressed(rear_gap: float, strength: float) -> float:
    r"""Return the acceleration due to a close follower.

    Parameters
    ----------
    rear_gap : float
        Own rear bumper to the follower's front (m); infinite or NaN without a follower.
    strength : float
        Magnitude :math:`c` (m/s²).

    Returns
    -------
    float
        :math:`c\max(0, 1-d_{rear}/15)` (m/s²), zero without a follower.
    """
    return strength * min(1.0 - rear_gap / REACH, 1.0) if rear_gap < REACH else 0.0


def _pressed(see: Moments) -> Floats:
    near = see.rear_gap < REACH
    return np.where(near, np.minimum(1.0 - np.where(near, see.rear_gap, 0.0) / REACH, 1.0), 0.0)


def _size(values: Values, _one: Median) -> str:
    return f"{abs(pressed(5.0, values['c'])):.2f} m/s² with a follower 5 m behind"


EFFECT = Effect(
    name="follower_pressure",
    summary="accelerates when pressed from behind",
    parameters=(Parameter("c", "m/s^2", slots.PRESSURE, -1.0, 1.5, 0.3),),
    required_stimuli=("rear_gap",),
    confusable_with=("location", "courtesy_yielding"),
    source="Herman, Montroll, Potts and Rothery (1959), backward-looking drivers",
    forms=(Form(slots.PRESSURE, _pressed, selection=0.1),),
    told=(
        Telling(
            "c",
            more="accelerate when a follower comes close",
            less="slow down when a follower comes close",
            when="with a follower closer than 15 m",
            size=_size,
            advice="Calibrate where nobody follows closely, or keep the follower in the model.",
            situation={"rear_gap": 5.0},
        ),
    ),
)
