r"""Courtesy: room is made before another vehicle cuts in.

.. math:: T \to T(1+c) \quad\text{in the 5 s before a vehicle is inserted ahead}

or the driver brakes a little while it shows that it wants in:

.. math:: \dot v \to \dot v - \beta \quad\text{in the 3 s before}
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter

NOTICE, SHOWN = 5.0, 3.0  # s


@njit(cache=True, error_model="numpy")
def before_cut_in(until: float, share: float) -> float:
    r"""Return :math:`1+c` in the five seconds before, else 1: a factor of the time headway."""
    return 1.0 + share if 0.0 <= until < NOTICE else 1.0


@njit(cache=True, error_model="numpy")
def braking_before(until: float, deceleration: float) -> float:
    """Return the acceleration (m/s²) in the three seconds before, minus ``deceleration``, else 0."""
    return -deceleration if 0.0 <= until < SHOWN else 0.0


EFFECT = Effect(
    name="courtesy_yielding",
    summary="makes room before another cuts in",
    parameters=(Parameter("c", "1", slots.COURTESY, -0.8, 3.0, 0.4),),
    instead=Parameter("beta", "m/s^2", slots.COURTESY_BRAKING, -1.5, 1.5, 0.3),
    must_see=("until_cut_in",),
    confusable_with=("lane_change_relaxation", "follower_pressure"),
    source="Kesting, Treiber and Helbing (2007), MOBIL; Hidas (2005), cooperative lane changing",
    hindsight=True,
)
