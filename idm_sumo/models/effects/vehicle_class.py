r"""Own class: trucks keep another time headway than cars.

.. math:: T \to T(1+\theta) \quad\text{of a vehicle of class 3}
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Telling, of_headway
from idm_sumo.recordings.columns import TRUCK


@njit(cache=True, error_model="numpy")
def of_truck(own_class: float, share: float) -> float:
    r"""Return the factor of the time headway of a vehicle.

    Parameters
    ----------
    own_class : float
        Own vehicle class; NaN if unknown.
    share : float
        Magnitude :math:`\theta`.

    Returns
    -------
    float
        :math:`1+\theta` for a truck, else 1.
    """
    return 1.0 + share if own_class == TRUCK else 1.0


EFFECT = Effect(
    name="vehicle_class",
    summary="trucks drive differently themselves",
    parameters=(Parameter("theta", "1", slots.OWN_CLASS, -0.8, 3.0, 0.3),),
    required_stimuli=("own_class",),
    confusable_with=("leader_class",),
    source="Ossen and Hoogendoorn (2011), Heterogeneity in car-following behavior, Transportation Research C 19",
    sumo="one vType a class",
    untestable="own class is part of the drivers' distribution, which is fitted driver by driver",
    told=(
        Telling(
            "theta",
            more="of trucks keep a longer time headway than those of cars",
            less="of trucks keep a shorter time headway than those of cars",
            when="",
            size=of_headway("theta"),
            advice="Calibrate trucks apart from cars.",
            situation={"own_class": 3.0},
        ),
    ),
)
