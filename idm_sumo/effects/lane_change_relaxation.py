r"""Relaxation: after a leader change that shortened the gap, the driver accepts it and recovers slowly.

.. math:: d \to d + \kappa\, J\, e^{-t_c/\tau_r}

with :math:`J` the shortening (m) at the last leader change and :math:`t_c` the time since.
"""

from __future__ import annotations

from math import exp

from numba import njit

from idm_sumo.effects import slots
from idm_sumo.effects.record import Effect, Parameter

LARGEST_JUMP = 40.0  # m; more is a new leader far behind a vanished one, not a gap accepted


@njit(cache=True, error_model="numpy")
def gap_credit(jump: float, since: float, share: float, recovery: float) -> float:
    r"""Return :math:`\kappa J e^{-t_c/\tau_r}` (m); zero without a change that shortened the gap."""
    if share == 0.0 or not jump > 0.0:
        return 0.0
    return share * min(jump, LARGEST_JUMP) * exp(-since / recovery)


EFFECT = Effect(
    name="lane_change_relaxation",
    summary="accepts a short gap after a leader change and recovers slowly",
    parameters=(
        Parameter("kappa", "1", slots.RELAXATION, 0.0, 1.5, 0.5),
        Parameter("tau_r", "s", slots.RELAXATION_TIME, 3.0, 40.0, 12.0),
    ),
    must_see=("jump", "since_change"),
    confusable_with=("location", "acceleration_asymmetry", "pre_insertion"),
    source="Schmidt-Coffaro (2009); Laval and Leclercq (2008), Transportation Research B 42",
)
