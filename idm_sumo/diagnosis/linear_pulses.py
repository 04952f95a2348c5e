"""What a unit of each linear effect adds to the acceleration, and what another car-following model would: means over pulses."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.rollout import BASE_A, BASE_V, BASE_X, BIN, BY_T
from idm_sumo.models.effects.acceleration_asymmetry import weakened
from idm_sumo.models.effects.adjacent_lane_friction import friction
from idm_sumo.models.effects.courtesy_yielding import before_cut_in, braking_before
from idm_sumo.models.effects.follower_pressure import pressed
from idm_sumo.models.effects.hysteresis import in_phase
from idm_sumo.models.effects.leader_class import behind_truck
from idm_sumo.models.effects.pre_insertion import before_own_change
from idm_sumo.models.effects.speed_dependent_headway import SPEED_UNIT
from idm_sumo.models.effects.vehicle_class import of_truck
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]

GUARD = "form:"  # begins the names of what another car-following model underneath would look like
FORMS = 6  # smooth functions of speed, approach rate and gap
LINEAR = (
    "acceleration_asymmetry", "leader_class", "speed_dependent_headway", "hysteresis", "hysteresis",
    "adjacent_lane_friction", "adjacent_lane_friction", "vehicle_class", "follower_pressure", "courtesy_yielding", "pre_insertion",
    "courtesy_yielding", "pre_insertion",
    *(f"{GUARD}{n}" for n in range(FORMS)),
)  # fmt: skip
# Of them: hysteresis by what the leader did of late, friction beside the next vehicle ahead, braking before a lane change.
OF_LATE, OF_NEXT, YIELDING, MOVING = 4, 6, 11, 12


def linear_pulses(seen: Floats, state: Floats, pivot: float) -> Floats:
    """Return the acceleration (m/s²) per unit of each magnitude of ``LINEAR``, as means over pulses.

    Parameters
    ----------
    seen : float64, shape (windows, COLUMNS, LEAD + horizon + 1)
    state : float64, shape (windows, horizon, 7)
        Of :func:`idm_sumo.diagnosis.rollout.respond`.
    pivot : float
        m/s.

    Returns
    -------
    float64, shape (windows, pulses, len(LINEAR))
        The last are smooth accelerations of speed, gap and approach rate, second order: the form of the car-following itself.
    """
    out = np.zeros((len(seen), state.shape[1] // BIN, len(LINEAR)))
    in_threads(_fill, len(seen), seen, state, pivot, out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(first, last, seen, state, pivot, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for k in range(out.shape[1] * BIN):
            row, to, base = seen[i, :, w.LEAD + k], out[i, k // BIN], state[i, k]
            by_t, a, v, x = base[BY_T], base[BASE_A], base[BASE_V], base[BASE_X]
            leader, of_late = _known(row[w.ACCELERATION]), _known(row[w.ACCELERATION_OF_LATE])
            speed = (v - pivot) / SPEED_UNIT
            form = smooth_forms(v, v - row[w.SPEED], row[w.REAR] - x, pivot)
            to[0] += weakened(a, 1.0) - a
            to[1] += by_t * (behind_truck(row[w.KIND], 1.0) - 1.0)
            to[2] += by_t * speed
            to[3] += by_t * (in_phase(leader, 1.0) - 1.0)
            to[OF_LATE] += by_t * (in_phase(of_late, 1.0) - 1.0)
            to[5] += friction(v, row[w.ADJACENT], 1.0)
            to[OF_NEXT] += friction(v, row[w.NEXT_BESIDE], 1.0)
            to[7] += by_t * (of_truck(row[w.OWN_KIND], 1.0) - 1.0)
            to[8] += pressed(x - row[w.BEHIND], 1.0)
            to[9] += by_t * (before_cut_in(row[w.UNTIL_CUT_IN], 1.0) - 1.0)
            to[10] += by_t * (before_own_change(row[w.UNTIL_OWN], 1.0) - 1.0)
            to[YIELDING] += braking_before(row[w.UNTIL_CUT_IN], 1.0)
            to[MOVING] += braking_before(row[w.UNTIL_OWN], 1.0)
            for n in range(FORMS):
                to[len(LINEAR) - FORMS + n] += form[n]
        for p in range(out.shape[1]):
            for n in range(out.shape[2]):
                out[i, p, n] /= BIN


@njit(cache=True, error_model="numpy")
def smooth_forms(speed, rate, gap, pivot):  # type: ignore[no-untyped-def]
    """Return smooth accelerations of second order, which no driver's own parameters make.

    Parameters
    ----------
    speed, rate, gap : float
        Own speed (m/s), approach rate (m/s) and gap (m).
    pivot : float
        Mean speed of the recording (m/s).

    Returns
    -------
    tuple of six floats
        Products of two of: the speed's deviation in 10 m/s, the approach rate in 3 m/s, and the logarithm of the gap over what is kept
        at that speed.
    """
    fast, closing = (speed - pivot) / SPEED_UNIT, rate / 3.0
    wide = math.log(max(gap, 1.0) / (2.0 + 1.2 * speed))
    return fast * fast, closing * closing, fast * closing, wide * wide, wide * fast, wide * closing


@njit(cache=True, error_model="numpy")
def _known(value):  # type: ignore[no-untyped-def]
    """Return a value, zero for one that is not known."""
    return value if value == value else 0.0
