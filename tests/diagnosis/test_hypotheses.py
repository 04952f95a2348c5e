"""Candidates: the best stretch of place or time, and the one beside it that may be meant as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.regressors import SECANT_REGRESSORS, Regressor
from idm_sumo.models.effects import slots

BINS, WIDTH, DRIVERS = 40, 16.0, 30


def evidence(effect: np.ndarray, absorbed: float, seed: int = 0) -> Evidence:
    """Return what is seen of a shift by bin, if drivers take up ``absorbed`` of what is the same everywhere."""
    rng = np.random.default_rng(seed)
    gram = 40.0 * (np.eye(BINS) - absorbed / BINS)
    noise = rng.multivariate_normal(np.zeros(BINS), gram, DRIVERS) / np.sqrt(DRIVERS)
    u = (gram @ effect) / DRIVERS + noise
    regressors = [Regressor("location", low=WIDTH * n, high=WIDTH * (n + 1)) for n in range(BINS)]
    part = np.tile(np.diag(gram) / DRIVERS, (DRIVERS, 1))
    replicates = rng.multivariate_normal(np.zeros(BINS), gram / 9.0, 3)
    return Evidence(regressors, u, replicates, gram, part, np.arange(DRIVERS))


def place(low: int, high: int, shift: float) -> np.ndarray:
    out = np.zeros(BINS)
    out[low:high] = shift
    return out


def test_the_place_that_was_shifted_is_found():
    found = hy.candidates(evidence(place(10, 20, -1.0), 0.0))[0]
    assert (found.name, found.regressor.low, found.regressor.high) == ("location", 10 * WIDTH, 20 * WIDTH)
    assert found.value == pytest.approx(-1.0, abs=4 * found.error)
    assert found.p < 1e-6
    assert dict(hy.slots_of(found))[slots.PLACE_BEGIN] == 10 * WIDTH


def test_where_less_is_done_at_a_place_more_is_done_beside_it():
    seen = evidence(place(20, 40, -1.0), 1.0)
    best = hy.candidates(seen)[0]
    both = hy.forms(seen, best)
    assert both[0] == best
    assert len(both) == 2
    assert both[0].value * both[1].value < 0.0
    assert sorted([one.regressor.low for one in both]) == pytest.approx([0.0, 20 * WIDTH], abs=WIDTH)


SHIFT = ((slots.PLACE_HEADWAY, 1.0),)


def with_braking(headway: Evidence) -> Evidence:
    """Return evidence of headways at places with that of braking: what one does there the other does in part, with the other sign."""
    regressors = [*headway.regressors, *(replace(regressor, fixed=SHIFT) for regressor in headway.regressors)]
    alike = np.array([[1.0, -0.8], [-0.8, 1.0]])
    u, replicates = np.hstack([-0.8 * headway.u, headway.u]), np.hstack([-0.8 * headway.replicates, headway.replicates])
    return Evidence(
        regressors, u, replicates, np.kron(alike, headway.gram), np.hstack([headway.part] * 2), headway.block
    )


def test_where_more_is_done_beside_a_place_it_is_so_of_braking_and_of_headway():
    both = with_braking(evidence(place(20, 40, 1.0), 1.0))
    best, *others = hy.forms(both, hy.candidates(both)[0])
    assert best.regressor.fixed == SHIFT
    assert sorted((one.regressor.fixed == SHIFT, np.sign(one.value)) for one in [best, *others]) == [
        (False, -1.0), (False, 1.0), (True, -1.0), (True, 1.0)]  # fmt: skip


def test_a_place_is_looked_for_as_braking_and_as_headway():
    both = with_braking(evidence(place(10, 20, 1.0), 0.0))
    u, replicates, gram = both.u, both.replicates, both.gram
    found = hy.candidates(both)[0]
    assert (found.name, found.regressor.fixed, found.value > 0.0) == ("location", SHIFT, True)
    assert [p.symbol for p in hy.acting_of(found)] == ["theta", "x_1", "x_2"]
    assert hy.slots_of(found)[0] == (slots.PLACE_HEADWAY, found.value)
    other = hy.forms(both, found)[-1]
    assert (other.regressor.fixed, other.value < 0.0) == ((), True)
    assert (other.z, other.p) == (-found.z, found.p)  # that it is there at all, the surest kind says
    assert hy.slots_of(other)[0] == (slots.PLACE, other.value)
    large = np.repeat([1.0, 100.0], BINS)  # a unit of headway does so much that what it takes of it is next to nothing
    small = replace(
        both, u=u * large, replicates=replicates * large, gram=gram * np.outer(large, large), part=both.part * large**2
    )
    assert hy.candidates(small)[0].regressor.fixed == ()
    assert all(form.regressor.fixed == () for form in hy.forms(small, hy.candidates(small)[0]))


def test_a_drift_over_the_whole_recording_is_told_from_a_part_of_it():
    along = (2.0 * np.arange(BINS) + 1.0) / BINS - 1.0
    for shift, is_drift in ((0.4 * along, True), (place(10, 20, 0.5), False)):
        seen = evidence(shift, 0.0)
        times = replace(seen, regressors=[replace(regressor, name="time_of_day") for regressor in seen.regressors])
        found = hy.candidates(times)[0]
        assert (found.regressor.fixed == ((slots.PERIOD_DRIFT, 1.0),)) is is_drift
        if is_drift:
            assert found.value == pytest.approx(0.4, abs=4 * found.error)
            assert found.error < 0.1
            assert dict(hy.slots_of(found)) == {
                slots.PERIOD_DRIFT: found.value, slots.PERIOD_BEGIN: 0.0, slots.PERIOD_END: BINS * WIDTH
            }  # fmt: skip


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_grows_along_the_whole_road_is_no_place(sign):
    found = hy.along_the_road(evidence(sign * np.linspace(-0.6, 0.6, BINS), 1.0))
    assert (found.regressor.low, found.regressor.high) == (0.0, BINS * WIDTH)
    assert found.value == pytest.approx(0.6 * sign, abs=4 * found.error)


@pytest.mark.parametrize("shift", [place(0, 20, -1.0), place(0, 8, 1.0), place(12, 30, -0.5), place(0, 40, 0.0)])
def test_a_place_and_chance_do_not_grow_along_the_whole_road(shift):
    assert all(hy.along_the_road(evidence(shift, absorbed)) is None for absorbed in (0.0, 1.0))


def test_of_a_recording_without_places_nothing_grows_along_the_road():
    seen = evidence(place(0, 40, 0.0), 0.0)
    assert hy.along_the_road(replace(seen, regressors=[Regressor("hysteresis")] * BINS)) is None


@pytest.mark.parametrize(
    ("falling", "others", "cannot_be"),
    [(-12.0, [-5.0], False), (-12.0, [-9.0], True), (-7.0, [], True), (-8.6, [], False), (8.0, [-9.0], False)],
)
def test_a_headway_that_falls_with_speed_cannot_be_unless_it_is_far_surer(falling, others, cannot_be):
    def seen(name: str, z: float) -> hy.Candidate:
        return hy.Candidate(name, 0.02 * z, 0.02, z, 1e-9, Regressor(name))

    name = "speed_dependent_headway"
    wrong = hy.impossible([seen(name, falling), seen("location", -20.0), *(seen("reaction_delay", z) for z in others)])
    assert (name in {one.name for one in wrong}) is cannot_be
    assert sum(one.name == "reaction_delay" for one in wrong) == len(others)


@pytest.mark.parametrize(("kind", "value", "large"), [((), 0.05, True), (((slots.PLACE_HEADWAY, 1.0),), 0.05, False),
                                                      (((slots.PLACE_HEADWAY, 1.0),), -0.07, True)])  # fmt: skip
def test_a_headway_at_a_place_must_be_larger_than_a_push(kind, value, large):
    one = hy.Candidate("location", value, 0.01, 6.0, 1e-9, Regressor("location", fixed=kind, low=0.0, high=100.0))
    assert one.large_enough is large


@pytest.mark.parametrize(("kind", "value", "large"), [((), 0.14, False), (((slots.COURTESY_BRAKING, 1.0),), 0.21, True),
                                                      (((slots.COURTESY_BRAKING, 1.0),), 0.18, False)])  # fmt: skip
def test_braking_before_a_lane_change_has_a_least_size_of_its_own(kind, value, large):
    one = hy.Candidate("courtesy_yielding", value, 0.01, 9.0, 1e-9, Regressor("courtesy_yielding", fixed=kind))
    assert one.large_enough is large
    assert [hy.slots_of(one)[0][0]] == [slots.COURTESY_BRAKING if kind else slots.COURTESY]


@pytest.mark.parametrize(("kind", "value", "large"), [((), 0.1, True), (((slots.LEADER_CLASS_DISTANCE, 1.0),), 0.9, False),
                                                      (((slots.LEADER_CLASS_DISTANCE, 1.0),), 1.1, True)])  # fmt: skip
def test_metres_behind_a_truck_have_a_least_size_of_their_own(kind, value, large):
    assert (
        hy.Candidate("leader_class", value, 0.01, 9.0, 1e-9, Regressor("leader_class", fixed=kind)).large_enough
        is large
    )


@pytest.mark.parametrize(("value", "large"), [(0.08, True), (0.06, False), (-0.06, False), (-0.08, True)])
def test_a_headway_that_changes_with_speed_has_one_least_size_for_both_signs(value, large):
    name = "speed_dependent_headway"
    assert hy.Candidate(name, value, 0.01, 9.0, 1e-9, Regressor(name)).large_enough is large


def test_a_place_that_stands_alone_has_one_form():
    seen = evidence(place(10, 20, -1.0), 0.0)
    assert len(hy.forms(seen, hy.candidates(seen)[0])) == 1


def test_every_recovery_of_a_relaxation_is_as_sure_as_the_surest():
    regressors = [regressor for regressor in SECANT_REGRESSORS if regressor.name == "lane_change_relaxation"]
    gram, best = np.diag([40.0, 60.0, 50.0, 50.0]), np.array([0.1, 0.6, 0.3, 0.4])
    u = np.tile(gram @ best / DRIVERS, (DRIVERS, 1)) + np.random.default_rng(0).standard_normal((DRIVERS, 4)) * 0.1
    seen = Evidence(
        regressors, u, np.zeros((3, 4)), gram, np.tile(np.diag(gram) / DRIVERS, (DRIVERS, 1)), np.arange(DRIVERS)
    )
    surest = hy.candidates(seen)[0]
    forms = hy.forms(seen, surest)
    assert [form.regressor.fixed for form in forms] == [regressor.fixed for regressor in regressors]
    assert {(form.z, form.p) for form in forms} == {(surest.z, surest.p)}
    assert forms[0].value < forms[2].value < forms[3].value < forms[1].value


def test_a_delay_is_tried_with_the_own_speed_late_and_known_each_at_the_size_that_agrees():
    sizes, known = (0.2, 0.4, 0.8, 0.3, 0.7), ((slots.OWN_SPEED_KNOWN, 1.0),)
    regressors = [
        Regressor("reaction_delay", s, ((slots.DELAY, s), *(known if n > 2 else ()))) for n, s in enumerate(sizes)
    ]
    count = len(regressors)
    gram, best = np.diag(np.full(count, 50.0)), np.array([0.25, 0.4, 0.3, 0.65, 0.75])
    u = np.tile(gram @ best / DRIVERS, (DRIVERS, 1)) + np.random.default_rng(0).standard_normal((DRIVERS, count)) * 0.05
    part = np.tile(np.diag(gram) / DRIVERS, (DRIVERS, 1))
    seen = Evidence(regressors, u, np.zeros((3, count)), gram, part, np.arange(DRIVERS))
    surest = hy.candidates(seen)[0]
    assert (slots.OWN_SPEED_KNOWN, 1.0) in surest.regressor.fixed
    assert surest.regressor.size == 0.7  # at 0.3 the estimate is far from the secant's size
    late, known = hy.forms(seen, surest)
    assert (len(late.regressor.fixed), late.regressor.size) == (1, 0.4)
    assert known == surest
    assert late.z == surest.z
    assert dict(hy.slots_of(known))[slots.OWN_SPEED_KNOWN] == 1.0


@pytest.mark.parametrize("surest", [2, 4])
def test_a_desired_speed_is_tried_in_its_lane_and_falling_over_all(surest):
    falls = Regressor("desired_speed", fixed=((slots.DESIRED_SPEED, 1.0), (slots.DESIRED_SPEED_ACROSS, 4.0)))
    regressors = [*(Regressor("desired_speed", lane=number) for number in (1, 2, 3, 4)), falls]
    best = np.full(5, -0.1)
    best[surest] = -0.3
    gram = np.diag(np.full(5, 400.0))
    u = np.tile(gram @ best / DRIVERS, (DRIVERS, 1)) + np.random.default_rng(0).standard_normal((DRIVERS, 5)) * 0.1
    part = np.tile(np.diag(gram) / DRIVERS, (DRIVERS, 1))
    seen = Evidence(regressors, u, np.zeros((3, 5)), gram, part, np.arange(DRIVERS))
    found = hy.candidates(seen)[0]
    assert found.regressor == regressors[surest]
    in_lane, over_all = hy.forms(seen, found)
    assert (in_lane.regressor.lane, over_all.regressor) == (3 if surest == 2 else in_lane.regressor.lane, falls)
    assert in_lane.z == over_all.z == found.z
    assert dict(hy.slots_of(over_all))[slots.DESIRED_SPEED_ACROSS] == 4.0
    assert dict(hy.slots_of(in_lane)) == {
        slots.DESIRED_SPEED: in_lane.value,
        slots.DESIRED_SPEED_LANE: in_lane.regressor.lane,
    }


def test_a_location_of_all_lanes_fills_all():
    found = hy.candidates(evidence(place(10, 20, -1.0), 0.0))[0]
    assert hy.lanes_of(found) == slice(None)


@pytest.mark.parametrize(
    ("value", "z", "is_large"), [(0.05, 6.0, False), (0.05, 8.0, True), (0.065, 5.0, True), (0.04, 12.0, False)]
)
def test_a_sure_headway_at_a_place_may_be_less_different(value, z, is_large):
    regressor = Regressor("location", fixed=((slots.PLACE_HEADWAY, 1.0),), low=100.0, high=200.0)
    assert hy.Candidate("location", value, value / z, z, 1e-9, regressor).large_enough is is_large


@pytest.mark.parametrize(("said_by", "drivers"), [(DRIVERS, DRIVERS), (4, 4), (1, 1)])
def test_a_place_rests_on_the_drivers_who_say_it(said_by, drivers):
    seen = evidence(np.zeros(BINS), 0.0)
    u = np.zeros_like(seen.u)
    u[:said_by, 10:20] = -1.0
    seen = replace(seen, u=u)
    found = replace(hy.candidates(seen)[0], regressor=Regressor("location", low=10 * WIDTH, high=20 * WIDTH))
    assert hy.effective_drivers(seen, found) == pytest.approx(drivers)


def test_who_says_the_contrary_does_not_count():
    seen = evidence(np.zeros(BINS), 0.0)
    u = np.zeros_like(seen.u)
    u[:10, 10:20], u[10:12, 10:20] = -1.0, 1.0
    seen = replace(seen, u=u)
    found = replace(hy.candidates(seen)[0], regressor=Regressor("location", low=10 * WIDTH, high=20 * WIDTH))
    assert hy.effective_drivers(seen, found) == pytest.approx(10.0)
