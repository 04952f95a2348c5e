r"""Time headway that changes with speed.

.. math:: T \to T\Big(1 + \gamma\,\frac{v-\bar v}{10\,\text{m/s}}\Big)

The pivot speed :math:`\bar v` is the recording's mean.
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import KMH, Median, Telling, Values

SPEED_UNIT = 10.0  # m/s
LEAST_FACTOR = 0.1  # least factor of the headway, which stays positive


@njit(cache=True, error_model="numpy")
def at_speed(speed: float, pivot: float, slope: float) -> float:
    r"""Return the factor of the time headway.

    Parameters
    ----------
    speed, pivot : float
        Own speed :math:`v` and pivot speed :math:`\bar v` (m/s).
    slope : float
        Magnitude :math:`\gamma` (per 10 m/s).

    Returns
    -------
    float
        :math:`1+\gamma(v-\bar v)/10`, at least ``LEAST_FACTOR``.
    """
    return max(1.0 + slope * (speed - pivot) / SPEED_UNIT, LEAST_FACTOR)


def _of_speed(see: Moments) -> Floats:
    return see.by_headway * ((see.speed - see.mean_speed) / SPEED_UNIT)


def _size(values: Values, one: Median) -> str:
    middle = values.get("v_mean", SPEED_UNIT)
    faster = one.headway * at_speed(middle + SPEED_UNIT, middle, values["gamma"])
    slow, fast = KMH * middle, KMH * (middle + SPEED_UNIT)
    return f"time headway {one.headway:.2f} s at {slow:.0f} km/h, {faster:.2f} s at {fast:.0f} km/h"


EFFECT = Effect(
    name="speed_dependent_headway",
    summary="keeps another time headway at another speed",
    parameters=(
        Parameter("gamma", "1 per 10 m/s", slots.SPEED_HEADWAY, -0.8, 1.0, 0.15),
        Parameter("v_mean", "m/s", slots.PIVOT_SPEED, 0.0, 50.0, 10.0),
    ),
    required_stimuli=(),
    confusable_with=("desired_speed", "time_of_day", "memory"),
    source="Treiber, Kesting and Helbing (2006), Understanding widely scattered traffic flows",
    forms=(Form(slots.SPEED_HEADWAY, _of_speed, of_recording=((slots.PIVOT_SPEED, "mean_speed"),)),),
    between=True,
    told=(
        Telling(
            "gamma",
            more="keep a longer time headway the faster they drive",
            less="keep a shorter time headway the faster they drive",
            when="",
            size=_size,
            advice="Calibrate slow and fast traffic apart, or let the time headway depend on speed.",
        ),
    ),
)
