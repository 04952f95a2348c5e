"""Leader-follower pairs become followers that see their own leader and nobody else."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording, write_parquet
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_OF_RECORDED, Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.pairs import pair

FEET = 1 / FOOT
SHORT = Window(observed=2, horizon=20)


def in_feet(table: pd.DataFrame) -> pd.DataFrame:
    lengths = ["x_follower", "v_follower", "a_follower", "x_leader", "v_leader", "leader_length", "spacing"]
    return table.assign(**{name: table[name] * FEET for name in lengths if name in table})


def read(tmp_path, table: pd.DataFrame, name="pairs.parquet"):
    path = tmp_path / name
    table.to_csv(path, index=False) if path.suffix == ".csv" else table.to_parquet(path)
    return read_recording(path)


@pytest.mark.parametrize("name", ["pairs.parquet", "pairs.csv"])
@pytest.mark.parametrize(("convert", "unit"), [(in_feet, "feet"), (lambda table: table, "metres")])
def test_units_are_told_by_the_leaders_lengths(tmp_path, convert, unit, name) -> None:
    recording = read(tmp_path, convert(pair(12, 7)), name)
    assert unit in recording.notes[0]
    row = recording.table.iloc[0]
    assert (row[c.VEHICLE], row[c.LEADER], row[c.FRAME], row[c.PERIOD]) == (12, 7, 100, "0400-0415")
    np.testing.assert_allclose([row[c.X], row[c.HEADWAY], row[c.SPEED]], [50.0, 24.5, 8.15])
    assert recording.leader_lengths == {("0400-0415", 7): pytest.approx(4.5)}


def test_the_gap_is_the_recorded_one_and_no_other_pair_is_seen(tmp_path) -> None:
    # The second pair drives exactly between the first one's cars, at the same moments.
    table = in_feet(pd.concat([pair(12, 7, length=18.0), pair(31, 30, start=55.0, gap=3.0), pair(41, 40)]))
    recording = smooth(clean(read(tmp_path, table)))
    scenes = build_scenes(recording, SHORT)
    assert scenes.excluded.empty
    assert scenes.leader_source == LEADER_OF_RECORDED
    driven = drive_idm(scenes, (1.4, 1.8, 1.1, 2.0, 0.0))
    np.testing.assert_allclose(driven.gap[:, 0], [20.0, 3.0, 20.0], atol=0.01)
    assert (driven.leader != NOBODY).all()


def test_who_follows_in_one_pair_and_leads_another_has_its_length(tmp_path) -> None:
    recording = read(tmp_path, pd.concat([pair(12, 7), pair(7, 5, start=74.5, length=5.1), pair(9, 12, length=4.1)]))
    lengths = recording.table.groupby(c.VEHICLE)[c.LENGTH].first()
    assert lengths[7] == pytest.approx(4.5)
    assert lengths[12] == pytest.approx(4.1)
    assert np.isnan(lengths[9])


def test_a_follower_that_changes_leader_is_one_vehicle(tmp_path) -> None:
    second = pair(12, 8, gap=11.0, first=140, start=50 + 32 + 0.3 * np.sin(2.0))
    recording = read(tmp_path, pd.concat([pair(12, 7), second]))
    assert recording.vehicle_count == 1
    assert recording.table[c.LEADER].unique().tolist() == [7, 8]
    gap = recording.table[c.HEADWAY] - 4.5
    np.testing.assert_allclose(gap.iloc[[0, -1]], [20.0, 11.0])


def test_every_row_is_used_or_dropped_with_a_reason(tmp_path) -> None:
    table = pair(12, 7).reset_index(drop=True)
    table.loc[3, "x_leader"] = np.nan
    table.loc[5, ["x_leader", "spacing"]] = [40.0, -30.0]
    table.loc[7, "v_follower"] = 99.0
    result = read(tmp_path, pd.concat([table, table.iloc[[10]], pair(13, 7)]))
    account = result.accounting
    assert account.total == 81
    assert account.dropped == {
        "non-finite value": 1, "impossible speed or lane": 1, "leader not ahead": 1, "duplicate frame of a vehicle": 1,
    }  # fmt: skip
    assert account.used == len(result.table) == 77


def test_speed_and_spacing_may_be_absent(tmp_path) -> None:
    bare = pair(12, 7).drop(columns=["v_follower", "a_follower", "leader_length", "period"])
    recording = read(tmp_path, bare)
    assert recording.periods == ["recording"]
    np.testing.assert_allclose(recording.table[c.SPEED], pair(12, 7)["v_follower"], atol=0.01)
    assert recording.leader_lengths["recording", 7] == pytest.approx(4.5)


def test_periods_keep_the_order_of_their_clocks(tmp_path) -> None:
    table = pd.concat([pair(1, 2, period="0515-0530", first=20), pair(1, 2, period="0400-0415", first=900)])
    assert read(tmp_path, table).periods == ["0400-0415", "0515-0530"]


def test_smooth_pairs_are_left_alone_and_noisy_ones_are_smoothed(tmp_path) -> None:
    recording = read(tmp_path, pair(12, 7))
    assert recording.is_smooth
    assert smooth(recording) is recording
    table = pair(12, 7, frames=200)
    table["x_follower"] += np.random.default_rng(1).normal(0, 0.1, len(table))
    noisy = read(tmp_path, table.assign(x_leader=table["x_follower"] + 24.5))
    assert not noisy.is_smooth
    assert np.abs(smooth(noisy).table[c.X] - noisy.table[c.X]).median() > 0.03


def test_a_recording_of_pairs_is_kept_whole_in_a_file_of_ours(tmp_path) -> None:
    recording = read(tmp_path, pair(12, 7))
    write_parquet(recording, tmp_path / "kept.parquet")
    again = read_recording(tmp_path / "kept.parquet")
    pd.testing.assert_frame_equal(again.table, recording.table)
    assert (again.notes, again.is_smooth, again.has_leader_rows) == (recording.notes, True, False)
    assert again.leader_lengths == recording.leader_lengths


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.assign(leader_length=450.0, x_leader=t["x_follower"] + 470), "neither metres"),
        (lambda t: t.assign(t=t["t"] + 0.04), "no multiple of 0.1 s"),
        (lambda t: t.assign(spacing=t["spacing"] + 4.5), "spacing differs"),
        (lambda t: t.assign(v_follower=t["v_follower"] * FEET), "one unit"),
        (lambda t: t.assign(x_leader=np.nan), "no rows left of 40"),
    ],
)
def test_what_cannot_be_pairs_is_refused_in_one_line(tmp_path, change, words) -> None:
    with pytest.raises(InputError, match=words) as error:
        read(tmp_path, change(pair(12, 7)))
    assert str(error.value).startswith("pairs.parquet: ")
    assert "\n" not in str(error.value)


def test_the_reconstructed_pairs_of_i80(shared_data) -> None:
    path = shared_data / "i80_pairs_reconstructed.parquet"
    if not path.is_file():
        pytest.skip(f"needs {path}")
    result, raw = read_recording(path), pd.read_parquet(path)
    recording = result
    assert result.accounting.total == result.accounting.used == len(raw) == len(recording.table)
    assert "feet" in recording.notes[0]
    assert recording.is_smooth
    assert recording.table[c.X].max() < 1660 * FOOT  # the I-80 section is 503 m long
    scenes = build_scenes(clean(recording).of_period("0400-0415"), Window())
    first = (
        raw[raw["period"] == "0400-0415"]
        .sort_values(["follower", "t"])
        .drop_duplicates("follower")
        .set_index("follower")
    )
    driven = drive_idm(scenes, (1.4, 1.8, 1.1, 2.0, 0.0))
    at_start = raw.set_index(["period", "follower", raw["t"].round(1)])["spacing"]
    expected = [
        at_start["0400-0415", v, round(float(first.loc[v, "t"]) + 0.9, 1)] * FOOT for v in scenes.vehicle.tolist()
    ]
    np.testing.assert_allclose(driven.gap[:, 0], expected, atol=0.05)  # the leader's path alone is filtered
    assert (driven.leader != NOBODY).all()


@pytest.mark.parametrize(
    ("names", "kept"),
    [
        ({"t": "Time", "follower": "follower_id", "leader": "leader_id", "x_follower": "x_f", "x_leader": "x_l"}, ()),
        ({"t": "time (s)", "follower": "ID_FAV", "leader": "ID_LV", "x_follower": "Pos_FAV", "x_leader": "Pos_LV"}, ()),
        ({"v_follower": "follower_speed(m/s)", "spacing": "gap"}, ("t", "follower", "leader", "v_follower", "spacing")),
    ],
)
def test_names_that_people_use(tmp_path: Path, names: dict[str, str], kept: tuple[str, ...]) -> None:
    time = np.arange(0, 10, 0.1)
    table = pd.DataFrame({
        "follower": 2, "leader": 1, "t": time, "x_follower": 20.0 * time, "x_leader": 20.0 * time + 34.5,
        "leader_length": 4.5, "spacing": 30.0, "v_follower": 20.0,
    })  # fmt: skip
    table = table[list(kept) or list(table)].rename(columns=names)
    table.to_csv(tmp_path / "pairs.csv", index=False)
    recording = read_recording(tmp_path / "pairs.csv")
    np.testing.assert_allclose(recording.table[c.HEADWAY], 34.5)
    np.testing.assert_allclose(recording.table[c.SPEED], 20.0, atol=1e-6)
    table.to_parquet(tmp_path / "pairs.parquet")
    pd.testing.assert_frame_equal(read_recording(tmp_path / "pairs.parquet").table, recording.table)


def test_cases_without_vehicle_numbers_at_five_frames_a_second(tmp_path: Path) -> None:
    time = np.arange(0, 10, 0.2)
    case = pd.DataFrame({"time": time, "leader_position": 20.0 * time + 34.5, "follower_position": 20.0 * time,
                         "leader_length": 4.5})  # fmt: skip
    pd.concat([case.assign(case_id=7), case.assign(case_id=9)]).to_csv(tmp_path / "cases.csv", index=False)
    recording = read_recording(tmp_path / "cases.csv")
    assert recording.vehicle_count == 2
    np.testing.assert_allclose(recording.table[c.HEADWAY], 34.5)
    assert recording.accounting.added == {"interpolated to frames of 0.1 s": 2 * 49}
