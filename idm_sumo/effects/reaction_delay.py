r"""Reaction delay: the driver acts on what was.

.. math:: \dot v(t) = f\big(v(t-(1-\eta)\tau),\, \Delta v(t-\tau),\, d(t-\tau)\big)

With :math:`\eta = 0` everything is late; with :math:`\eta = 1` the own speed is known at once, as a driver who anticipates
its own motion knows it (Treiber, Kesting and Helbing, 2006) and as the speedometer tells it.

A driver keeps a short past of gap, speed and approach rate; :func:`recall` reads it at a time between frames.
"""

from __future__ import annotations

from numba import njit

from idm_sumo.effects import slots
from idm_sumo.effects.record import Effect, Parameter

LONGEST = 1.5  # s, what a past has to hold


@njit(cache=True, error_model="numpy")
def moment_ago(now, delay, step):  # type: ignore[no-untyped-def]
    """Return the two rows between which a past is read ``delay`` (s) before row ``now``, and the share of the later one.

    Rows are ``step`` (s) apart. Before row 0 the first row holds.
    """
    place = now - delay / step
    if place <= 0.0:
        return 0, 0, 0.0
    row = int(place)
    share = place - row
    if share < 1e-9:
        return row, row, 0.0
    return row, row + 1, share


@njit(cache=True, error_model="numpy")
def between(one, other, share):  # type: ignore[no-untyped-def]
    """Return the value between two rows; an infinite one (no leader) is not mixed with share zero."""
    return one * (1.0 - share) + other * share if share > 0.0 else one


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
def acted_on(past, now, delay, own, step):  # type: ignore[no-untyped-def]
    """Return gap, own speed and approach rate on which a driver acts at row ``now``, of a past of these three columns.

    ``own`` (s) is the delay of the own speed, ``delay`` that of the other two.
    """
    return recall(past, 0, now, delay, step), recall(past, 1, now, own, step), recall(past, 2, now, delay, step)


EFFECT = Effect(
    name="reaction_delay",
    summary="acts on what was a moment ago",
    parameters=(
        Parameter("tau", "s", slots.DELAY, 0.0, LONGEST, 0.4),
        Parameter("eta", "1", slots.OWN_SPEED_KNOWN, 0.0, 1.0, 0.0),
    ),
    must_see=(),
    confusable_with=("hysteresis", "multi_leader_anticipation", "measurement_artefact"),
    source="Treiber, Kesting and Helbing (2006), Delays, inaccuracies and anticipation in microscopic traffic models",
    sumo="EIDM's tau-reaction (treaction), or actionStepLength for the coarse form",
)
