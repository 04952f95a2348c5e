r"""Friction: slower beside a slower lane.

.. math:: \dot v \to \dot v - k \max(0, v - v_{adj})

with :math:`v_{adj}` the mean speed of the vehicles near in the slower one of the adjacent lanes, or (:math:`\phi = 1`) the speed of
the slower one of the next vehicles ahead there: of those on whom the eye is.
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter

BESIDE = 30.0  # m, to either side: who counts as near
AHEAD = 60.0  # m: how far the next one counts


@njit(cache=True, error_model="numpy")
def friction(speed: float, adjacent_speed: float, strength: float) -> float:
    r"""Return :math:`-k\max(0, v-v_{adj})` (m/s²); nothing beside an empty lane (NaN)."""
    return -strength * (speed - adjacent_speed) if adjacent_speed < speed else 0.0


EFFECT = Effect(
    name="adjacent_lane_friction",
    summary="slows beside a slower lane",
    parameters=(
        Parameter("k", "1/s", slots.FRICTION, -0.3, 0.5, 0.05),
        Parameter("phi", "1", slots.FRICTION_NEXT, 0.0, 1.0, 0.0),
    ),
    must_see=("adjacent_speed", "next_beside_speed"),
    confusable_with=("location", "desired_speed"),
    source="Liu, Schroeder, Thomson, Wang, Rouphail and Yin (2011), Cartage friction between freeway lanes",
)
