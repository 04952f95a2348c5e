r"""Leader's class: a driver keeps more distance behind a truck.

.. math:: T \to T(1+\theta) \quad\text{behind a vehicle of class 3}

In the alternative form the distance is longer at every speed:

.. math:: d_0 \to d_0 + \ell
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Floats, Form, Moments
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values, of_headway
from idm_sumo.recordings.columns import TRUCK


@njit(cache=True, error_model="numpy")
def behind_truck(leader_class: float, share: float) -> float:
    r"""Return the factor of the time headway behind a leader.

    Parameters
    ----------
    leader_class : float
        Class of the leader; NaN if unknown.
    share : float
        Magnitude :math:`\theta`.

    Returns
    -------
    float
        :math:`1+\theta` behind a truck, else 1.
    """
    return 1.0 + share if leader_class == TRUCK else 1.0


@njit(cache=True, error_model="numpy")
def farther_from_truck(leader_class: float, distance: float) -> float:
    r"""Return the length added to the jam distance.

    Parameters
    ----------
    leader_class : float
        Class of the leader; NaN if unknown.
    distance : float
        Magnitude :math:`\ell` (m).

    Returns
    -------
    float
        :math:`\ell` behind a truck, else 0 (m).
    """
    return distance if leader_class == TRUCK else 0.0


def _behind_truck(see: Moments) -> Floats:
    return np.where(see.leader_class == TRUCK, see.by_headway, 0.0)


def _longer(values: Values, one: Median) -> str:
    return f"gap at standstill {one.jam_distance:.1f} → {one.jam_distance + values['ell']:.1f} m"


EFFECT = Effect(
    name="leader_class",
    summary="keeps more distance behind trucks",
    parameters=(Parameter("theta", "1", slots.LEADER_CLASS, -0.5, 2.0, 0.3),),
    alternative=Parameter("ell", "m", slots.LEADER_CLASS_DISTANCE, -5.0, 20.0, 4.0),
    required_stimuli=("leader_class",),
    confusable_with=("measurement_artefact", "vehicle_class"),
    source="Sarvi (2013), Heavy commercial vehicles-following behavior",
    forms=(
        Form(slots.LEADER_CLASS, _behind_truck),
        Form(slots.LEADER_CLASS_DISTANCE, size=3.0),
    ),
    between=True,
    told=(
        Telling(
            "theta",
            more="keep a longer time headway behind trucks",
            less="keep a shorter time headway behind trucks",
            when="behind a truck",
            size=of_headway("theta"),
            advice="Calibrate followers of trucks apart from followers of cars.",
            situation={"leader_class": 3.0},
        ),
        Telling(
            "ell",
            more="keep a longer distance behind trucks, at every speed",
            less="keep a shorter distance behind trucks, at every speed",
            when="behind a truck",
            size=_longer,
            advice="Calibrate followers of trucks apart from followers of cars, and check the lengths of trucks.",
            situation={"leader_class": 3.0},
        ),
    ),
)
