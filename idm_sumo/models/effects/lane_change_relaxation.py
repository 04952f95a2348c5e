r"""Relaxation: a driver accepts a shortened gap and recovers slowly.

.. math:: d \to d + \kappa\, J\, e^{-t_c/\tau_r}

Here :math:`J` is the shortening (m) at the last change of leader and :math:`t_c` the time since.
With :math:`\chi = 1` the credit is limited by what the gap lacks of the driver's own headway:

.. math:: d \to d + \min(\kappa\, J\, e^{-t_c/\tau_r},\, \min(1,\, \kappa\, e^{-t_c/\tau_r})\, v \max(0,\, T - T_c))

With :math:`\phi = 1` the driver accepts the time headway and returns from it to its own:

.. math:: T \to T - \kappa\, e^{-t_c/\tau_r} \max(0,\, T - T_c)

Here :math:`T_c` is the headway right after the change.
"""

from __future__ import annotations

from math import exp

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Form
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values

LARGEST_JUMP = 40.0  # m; a larger one comes from a leader that vanished, not from an accepted gap
STANDING, SLOWEST = 2.0, 2.0  # m, part of the gap kept at standstill; m/s, least speed of a time headway


@njit(cache=True, error_model="numpy")
def gap_credit(jump: float, since: float, share: float, recovery: float) -> float:
    r"""Return the length that is added to the gap.

    Parameters
    ----------
    jump : float
        Shortening of the gap at the change :math:`J` (m); NaN without a change.
    since : float
        Time since the change :math:`t_c` (s).
    share : float
        Magnitude :math:`\kappa`.
    recovery : float
        Relaxation time :math:`\tau_r` (s).

    Returns
    -------
    float
        :math:`\kappa J e^{-t_c/\tau_r}` (m), zero without a change that shortened the gap.
    """
    if share == 0.0 or not jump > 0.0:
        return 0.0
    return share * min(jump, LARGEST_JUMP) * exp(-since / recovery)


@njit(cache=True, error_model="numpy")
def headway_given_up(jump: float, since: float, share: float, recovery: float) -> float:
    r"""Return the share of the headway's shortage that is accepted.

    Parameters
    ----------
    jump : float
        Shortening of the gap at the change (m); NaN without a change.
    since : float
        Time since the change :math:`t_c` (s).
    share : float
        Magnitude :math:`\kappa`.
    recovery : float
        Relaxation time :math:`\tau_r` (s).

    Returns
    -------
    float
        :math:`\min(1, \kappa e^{-t_c/\tau_r})`, zero without a change that shortened the gap.
    """
    if share == 0.0 or not jump > 0.0:
        return 0.0
    return min(share * exp(-since / recovery), 1.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def within_shortage(credit, limited, lacking, speed):  # type: ignore[no-untyped-def]
    """Return the gap credit, limited by the shortage of headway.

    Parameters
    ----------
    credit : float
        :func:`gap_credit` (m).
    limited : float
        Share of the shortage that is the limit; not positive for no limit.
    lacking : float
        Shortage of the time headway (s).
    speed : float
        Own speed (m/s).

    Returns
    -------
    float
        Credit (m).
    """
    return min(credit, limited * lacking * speed) if limited > 0.0 else credit


@njit(cache=True, error_model="numpy")
def headway_after(gap, speed):  # type: ignore[no-untyped-def]
    """Return the time headway right after a change of leader.

    Parameters
    ----------
    gap : float or float64 array
        New gap (m).
    speed : float or float64 array
        Own speed (m/s).

    Returns
    -------
    float or float64 array
        Time headway (s), from the gap without ``STANDING`` and at least the speed ``SLOWEST``.
    """
    return np.maximum(gap - STANDING, 0.0) / np.maximum(speed, SLOWEST)


def _size(values: Values, _one: Median) -> str:
    within = f", given back within about {values['tau_r']:.0f} s" if "tau_r" in values else ""
    return f"{values['kappa']:.0%} of the lost gap accepted{within}"


EFFECT = Effect(
    name="lane_change_relaxation",
    summary="accepts a short gap after a leader change and recovers slowly",
    parameters=(
        Parameter("kappa", "1", slots.RELAXATION, 0.0, 1.5, 0.5),
        Parameter("tau_r", "s", slots.RELAXATION_TIME, 3.0, 40.0, 12.0),
        Parameter("phi", "1", slots.HEADWAY_ACCEPTED, 0.0, 1.0, 0.0),
        Parameter("chi", "1", slots.CREDIT_LIMITED, 0.0, 1.0, 0.0),
    ),
    required_stimuli=("jump", "since_change", "accepted_headway"),
    confusable_with=("location", "acceleration_asymmetry", "pre_insertion"),
    source="Schmidt-Coffaro (2009); Laval and Leclercq (2008), Transportation Research B 42; "
    "of the headway: Schakel, Knoop and van Arem (2012), Transportation Research Record 2316",
    forms=tuple(
        Form(slots.RELAXATION, size=0.5, fixed=((slots.RELAXATION_TIME, recovery), *kind))
        for kind in ((), ((slots.HEADWAY_ACCEPTED, 1.0),), ((slots.CREDIT_LIMITED, 1.0),))
        for recovery in (9.0, 16.0)
    ),
    between=True,
    told=(
        Telling(
            "kappa",
            more="accept the short gap after a change of leader, and let it grow back slowly",
            less="open the gap after a change of leader faster than the model",
            when="after a change of leader that shortened the gap",
            size=_size,
            advice="Leave the half minute after such a change of leader out of calibration.",
            situation={"jump": 15.0, "since_change": 2.0, "accepted_headway": 0.6},
        ),
    ),
)
