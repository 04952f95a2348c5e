r"""Reaction delay: the driver acts on past values.

.. math:: \dot v(t) = f\big(v(t'),\, \Delta v(t-\tau) + \xi\,[v(t') - v(t-\tau)],\, d(t-\tau)\big),
    \quad t' = t-(1-\eta)\tau

With :math:`\eta = 0` all values are late. With :math:`\eta = 1` the own speed is known at once, as
the speedometer shows it and as a driver who anticipates its own motion knows it (Treiber, Kesting
and Helbing, 2006). With :math:`\xi = 0` the approach rate is the late one; with :math:`\xi = 1` it
is formed from the own speed as known and the leader's late speed.

After a change of leader, past gaps and approach rates are those to the former leader with
:math:`\zeta = 0`: the driver has not noticed the new one yet. With :math:`\zeta = 1` they are those
to the new leader, as in simulators that remember where vehicles were, and as for a driver who saw
the change coming.

A driver remembers gap, speed and approach rate for a short time; :func:`acted_on` interpolates
them between frames.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from idm_sumo.models.effects import slots
from idm_sumo.models.effects.form import Form
from idm_sumo.models.effects.record import Effect, Parameter
from idm_sumo.models.effects.telling import Median, Telling, Values
from idm_sumo.models.idm import SMALLEST_GAP
from idm_sumo.recordings.columns import FRAME_STEP

LONGEST = 1.5  # s, largest delay
REMEMBERED = round(LONGEST / FRAME_STEP) + 1  # rows that a driver has to remember, the present one included


@njit(cache=True, error_model="numpy")
def moment_ago(now, delay, step):  # type: ignore[no-untyped-def]
    """Return the rows around a past time, and the weight.

    Parameters
    ----------
    now : int
        Present row.
    delay : float
        Delay (s); below zero it counts as none, since the future is unknown.
    step : float
        Time between rows (s).

    Returns
    -------
    row, after : int
        Rows before and after the past time; row 0 where it lies before the first row.
    share : float
        Weight of the later row.
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
    """Return the value interpolated between two rows.

    Parameters
    ----------
    one, other : float
        Values of the earlier and the later row.
    share : float
        Weight of the later row.

    Returns
    -------
    float
        Interpolated value.
    """
    return one * (1.0 - share) + other * share if share > 0.0 else one


@njit(cache=True, error_model="numpy")
def gap_between(one, other, share):  # type: ignore[no-untyped-def]
    """Return the gap interpolated between two rows.

    The inverse square is interpolated linearly, since the IDM depends on it. Where the leader changed
    between the rows, the driver so reacts to each leader for its part of the step.

    Parameters
    ----------
    one, other : float
        Gaps of the earlier and the later row (m), infinite without a leader.
    share : float
        Weight of the later row.

    Returns
    -------
    float
        Gap (m).
    """
    if share <= 0.0:
        return one
    near, far = 1.0 / max(one, SMALLEST_GAP), 1.0 / max(other, SMALLEST_GAP)
    return 1.0 / np.sqrt(near * near * (1.0 - share) + far * far * share)


@njit(cache=True, error_model="numpy")
def recall(past, column, now, delay, step):  # type: ignore[no-untyped-def]
    """Return a past value of one column, interpolated between rows.

    Parameters
    ----------
    past : float64, shape (rows, columns)
        Values by row.
    column : int
        Column to read.
    now : int
        Present row.
    delay, step : float
        Delay, and time between rows (s).

    Returns
    -------
    float
        Value ``delay`` seconds before row ``now``.
    """
    row, after, share = moment_ago(now, delay, step)
    return between(past[row, column], past[after, column], share)


@njit(cache=True, error_model="numpy")
def own_delay(m):  # type: ignore[no-untyped-def]
    r"""Return the delay with which the own speed is known.

    Parameters
    ----------
    m : float64, shape (slots.COUNT,)
        Magnitudes of the effects.

    Returns
    -------
    float
        :math:`(1-\eta)\tau` (s).
    """
    return m[slots.DELAY] * (1.0 - m[slots.OWN_SPEED_KNOWN])


