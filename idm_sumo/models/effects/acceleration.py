"""One compiled acceleration: a car-following law and all effects."""

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


class Stimuli(NamedTuple):
    """What a driver reacts to beside motion and gap.

    Unknown fields are NaN, and the effect that needs them then has no influence.

    Attributes
    ----------
    x, t : float
        Own front (m); time since the first frame of the recording's period (s).
    leader_acceleration : float
        Acceleration of the leader (m/s²).
    leader_class, own_class, lane : float
        Vehicle classes and lane number as in the recording.
    second_gap, second_speed : float
        Free space up to the second leader's rear bumper, without the first leader's length (m); its speed (m/s).
    adjacent_speed : float
        Mean speed of the vehicles nearby in the slower adjacent lane (m/s).
    rear_gap : float
        Own rear bumper to the follower's front (m).
    jump, since_change : float
        Old gap minus new gap at the last change of leader (m); time since then (s).
    accepted_headway : float
        Time headway right after the last change of leader (s).
    until_cut_in, until_own_change : float
        Time until a vehicle is inserted ahead, and until the own lane change (s). Known in replay only.
    mean_speed : float
        Running mean of the own speed (m/s).
    next_adjacent_speed : float
        Speed of the slower one of the next vehicles ahead in the adjacent lanes (m/s).
    leader_acceleration_mean : float
        Mean acceleration of the leader over the last seconds (m/s²).
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
    next_adjacent_speed: float = NAN
    leader_acceleration_mean: float = NAN


NO_STIMULI = Stimuli(*([NAN] * len(Stimuli._fields)))  # the driver knows its leader only


class EffectTerms(NamedTuple):
    """Terms of all effects at one moment.

    They do not depend on the driver's own state, so that they are computed once and serve many
    drivers of other parameters, positions and speeds side by side. All fields are plain numbers, so
    that a loop over them becomes vector instructions.

    Attributes
    ----------
    headway, limit : float
        Factors of the time headway and of the desired speed.
    credit : float
        Added to the gap (m).
    given_up, limited : float
        Shares of the difference between own and accepted time headway: by the first the headway is shortened,
        by the second, if positive, the credit is limited.
    accepted : float
        Accepted time headway (s).
    share, rate_share : float
        Shares of the second leader in the interaction and in the approach rate; zero without a second leader.
    second_speed : float
        Speed of the second leader (m/s).
    band, taken : float
        Perception threshold, and what is taken off larger approach rates (m/s).
    asymmetry, slope, memory : float
        Magnitudes of acceleration asymmetry, speed-dependent headway (per 10 m/s) and memory.
    pivot, mean_speed : float
        Speed at which the speed-dependent headway is unchanged, and running mean of the own speed (m/s).
    place, place_headway, begin, end : float
        Acceleration (m/s²) and share of the time headway of a location, and where it begins and ends (m).
    friction, adjacent_speed : float
        Strength (1/s) and speed (m/s) of the adjacent lane's friction.
    pressure : float
        Acceleration by a close follower (m/s²).
    room : float
        Acceleration before a lane change, own or of another vehicle (m/s²).
    reaction : float
        Time within which Krauss's safe speed is reached (s).
    farther : float
        Added to the jam distance (m).
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
def effect_terms(stimuli, m):  # type: ignore[no-untyped-def]
    """Return the terms independent of the driver's state.

    Parameters
    ----------
    stimuli : Stimuli
        What the driver reacts to.
    m : float64, shape (slots.COUNT,)
        Magnitudes of the effects.

    Returns
    -------
    EffectTerms
        Terms for :func:`acceleration_with_terms`.
    """
    answered = stimuli.leader_acceleration_mean if m[slots.HYSTERESIS_OF_LATE] > 0.5 else stimuli.leader_acceleration
    headway = (
        behind_truck(stimuli.leader_class, m[slots.LEADER_CLASS])
        * in_phase(answered if answered == answered else 0.0, m[slots.HYSTERESIS])
        * at_time(stimuli.t, m[slots.PERIOD], m[slots.PERIOD_BEGIN], m[slots.PERIOD_END])
        * drifted(stimuli.t, m[slots.PERIOD_DRIFT], m[slots.PERIOD_BEGIN], m[slots.PERIOD_END])
        * of_truck(stimuli.own_class, m[slots.OWN_CLASS])
        * before_cut_in(stimuli.until_cut_in, m[slots.COURTESY])
        * before_own_change(stimuli.until_own_change, m[slots.PRE_INSERTION])
    )
    of_gap, of_headway = 1.0 - m[slots.HEADWAY_ACCEPTED], m[slots.HEADWAY_ACCEPTED]
    given_up = headway_given_up(
        stimuli.jump, stimuli.since_change, m[slots.RELAXATION] * of_headway, m[slots.RELAXATION_TIME]
    )
    limited = headway_given_up(
        stimuli.jump, stimuli.since_change, m[slots.RELAXATION] * m[slots.CREDIT_LIMITED], m[slots.RELAXATION_TIME]
    )
    share = m[slots.SECOND_LEADER] if stimuli.second_gap < 1e6 else 0.0
    beside = stimuli.next_adjacent_speed if m[slots.FRICTION_NEXT] > 0.5 else stimuli.adjacent_speed
    # Named before the call: Numba takes no conditional within a call of so many keywords.
    accepted = stimuli.accepted_headway if given_up + limited > 0.0 else 0.0
    memory = m[slots.MEMORY] if stimuli.mean_speed == stimuli.mean_speed else 0.0
    return EffectTerms(
        headway=headway,
        limit=in_lane(stimuli.lane, m[slots.DESIRED_SPEED], m[slots.DESIRED_SPEED_LANE], m[slots.DESIRED_SPEED_ACROSS]),
        credit=gap_credit(stimuli.jump, stimuli.since_change, m[slots.RELAXATION] * of_gap, m[slots.RELAXATION_TIME]),
        given_up=given_up,
        limited=limited,
        accepted=accepted,
        share=share * (1.0 - m[slots.SECOND_SPEED_ONLY]),
        rate_share=share * m[slots.SECOND_SPEED_ONLY],
        second_speed=stimuli.second_speed,
        band=m[slots.BAND],
        taken=m[slots.BAND] * m[slots.BAND_TAKEN],
        asymmetry=m[slots.ASYMMETRY],
        slope=m[slots.SPEED_HEADWAY],
        pivot=m[slots.PIVOT_SPEED],
        memory=memory,
        mean_speed=stimuli.mean_speed,
        place=m[slots.PLACE],
        place_headway=m[slots.PLACE_HEADWAY],
        begin=m[slots.PLACE_BEGIN],
        end=m[slots.PLACE_END],
        friction=m[slots.FRICTION],
        adjacent_speed=beside,
        pressure=m[slots.PRESSURE],
        room=braking_before(stimuli.until_cut_in, m[slots.COURTESY_BRAKING])
        + braking_before(stimuli.until_own_change, m[slots.PRE_INSERTION_BRAKING]),
        reaction=laws.REACTION + m[slots.REACTION_CHANGE],
        farther=farther_from_truck(stimuli.leader_class, m[slots.LEADER_CLASS_DISTANCE]),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def _by_idm(speed, rate, gap, second_rate, second_gap, share, a, weight, headway, d0, d1, inverse):  # type: ignore[no-untyped-def]
    """Return the IDM's acceleration (m/s²) towards two leaders.

    ``share`` is that of the second leader in the interaction. Numbers, for the sake of vector instructions.
    """
    ratio = idm.desired_gap_of(speed, rate, weight, headway, d0, d1, inverse) * (1.0 / gap)
    wanted = idm.desired_gap_of(speed, second_rate, weight, headway, d0, d1, inverse)
    second = wanted / second_gap if share > 0.0 else 0.0
    interaction = shared_interaction(ratio * ratio, second * second, share)
    ratio = speed * inverse
    return a * (1.0 - ratio * ratio * ratio * ratio - interaction)


# Inlined by force: only then is a loop over drivers that calls it turned into vector instructions.
@njit(cache=True, error_model="numpy", forceinline=True)
def acceleration_with_terms(  # type: ignore[no-untyped-def]
    speed, approach_rate, gap, x, second_gap, rear_gap, terms, a, weight, T, d0, d1, desired_speed, law,
):  # fmt: skip
    """Return the acceleration of a driver from precomputed terms.

    The function has no branches that depend on the driver, so that a loop over many drivers becomes vector
    instructions. It takes numbers instead of a record of parameters for the same reason.

    Parameters
    ----------
    speed, approach_rate, gap : float
        What the driver acts on (m/s, m/s, m).
    x, second_gap, rear_gap : float
        As in :class:`Stimuli` (m).
    terms : EffectTerms
        Terms of the effects.
    a : float
        Maximum acceleration (m/s²).
    weight : float
        :func:`idm_sumo.models.idm.closing_weight` (s²/m).
    T, d0, d1, desired_speed : float
        Time headway (s), jam distances (m) and desired speed (m/s).
    law : float
        Number of the law, of :mod:`idm_sumo.models.laws`. It must be the same for all drivers of a loop that is
        to be vectorized.

    Returns
    -------
    float
        Acceleration (m/s²).
    """
    limit = desired_speed * terms.limit
    inverse = 1.0 / limit
    factor = at_speed(speed, terms.pivot, terms.slope) * resigned(terms.mean_speed, limit, terms.memory)
    factor *= 1.0 + at_place(x, terms.place_headway, terms.begin, terms.end)
    headway = T * (terms.headway * factor)
    lacking = max(headway - terms.accepted, 0.0)
    headway -= terms.given_up * lacking
    credit = within_shortage(terms.credit, terms.limited, lacking, speed)
    rate = (
        shared_rate(approach_rate, speed - terms.second_speed, terms.rate_share)
        if terms.rate_share > 0.0
        else approach_rate
    )
    seen = perceived(rate, terms.band, terms.taken)
    room, farther = max(gap + credit, idm.SMALLEST_GAP), max(0.5 * second_gap, idm.SMALLEST_GAP)
    second_rate, jam = speed - terms.second_speed, d0 + terms.farther
    if law == laws.IDM:
        free = _by_idm(speed, seen, room, second_rate, farther, terms.share, a, weight, headway, jam, d1, inverse)
    else:
        free = laws.acceleration(law, speed, seen, room, a, weight, headway, jam, limit, terms.reaction)
        if terms.share > 0.0:
            behind_second = laws.acceleration(
                law, speed, second_rate, farther, a, weight, headway, jam, limit, terms.reaction
            )
            free = shared_interaction(free, behind_second, terms.share)
    free = weakened(free, terms.asymmetry)
    free += at_place(x, terms.place, terms.begin, terms.end)
    free += friction(speed, terms.adjacent_speed, terms.friction)
    free += pressed(rear_gap, terms.pressure) + terms.room
    free = max(free, -idm.EMERGENCY_BRAKING)
    return free if gap > idm.SMALLEST_GAP else -idm.EMERGENCY_BRAKING


@njit(cache=True, error_model="numpy")
def extended_acceleration(speed, approach_rate, gap, stimuli, parameters, desired_speed, m):  # type: ignore[no-untyped-def]
    """Return the acceleration of a driver with effects.

    Parameters
    ----------
    speed, approach_rate, gap : float
        What the driver acts on (m/s, m/s, m). With a reaction delay these are values of a moment ago, see
        :func:`idm_sumo.models.effects.reaction_delay.acted_on`. The gap is infinite without a leader.
    stimuli : Stimuli
        What the driver reacts to beside them.
    parameters : IDMParameters, or float64, shape (5,)
        ``a, b, T, d0, d1``.
    desired_speed : float
        Desired speed (m/s).
    m : float64, shape (slots.COUNT,)
        Magnitudes of the effects; all zero gives :func:`idm_sumo.models.idm.acceleration`.

    Returns
    -------
    float
        Acceleration (m/s²).

    Notes
    -----
    The bound ``-EMERGENCY_BRAKING`` and the smallest gap are those of the plain IDM, whatever the law.
    """
    return acceleration_with_terms(
        speed,
        approach_rate,
        gap,
        stimuli.x,
        stimuli.second_gap,
        stimuli.rear_gap,
        effect_terms(stimuli, m),
        parameters[0],
        idm.closing_weight(parameters[0], parameters[1]),
        parameters[2],
        parameters[3],
        parameters[4],
        desired_speed,
        m[slots.LAW],
    )
