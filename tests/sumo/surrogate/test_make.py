"""The surrogate recording: NGSIM's layout, repeatable, physically possible."""

import io

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from idm_sumo.recordings.readers.layouts import OFFICIAL
from idm_sumo.roads.units import FOOT
from idm_sumo.roads.us101 import OFF_RAMP, ON_RAMP, US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.surrogate import make as surrogate
from idm_sumo.sumo.surrogate import noise as surrogate_noise
from idm_sumo.sumo.surrogate import traffic as surrogate_traffic

MINUTES, SEED = 3.0, 5
KEYS = ["period", "Vehicle_ID"]
OFFSETS = [1118846978900, 1118847842000, 1118848757000]  # Global_Time - 100 Frame_ID of the official files


@pytest.fixture(scope="module")
def table():
    return surrogate.surrogate_table(minutes=MINUTES, seed=SEED)


@pytest.fixture(scope="module")
def rows(table):
    """Return the table with period and strip.

    Lanes 6, 7 and 8 are one strip.
    """
    return table.assign(
        period=table["Global_Time"] - 100 * table["Frame_ID"],
        strip=table["Lane_ID"].clip(upper=6),
        gap=table["Space_Headway"],
    )


def test_layout_is_the_official_one(rows, table):
    assert tuple(table.columns) == OFFICIAL
    assert sorted(rows["period"].unique()) == OFFSETS
    assert not table.isna().any().any()
    assert not rows.duplicated([*KEYS, "Frame_ID"]).any()
    assert table["Frame_ID"].min() >= 1


def test_each_period_numbers_its_vehicles_from_one_in_order_of_appearance(rows):
    for _, period in rows.groupby("period"):
        first = period.groupby("Vehicle_ID")["Frame_ID"].min()
        assert first.index.tolist() == list(range(1, len(first) + 1))
        assert first.is_monotonic_increasing
        assert first.max() - first.min() <= MINUTES * 600 / 3


def test_vehicles_have_all_their_frames(rows):
    by_vehicle = rows.groupby(KEYS)
    assert (by_vehicle["Frame_ID"].diff().dropna() == 1).all()
    assert (by_vehicle["Frame_ID"].transform("size") == rows["Total_Frames"]).all()
    length_ft = US101.length / FOOT
    first, last = by_vehicle.first(), by_vehicle.last()
    on_ramp = first["Lane_ID"] == 7
    assert first.loc[~on_ramp, "Local_Y"].between(-5, 15).all()
    assert first.loc[on_ramp, "Local_Y"].between(495, ON_RAMP / FOOT).all()
    off_ramp = last["Lane_ID"] == 8
    assert last.loc[~off_ramp, "Local_Y"].between(length_ft - 15, length_ft + 5).all()
    assert last.loc[off_ramp, "Local_Y"].between(OFF_RAMP / FOOT, 1430).all()
    assert on_ramp.any()
    assert off_ramp.any()


def test_nobody_teleports(rows):
    by_vehicle = rows.groupby(KEYS)
    step, sideways = by_vehicle["Local_Y"].diff() * FOOT, by_vehicle["Local_X"].diff() * FOOT
    assert step.min() > -0.3  # noise may set a creeping car back a little
    assert step.max() < 4.0  # 40 m/s
    assert sideways.abs().max() < 0.5


def test_speed_and_acceleration_come_from_the_noisy_positions(rows):
    vehicle = rows[rows["Vehicle_ID"] == 10].groupby("period")
    for _, one in vehicle:
        speed = np.gradient(one["Local_Y"], 0.1)
        np.testing.assert_allclose(one["v_Vel"], np.maximum(speed, 0), atol=0.03)
    assert rows["v_Acc"].abs().max() <= 11.2
    assert (rows["v_Vel"] >= 0).all()