@njit(cache=True, error_model="numpy")
def approached(rate, late, known, share):  # type: ignore[no-untyped-def]
    r"""Return the approach rate by the known own speed.

    Parameters
    ----------
    rate : float
        Late approach rate (m/s).
    late, known : float
        Own speed, late and as known (m/s).
    share : float
        Magnitude :math:`\xi`.

    Returns
    -------
    float
        Approach rate (m/s).
    """
    return rate + share * (known - late)


@njit(cache=True, error_model="numpy")
def acted_on(past, now, m, step):  # type: ignore[no-untyped-def]
    """Return the values on which a driver acts.

    Parameters
    ----------
    past : float64, shape (rows, 3)
        Gap (m), own speed (m/s) and approach rate (m/s), one row a step.
    now : int
        Present row.
    m : float64, shape (slots.COUNT,)
        Magnitudes of the effects.
    step : float
        Time between rows (s).

    Returns
    -------
    gap : float
        Gap (m).
    speed, approach_rate : float
        Own speed and approach rate (m/s).
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
    """Rewrite the past as if following a new leader.

    The new leader is assumed to have driven at its present speed before.

    Parameters
    ----------
    gap, speed, rate : float64, shape (rows,)
        Gap (m), own speed and approach rate (m/s). Gap and rate are changed in place before row ``now``, as
        far back as a delay reaches.
    now : int
        Row of the change of leader.
    step : float
        Time between rows (s).
    """
    ahead, nearer = speed[now] - rate[now], 0.0
    for row in range(now - 1, max(now - REMEMBERED, 0) - 1, -1):
        nearer += (0.5 * (speed[row] + speed[row + 1]) - ahead) * step
        gap[row], rate[row] = gap[now] + nearer, speed[row] - ahead


@njit(cache=True, error_model="numpy")
def knows_new_leader(m):  # type: ignore[no-untyped-def]
    r"""Return whether a new leader's past is known at once.

    Parameters
    ----------
    m : float64, shape (slots.COUNT,)
        Magnitudes of the effects.

    Returns
    -------
    bool
        Whether :math:`\zeta = 1` and there is a delay.
    """
    return m[slots.DELAY] > 0.0 and m[slots.NEW_LEADER_KNOWN] > 0.5


def _size(values: Values, _one: Median) -> str:
    return f"{values['tau']:.2f} s after what they react to"


EFFECT = Effect(
    name="reaction_delay",
    summary="acts on past values of gap and speed",
    parameters=(
        Parameter("tau", "s", slots.DELAY, 0.0, LONGEST, 0.4),
        Parameter("eta", "1", slots.OWN_SPEED_KNOWN, 0.0, 1.0, 0.0),
        Parameter("zeta", "1", slots.NEW_LEADER_KNOWN, 0.0, 1.0, 0.0),
        Parameter("xi", "1", slots.OWN_SPEED_IN_RATE, 0.0, 1.0, 0.0),
    ),
    required_stimuli=(),
    confusable_with=("hysteresis", "multi_leader_anticipation", "measurement_artefact"),
    source="Treiber, Kesting and Helbing (2006), Delays, inaccuracies and anticipation in microscopic traffic models",
    sumo="EIDM's tau-reaction (treaction), or actionStepLength for the coarse form",
    forms=(
        Form(slots.DELAY, size=0.2),
        Form(slots.DELAY, size=0.6),
        Form(slots.DELAY, size=0.5, fixed=((slots.OWN_SPEED_KNOWN, 1.0),)),
        Form(slots.DELAY, size=0.4, fixed=((slots.NEW_LEADER_KNOWN, 1.0),)),
        Form(slots.DELAY, size=0.5, fixed=((slots.OWN_SPEED_KNOWN, 1.0), (slots.NEW_LEADER_KNOWN, 1.0))),
        Form(slots.DELAY, size=0.5, fixed=((slots.OWN_SPEED_KNOWN, 1.0), (slots.OWN_SPEED_IN_RATE, 1.0))),
        Form(
            slots.DELAY,
            size=0.5,
            fixed=((slots.OWN_SPEED_KNOWN, 1.0), (slots.NEW_LEADER_KNOWN, 1.0), (slots.OWN_SPEED_IN_RATE, 1.0)),
        ),
    ),
    told=(
        Telling(
            "tau",
            more="react late",
            less="",
            when="",
            size=_size,
            advice="Simulate with this delay: without it, a calibration absorbs it in the other parameters.",
        ),
    ),
)
