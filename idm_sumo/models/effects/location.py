r"""A place that changes behaviour: a grade, a curve, a merge, something to look at.

.. math:: \dot v \to \dot v + \alpha \quad\text{for } x_1 \le x < x_2

or the time headway is another there:

.. math:: T \to T(1+\theta)
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter


@njit(cache=True, error_model="numpy")
def at_place(x: float, shift: float, begin: float, end: float) -> float:
    """Return the shift between the two positions (m), else 0."""
    return shift if begin <= x < end else 0.0


EFFECT = Effect(
    name="location",
    summary="drives otherwise at one place of the road",
    parameters=(
        Parameter("alpha", "m/s^2", slots.PLACE, -1.5, 1.5, 0.12),
        Parameter("x_1", "m", slots.PLACE_BEGIN, -1e6, 1e6, 0.0),
        Parameter("x_2", "m", slots.PLACE_END, -1e6, 1e6, 0.0),
    ),
    instead=Parameter("theta", "1", slots.PLACE_HEADWAY, -0.8, 2.0, 0.12),
    must_see=("x",),
    confusable_with=("lane_change_relaxation", "measurement_artefact", "adjacent_lane_friction"),
    source="Chen, Ahn, Laval and Zheng (2014), On the periodicity of traffic oscillations: rubbernecking and grade",
    sumo="an edge of its own with another speed limit, or a calibrator, for an interval that brakes",
)
