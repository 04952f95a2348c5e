r"""Memory, or resignation: the time headway grows in long jams.

.. math:: T \to T\big(1 + m\,(1 - \bar v / v_0)\big)

Here :math:`\bar v` is the running mean of the own speed over up to 600 s; a short section shows far less.
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values


@njit(cache=True, error_model="numpy")
def resigned(mean_speed: float, desired_speed: float, share: float) -> float:
    r"""Return the factor of the time headway.

    Parameters
    ----------
    mean_speed : float
        Running mean of the own speed :math:`\bar v` (m/s).
    desired_speed : float
        Desired speed :math:`v_0` (m/s).
    share : float
        Magnitude :math:`m`.

    Returns
    -------
    float
        :math:`1+m\max(0, 1-\bar v/v_0)`.
    """
    return 1.0 + share * max(0.0, 1.0 - mean_speed / desired_speed) if share != 0.0 else 1.0


def _size(values: Values, one: Median) -> str:
    return f"time headway {one.headway:.2f} → up to {one.headway * (1.0 + values['m']):.2f} s"


EFFECT = Effect(
    name="memory",
    summary="keeps larger headways after a long time in a jam",
    parameters=(Parameter("m", "1", slots.MEMORY, 0.0, 2.0, 0.4),),
    required_stimuli=("mean_speed",),
    confusable_with=("time_of_day", "speed_dependent_headway"),
    source="Treiber and Helbing (2003), Physical Review E 68, 046119",
    untestable="windows of seconds cannot tell a slow trend from time_of_day and speed_dependent_headway",
    told=(
        Telling(
            "m",
            more="keep longer headways the longer they have been in a jam",
            less="keep shorter headways the longer they have been in a jam",
            when="after minutes in slow traffic",
            size=_size,
            advice="Calibrate jams and free traffic apart.",
            situation={"mean_speed": 3.0},
        ),
    ),
)
