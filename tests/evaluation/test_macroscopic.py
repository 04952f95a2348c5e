"""Edie's definitions, travel times, lane changes and waves, on traffic whose answer is known."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.evaluation import macroscopic as m
from idm_sumo.evaluation import waves
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.us101 import OFF_RAMP, ON_RAMP, US101
from tests.helpers.builders import Car, recording


def platoon(speed: float, spacing: float, seconds: float, lane: int = 3) -> list[Car]:
    """An endless row of equal cars, enough to fill the section all the time."""
    frames = round(seconds / FRAME_STEP)
    ahead = np.arange(-seconds * speed - spacing, US101.length, spacing)
    return [Car(n + 1, float(x), lane, speed, frames=frames) for n, x in enumerate(ahead)]


@given(speed=st.floats(2.0, 30.0), spacing=st.floats(8.0, 60.0))
def test_a_row_of_equal_cars_has_the_flow_and_density_of_its_spacing(speed: float, spacing: float) -> None:
    fields = m.edie(recording(*platoon(speed, spacing, 20.0)), segments=4, minutes=0.25)
    assert np.allclose(fields["speed_m_s"], speed)
    whole = fields.groupby(c.LANE)[["flow_veh_h", "density_veh_km"]].mean().loc[3]
    assert whole["density_veh_km"] == pytest.approx(1000.0 / spacing, rel=0.15)
    assert whole["flow_veh_h"] == pytest.approx(3600.0 * speed / spacing, rel=0.15)


@given(
    cars=st.lists(st.tuples(st.floats(0, 600), st.integers(1, 5), st.floats(0, 30)), min_size=1, max_size=12),
    segments=st.integers(1, 10),
    minutes=st.floats(0.02, 0.2),
)
def test_flow_is_density_times_speed_and_nothing_is_lost(
    cars: list[tuple[float, int, float]], segments: int, minutes: float
) -> None:
    some = recording(*(Car(n + 1, x, lane, v, frames=60) for n, (x, lane, v) in enumerate(cars)))
    fields = m.edie(some, segments=segments, minutes=minutes)
    assert np.allclose(fields["flow_veh_h"], 3.6 * fields["density_veh_km"] * fields["speed_m_s"])
    inside = some.table[c.X].between(0, US101.length).sum()
    assert fields["vehicle_seconds"].sum() == pytest.approx(0.1 * inside)


def test_the_auxiliary_lane_is_as_long_as_it_is() -> None:
    x = np.full(50, ON_RAMP + 10)
    car = Car(1, x, speed=0.0, y=np.full(50, float(US101.lane_center(6))), frames=50)
    table = recording(car).table.assign(**{c.LANE: np.int8(6)})
    whole = m.edie(recording(car).with_table(table), segments=1)
    assert whole["density_veh_km"].iloc[0] == pytest.approx(1000.0 / (OFF_RAMP - ON_RAMP))


def test_a_thin_recording_has_speeds_but_no_counts() -> None:
    fields = m.edie(recording(Car(1, speed=12.0), has_leader_rows=False))
    assert fields["flow_veh_h"].isna().all()
    assert fields["density_veh_km"].isna().all()
    assert np.allclose(fields["speed_m_s"], 12.0)


def test_speed_by_position_is_distance_by_time_not_the_mean_of_vehicles() -> None:
    fast, slow = Car(1, 0.0, 2, 16.0, frames=50), Car(2, 0.0, 4, 4.0, frames=100)
    first = m.speed_by_position(recording(fast, slow), bins=2).iloc[0]
    assert first["speed_m_s"] == pytest.approx((16.0 * 50 + 4.0 * 100) / 150)
    assert first["vehicles"] == 2


def test_travel_time_is_interpolated_and_needs_both_stations() -> None:
    through, starts_late = Car(1, 3.3, speed=20.0, frames=400), Car(2, 100.0, 1, 20.0, frames=400)
    found = m.travel_times(recording(through, starts_late))
    assert found[c.VEHICLE].tolist() == [1]
    assert found["travel_time_s"].iloc[0] == pytest.approx((600.0 - 25.0) / 20.0)


def lanes_of(*stays: tuple[int, int]) -> pd.DataFrame:
    y = np.concatenate([np.full(frames, float(US101.lane_center(lane))) for lane, frames in stays])
    return m.lane_changes(recording(Car(1, y=y, frames=len(y))))


def test_a_lane_change_counts_once_and_a_flicker_not_at_all() -> None:
    assert lanes_of((3, 30), (2, 30))["changes"].iloc[0] == 1
    assert lanes_of((3, 30), (2, 4), (3, 30))["changes"].iloc[0] == 0
    assert lanes_of((3, 30), (2, 3), (3, 3), (2, 30))["changes"].iloc[0] == 1
    assert lanes_of((3, 30), (2, 30))["km"].iloc[0] == pytest.approx(0.06)


def test_a_lane_change_has_its_place() -> None:
    lanes = np.repeat([2.0, 3.0], 60)
    changing = recording(Car(1, x=0.0, speed=10.0, y=US101.lane_center(lanes.astype(int)), frames=120))
    (found,) = m.lane_change_places(changing).itertuples()
    assert (found.before, found.after) == (2, 3)
    assert found.x == pytest.approx(60.0, abs=1.5)


def test_lane_changes_of_one_vehicle_are_not_those_of_the_next() -> None:
    found = m.lane_changes(recording(Car(1, lane=1), Car(2, lane=2)))
    assert found["changes"].tolist() == [0, 0]


@pytest.mark.parametrize("speed", [-3.0, -4.5, -6.0])
def test_a_known_wave_gives_its_speed(speed: float) -> None:
    x = (np.arange(32) + 0.5) * waves.CELL_LENGTH
    t = np.arange(900) * waves.CELL_TIME
    phase = t[None, :] - x[:, None] / speed
    field = 10.0 + 5.0 * np.sin(2 * np.pi * phase / 110.0) + 3.0 * np.sin(2 * np.pi * phase / 47.0 + 1.0)
    noise = np.random.default_rng(1).normal(0.0, 1.0, field.shape)
    found, correlation = waves.wave_of(field + noise)
    assert found == pytest.approx(speed, rel=0.03)
    assert correlation > 0.5


def test_what_moves_downstream_is_no_wave() -> None:
    x, t = (np.arange(32) + 0.5) * waves.CELL_LENGTH, np.arange(900) * waves.CELL_TIME
    forward = 15.0 + 3.0 * np.sin(2 * np.pi * (t[None, :] - x[:, None] / 15.0) / 120.0)
    assert np.isnan(waves.wave_of(forward)[0])


def test_noise_and_free_flow_have_no_wave() -> None:
    noise = np.random.default_rng(1).normal(15.0, 1.0, (32, 900))
    assert np.isnan(waves.wave_of(noise)[0])
    assert np.isnan(waves.wave_of(np.full((32, 900), 20.0))[0])


def test_a_thin_recording_has_no_wave_speed() -> None:
    assert waves.wave_speeds(recording(Car(1, frames=400)))["wave_speed_m_s"].isna().all()
