r"""Time headway that differs in one interval of time, or drifts.

.. math:: T \to T(1+\theta) \quad\text{for } t_1 \le t < t_2

or drifts from the one time to the other, and stays there:

.. math:: T \to T(1+\delta\,u), \qquad u = \min(\max(2\,\tfrac{t-t_1}{t_2-t_1} - 1, -1), 1)
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter


@njit(cache=True, error_model="numpy")
def at_time(t: float, share: float, begin: float, end: float) -> float:
    r"""Return :math:`1+\theta` between the two times (s), else 1: a factor of the time headway."""
    return 1.0 + share if begin <= t < end else 1.0


@njit(cache=True, error_model="numpy")
def drifted(t: float, drift: float, begin: float, end: float) -> float:
    r"""Return :math:`1+\delta u`: a factor of the time headway, from :math:`1-\delta` to :math:`1+\delta` between the times (s)."""
    if drift == 0.0:
        return 1.0
    along = (t - begin) / max(end - begin, 1e-9)
    return 1.0 + drift * min(max(2.0 * along - 1.0, -1.0), 1.0)


EFFECT = Effect(
    name="time_of_day",
    summary="drives otherwise at another time of the recording",
    parameters=(
        Parameter("theta", "1", slots.PERIOD, -0.8, 2.0, 0.12),
        Parameter("t_1", "s", slots.PERIOD_BEGIN, -1e9, 1e9, 0.0),
        Parameter("t_2", "s", slots.PERIOD_END, -1e9, 1e9, 0.0),
    ),
    instead=Parameter("delta", "1", slots.PERIOD_DRIFT, -0.8, 0.8, 0.12),
    must_see=("t",),
    confusable_with=("memory", "speed_dependent_headway"),
    source="Treiber and Helbing (2003), Memory effects in microscopic traffic models",
    sumo="one vType a departure period",
)
