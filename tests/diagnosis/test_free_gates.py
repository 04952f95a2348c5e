"""Gates of what is free: what no effect of the catalogue holds is told from what one does."""

from __future__ import annotations

from dataclasses import replace

import pytest

from idm_sumo.diagnosis import free_gates, gates
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.regressors import Regressor
from idm_sumo.models.effects import slots
from tests.helpers.followers import evidence, free


@pytest.mark.parametrize(
    ("z", "beyond", "neither"), [(12.0, 8.0, True), (-12.0, -8.0, True), (12.0, 4.0, False), (20.0, 6.0, False)]
)
def test_what_is_there_and_then_only_is_no_place_and_no_time(z, beyond, neither):
    assert free_gates.is_neither(replace(free("position and time", z), beyond=beyond)) is neither


@pytest.mark.parametrize(
    ("covariate", "z", "told"),
    [
        ("position and time within the place", -12.0, True),  # glare
        ("headway over position and time within the time", 7.0, True),
        ("position and time within the place", -3.3, False),  # the most of a place that was so at all times
        ("position and time", 12.0, False),
    ],
)
def test_a_place_of_the_model_that_is_so_for_a_while_only_is_told(covariate, z, told):
    assert bool(free_gates.only_there_and_then(evidence(0.0, free(covariate, z)))) is told
    assert not free_gates.only_there_and_then(evidence(0.0, free(covariate, z, is_credible=False)))


@pytest.mark.parametrize(
    ("covariate", "z", "stands_out"),
    [
        ("position and time", 5.9, False),
        ("position and time", 6.1, True),
        ("position and time", 5.0, False),
        ("position", 6.0, False),  # the catalogue's own place would have said it
        ("position", 7.0, True),
        ("position and time, moving at 2 m/s", 6.0, False),  # one of fourteen speeds
        ("position and time, moving at 2 m/s", 7.0, True),
        ("lane", 6.0, False),  # which to take drivers choose themselves
        ("delay over position in lane 2", 6.0, False),  # a response that changes: most looks
        ("delay over time", 6.2, False),
        ("delay over time", 7.0, True),
        ("delay over position", 4.4, False),
        ("delay over position", 4.6, True),  # late beside an accident
        ("delay over position", -6.2, False),  # nobody is early
        ("own oscillation in time, period 9.1 s", 3.9, False),
        ("own oscillation in time, periods around 9.1 s", 3.3, False),
        ("own oscillation in time, periods around 9.1 s", 3.5, True),
        ("response over position", 6.2, False),
        ("headway over leader_gap", 6.0, False),  # another car-following model looks like it
        ("headway over leader_gap", 7.0, True),
        ("faster_difference", 6.0, False),
        ("faster_difference", 7.4, True),  # drawn along beside a faster lane
        ("headway over since_braking", 7.0, False),  # so it does: of its own motion a driver's noise tells
        ("headway over since_braking", 9.5, True),
    ],
)
def test_what_is_looked_at_more_must_stand_out_more(covariate, z, stands_out):
    assert bool(free_gates.standing_out(evidence(0.0, free(covariate, z)))) is stands_out
    assert not free_gates.standing_out(evidence(0.0, free(covariate, -z, is_credible=False)))


@pytest.mark.parametrize(
    ("covariate", "z", "stands_out"),
    [
        ("braking_beside", 4.5, True),
        ("headway over trucks_beside", 4.5, True),
        ("nearest_beside", 4.0, False),
        ("leader_length", 4.5, False),  # of the one who is followed
        ("own oscillation in time, period 9.14 s", 4.2, True),
        ("own oscillation in time, each driver's own period", 3.5, False),
        ("variance over position", 4.9, True),  # three in five look aside for 3 s
        ("variance over time", 3.6, False),
        ("headway over unrest", 5.7, True),
        ("unrest", 5.7, False),
    ],
)
def test_who_is_around_a_swing_and_unsteadiness_stand_out_from_less(covariate, z, stands_out):
    assert bool(free_gates.standing_out(evidence(0.0, free(covariate, z)))) is stands_out
    assert bool(free_gates.untold(evidence(0.0, free(covariate, z)))) is stands_out


def test_a_law_that_is_another_asks_as_much_of_who_is_around_as_of_what_is_seen():
    assert free_gates.standing_out(evidence(-8.0, free("braking_beside", 4.5)))
    assert not free_gates.standing_out(evidence(-10.0, free("braking_beside", 4.5)))


