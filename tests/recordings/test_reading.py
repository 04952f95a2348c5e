import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.reading import read_recording, write_parquet
from idm_sumo.roads import US101
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.errors import InputError
from tests.helpers import ngsim_files
from tests.helpers.builders import Car, recording
from tests.helpers.ngsim_files import official, portal


def refused(path: Path, message: str, **how: Any) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_recording(path, **how)
    assert "\n" not in str(caught.value)
    assert path.name in str(caught.value)


def test_route_files_say_nothing_about_a_file_that_is_no_fcd(tmp_path: Path) -> None:
    routes = tmp_path / "a.rou.xml"
    routes.write_text('<routes><vType id="car" length="4.5"/></routes>')
    path = official(tmp_path / "trajectories.txt", ngsim_files.table())
    refused(path, r"trajectories.txt: is no SUMO floating car data.*a\.rou\.xml.*--route-files", route_files=[routes])


@pytest.mark.parametrize("blank", [" ", "      ", "\t", " \t "])
def test_official_text(tmp_path: Path, blank: str) -> None:
    result = read_recording(official(tmp_path / "trajectories.txt", ngsim_files.table(), blank))
    assert (result.accounting.total, result.accounting.used, result.accounting.vehicles) == (90, 90, 3)
    assert result.periods == ["0750-0805"]
    assert result.table[c.X].iloc[0] == pytest.approx(940 * FOOT)


def test_blanks_at_both_ends_and_windows_line_ends_do_not_matter(tmp_path: Path) -> None:
    path = official(tmp_path / "a.txt", ngsim_files.table())
    plain = read_recording(path).table
    path.write_bytes(b"".join(b"   " + line + b"  \r\n" for line in path.read_bytes().splitlines()) + b"\r\n")
    pd.testing.assert_frame_equal(read_recording(path).table, plain)


def test_all_layouts_of_one_table_give_one_recording(tmp_path: Path) -> None:
    raw = ngsim_files.table(vehicles=4)
    expected = read_recording(official(tmp_path / "a.txt", raw)).table
    raw.to_parquet(tmp_path / "a.parquet")
    raw.rename(columns=str.lower).astype(str).to_parquet(tmp_path / "text.parquet")
    portal(tmp_path / "a.csv", raw)
    portal(tmp_path / "bom.csv", raw, encoding="utf-8-sig")
    portal(tmp_path / "lower.csv", raw.rename(columns={"v_Vel": "V_VEL", "Frame_ID": "frame_id"}))
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress((tmp_path / "a.csv").read_bytes()))
    (tmp_path / "named-wrongly.csv").write_bytes((tmp_path / "a.txt").read_bytes())
    for name in ("a.parquet", "text.parquet", "a.csv", "bom.csv", "lower.csv", "a.csv.gz", "named-wrongly.csv"):
        pd.testing.assert_frame_equal(read_recording(tmp_path / name).table, expected, obj=name)


def test_portal_keeps_one_location_and_two_periods(tmp_path: Path) -> None:
    raw = pd.concat([
        ngsim_files.table().assign(Location="us-101"),
        ngsim_files.table(vehicles=2).assign(Location="i-80"),
        ngsim_files.table(start=ngsim_files.LATER).assign(Location="us-101"),
    ])  # fmt: skip
    path = portal(tmp_path / "portal.csv", raw)
    result = read_recording(path)
    assert result.accounting.dropped == {"other location": 60}
    assert (result.accounting.total, result.accounting.used) == (240, 180)
    assert result.periods == ["0750-0805", "0805-0820"]
    assert read_recording(path, location="I-80").vehicle_count == 2
    refused(path, "no row is of location 'lankershim'; the file has i-80, us-101", location="lankershim")


def test_global_time_may_be_written_as_a_float(tmp_path: Path) -> None:
    raw = ngsim_files.table().assign(Location="us-101")
    raw["Global_Time"] = raw["Global_Time"].map("{:.1f}".format)
    raw.to_csv(tmp_path / "f.csv", index=False)
    assert read_recording(tmp_path / "f.csv").periods == ["0750-0805"]


