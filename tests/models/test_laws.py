"""Car-following laws: what each of them must do, and values computed by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.models import idm, laws
from idm_sumo.models.effects import NO_STIMULI, extended_acceleration, slots

OTHERS = range(1, len(laws.NAMES))
A, B, T, D0, V0 = 1.2, 1.8, 1.2, 2.0, 30.0
WEIGHT = idm.closing_weight(A, B)


def accelerate(law: int, speed: float, rate: float, gap: float) -> float:
    return float(laws.acceleration(law, speed, rate, gap, A, WEIGHT, T, D0, V0, laws.REACTION))


@pytest.mark.parametrize(
    "law", [laws.FULL_VELOCITY_DIFFERENCE, laws.KRAUSS, laws.OPTIMAL_VELOCITY, laws.GIPPS, laws.IMPROVED_IDM]
)
@pytest.mark.parametrize("speed", [5.0, 12.0, 20.0])
def test_at_the_time_headway_behind_a_leader_of_the_same_speed_nothing_changes(law, speed):
    assert accelerate(law, speed, 0.0, D0 + speed * T) == pytest.approx(0.0, abs=1e-9)


def test_values_by_hand():
    # (V - 10) a/4 - b/3, V = 18/1.2 = 15 m/s: 5 * 0.3 - 0.6 = 0.9
    assert accelerate(laws.FULL_VELOCITY_DIFFERENCE, 10.0, 1.0, 20.0) == pytest.approx(0.9)
    # V = 30 tanh(18/36) = 13.8635 m/s
    assert accelerate(laws.SMOOTH_VELOCITY_DIFFERENCE, 10.0, 1.0, 20.0) == pytest.approx(0.3 * 3.86351 - 0.6, abs=1e-5)
    # 9 + (10 - 2 - 10.8)/(19/3.6 + 1.2) = 8.56775 m/s
    assert accelerate(laws.KRAUSS, 10.0, 1.0, 10.0) == pytest.approx(8.56775 - 10.0, abs=1e-5)
    # tau = 0.8 s, b tau = 1.44 m/s: sqrt(1.44^2 + 1.8 (16 - 8) + 81) - 1.44 = 8.43287 m/s
    assert accelerate(laws.GIPPS, 10.0, 1.0, 10.0) == pytest.approx((8.43287 - 10.0) / 0.8, abs=1e-5)
    # Gipps at a third of the desired speed: 2.5 * 1.2 * 2/3 * sqrt(0.025 + 1/3)
    assert accelerate(laws.GIPPS, 10.0, 0.0, 1e6) == pytest.approx(1.19722, abs=1e-5)
    # d* = 2 + 12 + 10/(2 sqrt(2.16)) = 17.402 m; nearer: 1.2 (1 - 1.7402^2)
    assert accelerate(laws.IMPROVED_IDM, 10.0, 1.0, 10.0) == pytest.approx(1.2 * (1.0 - 1.74021**2), abs=1e-4)
    # f = 1.2 (1 - 1/81) = 1.185185; farther: f (1 - 0.870103^(2.4/f))
    assert accelerate(laws.IMPROVED_IDM, 10.0, 1.0, 20.0) == pytest.approx(1.185185 * (1.0 - 0.870103**2.025), abs=1e-4)
    # faster than wanted, far behind: -1.8 (1 - (30/33)^(4 1.2/1.8))
    assert accelerate(laws.IMPROVED_IDM, 33.0, 0.0, 1e4) == pytest.approx(-1.8 * (1.0 - (30 / 33) ** (8 / 3)), abs=1e-6)
    # V = 5 m/s
    assert accelerate(laws.OPTIMAL_VELOCITY, 6.0, 3.0, 8.0) == pytest.approx(-1.8)


@given(
    law=st.sampled_from(OTHERS), speed=st.floats(0.0, 35.0), rate=st.floats(-10.0, 10.0), gap=st.floats(0.1, 200.0),
    more=st.floats(0.01, 5.0),
)  # fmt: skip
def test_no_law_wants_less_with_more_room_or_more_when_closing_in_or_more_than_a(law, speed, rate, gap, more):
    now = accelerate(law, speed, rate, gap)
    assert now <= A + 1e-12
    assert accelerate(law, speed, rate, gap + more) >= now - 1e-12
    # Of a leader who stands one cannot know whether it might drive backwards.
    if law != laws.KRAUSS or speed - rate - more >= 0.0:
        assert accelerate(law, speed, rate + more, gap) <= now + 1e-12


@pytest.mark.parametrize("law", OTHERS)
def test_on_a_free_road_no_one_exceeds_the_desired_speed_or_stops_short_of_it(law):
    speed = 0.0
    for _ in range(4000):
        speed += 0.1 * accelerate(law, speed, 0.0, 1e9)
    assert speed == pytest.approx(V0, rel=0.02)


@pytest.mark.parametrize("law", range(len(laws.NAMES)))
def test_the_extended_acceleration_follows_the_law_of_its_magnitudes(law):
    m = np.zeros(slots.COUNT)
    m[slots.LAW] = law
    expected = (
        idm.acceleration(9.0, 0.5, 14.0, A, B, T, D0, 0.0, V0) if law == laws.IDM else accelerate(law, 9.0, 0.5, 14.0)
    )
    assert extended_acceleration(9.0, 0.5, 14.0, NO_STIMULI, (A, B, T, D0, 0.0), V0, m) == pytest.approx(
        expected, rel=1e-12
    )


def test_each_law_has_a_type_of_its_own():
    assert [len(laws.as_type(float(law))) for law in range(len(laws.NAMES))] == list(range(len(laws.NAMES)))
    assert len(laws.TITLES) == len(laws.NAMES)
