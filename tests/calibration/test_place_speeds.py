"""Desired speeds by place: what drivers want whom no leader holds up, and nothing from the others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.calibration.place_speeds import FEWEST, INTERVAL, place_speeds
from idm_sumo.models.idm import TEXTBOOK, IDMParameters, equilibrium_gap
from tests.helpers.builders import Car, recording

ENDS = np.array([200.0, 640.0])
SLOW = 12.0  # m/s


def alone(vehicle: int, speed: float, x: float, first_frame: int = 1) -> Car:
    """A driver without a leader in its lane and moment, for three seconds."""
    return Car(vehicle, x, 1 + vehicle % 5, speed, first_frame=first_frame + 40 * (vehicle // 5), frames=30)


def test_drivers_alone_drive_what_they_want_at_each_place() -> None:
    cars = [alone(n, SLOW, 20.0) for n in range(1, 26)] + [alone(100 + n, 20.0, 300.0) for n in range(1, 26)]
    found = place_speeds(recording(*cars), TEXTBOOK, ENDS)
    assert found.speeds[0] == pytest.approx([SLOW, 20.0])
    assert found.at(np.array([50.0, 500.0]), 3.0) == pytest.approx([SLOW, 20.0])


@given(wanted=st.floats(10.0, 22.0), share=st.floats(0.85, 0.99))
def test_followers_in_equilibrium_tell_a_desired_speed_that_they_do_not_reach(wanted: float, share: float) -> None:
    driver = IDMParameters(1.0, 1.5, 1.2, 2.0, 0.0)
    speed = share * wanted
    gap = float(equilibrium_gap(speed, driver, wanted))
    # Of three in a row the first is far ahead: all follow in equilibrium but it, who drives what it wants.
    cars = [Car(10 * n + k, 20.0 + k * (gap + 4.0), 2, speed, first_frame=60 * n, frames=20)
            for n in range(1, FEWEST + 1) for k in range(3)]  # fmt: skip
    assert place_speeds(recording(*cars), driver, np.array([2000.0])).speeds[0, 0] == pytest.approx(wanted)


def test_who_is_held_up_by_its_leader_tells_nothing() -> None:
    cars = [Car(2 * n + k, 20.0 + 9.0 * k, 1 + n % 5, 5.0, first_frame=1 + 60 * (n // 5), frames=40)
            for n in range(1, 30) for k in (0, 1)]  # fmt: skip
    leaders = 29
    found = place_speeds(recording(*cars), TEXTBOOK, ENDS)
    assert found.speeds[0, 0] == pytest.approx(5.0)  # of the leaders alone, who want it
    few = place_speeds(recording(*cars[: 2 * (FEWEST - 1)]), TEXTBOOK, ENDS)
    assert leaders > FEWEST
    assert np.isinf(few.speeds).all()


def test_intervals_without_free_drivers_are_interpolated_and_the_limit_is_no_finding() -> None:
    later = round(2.6 * INTERVAL / 0.1)
    cars = [alone(n, SLOW, 20.0) for n in range(1, 26)]
    cars += [alone(200 + n, SLOW + 4.0, 20.0, first_frame=later) for n in range(1, 26)]
    cars += [alone(500 + n, 30.0, 300.0) for n in range(1, 26)]
    found = place_speeds(recording(*cars), TEXTBOOK, ENDS)
    assert found.speeds[:, 0] == pytest.approx([SLOW, SLOW + 2.0, SLOW + 4.0])
    assert np.isinf(found.speeds[:, 1]).all()
    assert found.at(np.full(4, 50.0), INTERVAL * np.array([0.0, 0.5, 1.0, 9.0])) == pytest.approx(
        [SLOW, SLOW, SLOW + 1.0, SLOW + 4.0]
    )
    assert np.isinf(found.at(np.array([500.0]), 10.0)).all()


def test_a_short_remainder_belongs_to_the_last_interval() -> None:
    later = round(1.1 * INTERVAL / 0.1)
    cars = [alone(n, SLOW, 20.0) for n in range(1, 26)]
    cars += [alone(25 + n, 2.0, 20.0, first_frame=later) for n in range(1, 6)]
    assert place_speeds(recording(*cars), TEXTBOOK, ENDS).speeds[:, 0] == pytest.approx([SLOW])
