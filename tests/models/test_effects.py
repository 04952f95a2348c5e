"""Effects: without magnitude the plain IDM, with one the law that its file states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.models import idm, laws
from idm_sumo.models.effects import (
    BY_NAME,
    CATALOGUE,
    NO_STIMULI,
    Cause,
    ExtendedModel,
    Stimuli,
    extended_acceleration,
    format_quantity,
    slots,
)
from idm_sumo.models.effects.reaction_delay import REMEMBERED, acted_on, follow_another, recall
from idm_sumo.models.idm import IDMParameters
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError

DRIVER = (1.2, 1.8, 1.3, 2.0, 0.4)
LIMIT = 25.0
SEEN = Stimuli(
    x=100.0, t=50.0, leader_acceleration=0.8, leader_class=3.0, own_class=3.0, lane=2.0, second_gap=40.0,
    second_speed=9.0, adjacent_speed=6.0, rear_gap=5.0, jump=12.0, since_change=4.0, accepted_headway=0.6,
    until_cut_in=2.0,
    until_own_change=2.0, mean_speed=8.0, next_adjacent_speed=4.0, leader_acceleration_mean=0.2,
)  # fmt: skip

speeds = st.floats(0.0, 35.0)
rates = st.floats(-8.0, 8.0)
gaps = st.floats(0.0, 200.0)


def none() -> np.ndarray:
    return np.zeros(slots.COUNT)


def drive(m: np.ndarray, *, speed: float = 12.0, rate: float = 0.5, gap: float = 18.0, see: Stimuli = SEEN) -> float:
    return float(extended_acceleration(speed, rate, gap, see, DRIVER, LIMIT, m))


def only(name: str, **more: float) -> np.ndarray:
    m = none()
    values = {p.symbol: p.typical for p in BY_NAME[name].parameters} | more
    Cause(name, values).fill(m)
    return m


@given(speeds, rates, gaps, st.booleans())
def test_without_magnitudes_it_is_the_plain_idm_exactly(speed, rate, gap, sees):
    plain = idm.acceleration(speed, rate, gap, *DRIVER, LIMIT)
    assert drive(none(), speed=speed, rate=rate, gap=gap, see=SEEN if sees else NO_STIMULI) == plain


def test_without_a_leader_too():
    assert drive(none(), gap=np.inf, see=NO_STIMULI) == idm.acceleration(12.0, 0.5, np.inf, *DRIVER, LIMIT)


@pytest.mark.parametrize(
    ("name", "more", "sign"),
    [
        ("multi_leader_anticipation", {}, None),
        ("lane_change_relaxation", {}, +1),
        ("leader_class", {}, -1),
        ("speed_dependent_headway", {"v_mean": 5.0}, -1),
        ("hysteresis", {}, -1),
        ("adjacent_lane_friction", {}, -1),
        ("location", {"x_1": 50.0, "x_2": 150.0}, +1),
        ("time_of_day", {"t_1": 0.0, "t_2": 60.0}, -1),
        ("desired_speed", {"lane": 2.0}, +1),
        ("vehicle_class", {}, -1),
        ("memory", {}, -1),
        ("follower_pressure", {}, +1),
        ("courtesy_yielding", {}, -1),
        ("pre_insertion", {}, -1),
        ("perception_threshold", {"delta": 0.6}, +1),
    ],
)
def test_each_effect_changes_the_acceleration_in_its_own_sense(name, more, sign):
    change = drive(only(name, **more)) - drive(none())
    assert change != 0.0
    if sign is not None:
        assert np.sign(change) == sign


@pytest.mark.parametrize(
    "name",
    [e.name for e in CATALOGUE if e.parameters and e.required_stimuli and e.name not in ("location", "time_of_day")],
)
def test_whoever_does_not_see_is_not_moved(name):
    assert drive(only(name, lane=2.0) if name == "desired_speed" else only(name), see=NO_STIMULI) == drive(
        none(), see=NO_STIMULI
    )


@pytest.mark.parametrize(("lane", "share"), [(1.0, 0.0), (2.0, 1.0 / 3.0), (3.0, 2.0 / 3.0), (4.0, 1.0), (6.0, 1.0)])
def test_a_desired_speed_falls_from_the_leftmost_lane_to_the_rightmost(lane, share):
    m = only("desired_speed", delta=-0.3, n=4.0)
    slower = idm.acceleration(12.0, 0.5, 18.0, *DRIVER, LIMIT * (1.0 - 0.3 * share))
    assert drive(m, see=SEEN._replace(lane=lane)) == pytest.approx(slower)


@pytest.mark.parametrize(("of_next", "difference"), [(0.0, 12.0 - 6.0), (1.0, 12.0 - 4.0)])
def test_friction_is_beside_the_mean_of_a_lane_or_beside_its_next_vehicle(of_next, difference):
    m = only("adjacent_lane_friction", k=0.05, phi=of_next)
    assert drive(m) == pytest.approx(drive(none()) - 0.05 * difference)


@pytest.mark.parametrize(("of_late", "acceleration"), [(0.0, 0.8), (1.0, 0.2)])
def test_hysteresis_answers_the_leader_of_the_moment_or_of_late(of_late, acceleration):
    m = only("hysteresis", h=0.3, phi=of_late)
    longer = (*DRIVER[:2], DRIVER[2] * (1.0 + 0.3 * np.tanh(acceleration / 0.5)), *DRIVER[3:])
    assert drive(m) == pytest.approx(idm.acceleration(12.0, 0.5, 18.0, *longer, LIMIT))


@pytest.mark.parametrize(
    ("slot", "until"),
    [(slots.COURTESY_BRAKING, "until_cut_in"), (slots.PRE_INSERTION_BRAKING, "until_own_change")],
)
@pytest.mark.parametrize(("seconds", "less"), [(0.0, 0.2), (2.9, 0.2), (3.1, 0.0), (np.nan, 0.0)])
def test_who_brakes_before_a_lane_change_does_so_in_its_last_three_seconds(slot, until, seconds, less):
    m, see = none(), SEEN._replace(**{until: seconds})
    m[slot] = 0.2
    assert drive(m, see=see) == pytest.approx(drive(none(), see=see) - less)


@pytest.mark.parametrize(("kind", "more"), [(3.0, 2.5), (2.0, 0.0), (np.nan, 0.0)])
def test_behind_a_truck_the_jam_distance_may_be_longer(kind, more):
    m, see = none(), SEEN._replace(leader_class=kind)
    m[slots.LEADER_CLASS_DISTANCE] = 2.5
    longer = (*DRIVER[:3], DRIVER[3] + more, *DRIVER[4:])
    assert drive(m, see=see) == pytest.approx(idm.acceleration(12.0, 0.5, 18.0, *longer, LIMIT))


def test_a_place_ends():
    m = only("location", x_1=200.0, x_2=300.0)
    assert drive(m) == drive(none())


@given(speeds, rates, gaps, st.floats(0.0, 0.9))
def test_asymmetry_leaves_braking_alone(speed, rate, gap, share):
    plain = drive(none(), speed=speed, rate=rate, gap=gap)
    m = only("acceleration_asymmetry", gamma=share)
    expected = plain * (1.0 - share) if plain > 0 else plain
    assert drive(m, speed=speed, rate=rate, gap=gap) == pytest.approx(expected)


@given(st.floats(0.5, 30.0), st.floats(3.0, 80.0), st.floats(0.0, 0.9), st.sampled_from([0.0, 1.0]))
def test_anticipation_keeps_the_equilibrium_of_a_homogeneous_platoon(speed, gap, share, of_speed):
    see = SEEN._replace(second_gap=2.0 * gap, second_speed=speed)
    m = only("multi_leader_anticipation", w=share, phi=of_speed)
    plain = drive(none(), speed=speed, rate=0.0, gap=gap, see=see)
    assert drive(m, speed=speed, rate=0.0, gap=gap, see=see) == pytest.approx(plain, abs=1e-9)


@given(speeds, rates, gaps, st.floats(0.0, 0.9))
def test_anticipation_of_speeds_is_an_approach_to_the_mean_of_both_leaders(speed, rate, gap, share):
    m = only("multi_leader_anticipation", w=share, phi=1.0)
    both = (1.0 - share) * rate + share * (speed - SEEN.second_speed)
    expected = drive(none(), speed=speed, rate=both, gap=gap)
    assert drive(m, speed=speed, rate=rate, gap=gap) == pytest.approx(expected, abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(0.1, 2.0), st.sampled_from([0.0, 1.0]))
def test_a_dead_band_hides_small_rates_only_or_all_rates_by_as_much(rate, band, taken):
    m = only("perception_threshold", delta=band, phi=taken)
    seen = 0.0 if abs(rate) < band else rate - taken * np.sign(rate) * band
    assert drive(m, rate=rate) == drive(none(), rate=seen)


@given(st.floats(0.0, 1.4), st.integers(15, 29))
def test_the_past_is_recalled_linearly(delay, now):
    past = np.outer(np.arange(30.0), [1.0, -2.0, 3.0])
    assert recall(past, 2, now, delay, 0.1) == pytest.approx(3.0 * (now - delay / 0.1))


def test_what_was_before_the_past_is_its_first_row():
    past = np.arange(6.0).reshape(2, 3)
    assert recall(past, 1, 1, 5.0, 0.1) == 1.0


@given(st.floats(-10.0, 0.0))
def test_no_delay_reads_what_is_yet_to_come(delay):
    past = np.arange(6.0).reshape(2, 3)
    assert recall(past, 1, 0, delay, 0.1) == 1.0


@given(st.floats(8.0, 200.0) | st.just(np.inf), st.floats(8.0, 200.0) | st.just(np.inf), st.floats(0.0, 0.1))
def test_a_new_leader_is_answered_for_as_much_of_the_step_as_it_was_seen(before, now, delay):
    past = np.array([[before, 9.0, 0.0], [now, 9.0, 0.0]])
    m = none()
    m[[slots.DELAY, slots.OWN_SPEED_KNOWN]] = delay, 1.0
    gap, speed, rate = acted_on(past, 1, m, 0.1)
    one, other = (drive(none(), speed=9.0, rate=0.0, gap=each) for each in (before, now))
    unseen = delay / 0.1
    assert drive(none(), speed=speed, rate=rate, gap=gap) == pytest.approx(
        unseen * one + (1.0 - unseen) * other, abs=1e-6
    )


@given(st.integers(1, 14), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_own_speed_as_known_may_be_in_the_approach_rate(frames, known, share):
    speed, ahead = 3.0 + 0.1 * np.arange(30.0) ** 2 / 30.0, np.linspace(9.0, 4.0, 30)
    m = none()
    m[[slots.DELAY, slots.OWN_SPEED_KNOWN, slots.OWN_SPEED_IN_RATE]] = 0.1 * frames, known, share
    _, own, rate = acted_on(np.stack([np.full(30, 20.0), speed, speed - ahead], axis=1), 29, m, 0.1)
    assert own == pytest.approx(np.interp(29.0 - frames * (1.0 - known), np.arange(30.0), speed))
    late = speed[29 - frames]
    assert rate == pytest.approx(share * own + (1.0 - share) * late - ahead[29 - frames])


@given(st.floats(2.0, 20.0), st.floats(5.0, 60.0), st.integers(1, 29))
def test_a_new_leader_is_put_into_the_past_where_it_came_from(ahead, gap_now, now):
    speed = 0.3 + 0.2 * np.arange(30.0)
    x = np.concatenate([[0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))])
    gap, rate = np.full(30, 99.0), np.full(30, -9.0)
    gap[now], rate[now] = gap_now, speed[now] - ahead
    follow_another(gap, speed, rate, now, 0.1)
    rewritten = slice(max(now - REMEMBERED, 0), now)
    rear = x[now] + gap_now - ahead * 0.1 * (now - np.arange(30))
    np.testing.assert_allclose(gap[rewritten], (rear - x)[rewritten], atol=1e-9)
    np.testing.assert_allclose(rate[rewritten], speed[rewritten] - ahead, atol=1e-9)
    assert (gap[now + 1 :] == 99.0).all()
    assert (gap[: rewritten.start] == 99.0).all()


@given(st.floats(0.0, 30.0), st.floats(0.1, 1.0), st.floats(0.2, 3.0))
def test_an_accepted_headway_returns_to_the_drivers_own(since, share, accepted):
    m = only("lane_change_relaxation", kappa=share, tau_r=10.0, phi=1.0)
    see = SEEN._replace(since_change=since, accepted_headway=accepted)
    less = share * np.exp(-since / 10.0) * max(0.0, 1.4 - accepted)
    found = extended_acceleration(12.0, 0.5, 15.0, see, (1.2, 1.8, 1.4, 2.0, 0.0), 28.0, m)
    expected = extended_acceleration(12.0, 0.5, 15.0, see, (1.2, 1.8, 1.4 - less, 2.0, 0.0), 28.0, none())
    assert found == pytest.approx(expected, abs=1e-9)


@given(st.floats(0.0, 30.0), st.floats(0.1, 1.0), st.floats(0.2, 3.0), st.floats(0.0, 30.0))
def test_no_more_is_overlooked_than_the_gap_is_short_of_the_drivers_headway(since, share, accepted, speed):
    m = only("lane_change_relaxation", kappa=share, tau_r=10.0, chi=1.0)
    see = SEEN._replace(since_change=since, accepted_headway=accepted)
    overlooked = share * min(see.jump, speed * max(0.0, 1.4 - accepted)) * np.exp(-since / 10.0)
    found = extended_acceleration(speed, 0.5, 15.0, see, (1.2, 1.8, 1.4, 2.0, 0.0), 28.0, m)
    expected = extended_acceleration(speed, 0.5, 15.0 + overlooked, see, (1.2, 1.8, 1.4, 2.0, 0.0), 28.0, none())
    assert found == pytest.approx(expected, abs=1e-9)


def test_a_change_to_a_longer_gap_leaves_the_headway_as_it_is():
    m, see = only("lane_change_relaxation", kappa=1.0, tau_r=10.0, phi=1.0), SEEN._replace(jump=0.0)
    given_up = extended_acceleration(12.0, 0.5, 15.0, see, (1.2, 1.8, 1.4, 2.0, 0.0), 28.0, m)
    assert given_up == extended_acceleration(12.0, 0.5, 15.0, see, (1.2, 1.8, 1.4, 2.0, 0.0), 28.0, none())


def test_every_magnitude_has_a_slot_of_its_own():
    used = [p.slot for e in CATALOGUE for p in e.all_parameters]
    assert sorted([*used, slots.LAW, slots.REACTION_CHANGE]) == list(range(slots.COUNT))
    assert all(p.lower <= p.typical <= p.upper for e in CATALOGUE for p in e.all_parameters)


@given(speeds, rates, gaps, st.lists(st.floats(-1.0, 1.0), min_size=slots.COUNT, max_size=slots.COUNT))
def test_what_surroundings_do_is_by_their_magnitudes_alone(speed, rate, gap, sizes):
    m = np.array(sizes)
    m[[slots.LAW, *slots.OF_SURROUNDINGS]] = 0.0
    others = SEEN._replace(**{name: 1.0 for name in Stimuli._fields if name not in ("x", "rear_gap", "second_gap")})
    assert drive(m, speed=speed, rate=rate, gap=gap, see=others) == drive(m, speed=speed, rate=rate, gap=gap)


@pytest.mark.parametrize("slot", slots.OF_SURROUNDINGS)
def test_each_magnitude_of_surroundings_depends_on_them(slot):
    m = none()
    m[[slots.RELAXATION_TIME, slots.DESIRED_SPEED_LANE, slots.PERIOD_BEGIN, slots.PERIOD_END]] = (
        5.0,
        SEEN.lane,
        40.0,
        70.0,
    )
    m[slot] = 0.4
    elsewhere = Stimuli(*(-100.0 for _ in Stimuli._fields))._replace(second_gap=90.0)
    assert drive(m, see=elsewhere) - drive(none(), see=elsewhere) != pytest.approx(drive(m) - drive(none()))


@given(st.floats(0.0, 100.0), st.floats(-0.5, 1.0))
def test_a_place_where_the_headway_is_another(x, share):
    m, see = none(), SEEN._replace(x=x)
    Cause("location", {"theta": share, "x_1": 30.0, "x_2": 60.0}).fill(m)
    there = 1.4 * (1.0 + share) if 30.0 <= x < 60.0 else 1.4
    found = extended_acceleration(12.0, 0.5, 15.0, see, (1.2, 1.8, 1.4, 2.0, 0.0), 28.0, m)
    assert found == pytest.approx(
        extended_acceleration(12.0, 0.5, 15.0, see, (1.2, 1.8, there, 2.0, 0.0), 28.0, none())
    )


def test_confusable_names_are_in_the_catalogue():
    assert {n for e in CATALOGUE for n in e.confusable_with} <= set(BY_NAME)


def test_a_model_survives_its_file(tmp_path):
    model = ExtendedModel(
        IDMParameters(1.1, 1.7, 1.2, 2.0, 0.0), 27.0,
        (Cause("reaction_delay", {"tau": 0.4, "eta": 1.0, "zeta": 0.0, "xi": 0.0}),
            Cause("location", {"alpha": -0.1, "x_1": 200.0, "x_2": 350.0}, (2, 3))), "here",
    )  # fmt: skip
    model.write(tmp_path / "model.json")
    back = ExtendedModel.read(tmp_path / "model.json")
    assert back == model
    assert back.magnitudes(1)[slots.PLACE] == 0.0
    assert back.magnitudes(2)[slots.PLACE] == -0.1
    assert back.magnitudes()[slots.DELAY] == 0.4
    assert list(tmp_path.iterdir()) == [tmp_path / "model.json"]


def test_a_cause_of_some_drivers_survives_its_file_and_the_others_are_without_it():
    late, place = (
        Cause("reaction_delay", {"tau": 0.8}, share=0.4),
        Cause("location", {"alpha": -0.1, "x_1": 2.0, "x_2": 9.0}),
    )
    model = ExtendedModel.from_json(
        ExtendedModel(IDMParameters(1.1, 1.7, 1.2, 2.0, 0.0), US101.speed_limit, causes=(late, place)).to_json()
    )
    assert model.causes[0].share == model.share == 0.4
    assert [cause.name for cause in model.without_partial_causes().causes] == ["location"]
    assert model.without_partial_causes().share == 1.0
    assert model.has_partial_causes(np.arange(1000)).mean() == pytest.approx(0.4, abs=0.01)
    assert model.without_partial_causes().has_partial_causes(np.arange(1000)).all()
    for share in ("0", "1.2", "NaN"):
        with pytest.raises(InputError, match=r"reaction_delay.*share"):
            ExtendedModel.from_json(model.to_json().replace('"share": 0.4', f'"share": {share}'))


def test_a_model_of_another_law_survives_its_file_and_an_older_file_is_an_idm(tmp_path):
    model = ExtendedModel(
        IDMParameters(1.1, 1.7, 1.2, 2.0, 0.0), 27.0, (Cause("reaction_delay", {"tau": 0.4}),), "here", "krauss", 0.8
    )
    model.write(tmp_path / "model.json")
    back = ExtendedModel.read(tmp_path / "model.json")
    assert back.law == "krauss"
    assert not back.is_idm
    assert (back.magnitudes_by_lane(8)[:, slots.LAW] == laws.KRAUSS).all()
    assert back.magnitudes()[slots.REACTION_CHANGE] == pytest.approx(-0.2)
    older = model.to_json().replace('  "law": "krauss",\n  "reaction": 0.8,\n', "")
    assert older != model.to_json()
    assert ExtendedModel.from_json(older).is_idm
    with pytest.raises(InputError, match="reaction"):
        ExtendedModel.from_json(model.to_json().replace('"reaction": 0.8', '"reaction": 0'))


@given(st.floats(-50.0, 500.0), st.floats(-0.7, 0.7))
def test_a_headway_drifts_from_one_time_to_the_other_and_stays_there(t, share):
    factor = np.interp(t, [100.0, 400.0], [1.0 - share, 1.0 + share])
    m = only("time_of_day", delta=share, t_1=100.0, t_2=400.0)
    expected = idm.acceleration(12.0, 0.5, 20.0, DRIVER[0], DRIVER[1], DRIVER[2] * factor, *DRIVER[3:], LIMIT)
    assert drive(m, speed=12.0, rate=0.5, gap=20.0, see=SEEN._replace(t=t)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("cause", "usual", "instead"),
    [
        (Cause("time_of_day", {"delta": 0.2, "t_1": 0.0, "t_2": 420.0}), slots.PERIOD, slots.PERIOD_DRIFT),
        (Cause("location", {"theta": 0.2, "x_1": 200.0, "x_2": 350.0}), slots.PLACE, slots.PLACE_HEADWAY),
        (Cause("leader_class", {"ell": 0.2}), slots.LEADER_CLASS, slots.LEADER_CLASS_DISTANCE),
        (Cause("courtesy_yielding", {"beta": 0.2}), slots.COURTESY, slots.COURTESY_BRAKING),
        (Cause("pre_insertion", {"beta": 0.2}), slots.PRE_INSERTION, slots.PRE_INSERTION_BRAKING),
    ],
)
def test_the_other_kind_of_an_effect_survives_its_file(cause, usual, instead, tmp_path):
    ExtendedModel(IDMParameters(1.1, 1.7, 1.2, 2.0, 0.0), 27.0, (cause,), "here").write(tmp_path / "model.json")
    back = ExtendedModel.read(tmp_path / "model.json")
    assert back.causes == (cause,)
    assert (back.magnitudes()[usual], back.magnitudes()[instead]) == (0.0, 0.2)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        '{"format": "other"}',
        ExtendedModel(IDMParameters(1, 1, 1, 1, 0), US101.speed_limit)
        .to_json()
        .replace("[]", '[{"name": "ghost", "parameters": {}}]'),
        ExtendedModel(IDMParameters(1, 1, 1, 1, 0), US101.speed_limit, law="krauss")
        .to_json()
        .replace("krauss", "ghost"),
    ],
)
def test_what_is_no_model_is_refused_in_one_line(text, tmp_path):
    (tmp_path / "m.json").write_text(text)
    with pytest.raises(InputError) as caught:
        ExtendedModel.read(tmp_path / "m.json")
    assert "\n" not in str(caught.value)
    assert "m.json" in str(caught.value)


@pytest.mark.parametrize("tau", [-0.1, 3.0, float("nan")])
def test_a_size_out_of_bounds_is_refused_with_its_bounds(tau, tmp_path):
    ExtendedModel(
        IDMParameters(1, 1, 1, 1, 0), US101.speed_limit, causes=(Cause("reaction_delay", {"tau": tau}),)
    ).write(tmp_path / "m.json")
    with pytest.raises(InputError, match=r"m\.json: cause 'reaction_delay': tau = .* s; give it from 0 to 1\.5"):
        ExtendedModel.read(tmp_path / "m.json")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("speed_dependent_headway", "0.329 per 10 m/s"),
        ("adjacent_lane_friction", "0.329 1/s"),
        ("leader_class", "0.329"),
    ],
)
def test_numbers_are_said_with_their_unit(name: str, said: str) -> None:
    assert format_quantity(0.3291, BY_NAME[name].parameters[0].unit) == said
