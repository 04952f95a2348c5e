r"""SUMO's EIDM without its random errors and delays.

Perception errors, reaction time, jerk limit and coolness are off. What is left is the improved IDM with the distances
that SUMO adds to it. It has the IDM's ``a, b, T, d0``; vehicles stand :math:`d_0 + 0.3` m apart.
"""

from __future__ import annotations

from numba import njit

from idm_sumo.models import idm, laws

SHORTER = 0.25  # m: by which the gap is taken for shorter than it is
FARTHER = 0.05  # m: by which the desired gap is longer
LEAST = 1e-3  # m: the smallest gap, SUMO's ``NUMERICAL_EPS``
NEAR, SLOW, HALTING = 0.1, 3.0, 0.1  # m beyond d0, m/s: there it brakes by at least so much (m/s²)
FREE_ROAD = 500.0  # m beyond d0: a vehicle at the desired speed is imagined there, as if ahead of everybody
DRIVE_OFF_SPEED, DRIVE_OFF_REST = 0.5, 4.0 - 1e-3  # m/s, s between two starts
DRIVE_OFF_ACCELERATION, DRIVE_OFF_SHARE = 0.2, 0.25  # m/s², and as a share of a: above it a vehicle drives already
DRIVE_OFF = 0.5  # of the acceleration, in the first step of a start


@njit(cache=True, error_model="numpy")
def acceleration(speed, approach_rate, gap, a, b, T, d0, desired_speed):  # type: ignore[no-untyped-def]
    """Return the acceleration over a step.

    Parameters
    ----------
    speed, approach_rate : float
        Own speed, and own speed minus the leader's (m/s).
    gap : float
        Gap (m), infinite without a leader.
    a, b, T, d0 : float
        Maximum acceleration, comfortable deceleration (m/s²), time headway (s) and jam distance (m).
    desired_speed : float
        m/s.

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    Source: SUMO, ``MSCFModel_EIDM::_v`` with the attributes of :data:`idm_sumo.sumo.export.vtypes.LAW_ATTRIBUTES`.
    """
    weight = idm.closing_weight(a, b)
    margin = max(LEAST, d0 - SHORTER)
    free = laws.improved_idm(
        speed, speed - desired_speed, FREE_ROAD + margin, a, b, weight, T, d0 + FARTHER, desired_speed
    )
    if gap == float("inf"):
        return free
    seen = max(LEAST, gap - d0 + margin)
    following = laws.improved_idm(speed, approach_rate, seen, a, b, weight, T, d0 + FARTHER, desired_speed)
    if seen < d0 + NEAR and speed < SLOW:
        following = min(following, -HALTING)
    return min(free, following)


@njit(cache=True)
def drives_off(speed, acceleration, before, since, a):  # type: ignore[no-untyped-def]
    """Return whether a vehicle starts, which SUMO delays.

    Parameters
    ----------
    speed : float
        m/s.
    acceleration, before : float
        Of this step and the one before (m/s²).
    since : float
        Time since its last start (s).
    a : float
        Maximum acceleration (m/s²).

    Returns
    -------
    bool
        Then only the share ``DRIVE_OFF`` of the acceleration acts in this step.

    Notes
    -----
    Source: SUMO, ``MSCFModel_EIDM::slowToStartTerm`` with the shortest start that its schema allows.
    """
    already = min(DRIVE_OFF_SHARE * a, DRIVE_OFF_ACCELERATION)
    return acceleration > 0.0 and speed < DRIVE_OFF_SPEED and since > DRIVE_OFF_REST and before < already