@pytest.mark.parametrize("covariate", ["since_standing", "headway over since_standing"])
def test_a_law_that_is_another_starts_after_standing_in_its_own_way(covariate):
    """So it did, by 6.5 standard errors beside 8.0 of what cannot be, where nothing was hidden."""
    assert free_gates.standing_out(evidence(0.0, free(covariate, 5.6)))
    assert free_gates.standing_out(evidence(-5.2, free(covariate, 5.6)))
    assert not free_gates.standing_out(evidence(-8.0, free(covariate, 6.5)))
    assert free_gates.standing_out(evidence(-8.0, free("unrest", 6.6)))


@pytest.mark.parametrize(("covariate", "stands_out"), [("position in lane 2", True), ("time in lane 2", False)])
def test_one_lane_for_a_while_are_few_drivers_and_must_stand_out_more(covariate, stands_out):
    one = replace(free(covariate, 6.0), lane=2)
    assert bool(free_gates.standing_out(evidence(0.0, one))) is stands_out
    assert free_gates.standing_out(evidence(0.0, replace(one, z=7.0)))


@pytest.mark.parametrize(
    ("covariate", "z"), [("unrest", 8.0), ("headway over rear_gap", 11.0), ("position", 8.0), ("delay over time", 8.0)]
)
def test_beside_what_cannot_be_what_a_driver_sees_must_be_half_as_sure(covariate, z):
    is_where_or_when = covariate.endswith(("position", "time"))
    assert free_gates.standing_out(evidence(-12.0, free(covariate, z)))
    assert bool(free_gates.standing_out(evidence(-24.0, free(covariate, z)))) is is_where_or_when
    assert free_gates.standing_out(evidence(24.0, free(covariate, z)))


@pytest.mark.parametrize("covariate", ["delay over position", "response over position and time"])
def test_where_the_law_is_another_its_response_changes_along_the_road(covariate):
    """So it did, by 7.2 standard errors beside 6.7 of what cannot be, where nothing was hidden."""
    assert free_gates.standing_out(evidence(0.0, free(covariate, 7.2)))
    assert not free_gates.standing_out(evidence(-6.7, free(covariate, 7.2)))
    assert free_gates.standing_out(evidence(-6.7, free(covariate, 9.0)))
    assert free_gates.standing_out(evidence(-6.7, free("delay over time", 7.2)))


@pytest.mark.parametrize("covariate", ["delay over position", "response over time"])
def test_a_response_must_be_surer_than_the_surest_of_which_that_cannot_be(covariate):
    """A few vehicles that stopped short in one lane made 7.4 of a rectangle that held them, in light traffic."""
    one, event = free(covariate, 7.4), free("response over time in lane 4", -11.5, is_credible=False)
    assert free_gates.standing_out(evidence(0.0, one))
    assert not free_gates.standing_out(evidence(0.0, event, one))
    assert free_gates.standing_out(evidence(0.0, replace(event, z=-6.0), one))
    assert free_gates.standing_out(evidence(0.0, event, free("position and time", 7.4)))


@pytest.mark.parametrize(
    ("place", "lane", "stands_out"), [((571.0, 603.0), 0, True), ((400.0, 603.0), 0, False), ((400.0, 603.0), 2, False)]
)
def test_what_cannot_be_elsewhere_is_no_reason_to_doubt_a_response(place, lane, stands_out):
    """A vehicle stopped short behind the place beside which drivers were late."""
    late = replace(free("delay over position", 7.8), position_m=(252.0, 412.0))
    stopped = replace(free("response over position", 8.4, is_credible=False), position_m=place, lane=lane)
    assert bool(free_gates.standing_out(evidence(0.0, late, stopped))) is stands_out
    whenever = replace(stopped, covariate="response over time", position_m=None, time_s=(0.0, 30.0))
    assert not free_gates.standing_out(evidence(0.0, late, whenever))
    assert free_gates.standing_out(
        evidence(0.0, replace(late, lane=3), replace(stopped, position_m=(400.0, 603.0), lane=2))
    )


@pytest.mark.parametrize(
    ("delay", "covariate", "z", "is_outside"),
    [
        (0.0, "trucks_beside", 6.0, True),
        (0.0, "unrest", 6.0, False),  # is of the driver's own motion
        (0.0, "unrest", 7.0, True),
        (6.0, "leader_gap", 8.0, False),  # less than one and a half times the delay's, and 25
        (6.0, "leader_gap", 9.5, True),
        (6.0, "unrest", 7.2, False),  # what a driver did of late needs no 25 more
        (6.0, "unrest", 7.5, True),
        (0.0, "since_braking", 8.9, False),  # of which its noise tells
        (6.0, "position", 9.5, False),  # location holds it
        (6.0, "delay over time", 7.0, True),  # what changes needs half of the delay's, and 25
        (6.0, "variance over position", 7.5, False),  # no cause makes drivers less steady: as much as it, and 25
        (6.0, "variance over position", 8.0, True),
    ],
)
def test_what_says_more_than_the_catalogue_is_outside_it(delay, covariate, z, is_outside):
    one = free(covariate, z)
    assert free_gates.outside(evidence(delay, one)) == ((one,) if is_outside else ())


