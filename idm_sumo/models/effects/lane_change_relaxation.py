r"""Relaxation: after a leader change that shortened the gap, the driver accepts it and recovers slowly.

.. math:: d \to d + \kappa\, J\, e^{-t_c/\tau_r}

with :math:`J` the shortening (m) at the last leader change and :math:`t_c` the time since. Or no more of it is overlooked than the gap is
short of the driver's own headway (:math:`\chi = 1`):

.. math:: d \to d + \min(\kappa\, J\, e^{-t_c/\tau_r},\, \min(1,\, \kappa\, e^{-t_c/\tau_r})\, v \max(0,\, T - T_c))

Or the time headway is what is accepted (:math:`\phi = 1`), and returns from that to the driver's own:

.. math:: T \to T - \kappa\, e^{-t_c/\tau_r} \max(0,\, T - T_c)

with :math:`T_c` the headway right after the change.
"""

from __future__ import annotations

from math import exp

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter

LARGEST_JUMP = 40.0  # m; more is a new leader far behind a vanished one, not a gap accepted
STANDING, SLOWEST = 2.0, 2.0  # m, of a gap, that are no headway; m/s, below which there is none


@njit(cache=True, error_model="numpy")
def gap_credit(jump: float, since: float, share: float, recovery: float) -> float:
    r"""Return :math:`\kappa J e^{-t_c/\tau_r}` (m); zero without a change that shortened the gap."""
    if share == 0.0 or not jump > 0.0:
        return 0.0
    return share * min(jump, LARGEST_JUMP) * exp(-since / recovery)


@njit(cache=True, error_model="numpy")
def headway_given_up(jump: float, since: float, share: float, recovery: float) -> float:
    r"""Return :math:`\kappa e^{-t_c/\tau_r}`: the share of what the accepted headway lacks; zero without such a change."""
    if share == 0.0 or not jump > 0.0:
        return 0.0
    return min(share * exp(-since / recovery), 1.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def within_shortage(credit, limited, lacking, speed):  # type: ignore[no-untyped-def]
    """Return the gap credit (m), no more than a share ``limited``, if positive, of what a headway ``lacking`` (s) is in m."""
    return min(credit, limited * lacking * speed) if limited > 0.0 else credit


@njit(cache=True, error_model="numpy")
def headway_after(gap, speed):  # type: ignore[no-untyped-def]
    """Return the time headway (s) at a gap (m) and speed (m/s), of a leader change."""
    return np.maximum(gap - STANDING, 0.0) / np.maximum(speed, SLOWEST)


EFFECT = Effect(
    name="lane_change_relaxation",
    summary="accepts a short gap after a leader change and recovers slowly",
    parameters=(
        Parameter("kappa", "1", slots.RELAXATION, 0.0, 1.5, 0.5),
        Parameter("tau_r", "s", slots.RELAXATION_TIME, 3.0, 40.0, 12.0),
        Parameter("phi", "1", slots.HEADWAY_ACCEPTED, 0.0, 1.0, 0.0),
        Parameter("chi", "1", slots.CREDIT_LIMITED, 0.0, 1.0, 0.0),
    ),
    must_see=("jump", "since_change", "accepted_headway"),
    confusable_with=("location", "acceleration_asymmetry", "pre_insertion"),
    source="Schmidt-Coffaro (2009); Laval and Leclercq (2008), Transportation Research B 42; of the headway: Schakel, Knoop and "
    "van Arem (2012), Transportation Research Record 2316",
)
