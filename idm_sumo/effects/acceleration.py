"""One compiled acceleration: the IDM and all effects, by a flat vector of magnitudes."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from idm_sumo import idm
from idm_sumo.effects import slots
from idm_sumo.effects.acceleration_asymmetry import weakened
from idm_sumo.effects.adjacent_lane_friction import friction
from idm_sumo.effects.courtesy_yielding import before_cut_in
from idm_sumo.effects.desired_speed import in_lane
from idm_sumo.effects.follower_pressure import pressed
from idm_sumo.effects.hysteresis import in_phase
from idm_sumo.effects.lane_change_relaxation import gap_credit
from idm_sumo.effects.leader_class import behind_truck
from idm_sumo.effects.location import at_place
from idm_sumo.effects.memory import resigned
from idm_sumo.effects.multi_leader_anticipation import shared_interaction
from idm_sumo.effects.perception_threshold import perceived
from idm_sumo.effects.pre_insertion import before_own_change
from idm_sumo.effects.speed_dependent_headway import at_speed
from idm_sumo.effects.time_of_day import at_time
from idm_sumo.effects.vehicle_class import of_truck


class Sight(NamedTuple):
    """What a driver sees at one moment, own gap, speed and approach rate apart. Unknown is NaN.

    Attributes
    ----------
    x, t : float
        Own front (m); time since the recording's first frame (s).
    leader_acceleration : float
        m/s².
    leader_class, own_class, lane : float
        Numbers as in the recording.
    second_gap, second_speed : float
        Free space (m) up to the second leader's rear bumper, the first leader's length taken out; its speed (m/s).
    adjacent_speed : float
        Mean speed (m/s) of the vehicles near in the slower adjacent lane.
    rear_gap : float
        Own rear bumper to the follower's front (m).
    jump, since_change : float
        By how much the last leader change shortened the gap (m), and the time since (s).
    until_cut_in, until_own_change : float
        Seconds until a vehicle is inserted ahead; until the own lane change.
    mean_speed : float
        Running mean of the own speed (m/s).
    """

    x: float
    t: float
    leader_acceleration: float
    leader_class: float
    own_class: float
    lane: float
    second_gap: float
    second_speed: float
    adjacent_speed: float
    rear_gap: float
    jump: float
    since_change: float
    until_cut_in: float
    until_own_change: float
    mean_speed: float


NAN = float("nan")
BLIND = Sight(*([NAN] * len(Sight._fields)))  # sees nothing but its leader


@njit(cache=True, error_model="numpy")
def headway_factor(see, speed, desired_speed, m):  # type: ignore[no-untyped-def]
    """Return the product of all factors of the time headway."""
    return (
        behind_truck(see.leader_class, m[slots.LEADER_CLASS])
        * at_speed(speed, m[slots.PIVOT_SPEED], m[slots.SPEED_HEADWAY])
        * in_phase(
            see.leader_acceleration if see.leader_acceleration == see.leader_acceleration else 0.0, m[slots.HYSTERESIS]
        )
        * at_time(see.t, m[slots.PERIOD], m[slots.PERIOD_BEGIN], m[slots.PERIOD_END])
        * of_truck(see.own_class, m[slots.OWN_CLASS])
        * resigned(
            see.mean_speed if see.mean_speed == see.mean_speed else desired_speed, desired_speed, m[slots.MEMORY]
        )
        * before_cut_in(see.until_cut_in, m[slots.COURTESY])
        * before_own_change(see.until_own_change, m[slots.PRE_INSERTION])
    )


@njit(cache=True, error_model="numpy")
def interaction_of(speed, approach_rate, gap, see, a, b, T, d0, d1, desired_speed, m):  # type: ignore[no-untyped-def]
    """Return the squared ratio of wanted to kept gap, shared with the second leader where there is one."""
    weight, inverse = idm.closing_weight(a, b), 1.0 / desired_speed
    seen = perceived(approach_rate, m[slots.BAND])
    ratio = idm.desired_gap_of(speed, seen, weight, T, d0, d1, inverse) * (1.0 / max(gap, idm.SMALLEST_GAP))
    share = m[slots.SECOND_LEADER]
    if share == 0.0 or not see.second_gap < 1e6:
        return ratio * ratio
    wanted = idm.desired_gap_of(speed, speed - see.second_speed, weight, T, d0, d1, inverse)
    second = wanted / max(0.5 * see.second_gap, idm.SMALLEST_GAP)
    return shared_interaction(ratio * ratio, second * second, share)


@njit(cache=True, error_model="numpy")
def extended_acceleration(speed, approach_rate, gap, see, a, b, T, d0, d1, desired_speed, m):  # type: ignore[no-untyped-def]
    """Return the acceleration (m/s²) of a driver with effects; with ``m`` all zero :func:`idm_sumo.idm.acceleration`.

    Parameters
    ----------
    speed, approach_rate, gap : float
        m/s, m/s, m as the driver acts on them: of a moment ago with a reaction delay
        (:func:`idm_sumo.effects.reaction_delay.recall`). Gap is infinite without a leader.
    see : Sight
    a, b, T, d0, d1, desired_speed : float
    m : float64, shape (slots.COUNT,)

    Notes
    -----
    The bound ``-EMERGENCY_BRAKING`` and the smallest gap are those of the plain IDM.
    """
    if not gap > idm.SMALLEST_GAP:
        return -idm.EMERGENCY_BRAKING
    limit = desired_speed * in_lane(see.lane, m[slots.DESIRED_SPEED], m[slots.DESIRED_SPEED_LANE])
    credit = gap_credit(see.jump, see.since_change, m[slots.RELAXATION], m[slots.RELAXATION_TIME])
    headway = T * headway_factor(see, speed, limit, m)
    interaction = interaction_of(speed, approach_rate, gap + credit, see, a, b, headway, d0, d1, limit, m)
    ratio = speed * (1.0 / limit)
    free = a * (1.0 - ratio * ratio * ratio * ratio - interaction)
    behaved = weakened(free, m[slots.ASYMMETRY])
    behaved += at_place(see.x, m[slots.PLACE], m[slots.PLACE_BEGIN], m[slots.PLACE_END])
    behaved += friction(speed, see.adjacent_speed, m[slots.FRICTION]) if m[slots.FRICTION] != 0.0 else 0.0
    behaved += pressed(see.rear_gap, m[slots.PRESSURE]) if m[slots.PRESSURE] != 0.0 else 0.0
    return max(behaved, -idm.EMERGENCY_BRAKING)
