r"""Leader's class: more distance behind a truck.

.. math:: T \to T(1+\theta) \quad\text{behind a vehicle of class 3}

or some metres, whatever the speed:

.. math:: d_0 \to d_0 + \ell
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.recordings.columns import TRUCK


@njit(cache=True, error_model="numpy")
def behind_truck(leader_class: float, share: float) -> float:
    r"""Return :math:`1+\theta` behind a truck, else 1: a factor of the time headway."""
    return 1.0 + share if leader_class == TRUCK else 1.0


@njit(cache=True, error_model="numpy")
def farther_from_truck(leader_class: float, distance: float) -> float:
    """Return the metres kept more behind a truck, else 0: added to the jam distance."""
    return distance if leader_class == TRUCK else 0.0


EFFECT = Effect(
    name="leader_class",
    summary="keeps more distance behind trucks",
    parameters=(Parameter("theta", "1", slots.LEADER_CLASS, -0.5, 2.0, 0.3),),
    instead=Parameter("ell", "m", slots.LEADER_CLASS_DISTANCE, -5.0, 20.0, 4.0),
    must_see=("leader_class",),
    confusable_with=("measurement_artefact", "vehicle_class"),
    source="Sarvi (2013), Heavy commercial vehicles-following behavior",
)