@pytest.mark.parametrize(
    ("covariate", "z", "p"),
    [("position", 6.0, 1e-9), ("position", 5.0, 0.5), ("time", 6.0, 0.5), ("position and time", 6.0, 0.5)],
)
def test_a_place_that_stands_out_freely_is_that_of_the_catalogue(monkeypatch, covariate, z, p):
    place = Candidate("location", -0.06, 0.01, -4.7, 0.5, Regressor("location", low=100.0, high=200.0))
    monkeypatch.setattr(gates.hy, "candidates", lambda _: [place])
    (found,) = gates.believed(evidence(0.0, free(covariate, z)))
    assert found == replace(place, p=p)
    assert free_gates.outside(evidence(0.0, free("position", 6.0))) == ()


def test_what_a_cause_takes_half_away_is_held_by_it():
    strange = free("unrest", 10.0)
    assert free_gates.is_left(strange, evidence(0.0, free("unrest", 8.0)))
    assert free_gates.is_left(strange, evidence(0.0, free("unrest", 6.8)))
    assert not free_gates.is_left(strange, evidence(0.0, free("unrest", 6.0)))
    assert not free_gates.is_left(strange, evidence(12.0, free("unrest", 8.0)))


def test_a_region_that_a_place_leaves_needs_less_to_be_left():
    strange = free("position and time", 16.0)
    assert free_gates.is_left(strange, evidence(0.0, free("position and time", 10.0)))
    assert not free_gates.is_left(strange, evidence(0.0, free("position and time", 8.0)))


@pytest.mark.parametrize(("value", "is_outside"), [(0.2, False), (-0.2, True)])
def test_who_drives_closer_after_a_change_relaxes_and_who_holds_back_does_something_else(value, is_outside):
    after = replace(free("since_change", 14.0), value=value)
    relaxing = replace(evidence(8.0, after), regressors=[Regressor("lane_change_relaxation", 0.2, ((2, 0.2),))])
    assert bool(free_gates.outside(relaxing)) is is_outside
    assert free_gates.outside(evidence(8.0, after))


@pytest.mark.parametrize(
    ("covariate", "seen", "value", "is_outside"),
    [
        ("leader_acceleration", (-20.0, -1.0), 0.3, False),  # pushes on behind a leader that brakes: a shorter headway
        ("leader_acceleration", (1.0, 20.0), -0.3, False),
        ("leader_acceleration", (-20.0, -1.0), -0.3, True),  # brakes more than the leader
        ("headway over leader_acceleration", (-20.0, -1.0), -0.2, False),
        ("headway over leader_acceleration", (-20.0, -1.0), 0.2, True),
    ],
)
def test_headways_that_follow_the_leaders_acceleration_are_hysteresis(covariate, seen, value, is_outside):
    one = replace(free(covariate, 18.0), range=seen, value=value)
    hysteresis = replace(evidence(8.0, one), regressors=[Regressor("hysteresis", 0.2, ((slots.HYSTERESIS, 0.2),))])
    assert bool(free_gates.outside(hysteresis)) is is_outside
    assert free_gates.outside(evidence(0.0, one))


@pytest.mark.parametrize(("z", "is_outside"), [(11.2, False), (12.0, True)])
def test_long_leaders_are_more_than_trucks_where_their_length_says_far_more(z, is_outside):
    """Who keeps away from vans keeps away from trucks, too, which are a few of the long."""
    long = replace(free("headway over leader_length", z), range=(5.2, 40.0))
    trucks = replace(evidence(8.0, long), regressors=[Regressor("leader_class", 0.2, ((4, 0.2),))])
    assert bool(free_gates.outside(trucks)) is is_outside
    assert free_gates.outside(evidence(0.0, long))


@pytest.mark.parametrize(("name", "stands_out"), [("follower_pressure", True), ("reaction_delay", False)])
def test_a_follower_who_comes_near_is_no_sign_of_another_law(name, stands_out):
    """He does so where a driver starts slowly; acting before the leader does is a sign of one."""
    slow = free("since_standing", -5.8)
    found = replace(evidence(-6.2, slow), regressors=[Regressor(name, 0.2, ((0, 0.2),))])
    assert bool(free_gates.standing_out(found)) is stands_out


