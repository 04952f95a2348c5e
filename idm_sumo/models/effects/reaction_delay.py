r"""Reaction delay: the driver acts on what was.

.. math:: \dot v(t) = f\big(v(t'),\, \Delta v(t-\tau) + \xi\,[v(t') - v(t-\tau)],\, d(t-\tau)\big), \quad t' = t-(1-\eta)\tau

With :math:`\eta = 0` everything is late; with :math:`\eta = 1` the own speed is known at once, as a driver who anticipates
its own motion knows it (Treiber, Kesting and Helbing, 2006) and as the speedometer tells it. The approach rate is seen as it
was, with :math:`\xi = 0`, or is that of the own speed, as known, over the leader's late one, with :math:`\xi = 1`.

After a leader change gap and approach rate of a moment ago are those to the leader before, with :math:`\zeta = 0`: nobody has
noticed the new one yet. With :math:`\zeta = 1` they are those that there were to the new one, as in simulators that remember
where vehicles were, and as of a driver who saw the change coming.

A driver keeps a short past of gap, speed and approach rate; :func:`acted_on` reads it at a time between frames.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.idm import SMALLEST_GAP
from idm_sumo.roads.road import FRAME_STEP

LONGEST = 1.5  # s, what a past has to hold
REMEMBERED = round(LONGEST / FRAME_STEP) + 1  # moments: as much, and the one before


@njit(cache=True, error_model="numpy")
def moment_ago(now, delay, step):  # type: ignore[no-untyped-def]
    """Return the two rows between which a past is read ``delay`` (s) before row ``now``, and the share of the later one.

    Rows are ``step`` (s) apart. Before row 0 the first row holds. A delay below zero is none: what comes is not in the past.
    """
    place = now - max(delay, 0.0) / step
    if place <= 0.0:
        return 0, 0, 0.0
    row = int(place)
    share = place - row
    if share < 1e-9:
        return row, row, 0.0
    return row, row + 1, share


@njit(cache=True, error_model="numpy")
def between(one, other, share):  # type: ignore[no-untyped-def]
    """Return the value between two rows, ``share`` of it the later one's."""
    return one * (1.0 - share) + other * share if share > 0.0 else one


@njit(cache=True, error_model="numpy")
def gap_between(one, other, share):  # type: ignore[no-untyped-def]
    """Return the gap (m) between two rows, infinite without a leader.

    Its inverse square is linear between them: what the IDM answers. Where the two rows have different leaders, the driver answers
    each of them for as much of the step as it is the one that was seen.
    """
    if share <= 0.0:
        return one
    near, far = 1.0 / max(one, SMALLEST_GAP), 1.0 / max(other, SMALLEST_GAP)
    return 1.0 / np.sqrt(near * near * (1.0 - share) + far * far * share)


@njit(cache=True, error_model="numpy")
def recall(past, column, now, delay, step):  # type: ignore[no-untyped-def]
    """Return what ``past[:, column]`` held ``delay`` (s) before row ``now``, linear between rows."""
    row, after, share = moment_ago(now, delay, step)
    return between(past[row, column], past[after, column], share)


@njit(cache=True, error_model="numpy")
def own_delay(m):  # type: ignore[no-untyped-def]
    """Return the delay (s) with which the own speed is known, of a vector of magnitudes."""
    return m[slots.DELAY] * (1.0 - m[slots.OWN_SPEED_KNOWN])


@njit(cache=True, error_model="numpy")
def approached(rate, late, known, share):  # type: ignore[no-untyped-def]
    """Return the approach rate (m/s) to the leader as it was, a share of it by the own speed as known, not as late (m/s)."""
    return rate + share * (known - late)


@njit(cache=True, error_model="numpy")
def acted_on(past, now, m, step):  # type: ignore[no-untyped-def]
    """Return gap, own speed and approach rate on which a driver acts at row ``now``, of a past of these three columns.

    ``m`` is the vector of magnitudes, rows are ``step`` (s) apart.
    """
    row, after, share = moment_ago(now, m[slots.DELAY], step)
    late, known = between(past[row, 1], past[after, 1], share), recall(past, 1, now, own_delay(m), step)
    rate = between(past[row, 2], past[after, 2], share)
    return (
        gap_between(past[row, 0], past[after, 0], share),
        known,
        approached(rate, late, known, m[slots.OWN_SPEED_IN_RATE]),
    )


@njit(cache=True, error_model="numpy")
def follow_another(gap, speed, rate, now, step):  # type: ignore[no-untyped-def]
    """Rewrite a past as if the leader of row ``now``, who is new, had been followed before, at its present speed.

    Parameters
    ----------
    gap, speed, rate : float64, shape (rows,)
        Changed before row ``now`` as far back as a delay reaches: m, m/s, m/s.
    now : int
    step : float
        s.
    """
    ahead, nearer = speed[now] - rate[now], 0.0
    for row in range(now - 1, max(now - REMEMBERED, 0) - 1, -1):
        nearer += (0.5 * (speed[row] + speed[row + 1]) - ahead) * step
        gap[row], rate[row] = gap[now] + nearer, speed[row] - ahead


@njit(cache=True, error_model="numpy")
def knows_new_leader(m):  # type: ignore[no-untyped-def]
    """Return whether a vector of magnitudes says that a new leader's past counts at once."""
    return m[slots.DELAY] > 0.0 and m[slots.NEW_LEADER_KNOWN] > 0.5


EFFECT = Effect(
    name="reaction_delay",
    summary="acts on what was a moment ago",
    parameters=(
        Parameter("tau", "s", slots.DELAY, 0.0, LONGEST, 0.4),
        Parameter("eta", "1", slots.OWN_SPEED_KNOWN, 0.0, 1.0, 0.0),
        Parameter("zeta", "1", slots.NEW_LEADER_KNOWN, 0.0, 1.0, 0.0),
        Parameter("xi", "1", slots.OWN_SPEED_IN_RATE, 0.0, 1.0, 0.0),
    ),
    must_see=(),
    confusable_with=("hysteresis", "multi_leader_anticipation", "measurement_artefact"),
    source="Treiber, Kesting and Helbing (2006), Delays, inaccuracies and anticipation in microscopic traffic models",
    sumo="EIDM's tau-reaction (treaction), or actionStepLength for the coarse form",
)
