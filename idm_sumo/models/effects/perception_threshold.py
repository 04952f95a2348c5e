r"""Perception threshold: small approach rates are not seen.

.. math:: \Delta v \to 0 \quad\text{where } |\Delta v| < \delta

and all of it is seen beyond, or (:math:`\phi = 1`) only what goes beyond: :math:`\Delta v - \delta\,\mathrm{sgn}\,\Delta v`.
"""

from __future__ import annotations

from math import copysign

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter


@njit(cache=True, error_model="numpy")
def perceived(approach_rate: float, band: float, taken: float) -> float:
    """Return the approach rate (m/s) that is seen: nothing inside the band; outside, all but what is taken off (m/s)."""
    return 0.0 if abs(approach_rate) < band else approach_rate - copysign(taken, approach_rate)


EFFECT = Effect(
    name="perception_threshold",
    summary="ignores small approach rates",
    parameters=(
        Parameter("delta", "m/s", slots.BAND, 0.0, 2.5, 0.6),
        Parameter("phi", "1", slots.BAND_TAKEN, 0.0, 1.0, 0.0),
    ),
    must_see=(),
    confusable_with=("hysteresis", "reaction_delay", "acceleration_asymmetry"),
    source="Wiedemann (1974), Simulation des Strassenverkehrsflusses",
    sumo="the W99 or Wiedemann models have it; the driver-state device in part",
)