def test_own_parquet_comes_back_as_it_was(tmp_path: Path) -> None:
    rec = recording(Car(1, headway=12.0), Car(2), has_leader_rows=False).with_table(recording(Car(1)).table, "a note")
    write_parquet(rec, tmp_path / "deep" / "rec.parquet")
    back = read_recording(tmp_path / "deep" / "rec.parquet")
    pd.testing.assert_frame_equal(back.table, rec.table)
    assert (back.notes, back.has_leader_rows) == (("a note",), False)
    assert back.source == rec.source
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["rec.parquet"]


@pytest.mark.parametrize("partitioned", [False, True])
def test_a_folder_of_parquet_parts_is_one_recording(tmp_path: Path, partitioned: bool) -> None:
    raw = pd.concat([ngsim_files.table(), ngsim_files.table(start=ngsim_files.LATER)])
    raw["period"] = np.repeat(["0750-0805", "0805-0820"], 90)
    if partitioned:
        raw.to_parquet(tmp_path / "d", partition_cols=["period"])
    else:
        (tmp_path / "d").mkdir()
        for period, part in raw.groupby("period"):
            part.to_parquet(tmp_path / "d" / f"{period}.parquet")
    (tmp_path / "d" / "README.md").write_text("not data")
    result = read_recording(tmp_path / "d")
    assert (result.accounting.used, result.periods) == (180, ["0750-0805", "0805-0820"])


def test_write_where_one_cannot(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file, not a folder"):
        write_parquet(recording(Car(1)), tmp_path / "file" / "rec.parquet")
    (tmp_path / "taken.parquet").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        write_parquet(recording(Car(1)), tmp_path / "taken.parquet")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "taken.parquet"]


def test_no_file_no_content_no_folder(tmp_path: Path) -> None:
    refused(tmp_path / "absent.txt", "absent.txt: no such file")
    for name in ("empty.txt", "empty.csv", "blank.txt"):
        (tmp_path / name).write_text("\n \n" if name == "blank.txt" else "")
        refused(tmp_path / name, f"{name}: the file is empty")
    refused(tmp_path, "is a folder without Parquet files")


def damaged(path: Path, row: int, old: str, new: str) -> Path:
    """Change one row (counted from 1) of a file."""
    lines = path.read_text().splitlines(keepends=True)
    assert old in lines[row - 1]
    lines[row - 1] = lines[row - 1].replace(old, new, 1)
    path.write_text("".join(lines))
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("18.5", "abc", "row 57, column Local_X: 'abc' is not a number"),
        ("18.5", "18,5", "row 57, column Local_X: '18,5' is not a number"),
        ("18.5", "", "row 57 has 17 columns where 18 are needed"),
        ("18.5", "18.5 9", "row 57 has 19 columns where 18 are needed"),
    ],
)
def test_a_bad_row_of_official_text_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    refused(damaged(official(tmp_path / "bad.txt", ngsim_files.table()), 57, old, new), message)


@pytest.mark.parametrize("row", [1, 90])
def test_first_and_last_row_are_checked_too(tmp_path: Path, row: int) -> None:
    path = official(tmp_path / "bad.txt", ngsim_files.table())
    refused(damaged(path, row, "18.5", "x"), f"row {row}, column Local_X: 'x' is not a number")


def test_text_cut_short_is_named(tmp_path: Path) -> None:
    path = official(tmp_path / "cut.txt", ngsim_files.table())
    path.write_text(path.read_text()[:-60])
    refused(path, r"row 90 has \d+ columns where 18 are needed.*cut short")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (",18.5,", ",left,", "row 57, column Local_X: 'left' is not a number"),
        (",us-101", "", "row 57 has 19 columns where 20 are needed"),
        (",us-101", ",us-101,9", "row 57 has 21 columns where 20 are needed"),
    ],
)
def test_a_bad_row_of_portal_csv_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    refused(damaged(portal(tmp_path / "bad.csv", ngsim_files.table()), 57, old, new), message)


