r"""Perception threshold: small approach rates are not perceived.

.. math:: \Delta v \to 0 \quad\text{where } |\Delta v| < \delta

Larger ones are perceived as they are or, with :math:`\phi = 1`, less the threshold:
:math:`\Delta v - \delta\,\mathrm{sgn}\,\Delta v`.
"""

from __future__ import annotations

from math import copysign

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Form
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values


@njit(cache=True, error_model="numpy")
def perceived(approach_rate: float, band: float, taken: float) -> float:
    r"""Return the approach rate that the driver perceives.

    Parameters
    ----------
    approach_rate : float
        True approach rate (m/s).
    band : float
        Threshold :math:`\delta` (m/s).
    taken : float
        What is taken off larger approach rates (m/s).

    Returns
    -------
    float
        Perceived approach rate (m/s).
    """
    return 0.0 if abs(approach_rate) < band else approach_rate - copysign(taken, approach_rate)


def _size(values: Values, _one: Median) -> str:
    return f"approach rates below {values['delta']:.2f} m/s have no effect"


EFFECT = Effect(
    name="perception_threshold",
    summary="ignores small approach rates",
    parameters=(
        Parameter("delta", "m/s", slots.BAND, 0.0, 2.5, 0.6),
        Parameter("phi", "1", slots.BAND_TAKEN, 0.0, 1.0, 0.0),
    ),
    required_stimuli=(),
    confusable_with=("hysteresis", "reaction_delay", "acceleration_asymmetry"),
    source="Wiedemann (1974), Simulation des Strassenverkehrsflusses",
    sumo="the W99 or Wiedemann models have it; the driver-state device in part",
    forms=(
        Form(slots.BAND, size=0.4),
        Form(slots.BAND, size=0.9),
        Form(slots.BAND, size=0.5, fixed=((slots.BAND_TAKEN, 1.0),)),
    ),
    told=(
        Telling(
            "delta",
            more="do not notice that they approach, or fall back, slowly",
            less="",
            when="while the approach rate is small",
            size=_size,
            advice="Calibrate on windows with clear braking: small approach rates say little about these drivers.",
        ),
    ),
)