@pytest.mark.parametrize(
    ("covariate", "name"),
    [("until_cut_in", "courtesy_yielding"), ("headway over until_own_change", "pre_insertion")],
)
def test_what_rests_on_changes_to_come_is_what_the_catalogue_calls_it(covariate, name):
    """Its form there may be another: whoever yields brakes, or keeps a longer headway, for other seconds than five."""
    for value in (-0.3, 0.3):
        one = replace(free(covariate, 18.0), value=value)
        there = replace(evidence(12.0, one), regressors=[Regressor(name, 0.3, ((2, 0.3),))])
        assert not free_gates.outside(there)
        assert free_gates.outside(evidence(8.0, one))


def test_what_shows_an_effect_that_is_too_small_for_a_name_is_not_told_as_unknown():
    one = replace(free("until_cut_in", 18.0), value=-0.3)
    small = replace(evidence(5.0, one), regressors=[Regressor("courtesy_yielding", 0.3, ((2, 0.3),))])
    (there,) = gates.believed(small)
    assert gates.is_too_small(there)
    assert not free_gates.outside(small)
    assert free_gates.untold(small) == ()
    for other in (replace(small, free=(free("unrest", 18.0),)), replace(small, u=0.1 * small.u)):
        assert free_gates.untold(other) == other.free


@pytest.mark.parametrize(
    ("name", "z", "pedal", "stands_out"),
    [
        ("perception_threshold", 8.4, 15.8, True),
        ("perception_threshold", 5.6, 5.1, True),
        ("perception_threshold", 8.9, 6.8, False),  # the most of drivers with a dead band
        ("perception_threshold", 5.0, 4.8, False),
        ("hysteresis", 8.4, 15.8, False),  # the law may be another one
        ("", 0.0, 15.8, False),
    ],
)
def test_a_pedal_left_alone_is_asked_for_where_small_approach_rates_seem_unnoticed(
    monkeypatch, name, z, pedal, stands_out
):
    seen = [Candidate(name, 0.5, 0.01, z, 1e-6, Regressor(name, 0.5), 1.0, 0.0)] if name else []
    monkeypatch.setattr(gates, "believed", lambda _: seen)
    one = free("response over wanted_acceleration", -pedal)
    assert free_gates.is_stood_in_for(one, evidence(0.0, one))
    assert bool(free_gates.outside(evidence(0.0, one))) is stands_out


@pytest.mark.parametrize(
    ("place", "z", "road", "entry", "is_it"),
    [
        (300.0, 14.9, (200.0, 13.9), (12.0, 16.8), True),
        (300.0, 8.4, (200.0, 11.5), (12.0, 11.2), False),  # along the road it is surer
        (300.0, 15.0, (200.0, 14.0), (12.0, 15.5), False),  # the place says as much
        (0.0, 15.0, (200.0, 14.0), (12.0, 15.5), True),  # one that begins where the recording does
        (0.0, 15.0, (200.0, 14.0), (12.0, 14.9), False),
        (0.0, 15.0, (0.0, 15.0), (12.0, 13.0), False),  # who has just come into sight does nothing
        (0.0, 15.0, (0.0, 15.0), (2.0, 13.0), True),  # whose entry is not known was there, too
        (0.0, 15.0, (0.0, 15.0), (2.0, 11.0), False),
        (0.0, 15.0, (200.0, 15.0), (2.0, 13.0), False),
        (None, 0.0, (200.0, 0.0), (12.0, 5.6), True),
    ],
)
def test_what_changes_with_the_time_since_the_entry_is_told_from_a_place(monkeypatch, place, z, road, entry, is_it):
    bins = [Regressor("location", low=low, high=low + 20.0) for low in (0.0, 300.0)]
    seen = [Candidate("location", -0.2, 0.01, z, 1e-6, Regressor("location", -0.2, low=place), 1.0, 0.0)] if z else []
    monkeypatch.setattr(gates, "believed", lambda _: seen)
    one, along = (
        replace(free(covariate, z), range=(begin, begin + 30.0))
        for covariate, (begin, z) in (("headway over since_entry", entry), ("position", road))
    )
    monkeypatch.setattr(free_gates, "standing_out", lambda _: (one,))
    assert free_gates.is_stood_in_for(one, evidence(0.0, one))
    assert bool(free_gates.outside(replace(evidence(0.0, one, along), regressors=bins))) is is_it


