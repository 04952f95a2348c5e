import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from idm_sumo.models import idm
from idm_sumo.models.idm import LOWER, TEXTBOOK, UPPER, IDMParameters, acceleration, equilibrium_gap

V0 = 24.5872  # m/s, 55 mph

parameters = st.builds(
    IDMParameters, **{f: st.floats(getattr(LOWER, f), getattr(UPPER, f)) for f in IDMParameters._fields}
)
speeds = st.floats(0.0, 35.0)
approach_rates = st.floats(-15.0, 15.0)
gaps = st.floats(0.02, 300.0)


def textbook_acceleration(v, v_leader, s, p, v0):
    """Treiber and Kesting (2013), eqs. 11.14-11.15, with the ``s1`` of Treiber et al. (2000); no limits."""
    s_star = p.d0 + p.d1 * np.sqrt(v / v0) + np.maximum(0.0, v * p.T + v * (v - v_leader) / (2 * np.sqrt(p.a * p.b)))
    return p.a * (1 - np.power(v / v0, 4) - np.square(s_star / s))


@given(parameters, speeds, approach_rates, gaps)
def test_is_the_textbook_model_down_to_emergency_braking(p, v, dv, s):
    expected = max(textbook_acceleration(v, v - dv, s, p, V0), -idm.EMERGENCY_BRAKING)
    assert acceleration(v, dv, s, *p, V0) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_known_values():
    # By hand: at rest 5 m behind a standing car, 1 - (2/5)^2 = 0.84; of 0.73 m/s^2 that is 0.6132.
    assert acceleration(0.0, 0.0, 5.0, *TEXTBOOK, V0) == pytest.approx(0.6132, rel=1e-12)
    # v = 10, dv = 2, sqrt(ab) = 1, T = 1.5, d0 = 2, d1 = 4, v0 = 40: d* = 2 + 2 + 15 + 10 = 29.
    assert idm.desired_gap(10.0, 2.0, 0.5, 2.0, 1.5, 2.0, 4.0, 40.0) == pytest.approx(29.0, rel=1e-12)
    expected = 0.5 * (1 - 1 / 256 - 1 / 4)
    assert acceleration(10.0, 2.0, 58.0, 0.5, 2.0, 1.5, 2.0, 4.0, 40.0) == pytest.approx(expected, rel=1e-12)


@given(parameters, st.floats(0.0, 0.98))
def test_a_follower_at_its_equilibrium_gap_keeps_its_speed(p, share):
    gap = float(equilibrium_gap(share * V0, p, V0))
    assert acceleration(share * V0, 0.0, gap, *p, V0) == pytest.approx(0.0, abs=1e-10)


@given(parameters, speeds, approach_rates, gaps, gaps)
def test_more_gap_never_brakes_harder(p, v, dv, one, other):
    near, far = sorted((one, other))
    assert acceleration(v, dv, far, *p, V0) >= acceleration(v, dv, near, *p, V0)


@given(parameters, speeds, approach_rates, approach_rates, gaps)
def test_a_faster_approach_never_accelerates_more(p, v, one, other, s):
    slow, fast = sorted((one, other))
    assert acceleration(v, fast, s, *p, V0) <= acceleration(v, slow, s, *p, V0)


@given(parameters, speeds, approach_rates)
def test_no_leader_is_the_free_road(p, v, dv):
    free = max(p.a * (1 - (v / V0) ** 4), -idm.EMERGENCY_BRAKING)
    assert acceleration(v, dv, np.inf, *p, V0) == pytest.approx(free, rel=1e-12, abs=1e-12)
    assert acceleration(v, 0.0, 1e9, *p, V0) == pytest.approx(free, abs=1e-9)


@given(parameters, st.floats(1e-6, 20.0), approach_rates, st.one_of(gaps, st.just(np.inf)))
def test_above_the_desired_speed_everyone_slows_down(p, excess, dv, s):
    assert acceleration(V0 + excess, dv, s, *p, V0) < 0.0


@given(parameters, speeds, approach_rates, st.floats(-50.0, idm.SMALLEST_GAP))
def test_without_a_gap_there_is_emergency_braking(p, v, dv, s):
    assert acceleration(v, dv, s, *p, V0) == -idm.EMERGENCY_BRAKING


@given(parameters, speeds, approach_rates, st.floats(-5.0, 300.0))
def test_acceleration_stays_between_emergency_braking_and_a(p, v, dv, s):
    assert -idm.EMERGENCY_BRAKING <= acceleration(v, dv, s, *p, V0) <= p.a


@given(parameters, speeds, st.floats(0.0, 15.0), gaps)
def test_a_leader_that_pulls_away_never_makes_one_brake_harder_than_the_standing_gaps_do(p, v, pulling_away, s):
    # The printed d* without the maximum turns negative here, and its square would brake.
    assume(v > 0)
    standing = p.a * (1 - (v / V0) ** 4 - ((p.d0 + p.d1 * np.sqrt(v / V0) + p.T * v) / s) ** 2)
    assert acceleration(v, -pulling_away, s, *p, V0) >= max(standing, -idm.EMERGENCY_BRAKING) - 1e-9
