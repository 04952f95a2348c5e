r"""Reaction delay: the driver acts on what was.

.. math:: \dot v(t) = f\big(v(t-\tau),\, \Delta v(t-\tau),\, d(t-\tau)\big)

A driver keeps a short past of gap, speed and approach rate; :func:`recall` reads it at a time between frames.
"""

from __future__ import annotations

from numba import njit

from idm_sumo.effects import slots
from idm_sumo.effects.record import Effect, Parameter

LONGEST = 1.5  # s, what a past has to hold


@njit(cache=True, error_model="numpy")
def recall(past, column, now, delay, step):  # type: ignore[no-untyped-def]
    """Return what ``past[:, column]`` held ``delay`` (s) before row ``now``; rows are ``step`` (s) apart.

    Linear between rows. Before row 0 the first row holds; an infinite value (no leader) is not mixed.
    """
    place = now - delay / step
    if place <= 0.0:
        return past[0, column]
    row = int(place)
    share = place - row
    if share < 1e-9:
        return past[row, column]
    return past[row, column] * (1.0 - share) + past[row + 1, column] * share


EFFECT = Effect(
    name="reaction_delay",
    summary="acts on what was a moment ago",
    parameters=(Parameter("tau", "s", slots.DELAY, 0.0, LONGEST, 0.4),),
    must_see=(),
    confusable_with=("hysteresis", "multi_leader_anticipation", "measurement_artefact"),
    source="Treiber, Kesting and Helbing (2006), Delays, inaccuracies and anticipation in microscopic traffic models",
    sumo="EIDM's tau-reaction (treaction), or actionStepLength for the coarse form",
)
