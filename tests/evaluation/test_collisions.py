"""Who touches whom, and who is at fault: rectangles by separating axes, against plain geometry."""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from idm_sumo.evaluation.collisions import first_contacts, may_touch
from idm_sumo.evaluation.rectangles import overlap, rectangle, separation
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_constant_velocity, drive_idm
from tests.helpers.builders import Car, scenes, trajectories

STEPS = np.arange(21)
MIDDLE = float(US101.lane_center(3))

rectangles = st.tuples(
    st.floats(-12.0, 12.0), st.floats(-12.0, 12.0), st.floats(-3.2, 3.2), st.floats(0.5, 20.0), st.floats(0.5, 3.0)
)


def corners(front_x, front_y, heading, length, width):
    along, across = np.array([cos(heading), sin(heading)]), np.array([-sin(heading), cos(heading)])
    front = np.array([front_x, front_y])
    half = width / 2 * across
    return [front + half, front - length * along + half, front - length * along - half, front - half]


def common_area(one, other):
    """Clip one polygon by the edges of the other (Sutherland and Hodgman 1974) and return the area left."""
    left = corners(*one)
    clip = corners(*other)
    for start, end in zip(clip, clip[1:] + clip[:1], strict=True):
        inside = [(end[0] - start[0]) * (p[1] - start[1]) - (end[1] - start[1]) * (p[0] - start[0]) for p in left]
        cut = []
        for i, p in enumerate(left):
            before, now = inside[i - 1], inside[i]
            if (before < 0) != (now < 0):
                cut.append(left[i - 1] + (p - left[i - 1]) * before / (before - now))
            if now >= 0:
                cut.append(p)
        left = cut
    x, y = (np.array([p[i] for p in left]) for i in (0, 1))
    return 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) if len(left) > 2 else 0.0


def clearance(one, other):
    """Return the largest distance on the four edge normals: near 0 the answer hangs on rounding."""
    a, b = rectangle(*one), rectangle(*other)
    return max(separation(a, b, r[2], r[3]) for r in (a, b)), max(separation(a, b, -r[3], r[2]) for r in (a, b))


@given(rectangles, rectangles)
def test_whoever_overlaps_may_touch(one, other):
    if overlap(rectangle(*one), rectangle(*other)):
        assert may_touch(*one, *other)


def test_neighbours_on_their_lanes_need_no_sine():
    assert not may_touch(0.0, 0.0, 0.02, 5.0, 2.0, 1.0, 3.7, -0.03, 5.0, 2.0)
    assert not may_touch(0.0, 0.0, 0.02, 5.0, 2.0, 9.0, 0.1, -0.03, 5.0, 2.0)
    assert not may_touch(9.0, 0.0, 0.02, 5.0, 2.0, 0.0, 0.1, -0.03, 5.0, 2.0)


@given(rectangles, rectangles)
def test_overlap_is_a_common_area(one, other):
    assume(abs(max(clearance(one, other))) > 1e-6)
    assert overlap(rectangle(*one), rectangle(*other)) == (common_area(one, other) > 0.0)


@given(rectangles, rectangles, st.floats(-500.0, 500.0), st.floats(-3.2, 3.2))
def test_overlap_is_symmetric_and_does_not_depend_on_the_frame_of_reference(one, other, shift, turn):
    assume(abs(max(clearance(one, other))) > 1e-6)

    def moved(rect):
        x, y, heading, length, width = rect
        return (
            cos(turn) * x - sin(turn) * y + shift,
            sin(turn) * x + cos(turn) * y - shift,
            heading + turn,
            length,
            width,
        )

    expected = overlap(rectangle(*one), rectangle(*other))
    assert overlap(rectangle(*other), rectangle(*one)) == expected
    assert overlap(rectangle(*moved(one)), rectangle(*moved(other))) == expected


def test_cars_bumper_to_bumper_do_not_overlap():
    assert not overlap(rectangle(10.0, 0.0, 0.0, 4.0, 2.0), rectangle(6.0, 0.0, 0.0, 4.0, 2.0))
    assert overlap(rectangle(10.0, 0.0, 0.0, 4.0, 2.0), rectangle(6.001, 0.0, 0.0, 4.0, 2.0))


def contact(ego_path, *others, twin=None, **options):
    """Drive vehicle 1 (4 m by 2 m, otherwise at 10 m/s from x = 103) along ``ego_path`` among ``others``."""
    some = scenes(twin or Car(1, x=100.0), *others, **options)
    return first_contacts(some, trajectories(some, **ego_path)).iloc[0]


def cruise(speed):
    return {"x": 103.0 + speed * 0.1 * STEPS, "speed": np.full(21, speed)}


def test_running_into_the_car_ahead_is_our_fault():
    hit = contact(cruise(20.0), Car(2, x=113.5))  # 9.5 m apart at the start, closing at 10 m/s
    assert hit.to_dict() == {
        "collision": True, "at_fault": True, "contact_time_s": pytest.approx(1.0), "contact_with": 2,
        "contact_edge": "front",
    }  # fmt: skip