@pytest.mark.parametrize(("fixed", "place", "z", "stood_in_for"), [
    (((slots.PERIOD_DRIFT, 1.0),), 6.5, 9.4, False),  # who comes later comes with more
    (((slots.PERIOD_DRIFT, 1.0),), 9.6, 9.4, True),  # a location says more
    ((), 6.5, 9.4, True),  # some time
    (((slots.PERIOD_DRIFT, 1.0),), 0.0, 2.0, True),  # chance
])  # fmt: skip
def test_what_changes_with_the_time_since_the_entry_may_be_a_drift(monkeypatch, fixed, place, z, stood_in_for):
    drift = Candidate(
        "time_of_day", 0.1, 0.01, z, 1e-6 if z > 4.0 else 1.0, Regressor("time_of_day", 0.1, fixed), 1.0, 0.0
    )
    where = Candidate("location", 0.1, 0.01, place, 1e-6 if place else 1.0, Regressor("location", 0.1), 1.0, 0.0)
    monkeypatch.setattr(gates, "believed", lambda _: sorted([where, drift], key=lambda one: -abs(one.z)))
    entry = free("headway over since_entry", -12.9)
    assert free_gates.is_stood_in_for(entry, evidence(0.0, entry)) is stood_in_for


@pytest.mark.parametrize(
    ("name", "z", "drawn", "is_outside"),
    [
        ("adjacent_lane_friction", 8.0, 10.8, True),
        ("adjacent_lane_friction", 15.9, 7.4, False),  # drivers who are slowed
        ("hysteresis", 8.0, 10.8, False),  # another law may look like it
    ],
)
def test_of_a_slower_lane_and_a_faster_one_that_is_believed_which_says_more(monkeypatch, name, z, drawn, is_outside):
    seen = [Candidate(name, 0.05, 0.01, z, 1e-6, Regressor(name, 0.05), 1.0, 0.0)]
    monkeypatch.setattr(gates, "believed", lambda _: seen)
    assert bool(free_gates.outside(evidence(0.0, free("faster_difference", drawn)))) is is_outside


@pytest.mark.parametrize(
    ("covariate", "range_", "z", "is_outside"),
    [
        ("leader_acceleration", (-20.0, -0.3), -10.3, True),  # brakes with the one ahead whatever the gap
        ("headway over leader_acceleration", (-0.3, 20.0), -10.3, True),
        ("leader_acceleration", (-20.0, -0.3), -9.5, False),  # not by enough
        ("leader_acceleration", (-20.0, -0.3), 10.3, False),  # a hysteresis leaves it over
        ("relative_speed", (-20.0, -0.3), -10.3, False),
    ],
)
def test_who_brakes_with_the_one_ahead_must_say_more_than_the_best_cause_but_not_half_more(
    monkeypatch, covariate, range_, z, is_outside
):
    """It is the reverse of hysteresis, and no form of any cause."""
    best = Candidate(
        "speed_dependent_headway", 0.24, 0.03, 8.3, 1e-14, Regressor("speed_dependent_headway", 0.24), 1.0, 0.0
    )
    monkeypatch.setattr(gates, "believed", lambda _: [best])
    seen = evidence(0.0, replace(free(covariate, z), value=0.01 * z, range=range_))
    assert bool(free_gates.outside(seen)) is is_outside


@pytest.mark.parametrize(
    ("kind", "entry", "covariate"),
    [((), 3.9, "since_entry"), (((slots.PLACE_HEADWAY, 1.0),), 3.9, "headway over since_entry"), ((), 9.0, None)],
)
def test_what_grows_along_the_whole_road_changes_with_the_time_since_the_entry(monkeypatch, kind, entry, covariate):
    """In light traffic: who entered where the road begins has been there the longer the farther he is."""
    grown = Candidate("location", 0.12, 0.01, 8.5, 1e-9, Regressor("location", low=40.0, high=480.0, fixed=kind))
    monkeypatch.setattr(free_gates.hy, "along_the_road", lambda _: grown)
    seen = evidence(0.0, free("trucks_beside", 5.0), free("since_entry", -entry))
    told = free_gates.standing_out(seen)
    assert len([one for one in told if one.subject == "since_entry"]) == 1
    if covariate is None:  # that says more by itself
        assert told == seen.free
    else:
        assert (told[0].covariate, told[0].z, told[0].p, told[0].position_m) == (covariate, 8.5, 1e-9, (40.0, 480.0))
        assert told[1:] == seen.free[:1]
