"""A driver's acceleration: the law, bent by whatever effects are hidden in the recording."""

import numpy as np
from numba import njit

from tests.simulators.second import effects, outside
from tests.simulators.second import view as w
from tests.simulators.second.laws import acceleration

HARDEST, STRONGEST = -5.5, 3.0  # m/s2, what a vehicle can do
ALL = -1


@njit(cache=True)
def applies(e, see, touched):
    """Whether the driver has the effect and is in the lane where it works."""
    return touched > 0.0 and (e[w.ONLY] == 0.0 or e[w.ONLY] == see[w.LANE])


@njit(cache=True)
def wish(law, see, theta, hidden, touched, without):
    """Acceleration in m/s2 that the driver wants with all effects but number `without`."""
    see, th = see.copy(), theta.copy()
    for k in range(len(hidden)):
        if k != without and applies(hidden[k], see, touched[k]):
            if hidden[k, w.KIND] < outside.FIRST:
                effects.inputs(hidden[k], see, th)
            else:
                outside.inputs(hidden[k], see, th)
    acc = acceleration(law, see[w.S], see[w.V], see[w.VL], th)
    if see[w.WEIGHT] > 0.0:
        second = acceleration(law, 0.5 * (see[w.S] + see[w.S2]), see[w.V], see[w.V2], th)
        acc += see[w.WEIGHT] * (second - acc)
    for k in range(len(hidden)):
        if k != without and applies(hidden[k], see, touched[k]):
            if hidden[k, w.KIND] < outside.FIRST:
                acc = effects.output(hidden[k], see, acc)
            else:
                acc = outside.output(hidden[k], see, acc)
    return acc


@njit(cache=True)
def possible(acc, see):
    """Acceleration within the vehicle's limits, and never less braking than it takes to avoid the leader."""
    soon = max(0.0, see[w.VL] + 0.6 * min(0.0, see[w.AL]))  # a leader who brakes hard goes on doing so
    closing = see[w.V] - soon
    if closing > 0.0:
        needed = 0.5 * closing * closing / max(see[w.S] - 0.8, 0.2)
        if see[w.S] < 1.0:
            needed += 1.0
        if needed > 3.0 or see[w.S] < 1.0:
            acc = min(acc, -needed)
    return min(STRONGEST, max(HARDEST, acc))


@njit(cache=True)
def respond(law, see, theta, hidden, touched, squares):
    """Acceleration in m/s2 with everything; adds squared effects to `squares` (all together, then each)."""
    nobody = np.zeros_like(touched)
    acc = possible(wish(law, see, theta, hidden, touched, ALL), see)
    if len(squares) > 1:
        squares[0] += (acc - possible(wish(law, see, theta, hidden, nobody, ALL), see)) ** 2
        for k in range(len(hidden)):
            squares[k + 1] += (acc - possible(wish(law, see, theta, hidden, touched, k), see)) ** 2
    return acc