def test_first_contact_is_the_first_step_at_which_bumpers_cross():
    # Rear of 2 at 112 + k, our front at 103 + 2.5 k: apart at k = 6 exactly, inside from k = 7.
    assert contact(cruise(25.0), Car(2, x=113.0)).contact_time_s == pytest.approx(0.7)


def test_without_a_contact_nothing_is_reported():
    nothing = contact(cruise(10.0), Car(2, x=113.0), Car(3, x=100.0, lane=2), Car(4, x=90.0))
    assert nothing.contact_edge == ""
    assert not nothing.collision
    assert not nothing.at_fault
    assert nothing.contact_with == 0
    assert np.isnan(nothing.contact_time_s)


def test_being_struck_from_behind_is_not():
    hit = contact(cruise(2.0), Car(2, x=90.0, speed=15.0))
    assert (hit.collision, hit.at_fault, hit.contact_edge, hit.contact_with) == (True, False, "rear", 2)


def test_a_long_vehicle_is_struck_at_its_far_end():
    truck = Car(1, x=100.0, length=18.0)
    hit = contact(cruise(2.0), Car(2, x=70.0, speed=15.0), twin=truck)
    assert (hit.collision, hit.at_fault, hit.contact_edge) == (True, False, "rear")
    assert hit.contact_time_s == pytest.approx(0.9)  # rear at 85 + 0.2 k, the other at 74.5 + 1.5 k: 8.08 steps


def test_being_struck_from_behind_right_after_cutting_in_is():
    start, end = float(US101.lane_center(2)), MIDDLE
    sideways = np.clip(np.linspace(start, end, 11)[np.minimum(STEPS, 10)], end, start)
    twin = Car(1, x=100.0, lane=2)
    struck = {**cruise(5.0), "y": sideways}
    hit = contact(struck, Car(2, x=88.0, speed=15.0), twin=twin)
    assert (hit.at_fault, hit.contact_edge) == (True, "rear")
    later = contact(struck, Car(2, x=77.0, speed=15.0), twin=twin)  # had the time to see us
    assert (later.collision, later.at_fault, later.contact_edge) == (True, False, "rear")
    assert later.contact_time_s > hit.contact_time_s


def sidling(frames, from_lane, to_lane, seconds=1.5):
    """Return y and heading of a car at 10 m/s that changes lanes evenly."""
    start, end = US101.lane_center(from_lane), US101.lane_center(to_lane)
    share = np.clip(np.arange(frames) / (seconds / FRAME_STEP), 0.0, 1.0)
    y = start + (end - start) * share
    return y, np.where(share < 1, np.arcsin((end - start) / seconds / 10.0), 0.0)


@pytest.mark.parametrize("lane", [2, 4])
def test_being_overlapped_from_the_side_while_keeping_the_lane_is_not(lane):
    y, heading = sidling(40, lane, 3)
    hit = contact(cruise(10.0), Car(2, x=101.0, y=y, heading=heading))
    assert (hit.collision, hit.at_fault, hit.contact_edge) == (True, False, "side")


@pytest.mark.parametrize("lane", [2, 4])
def test_drifting_into_a_car_in_the_next_lane_is(lane):
    y, heading = sidling(21, 3, lane)
    hit = contact({**cruise(10.0), "y": y, "heading": heading}, Car(2, x=101.0, lane=lane))
    assert (hit.collision, hit.at_fault, hit.contact_edge) == (True, True, "side")


def test_sideways_the_faster_one_is_at_fault():
    slow, slow_heading = sidling(40, 4, 3, seconds=4.0)
    fast, fast_heading = sidling(40, 3, 4, seconds=2.0)
    ours = contact(
        {**cruise(10.0), "y": fast[:21], "heading": fast_heading[:21]}, Car(2, x=101.0, y=slow, heading=slow_heading)
    )
    assert (ours.at_fault, ours.contact_edge) == (True, "side")
    theirs, heading = sidling(40, 4, 3, seconds=2.0)
    own, own_heading = sidling(21, 3, 4, seconds=4.0)
    hit = contact({**cruise(10.0), "y": own, "heading": own_heading}, Car(2, x=101.0, y=theirs, heading=heading))
    assert (hit.collision, hit.at_fault, hit.contact_edge) == (True, False, "side")


def test_driving_into_the_rear_of_a_car_that_changed_lanes_is_only_after_a_reaction_time():
    y, heading = sidling(40, 2, 3)
    seen = contact(cruise(16.0), Car(2, x=114.0, y=y, heading=heading))
    assert (seen.at_fault, seen.contact_edge) == (True, "front")
    cut_in = contact(cruise(16.0), Car(2, x=110.5, y=y, heading=heading))
    assert (cut_in.collision, cut_in.at_fault, cut_in.contact_edge) == (True, False, "front")
    assert cut_in.contact_time_s < seen.contact_time_s


def test_a_fast_blow_from_the_front_is_not_taken_for_one_from_the_side():
    # 30 m/s against a standing car: 3 m a step, deeper lengthwise than across.
    hit = contact(cruise(30.0), Car(2, x=119.5, speed=0.0, y=np.full(40, MIDDLE + 1.5)))
    assert (hit.at_fault, hit.contact_edge) == (True, "front")


