import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting, Ledger
from idm_sumo.recordings.readers.ngsim import to_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.units import FOOT
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from tests.helpers import ngsim_files


def convert(raw: pd.DataFrame) -> tuple[Recording, Accounting]:
    return to_recording(
        raw.astype(dict.fromkeys(raw.select_dtypes("number"), float)), Ledger(len(raw)), road=US101, source="inline"
    )


def test_feet_become_metres_and_the_axes_turn() -> None:
    rec, _ = convert(ngsim_files.table())
    row = rec.table.iloc[0]
    assert row[c.X] == pytest.approx(940 * FOOT)
    assert row[c.Y] == pytest.approx(-18.5 * FOOT)
    assert row[c.SPEED] == pytest.approx(40 * FOOT)
    assert row[c.ACCELERATION] == pytest.approx(0.5 * FOOT)
    assert row[c.LENGTH] == pytest.approx(14.5 * FOOT)
    assert row[c.WIDTH] == pytest.approx(4.9 * FOOT)
    assert row[c.TIME] == pytest.approx((ngsim_files.START + 1300) / 1000)
    assert (row[c.PERIOD], row[c.VEHICLE], row[c.FRAME], row[c.LANE], row[c.CLASS]) == ("0750-0805", 1, 13, 2, 2)


def test_no_leader_is_zero_and_nan() -> None:
    rec, _ = convert(ngsim_files.table())
    by_vehicle = rec.table.groupby(c.VEHICLE)[[c.LEADER, c.HEADWAY]].first()
    assert by_vehicle[c.LEADER].tolist() == [0, 1, 2]
    assert np.isnan(rec.table[c.HEADWAY].iloc[0])
    assert by_vehicle[c.HEADWAY].iloc[1] == pytest.approx(60 * FOOT)


def test_every_drop_has_its_reason() -> None:
    raw = ngsim_files.table(vehicles=4, frames=100)
    second = raw.iloc[[60]].assign(Local_X=19.0)  # the same vehicle and frame with another position
    raw = pd.concat([raw, raw.iloc[[5, 5]], second], ignore_index=True)
    raw.loc[7, "Local_Y"] = np.nan
    raw.loc[8, "v_Vel"] = np.inf
    raw.loc[9, "Lane_ID"] = 11
    rec, account = convert(raw)
    assert account.dropped == {
        "non-finite value": 2, "exact duplicate row": 2, "duplicate frame of a vehicle": 1,
        "impossible speed or lane": 1,
    }  # fmt: skip
    assert (account.total, account.used) == (403, 397)
    assert len(rec.table) == 397


def test_a_vehicle_without_any_row_left_is_counted() -> None:
    raw = ngsim_files.table()
    raw.loc[raw["Vehicle_ID"] == 2, "Local_X"] = np.nan
    assert convert(raw)[1].vehicles_dropped == {"no row left": 1}


def test_numbers_that_repeat_in_another_period_stay_apart() -> None:
    raw = pd.concat([ngsim_files.table(), ngsim_files.table(start=ngsim_files.LATER)], ignore_index=True)
    rec, account = convert(raw)
    assert rec.periods == ["0750-0805", "0805-0820"]
    assert (rec.vehicle_count, account.used) == (6, 180)


def test_missing_sizes_are_nan_and_said_so() -> None:
    rec, _ = convert(ngsim_files.table().drop(columns=["v_Length", "v_Width", "v_Class"]))
    assert rec.table[[c.LENGTH, c.WIDTH]].isna().all(axis=None)
    assert (rec.table[c.CLASS] == 0).all()
    assert "v_Length, v_Width, v_Class not recorded" in rec.notes


def test_a_dense_file_without_labels_gets_its_leaders_from_headways() -> None:
    rec, _ = convert(ngsim_files.table().drop(columns=["Preceding", "Lane_ID"]))
    assert rec.has_leader_rows
    assert rec.table.groupby(c.VEHICLE)[c.LEADER].first().tolist() == [0, 1, 2]
    assert (rec.table[c.LANE] == 2).all()
    assert any("leader is found from Space_Headway (100%" in note for note in rec.notes)


def test_a_thin_file_knows_its_leaders_by_headway_only() -> None:
    raw = ngsim_files.table(vehicles=6)
    thin = raw[raw["Vehicle_ID"].isin([2, 5])].drop(columns=["Preceding", "Lane_ID"])
    rec, _ = convert(thin)
    assert not rec.has_leader_rows
    assert (rec.table[c.LEADER] == 0).all()
    assert (rec.table[c.HEADWAY] == 60 * FOOT).all()


def test_scene_and_step_stand_in_for_clock_and_frame() -> None:
    raw = ngsim_files.table().drop(columns=["Global_Time", "v_Acc", "Space_Headway", "Preceding"])
    raw = raw.assign(scene="env_8", step=raw["Frame_ID"] - 13, period="")
    raw["Frame_ID"] = np.where(raw["Vehicle_ID"] == 1, raw["Frame_ID"], np.nan)
    rec, _ = convert(raw)
    assert rec.periods == ["env_8"]
    assert rec.table.groupby(c.VEHICLE)[c.FRAME].min().tolist() == [13, 0, 0]
    assert rec.has_leader_rows
    np.testing.assert_allclose(rec.table[c.ACCELERATION], 0.0, atol=1e-9)


def test_speed_is_found_from_positions_where_it_is_not_recorded() -> None:
    rec, _ = convert(ngsim_files.table().drop(columns=["v_Vel", "v_Acc"]))
    np.testing.assert_allclose(rec.table[c.SPEED], 40 * FOOT, atol=1e-6)


def test_lane_numbers_follow_the_painted_lanes_and_the_ramps() -> None:
    y = np.array([-7.0, -18.8, -30.2, -40.6, -52.8, -63.0, -66.0, -66.8]) * FOOT  # observed centres
    x = np.array([500, 500, 500, 500, 500, 900, 400, 1400]) * FOOT
    assert US101.lane_of(x, y).tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    assert US101.lane_of(np.full(5, 10.0), US101.lane_center(np.arange(1, 6))).tolist() == [1, 2, 3, 4, 5]


def metres(raw: pd.DataFrame) -> pd.DataFrame:
    lengths = ["Local_X", "Local_Y", "v_Length", "v_Width", "v_Vel", "v_Acc", "Space_Headway"]
    return raw.assign(**{name: raw[name] * FOOT for name in lengths if name in raw})


@pytest.mark.parametrize("missing", [[], ["Lane_ID"]])
def test_metres_are_recognised(missing: list[str]) -> None:
    with pytest.raises(InputError, match=r"inline: looks like metres.*feet"):
        convert(metres(ngsim_files.table()).drop(columns=missing))


def test_positions_in_metres_beside_speeds_in_feet_are_recognised() -> None:
    raw = ngsim_files.table()
    with pytest.raises(InputError, match=r"Local_Y advances 0\.30 times as fast as v_Vel"):
        convert(raw.assign(Local_Y=raw["Local_Y"] * FOOT))


def test_many_impossible_speeds_are_a_mistake_of_the_file() -> None:
    raw = ngsim_files.table()
    with pytest.raises(InputError, match=r"30 of 90 rows are impossible, first vehicle 2, frame 13: speed 2743.2 m/s"):
        convert(raw.assign(v_Vel=np.where(raw["Vehicle_ID"] == 2, 9000, 40.0)))


def test_nothing_usable_says_why() -> None:
    with pytest.raises(InputError, match=r"no rows left of 90 read .90 non-finite value."):
        convert(ngsim_files.table().assign(Local_X=np.nan))
