"""What drivers do beyond the IDM, one file an effect.

All effects share one compiled acceleration, :func:`extended_acceleration`. How to drive with a
model is described in the page on the extended model of the documentation.
"""

from idm_sumo.models.effects.acceleration import NO_STIMULI, Stimuli, extended_acceleration
from idm_sumo.models.effects.catalogue import BY_NAME, CATALOGUE
from idm_sumo.models.effects.extended_model import Cause, ExtendedModel
from idm_sumo.models.effects.record import Effect, Parameter, format_quantity

__all__ = [
    "BY_NAME",
    "CATALOGUE",
    "NO_STIMULI",
    "Cause",
    "Effect",
    "ExtendedModel",
    "Parameter",
    "Stimuli",
    "extended_acceleration",
    "format_quantity",
]
