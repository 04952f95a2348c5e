r"""Multi-leader anticipation: a driver reacts to the second leader, too.

.. math:: \Big(\frac{d^*}{d}\Big)^2 \to (1-w)\Big(\frac{d^*}{d}\Big)^2
          + w\Big(\frac{d^*(v, v-v_2)}{d_2/2}\Big)^2

Here :math:`d_2` is the free space up to the second leader without the first leader's length. In a
homogeneous platoon :math:`d_2 = 2d`, so the equilibrium is unchanged. With :math:`\phi = 1` only
the second leader's speed counts:

.. math:: \Delta v \to (1-w)\,\Delta v + w\,(v - v_2)
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Form
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values


@njit(cache=True, error_model="numpy")
def shared_interaction(first: float, second: float, weight: float) -> float:
    r"""Return the interaction with two leaders.

    Parameters
    ----------
    first, second : float
        Squared ratios of desired to present gap, for the first and the second leader.
    weight : float
        Magnitude :math:`w`.

    Returns
    -------
    float
        :math:`(1-w)\,i_1 + w\,i_2`.
    """
    return (1.0 - weight) * first + weight * second


@njit(cache=True, error_model="numpy")
def shared_rate(first: float, second: float, weight: float) -> float:
    r"""Return the approach rate to two leaders.

    Parameters
    ----------
    first, second : float
        Approach rates to the first and the second leader (m/s).
    weight : float
        Magnitude :math:`w`.

    Returns
    -------
    float
        :math:`(1-w)\,\Delta v + w\,(v-v_2)` (m/s).
    """
    return first + weight * (second - first)


def _size(values: Values, _one: Median) -> str:
    return f"{values['w']:.0%} of the reaction is to the second leader"


EFFECT = Effect(
    name="multi_leader_anticipation",
    summary="reacts to the second leader too",
    parameters=(
        Parameter("w", "1", slots.SECOND_LEADER, 0.0, 0.9, 0.2),
        Parameter("phi", "1", slots.SECOND_SPEED_ONLY, 0.0, 1.0, 0.0),
    ),
    required_stimuli=("second_gap", "second_speed"),
    confusable_with=("measurement_artefact", "reaction_delay", "correlated_noise"),
    source="Treiber, Kesting and Helbing (2006), Physica A 360; "
    "of speeds: Hoogendoorn and Ossen (2006), IFAC Proceedings 39",
    sumo="EIDM's maxvehpreview",
    forms=(
        Form(slots.SECOND_LEADER, size=0.2),
        Form(slots.SECOND_LEADER, size=0.2, fixed=((slots.SECOND_SPEED_ONLY, 1.0),)),
    ),
    told=(
        Telling(
            "w",
            more="look past their leader and react to the one before it, too",
            less="",
            when="",
            size=_size,
            advice="Keep the second leader in the model: with the first alone, parameters absorb the anticipation.",
        ),
    ),
)
