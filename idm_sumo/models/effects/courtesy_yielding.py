r"""Courtesy yielding: a driver makes room before a cut-in.

.. math:: T \to T(1+c) \quad\text{in the 5 s before a vehicle is inserted ahead}

In the alternative form the driver brakes a little while the other vehicle shows its intention:

.. math:: \dot v \to \dot v - \beta \quad\text{in the 3 s before}
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Telling, of_acceleration, of_headway

NOTICE, SHOWN = 5.0, 3.0  # s before the cut-in, in which the headway changes and the driver brakes


@njit(cache=True, error_model="numpy")
def before_cut_in(until: float, share: float) -> float:
    """Return the factor of the time headway before a cut-in.

    Parameters
    ----------
    until : float
        Time until the cut-in (s); NaN for none.
    share : float
        Magnitude :math:`c`.

    Returns
    -------
    float
        :math:`1+c` in the five seconds before, else 1.
    """
    return 1.0 + share if 0.0 <= until < NOTICE else 1.0


@njit(cache=True, error_model="numpy")
def braking_before(until: float, deceleration: float) -> float:
    r"""Return the acceleration before a cut-in.

    Parameters
    ----------
    until : float
        Time until the cut-in (s); NaN for none.
    deceleration : float
        Magnitude :math:`\beta` (m/s²).

    Returns
    -------
    float
        :math:`-\beta` in the three seconds before, else 0 (m/s²).
    """
    return -deceleration if 0.0 <= until < SHOWN else 0.0


def _of_headway(see: Moments) -> Floats:
    return see.by_headway * ((see.until_cut_in >= 0.0) & (see.until_cut_in < NOTICE))


def _braking(see: Moments) -> Floats:
    return np.where((see.until_cut_in >= 0.0) & (see.until_cut_in < SHOWN), -1.0, 0.0)


EFFECT = Effect(
    name="courtesy_yielding",
    summary="makes room before another cuts in",
    parameters=(Parameter("c", "1", slots.COURTESY, -0.8, 3.0, 0.4),),
    alternative=Parameter("beta", "m/s^2", slots.COURTESY_BRAKING, -1.5, 1.5, 0.3),
    required_stimuli=("until_cut_in",),
    confusable_with=("lane_change_relaxation", "follower_pressure"),
    source="Kesting, Treiber and Helbing (2007), MOBIL; Hidas (2005), cooperative lane changing",
    hindsight=True,
    forms=(
        Form(slots.COURTESY, _of_headway, selection=0.06),
        Form(slots.COURTESY_BRAKING, _braking, selection=0.07),
    ),
    told=(
        Telling(
            "c",
            more="make room before another vehicle cuts in",
            less="close up before another vehicle cuts in",
            when="in the last five seconds before the cut-in",
            size=of_headway("c"),
            advice="Leave the last five seconds before a cut-in out of calibration.",
            situation={"until_cut_in": 2.0},
        ),
        Telling(
            "beta",
            more="brake a little before another vehicle cuts in",
            less="accelerate a little before another vehicle cuts in",
            when="in the last three seconds before the cut-in",
            size=of_acceleration("beta", -1.0),
            advice="Leave the last three seconds before a cut-in out of calibration.",
            situation={"until_cut_in": 2.0},
        ),
    ),
)
