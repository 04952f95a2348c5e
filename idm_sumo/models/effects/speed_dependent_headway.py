r"""Time headway that changes with speed.

.. math:: T \to T\Big(1 + \gamma\,\frac{v-\bar v}{10\,\text{m/s}}\Big)

around a pivot speed :math:`\bar v`, the recording's mean.
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter

SPEED_UNIT = 10.0  # m/s
LEAST_FACTOR = 0.1  # of the headway: no driver wants to be touched


@njit(cache=True, error_model="numpy")
def at_speed(speed: float, pivot: float, slope: float) -> float:
    r"""Return :math:`1+\gamma(v-\bar v)/10`: a factor of the time headway."""
    return max(1.0 + slope * (speed - pivot) / SPEED_UNIT, LEAST_FACTOR)


EFFECT = Effect(
    name="speed_dependent_headway",
    summary="keeps another time headway at another speed",
    parameters=(
        Parameter("gamma", "1 per 10 m/s", slots.SPEED_HEADWAY, -0.8, 1.0, 0.15),
        Parameter("v_mean", "m/s", slots.PIVOT_SPEED, 0.0, 50.0, 10.0),
    ),
    must_see=(),
    confusable_with=("desired_speed", "time_of_day", "memory"),
    source="Treiber, Kesting and Helbing (2006), Understanding widely scattered traffic flows",
)
