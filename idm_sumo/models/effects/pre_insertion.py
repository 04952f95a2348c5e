r"""Pre-insertion: a driver adapts its gap before its lane change.

.. math:: T \to T(1+c) \quad\text{in the 5 s before the own lane change}

In the alternative form it brakes a little, or accelerates:

.. math:: \dot v \to \dot v - \beta \quad\text{in the 3 s before}
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.courtesy_yielding import NOTICE, SHOWN, before_cut_in
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Telling, of_acceleration, of_headway


@njit(cache=True, error_model="numpy")
def before_own_change(until: float, share: float) -> float:
    """Return the time headway's factor before a lane change.

    Parameters
    ----------
    until : float
        Time until the own lane change (s); NaN for none.
    share : float
        Magnitude :math:`c`.

    Returns
    -------
    float
        :math:`1+c` in the five seconds before, else 1.
    """
    return before_cut_in(until, share)


def _of_headway(see: Moments) -> Floats:
    return see.by_headway * ((see.until_own_change >= 0.0) & (see.until_own_change < NOTICE))


def _braking(see: Moments) -> Floats:
    return np.where((see.until_own_change >= 0.0) & (see.until_own_change < SHOWN), -1.0, 0.0)


EFFECT = Effect(
    name="pre_insertion",
    summary="opens or closes the gap before its own lane change",
    parameters=(Parameter("c", "1", slots.PRE_INSERTION, -0.8, 3.0, 0.4),),
    alternative=Parameter("beta", "m/s^2", slots.PRE_INSERTION_BRAKING, -1.5, 1.5, 0.3),
    required_stimuli=("until_own_change",),
    confusable_with=("lane_change_relaxation", "courtesy_yielding"),
    source="Zheng, Ahn, Chen and Laval (2013), The effects of lane-changing on the immediate follower",
    hindsight=True,
    forms=(
        Form(slots.PRE_INSERTION, _of_headway),
        Form(slots.PRE_INSERTION_BRAKING, _braking),
    ),
    told=(
        Telling(
            "c",
            more="open their gap before their own lane change",
            less="close up before their own lane change",
            when="in the last five seconds before the lane change",
            size=of_headway("c"),
            advice="Leave the last five seconds before a lane change out of calibration.",
            situation={"until_own_change": 2.0},
        ),
        Telling(
            "beta",
            more="brake a little before their own lane change",
            less="accelerate before their own lane change",
            when="in the last three seconds before the lane change",
            size=of_acceleration("beta", -1.0),
            advice="Leave the last three seconds before a lane change out of calibration.",
            situation={"until_own_change": 2.0},
        ),
    ),
)
