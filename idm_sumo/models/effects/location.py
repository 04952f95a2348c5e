r"""Location: a place of the road changes behaviour.

.. math:: \dot v \to \dot v + \alpha \quad\text{for } x_1 \le x < x_2

Examples are a grade, a curve, a merge or an object to look at. In the alternative form the time
headway differs at the place:

.. math:: T \to T(1+\theta)
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import POSITION, Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Telling, of_acceleration, of_headway


@njit(cache=True, error_model="numpy")
def at_place(x: float, shift: float, begin: float, end: float) -> float:
    """Return the shift inside the place, else 0.

    Parameters
    ----------
    x : float
        Own front (m).
    shift : float
        Magnitude: an acceleration (m/s²) or a share of the time headway.
    begin, end : float
        Where the place begins and ends (m).

    Returns
    -------
    float
        ``shift`` inside the place, else 0.
    """
    return shift if begin <= x < end else 0.0


def _everywhere(see: Moments) -> Floats:
    return np.ones_like(see.position)


def _of_headway(see: Moments) -> Floats:
    return see.by_headway


EFFECT = Effect(
    name="location",
    summary="drives differently at one place of the road",
    parameters=(
        Parameter("alpha", "m/s^2", slots.PLACE, -1.5, 1.5, 0.12),
        Parameter("x_1", "m", slots.PLACE_BEGIN, -1e6, 1e6, 0.0),
        Parameter("x_2", "m", slots.PLACE_END, -1e6, 1e6, 0.0),
    ),
    alternative=Parameter("theta", "1", slots.PLACE_HEADWAY, -0.8, 2.0, 0.12),
    required_stimuli=("x",),
    confusable_with=("lane_change_relaxation", "measurement_artefact", "adjacent_lane_friction"),
    source="Chen, Ahn, Laval and Zheng (2014), On the periodicity of traffic oscillations: rubbernecking and grade",
    sumo="an edge of its own with another speed limit, or a calibrator, for an interval that brakes",
    forms=(
        Form(slots.PLACE, _everywhere, along=POSITION, bounds=(slots.PLACE_BEGIN, slots.PLACE_END)),
        Form(slots.PLACE_HEADWAY, _of_headway, along=POSITION, bounds=(slots.PLACE_BEGIN, slots.PLACE_END)),
    ),
    between=True,
    told=(
        Telling(
            "alpha",
            more="push on",
            less="hold back",
            when="",
            size=of_acceleration("alpha"),
            advice="Leave this stretch out of calibration: parameters fitted there are those of the place.",
        ),
        Telling(
            "theta",
            more="keep a longer time headway",
            less="keep a shorter time headway",
            when="",
            size=of_headway("theta"),
            advice="Leave this stretch out of calibration: parameters fitted there are those of the place.",
        ),
    ),
)