def test_lanes_are_where_the_lateral_positions_say(rows):
    inside = rows[rows["Lane_ID"] <= 5]
    computed = np.clip(inside["Local_X"] // 12 + 1, 1, 6)
    assert (computed == inside["Lane_ID"]).mean() > 0.97  # noise and lane changes blur the lines
    assert rows.loc[rows["Lane_ID"] == 6, "Local_Y"].between(570, 1285).all()
    assert set(rows["Lane_ID"]) == set(range(1, 9))


def test_preceding_is_the_next_ahead_in_the_lane(rows):
    named = rows[rows["Preceding"] > 0]
    other = rows[["period", "Frame_ID", "Vehicle_ID", "Local_Y", "strip", "Following"]]
    pairs = named.merge(
        other, left_on=["period", "Frame_ID", "Preceding"], right_on=["period", "Frame_ID", "Vehicle_ID"],
        suffixes=("", "_ahead"), how="left", validate="one_to_one",
    )  # fmt: skip
    assert pairs["Local_Y_ahead"].notna().all()
    assert (pairs["strip"] == pairs["strip_ahead"]).all()
    assert (pairs["Following_ahead"] == pairs["Vehicle_ID"]).all()
    np.testing.assert_allclose(pairs["Space_Headway"], pairs["Local_Y_ahead"] - pairs["Local_Y"], atol=0.006)
    moving = pairs[pairs["v_Vel"] > 5]
    np.testing.assert_allclose(moving["Time_Headway"], moving["Space_Headway"] / moving["v_Vel"], atol=0.006)
    # Nobody of the same period stands between: who follows is next behind in place.
    ordered = rows.sort_values(["period", "Frame_ID", "strip", "Local_Y"])
    same = (ordered[["period", "Frame_ID", "strip"]].shift(-1) == ordered[["period", "Frame_ID", "strip"]]).all(axis=1)
    between = same & (ordered["Preceding"] > 0)
    assert (ordered.loc[between, "Preceding"] == ordered["Vehicle_ID"].shift(-1)[between]).all()
    alone = rows[rows["Preceding"] == 0]
    assert (alone[["Space_Headway", "Time_Headway"]] == 0).all().all()


def test_traffic_is_dense_and_mixed(rows):
    vehicles = rows.groupby(KEYS).agg(
        kind=("v_Class", "first"), length=("v_Length", "first"), lanes=("strip", "nunique")
    )
    shares = vehicles["kind"].value_counts(normalize=True)
    assert shares[2] > 0.94
    assert 0.01 < shares[3] < 0.05
    assert 14 < vehicles.loc[vehicles["kind"] == 2, "length"].median() < 17
    assert (vehicles["lanes"] > 1).mean() > 0.15
    per_minute = len(vehicles) / MINUTES
    assert 110 < per_minute < 170  # the real recording had 2,169, 2,017 and 1,915 in 15 minutes
    assert 5 < rows["v_Vel"].mean() * FOOT < 18


def test_some_vehicles_are_motorcycles(table):
    other = surrogate.surrogate_table(minutes=MINUTES, seed=SEED + 1)
    assert set(table["v_Class"]) | set(other["v_Class"]) == {1, 2, 3}
    assert not table.head(1000).equals(other.head(1000))


def test_same_seed_same_bytes(table, tmp_path):
    again = tmp_path / "again.parquet"
    told = []
    surrogate.make_surrogate(again, minutes=MINUTES, seed=SEED, progress=lambda done, total: told.append(done / total))
    periods = [period for _, period in table.groupby(table["Global_Time"] - 100 * table["Frame_ID"])]
    surrogate.write_layout(periods, tmp_path / "first.parquet", ".parquet")
    assert again.read_bytes() == (tmp_path / "first.parquet").read_bytes()
    assert told == sorted(told)
    assert 0 < told[0] < 0.05
    assert told[-1] <= 1
    assert b"Not measured" in pq.read_schema(again).metadata[b"notice"]
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_text_and_csv_hold_the_same_rows(table, tmp_path):
    few = table.head(500)
    surrogate.write_layout([few], tmp_path / "us101.txt", ".txt")
    text = pd.read_csv(tmp_path / "us101.txt", sep=r"\s+", header=None, names=list(OFFICIAL))
    pd.testing.assert_frame_equal(text, few, check_dtype=False)
    assert '"' not in (tmp_path / "us101.txt").read_text()
    surrogate.write_layout([few], tmp_path / "us101.csv", ".csv")
    portal = pd.read_csv(io.StringIO((tmp_path / "us101.csv").read_text()))
    assert (portal.pop("Location") == "us-101").all()
    assert (portal.pop("Surrogate") == "not measured").all()
    pd.testing.assert_frame_equal(portal, few, check_dtype=False)


@pytest.mark.parametrize(("arguments", "message"), [({"minutes": 0.0}, "minutes = 0"), ({"seed": -1}, "seed = -1")])
def test_impossible_options_are_named_and_leave_nothing(arguments, message, tmp_path):
    with pytest.raises(InputError, match=message):
        surrogate.make_surrogate(tmp_path / "no.parquet", **arguments)
    assert list(tmp_path.iterdir()) == []


def test_noise_has_the_stated_size_and_correlation_time():
    rng = np.random.default_rng(0)
    noise = surrogate_noise._correlated(np.full(400, 300), 0.5, rng).reshape(400, 300)
    assert noise.std() == pytest.approx(1, abs=0.03)
    lag = np.mean(noise[:, 5:] * noise[:, :-5])  # 0.5 s: exp(-1/2)
    assert lag == pytest.approx(np.exp(-0.5), abs=0.04)
    assert abs(np.corrcoef(noise[0::2, -1], noise[1::2, 0])[0, 1]) < 0.25  # vehicles know nothing of each other


def test_frames_between_steps_are_of_constant_acceleration():
    t = surrogate_traffic.STEP * np.arange(6)
    steps = {
        "vehicle": np.zeros(6, int),
        "step": np.arange(6),
        "x": 3 * t + 0.7 * t**2,
        "y": -2 * t,
        "speed": 3 + 1.4 * t,
    }
    frames = surrogate_noise.between_steps(steps)
    time = frames["frame"] * 0.1
    np.testing.assert_allclose(frames["x"], 3 * time + 0.7 * time**2)
    np.testing.assert_allclose(frames["y"], -2 * time)
    assert np.diff(frames["frame"]).tolist() == [1] * (5 * surrogate_traffic.FRAMES_A_STEP - 1)


def test_a_car_that_stops_within_a_step_does_not_roll_back():
    steps = {
        "vehicle": np.zeros(2, int),
        "step": np.arange(2),
        "x": np.array([0, 0.1]),
        "y": np.zeros(2),
        "speed": np.array([1.0, 0]),
    }
    assert (np.diff(surrogate_noise.between_steps(steps)["x"]) >= 0).all()
