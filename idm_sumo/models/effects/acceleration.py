"""One compiled acceleration: the IDM, or another law in its place, and all effects, by a flat vector of magnitudes."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from idm_sumo.models import idm, laws
from idm_sumo.models.effects import slots
from idm_sumo.models.effects.acceleration_asymmetry import weakened
from idm_sumo.models.effects.adjacent_lane_friction import friction
from idm_sumo.models.effects.courtesy_yielding import before_cut_in, braking_before
from idm_sumo.models.effects.desired_speed import in_lane
from idm_sumo.models.effects.follower_pressure import pressed
from idm_sumo.models.effects.hysteresis import in_phase
from idm_sumo.models.effects.lane_change_relaxation import gap_credit, headway_given_up, within_shortage
from idm_sumo.models.effects.leader_class import behind_truck, farther_from_truck
from idm_sumo.models.effects.location import at_place
from idm_sumo.models.effects.memory import resigned
from idm_sumo.models.effects.multi_leader_anticipation import shared_interaction, shared_rate
from idm_sumo.models.effects.perception_threshold import perceived
from idm_sumo.models.effects.pre_insertion import before_own_change
from idm_sumo.models.effects.speed_dependent_headway import at_speed
from idm_sumo.models.effects.time_of_day import at_time, drifted
from idm_sumo.models.effects.vehicle_class import of_truck

NAN = float("nan")


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
    accepted_headway : float
        Time headway right after it (s).
    until_cut_in, until_own_change : float
        Seconds until a vehicle is inserted ahead; until the own lane change.
    mean_speed : float
        Running mean of the own speed (m/s).
    next_beside_speed : float
        Speed (m/s) of the slower one of the next vehicles ahead in the adjacent lanes.
    leader_acceleration_of_late : float
        Its mean over the last seconds (m/s²).
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
    accepted_headway: float
    until_cut_in: float
    until_own_change: float
    mean_speed: float
    next_beside_speed: float = NAN
    leader_acceleration_of_late: float = NAN


BLIND = Sight(*([NAN] * len(Sight._fields)))  # sees nothing but its leader


class Moment(NamedTuple):
    """What the surroundings and the magnitudes make of one moment, whatever the driver's own state.

    Computed once, it serves many drivers of other parameters, places and speeds side by side. Plain numbers throughout, so that
    a loop over them becomes vector instructions.

    Attributes
    ----------
    headway, limit : float
        Factors of the time headway and of the desired speed.
    credit : float
        Added to the gap, m.
    given_up, limited, accepted : float
        Shares of what the own headway is longer than the accepted one: that the headway is shorter by, and, of the way in it, that
        the credit is at most, if positive; the accepted one (s).
    share, rate_share, second_speed : float
        Of the interaction, and of the approach rate, that the second leader has, zero if there is none; its speed (m/s).
    band, taken, asymmetry, slope, pivot, memory, mean_speed : float
        Magnitudes (m/s what is taken off the approach rate), and the running mean speed (m/s).
    place, place_headway, begin, end : float
        m/s², share, m, m.
    friction, adjacent_speed, pressure, room : float
        1/s, m/s, m/s²; m/s² (how a driver brakes before a lane change, its own or another's).
    reaction, farther : float
        s, in which Krauss's safe speed is reached; m, by which the jam distance is longer.
    """

    headway: float
    limit: float
    credit: float
    given_up: float
    limited: float
    accepted: float
    share: float
    rate_share: float
    second_speed: float
    band: float
    taken: float
    asymmetry: float
    slope: float
    pivot: float
    memory: float
    mean_speed: float
    place: float
    place_headway: float
    begin: float
    end: float
    friction: float
    adjacent_speed: float
    pressure: float
    room: float
    reaction: float
    farther: float


@njit(cache=True, error_model="numpy", forceinline=True)
def moment_of(see, m):  # type: ignore[no-untyped-def]
    """Return what does not depend on the driver's own place and speed."""
    answered = see.leader_acceleration_of_late if m[slots.HYSTERESIS_OF_LATE] > 0.5 else see.leader_acceleration
    headway = (
        behind_truck(see.leader_class, m[slots.LEADER_CLASS])
        * in_phase(answered if answered == answered else 0.0, m[slots.HYSTERESIS])
        * at_time(see.t, m[slots.PERIOD], m[slots.PERIOD_BEGIN], m[slots.PERIOD_END])
        * drifted(see.t, m[slots.PERIOD_DRIFT], m[slots.PERIOD_BEGIN], m[slots.PERIOD_END])
        * of_truck(see.own_class, m[slots.OWN_CLASS])
        * before_cut_in(see.until_cut_in, m[slots.COURTESY])
        * before_own_change(see.until_own_change, m[slots.PRE_INSERTION])
    )
    of_gap, of_headway = 1.0 - m[slots.HEADWAY_ACCEPTED], m[slots.HEADWAY_ACCEPTED]
    given_up = headway_given_up(see.jump, see.since_change, m[slots.RELAXATION] * of_headway, m[slots.RELAXATION_TIME])
    limited = headway_given_up(
        see.jump, see.since_change, m[slots.RELAXATION] * m[slots.CREDIT_LIMITED], m[slots.RELAXATION_TIME]
    )
    share = m[slots.SECOND_LEADER] if see.second_gap < 1e6 else 0.0
    beside = see.next_beside_speed if m[slots.FRICTION_NEXT] > 0.5 else see.adjacent_speed
    return Moment(
        headway,
        in_lane(see.lane, m[slots.DESIRED_SPEED], m[slots.DESIRED_SPEED_LANE], m[slots.DESIRED_SPEED_ACROSS]),
        gap_credit(see.jump, see.since_change, m[slots.RELAXATION] * of_gap, m[slots.RELAXATION_TIME]),
        given_up, limited, see.accepted_headway if given_up + limited > 0.0 else 0.0,
        share * (1.0 - m[slots.SECOND_SPEED_ONLY]), share * m[slots.SECOND_SPEED_ONLY], see.second_speed,
        m[slots.BAND], m[slots.BAND] * m[slots.BAND_TAKEN], m[slots.ASYMMETRY], m[slots.SPEED_HEADWAY], m[slots.PIVOT_SPEED],
        m[slots.MEMORY] if see.mean_speed == see.mean_speed else 0.0, see.mean_speed,
        m[slots.PLACE], m[slots.PLACE_HEADWAY], m[slots.PLACE_BEGIN], m[slots.PLACE_END],
        m[slots.FRICTION], beside, m[slots.PRESSURE],
        braking_before(see.until_cut_in, m[slots.COURTESY_BRAKING]) + braking_before(see.until_own_change, m[slots.PRE_INSERTION_BRAKING]),
        laws.REACTION + m[slots.REACTION_CHANGE], farther_from_truck(see.leader_class, m[slots.LEADER_CLASS_DISTANCE]),
    )  # fmt: skip


@njit(cache=True, error_model="numpy", forceinline=True)
def _by_idm(speed, rate, gap, second_rate, second_gap, share, a, weight, headway, d0, d1, inverse):  # type: ignore[no-untyped-def]
    """Return the IDM's acceleration (m/s²), a share of its interaction with the second leader."""
    ratio = idm.desired_gap_of(speed, rate, weight, headway, d0, d1, inverse) * (1.0 / gap)
    wanted = idm.desired_gap_of(speed, second_rate, weight, headway, d0, d1, inverse)
    second = wanted / second_gap if share > 0.0 else 0.0
    interaction = shared_interaction(ratio * ratio, second * second, share)
    ratio = speed * inverse
    return a * (1.0 - ratio * ratio * ratio * ratio - interaction)


# Inlined by force: a loop over drivers that calls it is turned into vector instructions only then.
@njit(cache=True, error_model="numpy", forceinline=True)
def behaved(speed, approach_rate, gap, x, second_gap, rear_gap, moment, a, weight, T, d0, d1, desired_speed, law):  # type: ignore[no-untyped-def]
    """Return the acceleration (m/s²) at one moment; without branches, for many at once.

    Parameters
    ----------
    speed, approach_rate, gap : float
        m/s, m/s, m as the driver acts on them.
    x, second_gap, rear_gap : float
        Of :class:`Sight`.
    moment : Moment
    a, weight, T, d0, d1, desired_speed : float
        ``weight`` of :func:`idm_sumo.models.idm.closing_weight`.
    law : float
        Of :mod:`idm_sumo.models.laws`; the same for all of many, or the loop over them is none of vector instructions.
    """
    limit = desired_speed * moment.limit
    inverse = 1.0 / limit
    factor = at_speed(speed, moment.pivot, moment.slope) * resigned(moment.mean_speed, limit, moment.memory)
    factor *= 1.0 + at_place(x, moment.place_headway, moment.begin, moment.end)
    headway = T * (moment.headway * factor)
    lacking = max(headway - moment.accepted, 0.0)
    headway -= moment.given_up * lacking
    credit = within_shortage(moment.credit, moment.limited, lacking, speed)
    rate = (
        shared_rate(approach_rate, speed - moment.second_speed, moment.rate_share)
        if moment.rate_share > 0.0
        else approach_rate
    )
    seen = perceived(rate, moment.band, moment.taken)
    room, farther = max(gap + credit, idm.SMALLEST_GAP), max(0.5 * second_gap, idm.SMALLEST_GAP)
    second_rate, jam = speed - moment.second_speed, d0 + moment.farther
    if law == laws.IDM:
        free = _by_idm(speed, seen, room, second_rate, farther, moment.share, a, weight, headway, jam, d1, inverse)
    else:
        free = laws.acceleration(law, speed, seen, room, a, weight, headway, jam, limit, moment.reaction)
        if moment.share > 0.0:
            behind_second = laws.acceleration(
                law, speed, second_rate, farther, a, weight, headway, jam, limit, moment.reaction
            )
            free = shared_interaction(free, behind_second, moment.share)
    free = weakened(free, moment.asymmetry)
    free += at_place(x, moment.place, moment.begin, moment.end)
    free += friction(speed, moment.adjacent_speed, moment.friction)
    free += pressed(rear_gap, moment.pressure) + moment.room
    free = max(free, -idm.EMERGENCY_BRAKING)
    return free if gap > idm.SMALLEST_GAP else -idm.EMERGENCY_BRAKING


@njit(cache=True, error_model="numpy")
def extended_acceleration(speed, approach_rate, gap, see, a, b, T, d0, d1, desired_speed, m):  # type: ignore[no-untyped-def]
    """Return the acceleration (m/s²) of a driver with effects; with ``m`` all zero :func:`idm_sumo.models.idm.acceleration`.

    Parameters
    ----------
    speed, approach_rate, gap : float
        m/s, m/s, m as the driver acts on them: of a moment ago with a reaction delay
        (:func:`idm_sumo.models.effects.reaction_delay.acted_on`). Gap is infinite without a leader.
    see : Sight
    a, b, T, d0, d1, desired_speed : float
    m : float64, shape (slots.COUNT,)

    Notes
    -----
    The bound ``-EMERGENCY_BRAKING`` and the smallest gap are those of the plain IDM, by whatever law ``m`` follows.
    """
    return behaved(
        speed, approach_rate, gap, see.x, see.second_gap, see.rear_gap, moment_of(see, m),
        a, idm.closing_weight(a, b), T, d0, d1, desired_speed, m[slots.LAW],
    )  # fmt: skip