def test_the_recorded_twin_is_not_there():
    assert not contact(cruise(11.0)).collision


def test_an_overlap_at_the_start_counts_only_after_it_has_ended():
    beside = Car(2, x=100.0, y=np.full(40, MIDDLE + 1.9))
    assert not contact(cruise(10.0), beside).collision
    away_and_back = np.interp(np.arange(40), [0, 6, 10, 14], MIDDLE + np.array([1.9, 1.9, 2.5, 1.5]))
    heading = np.concatenate([[0.0], np.diff(away_and_back) / 1.0])
    hit = contact(cruise(10.0), beside._replace(y=away_and_back, heading=heading))
    assert (hit.collision, hit.at_fault, hit.contact_edge) == (True, False, "side")
    assert hit.contact_time_s > 0.7


def test_an_overlap_at_the_start_does_not_hide_another_contact():
    beside = Car(2, x=100.0, y=np.full(40, MIDDLE + 1.9))
    assert contact(cruise(20.0), beside, Car(3, x=113.0)).contact_with == 3


def test_the_first_contact_decides():
    slower = Car(3, x=109.0, speed=8.0)
    assert contact(cruise(12.0), slower).at_fault
    struck = contact(cruise(12.0), Car(2, x=84.0, speed=30.0), slower)
    assert (struck.contact_with, struck.at_fault) == (2, False)


def test_at_the_same_step_the_one_that_is_our_fault_is_taken():
    cars = Car(2, x=111.1, speed=5.0), Car(3, x=94.9, speed=15.0)  # each 2.1 m away and closing at 5 m/s
    for numbers in ((2, 3), (3, 2)):
        renumbered = [car._replace(vehicle=v) for car, v in zip(cars, numbers, strict=True)]
        hit = contact(cruise(10.0), *renumbered)
        assert (hit.at_fault, hit.contact_with) == (True, numbers[0])


def test_a_long_slanting_truck_is_found_two_lanes_away():
    # Its front is in lane 1, its rear, 0.6 m ahead of us, in ours.
    truck = Car(2, x=119.5, lane=1, length=20.0, width=2.5, heading=0.4)
    hit = contact(cruise(15.0), truck)
    assert (hit.contact_with, hit.at_fault, hit.contact_edge) == (2, True, "front")


def test_where_only_the_headway_is_known_the_twins_leader_can_be_hit():
    lone = scenes(Car(1, x=100.0, headway=np.full(40, 12.0)), has_leader_rows=False)
    hit = first_contacts(lone, trajectories(lone, **cruise(20.0))).iloc[0]
    assert (hit.at_fault, hit.contact_edge, hit.contact_with) == (True, "front", 0)
    expected = (12.0 - US101.car_length) / 10.0
    assert expected < hit.contact_time_s <= expected + 0.1


def test_blind_and_seeing_drivers_are_counted_alike():
    some = scenes(Car(1, x=100.0, speed=15.0), Car(2, x=115.0, speed=5.0))
    assert first_contacts(some, drive_constant_velocity(some)).at_fault.tolist() == [True]
    assert first_contacts(some, drive_idm(some, TEXTBOOK)).collision.tolist() == [False]


def test_recorded_drivers_do_not_collide(shared_data):
    recording = smooth(clean(read_recording(shared_data / "us101_scenes_smoothed.parquet")))
    for period in recording.periods:
        some = build_scenes(recording.of_period(period), Window(observed=10, horizon=100, every=50))
        assert len(some) > 10
        assert not first_contacts(some, trajectories(some)).collision.any()


@settings(max_examples=40)  # a recording each
@given(st.data())
def test_agrees_with_looking_at_every_pair_of_vehicles(data):
    n = data.draw(st.integers(1, 6))
    cars = [
        Car(i + 2, x=data.draw(st.floats(80.0, 130.0)), y=np.full(40, data.draw(st.floats(-0.98, -0.02)) * US101.width),
            speed=data.draw(st.floats(0.0, 20.0)), heading=data.draw(st.floats(-0.2, 0.2)),
            length=data.draw(st.floats(2.0, 18.0)))
        for i in range(n)
    ]  # fmt: skip
    some = scenes(Car(1, x=100.0), *cars)
    path = trajectories(some, heading=np.full(21, 0.05), y=MIDDLE + 0.05 * STEPS)
    found = first_contacts(some, path).iloc[0]
    first = None
    since_start = {car.vehicle for car in cars}
    for k in range(21):
        ego = (path.x[0, k], path.y[0, k], 0.05, 4.0, 2.0)
        hits = {
            car.vehicle for car in cars
            if common_area(ego, (car.x + car.speed * 0.1 * (3 + k), car.y[0], car.heading,
                                 car.length, car.width)) > 1e-12
        }  # fmt: skip
        if k and hits - since_start:
            first = k, hits - since_start
            break
        since_start &= hits
    assert found.collision == (first is not None)
    if first:
        assert found.contact_time_s == pytest.approx(0.1 * first[0])
        assert found.contact_with in first[1]
