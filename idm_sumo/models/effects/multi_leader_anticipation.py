r"""Anticipation: part of the interaction is with the second leader.

.. math:: \Big(\frac{d^*}{d}\Big)^2 \to (1-w)\Big(\frac{d^*}{d}\Big)^2
          + w\Big(\frac{d^*(v, v-v_2)}{d_2/2}\Big)^2

with :math:`d_2` the free space up to the second leader, the first leader's length taken out; in a homogeneous
platoon :math:`d_2 = 2d`, so that the equilibrium stays. Or of the second leader the speed alone counts (:math:`\phi = 1`):

.. math:: \Delta v \to (1-w)\,\Delta v + w\,(v - v_2)
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter


@njit(cache=True, error_model="numpy")
def shared_interaction(first: float, second: float, weight: float) -> float:
    r"""Return :math:`(1-w)\,i_1 + w\,i_2`, the shared squared ratio of wanted to kept gap."""
    return (1.0 - weight) * first + weight * second


@njit(cache=True, error_model="numpy")
def shared_rate(first: float, second: float, weight: float) -> float:
    r"""Return :math:`(1-w)\,\Delta v + w\,(v-v_2)`, the shared approach rate (m/s)."""
    return first + weight * (second - first)


EFFECT = Effect(
    name="multi_leader_anticipation",
    summary="reacts to the second leader too",
    parameters=(
        Parameter("w", "1", slots.SECOND_LEADER, 0.0, 0.9, 0.2),
        Parameter("phi", "1", slots.SECOND_SPEED_ONLY, 0.0, 1.0, 0.0),
    ),
    must_see=("second_gap", "second_speed"),
    confusable_with=("measurement_artefact", "reaction_delay", "correlated_noise"),
    source="Treiber, Kesting and Helbing (2006), Physica A 360; of speeds: Hoogendoorn and Ossen (2006), IFAC Proceedings 39",
    sumo="EIDM's maxvehpreview",
)
