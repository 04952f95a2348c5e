r"""Time headway that differs in an interval, or drifts.

.. math:: T \to T(1+\theta) \quad\text{for } t_1 \le t < t_2

In the alternative form it drifts from the first time to the second and then stays:

.. math:: T \to T(1+\delta\,u), \qquad u = \min(\max(2\,\tfrac{t-t_1}{t_2-t_1} - 1, -1), 1)
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import TIME, Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values, of_headway


@njit(cache=True, error_model="numpy")
def at_time(t: float, share: float, begin: float, end: float) -> float:
    r"""Return the factor of the time headway in an interval.

    Parameters
    ----------
    t : float
        Time since the first frame of the recording's period (s).
    share : float
        Magnitude :math:`\theta`.
    begin, end : float
        Begin and end of the interval (s).

    Returns
    -------
    float
        :math:`1+\theta` inside the interval, else 1.
    """
    return 1.0 + share if begin <= t < end else 1.0


@njit(cache=True, error_model="numpy")
def drifted(t: float, drift: float, begin: float, end: float) -> float:
    r"""Return the factor of the time headway during a drift.

    Parameters
    ----------
    t : float
        Time since the first frame of the recording's period (s).
    drift : float
        Magnitude :math:`\delta`.
    begin, end : float
        Begin and end of the drift (s).

    Returns
    -------
    float
        :math:`1+\delta u`, from :math:`1-\delta` to :math:`1+\delta`.
    """
    if drift == 0.0:
        return 1.0
    along = (t - begin) / max(end - begin, 1e-9)
    return 1.0 + drift * min(max(2.0 * along - 1.0, -1.0), 1.0)


def _of_headway(see: Moments) -> Floats:
    return see.by_headway


def _drift(see: Moments) -> Floats:
    along = (see.time - see.begin) / max(see.end - see.begin, 1e-9)
    return see.by_headway * np.clip(2.0 * along - 1.0, -1.0, 1.0)


def _drift_told(values: Values, one: Median) -> str:
    before, after = (one.headway * (1.0 + sign * values["delta"]) for sign in (-1.0, 1.0))
    return f"time headway {before:.2f} s in the beginning, {after:.2f} s in the end"


EFFECT = Effect(
    name="time_of_day",
    summary="drives differently at another time of the recording",
    parameters=(
        Parameter("theta", "1", slots.PERIOD, -0.8, 2.0, 0.12),
        Parameter("t_1", "s", slots.PERIOD_BEGIN, -1e9, 1e9, 0.0),
        Parameter("t_2", "s", slots.PERIOD_END, -1e9, 1e9, 0.0),
    ),
    alternative=Parameter("delta", "1", slots.PERIOD_DRIFT, -0.8, 0.8, 0.12),
    required_stimuli=("t",),
    confusable_with=("memory", "speed_dependent_headway"),
    source="Treiber and Helbing (2003), Memory effects in microscopic traffic models",
    sumo="one vType a departure period",
    forms=(
        Form(slots.PERIOD, _of_headway, along=TIME, bounds=(slots.PERIOD_BEGIN, slots.PERIOD_END)),
        Form(
            slots.PERIOD_DRIFT,
            _drift,
            of_recording=((slots.PERIOD_BEGIN, "begin"), (slots.PERIOD_END, "end")),
        ),
    ),
    between=True,
    told=(
        Telling(
            "theta",
            more="keep a longer time headway for a part of the recording",
            less="keep a shorter time headway for a part of the recording",
            when="",
            size=of_headway("theta"),
            advice="Calibrate this part of the recording apart from the rest.",
        ),
        Telling(
            "delta",
            more="keep longer and longer time headways as the recording goes on",
            less="keep shorter and shorter time headways as the recording goes on",
            when="",
            size=_drift_told,
            advice="Calibrate the beginning and the end of the recording apart.",
        ),
    ),
)