def test_text_in_a_parquet_is_named(tmp_path: Path) -> None:
    raw = ngsim_files.table().astype({"Local_X": object})
    raw["Local_X"] = raw["Local_X"].map(str)
    raw.loc[41, "Local_X"] = "n/a?"
    raw.to_parquet(tmp_path / "bad.parquet")
    refused(tmp_path / "bad.parquet", "row 42, column Local_X: 'n/a.' is not a number")


@pytest.mark.parametrize(("mark", "point"), [(";", "."), (";", ","), ("|", "."), ("\t", "."), ("\t", ",")])
def test_other_delimiters_and_decimal_commas_give_the_same_values(tmp_path: Path, mark: str, point: str) -> None:
    ngsim_files.table().to_csv(tmp_path / "commas.csv", index=False)
    ngsim_files.table().to_csv(tmp_path / "other.csv", index=False, sep=mark, decimal=point)
    expected = read_recording(tmp_path / "commas.csv").table
    pd.testing.assert_frame_equal(read_recording(tmp_path / "other.csv").table, expected)


@pytest.mark.parametrize("mark", [";", ",", "\t"])
def test_official_text_apart_by_a_delimiter(tmp_path: Path, mark: str) -> None:
    expected = read_recording(official(tmp_path / "blanks.txt", ngsim_files.table())).table
    other = official(tmp_path / "other.txt", ngsim_files.table(), mark)
    pd.testing.assert_frame_equal(read_recording(other).table, expected)


def test_a_header_apart_by_blanks(tmp_path: Path) -> None:
    ngsim_files.table().to_csv(tmp_path / "commas.csv", index=False)
    ngsim_files.table().to_csv(tmp_path / "blanks.txt", index=False, sep=" ")
    expected = read_recording(tmp_path / "commas.csv").table
    pd.testing.assert_frame_equal(read_recording(tmp_path / "blanks.txt").table, expected)


@pytest.mark.parametrize("ending", [".gz", ".xz", ".bz2"])
def test_packed_files_give_the_same_values(tmp_path: Path, ending: str) -> None:
    ngsim_files.table().to_csv(tmp_path / "plain.csv", index=False)
    ngsim_files.table().to_csv(tmp_path / f"packed.csv{ending}", index=False)
    expected = read_recording(tmp_path / "plain.csv").table
    pd.testing.assert_frame_equal(read_recording(tmp_path / f"packed.csv{ending}").table, expected)


def test_lanes_of_another_road_make_a_straight_one(tmp_path: Path) -> None:
    table = ngsim_files.table()
    lane = table["Vehicle_ID"]
    table = table.assign(Lane_ID=lane, Local_X=10.5 * lane - 5.0, Local_Y=table["Local_Y"] + 2500.0)
    table.to_csv(tmp_path / "other.csv", index=False)
    recording = read_recording(tmp_path / "other.csv")
    assert recording.road.main_lanes == 3
    np.testing.assert_allclose(recording.road.widths, 10.5 * FOOT)
    assert any("a straight road of the recorded lanes is taken" in note for note in recording.notes)
    with pytest.raises(InputError, match="another road"):
        read_recording(tmp_path / "other.csv", road=US101)


def test_an_unknown_layout_names_what_it_has_and_needs(tmp_path: Path) -> None:
    other = pd.DataFrame({"follower": [1], "leader": [2], "spacing": [3.0]})
    other.to_parquet(tmp_path / "pairs.parquet")
    other.to_csv(tmp_path / "pairs.csv", index=False)
    for name in ("pairs.parquet", "pairs.csv"):
        refused(
            tmp_path / name,
            r"unknown layout .found follower, leader, spacing.; "
            r"nearest is pairs: column t, x_follower, x_leader missing",
        )


def test_a_header_without_rows(tmp_path: Path) -> None:
    ngsim_files.table().head(0).to_csv(tmp_path / "none.csv", index=False)
    refused(tmp_path / "none.csv", "no rows")
    ngsim_files.table().head(0).to_parquet(tmp_path / "none.parquet")
    refused(tmp_path / "none.parquet", "no rows")


