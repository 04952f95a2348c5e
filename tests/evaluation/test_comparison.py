"""Distances between distributions, and recordings held against the first."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import ks_2samp, wasserstein_distance

from idm_sumo.evaluation.comparison import compare, geh, matched_periods
from idm_sumo.evaluation.distances import Sample, distance
from idm_sumo.evaluation.traffic_measures import following
from idm_sumo.recordings import columns as c
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from tests.helpers.builders import Car, recording


def sample(values: np.ndarray, vehicles: int = 20) -> Sample:
    return Sample(np.asarray(values, dtype=float), np.arange(len(values)) % vehicles)


@given(shift=st.floats(0.0, 5.0), seed=st.integers(0, 100))
def test_distances_agree_with_scipy_on_the_values_themselves(shift: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = rng.gamma(4.0, 3.0, 400), rng.gamma(4.0, 3.0, 300) + shift
    found = distance(sample(one), sample(other), upper=100.0, rng=rng, resamples=20)
    assert found.wasserstein == pytest.approx(wasserstein_distance(one, other), abs=0.25)
    assert found.ks == pytest.approx(ks_2samp(one, other).statistic, abs=0.03)


def test_the_interval_is_wider_where_vehicles_differ_more_than_their_rows() -> None:
    rng = np.random.default_rng(3)
    level, vehicle = rng.normal(20.0, 4.0, 30), np.repeat(np.arange(30), 50)
    values = level[vehicle] + rng.normal(0.0, 0.2, 1500)
    other = sample(rng.normal(25.0, 4.0, 1500), 1500)
    clustered = distance(Sample(values, vehicle), other, upper=60.0, rng=rng)
    as_if_free = distance(Sample(values, np.arange(1500)), other, upper=60.0, rng=rng)
    width = clustered.wasserstein_high - clustered.wasserstein_low
    assert width > 3 * (as_if_free.wasserstein_high - as_if_free.wasserstein_low)
    assert clustered.wasserstein_low < clustered.wasserstein < clustered.wasserstein_high


def test_an_empty_sample_has_no_distance() -> None:
    nothing = Sample(np.empty(0), np.empty(0, dtype=np.int64))
    assert np.isnan(distance(nothing, nothing, upper=1.0, rng=np.random.default_rng(1))).all()


def test_gaps_are_bumper_to_bumper_and_headways_front_to_front() -> None:
    rows = following(recording(Car(1, 0.0, speed=10.0), Car(2, 25.0, speed=10.0, length=5.0)))
    own = rows[rows[c.VEHICLE] == 1]
    assert np.allclose(own["gap_m"], 20.0)
    assert np.allclose(own["time_headway_s"], 2.5)
    assert rows[rows[c.VEHICLE] == 2]["gap_m"].isna().all()


def test_a_thin_recording_takes_gaps_from_its_headways() -> None:
    rows = following(recording(Car(1, headway=20.0), has_leader_rows=False))
    assert np.allclose(rows["gap_m"], 20.0 - US101.car_length)


def platoon(spacing: float, speed: float = 10.0) -> list[Car]:
    return [Car(n + 1, -900.0 + spacing * n, 3, speed, frames=900) for n in range(int(1500 / spacing))]


def test_a_recording_is_as_near_to_itself_as_can_be_and_another_one_farther() -> None:
    near = recording(*platoon(20.0))
    found = compare({"a": near, "same": near, "b": recording(*platoon(26.0))}, resamples=20)
    by_name = found.summary.set_index("recording")
    assert by_name.loc["same", "gap_wasserstein_m"] == 0.0
    assert by_name.loc["same", ["speed_rmse_m_s", "flow_rmse_veh_h", "density_rmse_veh_km"]].eq(0.0).all()
    assert by_name.loc["same", "geh_below_5_share"] == 1.0
    assert by_name.loc["b", "gap_wasserstein_m"] == pytest.approx(6.0, abs=0.3)
    assert by_name.loc["b", "density_rmse_veh_km"] > 5.0
    assert np.isnan(by_name.loc["a", "gap_wasserstein_m"])
    assert by_name.loc["a", "travel_time_s"] == pytest.approx(57.5)


def test_the_same_seed_gives_the_same_table() -> None:
    both = {"a": recording(*platoon(20.0)), "b": recording(*platoon(26.0))}
    assert compare(both, seed=5, resamples=30).summary.equals(compare(both, seed=5, resamples=30).summary)


def test_what_a_thin_recording_cannot_tell_is_said() -> None:
    thin = recording(Car(1, frames=100), Car(2, 50.0, frames=100), has_leader_rows=False)
    found = compare({"thin": thin, "whole": recording(*platoon(20.0))}, resamples=5)
    assert found.summary[["flow_veh_h", "density_veh_km"]].iloc[0].isna().all()
    assert np.isnan(found.summary["flow_rmse_veh_h"].iloc[1])
    assert any("flow, density and counts" in note for note in found.notes)


def test_periods_match_by_label_or_else_by_order() -> None:
    assert matched_periods(["a", "b", "c"], ["b", "c"]) == [("b", "b"), ("c", "c")]
    assert matched_periods(["a", "b", "c"], ["x", "y"]) == [("a", "x"), ("b", "y")]


def test_one_recording_cannot_be_compared() -> None:
    with pytest.raises(InputError, match="two recordings"):
        compare({"a": recording(Car(1))})


def test_the_geh_has_the_value_of_a_hand_calculation_and_none_where_nobody_drives() -> None:
    assert geh([100.0, 0.0], [120.0, 0.0]) == pytest.approx([np.sqrt(2.0 * 400.0 / 220.0), 0.0])
    assert geh(500.0, 700.0) == geh(700.0, 500.0)