def test_damaged_containers(tmp_path: Path) -> None:
    ngsim_files.table().to_parquet(tmp_path / "good.parquet")
    whole = (tmp_path / "good.parquet").read_bytes()
    (tmp_path / "cut.parquet").write_bytes(whole[: len(whole) // 2])
    refused(tmp_path / "cut.parquet", "is no whole Parquet file")
    middle = whole[:200] + bytes(255 - b for b in whole[200:400]) + whole[400:]
    (tmp_path / "bits.parquet").write_bytes(middle)
    refused(tmp_path / "bits.parquet", "is no whole Parquet file")
    (tmp_path / "text.parquet").write_text("hello there")
    refused(tmp_path / "text.parquet", "is no whole Parquet file")
    packed = gzip.compress(portal(tmp_path / "a.csv", ngsim_files.table(vehicles=40, frames=200)).read_bytes())
    (tmp_path / "cut.csv.gz").write_bytes(packed[: len(packed) // 2])
    refused(tmp_path / "cut.csv.gz", "cut.csv.gz")
    (tmp_path / "bits.csv.gz").write_bytes(packed[:100] + bytes(100) + packed[200:])
    refused(tmp_path / "bits.csv.gz", "bits.csv.gz")
    (tmp_path / "a.zip").write_bytes(b"PK\x03\x04" + bytes(100))
    refused(tmp_path / "a.zip", "unpack it first")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    refused(tmp_path / "picture.png", "is not a text file")
    (tmp_path / "utf16.csv").write_text((tmp_path / "a.csv").read_text(), encoding="utf-16")
    refused(tmp_path / "utf16.csv", "save it as UTF-8")


def test_own_parquet_without_a_column_or_with_an_impossible_value(tmp_path: Path) -> None:
    table = recording(Car(1)).table
    table.drop(columns=c.HEADING).to_parquet(tmp_path / "short.parquet")
    refused(tmp_path / "short.parquet", "column 'heading' is missing")
    table.assign(speed=99.0).to_parquet(tmp_path / "fast.parquet")
    refused(tmp_path / "fast.parquet", "speed = 99.0 is impossible")


def test_metres_are_refused(tmp_path: Path) -> None:
    raw = ngsim_files.table()
    for name in ("Local_X", "Local_Y", "v_Vel"):
        raw[name] = (raw[name] * FOOT).round(3)
    refused(official(tmp_path / "m.txt", raw), "looks like metres: lanes are 3.8 wide")


def test_the_real_subset(shared_data: Path) -> None:
    result = read_recording(shared_data / "us101_raw_subset.parquet")
    rec = result
    assert (result.accounting.total, result.accounting.used, rec.vehicle_count) == (179_319, 179_319, 322)
    assert rec.periods == ["0750-0805", "0805-0820", "0820-0835"]
    speeds = rec.table.groupby(c.PERIOD, observed=True)[c.SPEED].mean()
    assert speeds.tolist() == pytest.approx([11.6, 8.5, 7.2], abs=0.05)
    assert not rec.has_leader_rows


def test_the_real_subset_without_its_labels_falls_into_the_same_periods(shared_data: Path, tmp_path: Path) -> None:
    raw = pd.read_parquet(shared_data / "us101_raw_subset.parquet")
    raw.drop(columns="period").to_parquet(tmp_path / "raw.parquet")
    labels = read_recording(tmp_path / "raw.parquet").table[c.PERIOD].value_counts().to_dict()
    assert labels == raw["period"].value_counts().to_dict()


def test_the_real_scenes(shared_data: Path) -> None:
    rec = read_recording(shared_data / "us101_scenes_smoothed.parquet")
    assert (sorted(rec.periods), rec.vehicle_count) == (["env_320", "env_8", "env_888"], 55)
    assert rec.has_leader_rows
    assert rec.table[c.LANE].max() == 8
    assert rec.table[c.LENGTH].notna().all()
