"""Many recordings through the command line: one data set, resumed by content, that loses nothing."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from analysis.many.dataset import as_folder, as_label
from analysis.many.plan import digest, is_one, recordings_of
from idm_sumo.cli import main
from idm_sumo.runtime import ownership
from tests.helpers.platoons import platoon_recording

WINDOW = ("--observed", "10", "--horizon", "40")


def write(path: Path, *, seed: int, periods: int = 1) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    platoon_recording(periods=periods, platoons=2, seed=seed).to_parquet(path)
    return path


def command(*words: object) -> int:
    """Run a command; return its exit code."""
    try:
        main([str(word) for word in words])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def rows_of(out: Path) -> pd.DataFrame:
    return pd.read_csv(out / "_recordings.csv").set_index("file")


def state(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def made(made_once: Callable[..., Path]) -> Path:
    """Two recordings of one name, one of them of two periods, and a file that is none; calibrated."""

    def make(folder: Path) -> None:
        write(folder / "in" / "a" / "r.parquet", seed=1)
        write(folder / "in" / "b" / "r.parquet", seed=2, periods=2)
        (folder / "in" / "bad.csv").write_text("x,y\n1,2\n")
        assert command("calibrate", folder / "in", *WINDOW, "-o", folder / "out") == 2

    return made_once("many-recordings", make)


@pytest.fixture
def place(made: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(made, tmp_path / "many"))


def test_all_is_one_data_set_by_recording_and_period(made: Path) -> None:
    whole = pd.read_parquet(made / "out")
    assert len(whole) == 12 + 24
    assert whole.groupby(["recording", "period"], observed=True).size().to_list() == [12, 12, 12]
    assert whole["recording"].str.startswith("r-").all()
    name = rows_of(made / "out").loc[str(made / "in/a/r.parquet"), "recording"]
    assert command("calibrate", made / "in/a/r.parquet", *WINDOW, "-o", (made / "alone.parquet")) == 0
    alone, part = pd.read_parquet(made / "alone.parquet"), whole[whole["recording"] == name]
    pd.testing.assert_frame_equal(
        part[list(alone)].reset_index(drop=True), alone, check_dtype=False, check_categorical=False
    )


def test_a_recording_that_fails_is_a_row_with_its_reason(made: Path) -> None:
    rows = rows_of(made / "out")
    assert rows["status"].tolist() == ["done", "done", "failed"]
    assert "unknown layout" in rows.loc[str(made / "in/bad.csv"), "reason"]
    assert rows["drivers"].tolist()[:2] == [12, 24]


def test_the_last_line_says_what_failed(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("calibrate", place / "in", *WINDOW, "-o", place / "out") == 2
    said = capsys.readouterr()
    assert "2 of them finished before" in said.out
    assert "1 of 3 recordings failed" in said.err.splitlines()[-1]


def test_what_is_finished_is_skipped_by_content(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inside, out = place / "in", place / "out"
    (inside / "bad.csv").unlink()
    (inside / "a" / "r.parquet").rename(inside / "moved.parquet")
    before = {part: part.stat().st_mtime_ns for part in out.rglob("drivers.parquet")}
    write(inside / "a" / "r.parquet", seed=3)  # another content under the old name
    assert command("calibrate", inside, *WINDOW, "-o", out) == 0
    assert "2 of them finished before" in capsys.readouterr().out
    assert {part: part.stat().st_mtime_ns for part in before} == before
    assert len(pd.read_parquet(out)) == 12 + 24 + 12
    # A run over one of them leaves the others, which are of the same options.
    assert command("calibrate", inside / "moved.parquet", *WINDOW, "-o", out) == 0
    assert len(pd.read_parquet(out)) == 12 + 24 + 12
    assert len(rows_of(out)) == 3


def test_two_copies_are_two_recordings(tmp_path: Path) -> None:
    one = write(tmp_path / "a" / "r.parquet", seed=1)
    shutil.copytree(one.parent, tmp_path / "b")
    for skipped in (0, 2):
        assert command("calibrate", tmp_path / "a", tmp_path / "b", *WINDOW, "-o", tmp_path / "out") == 0, skipped
        sizes = pd.read_parquet(tmp_path / "out").groupby("recording", observed=True).size()
        assert sizes.tolist() == [12, 12]


def test_other_options_need_all_recordings_again(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = state(place / "out")
    assert command("calibrate", place / "in" / "a", *WINDOW[:2], "--horizon", 50, "-o", place / "out") == 2
    assert "holds recordings of other options or another version (r-" in capsys.readouterr().err
    assert state(place / "out") == before
    (place / "in" / "bad.csv").unlink()
    assert command("calibrate", place / "in", *WINDOW[:2], "--horizon", 50, "-o", place / "out") == 0
    assert sum(path.endswith("drivers.parquet") for path in state(place / "out")) == 3


@pytest.mark.parametrize("where", ["notes.txt", "recording=mine/table.parquet", "{part}/notes.txt"])
def test_files_of_somebody_else_are_left_alone(where: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part = next((place / "out").glob("recording=*")).name
    path = place / "out" / where.format(part=part)
    path.parent.mkdir(exist_ok=True)
    path.write_text("mine")
    before = state(place / "out")
    assert command("calibrate", place / "in", *WINDOW, "-o", place / "out") == 2
    assert path.name in capsys.readouterr().err
    assert state(place / "out") == before


def test_a_changed_result_is_somebodys_too(place: Path) -> None:
    part = next((place / "out").rglob("drivers.parquet"))
    part.write_bytes(b"changed")
    assert command("calibrate", place / "in", *WINDOW, "-o", place / "out") == 2
    assert part.read_bytes() == b"changed"


def test_an_interrupted_run_leaves_what_was_finished(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.many.dataset import DataSet

    keep, out = DataSet.keep, place / "again"

    def once(*given: object) -> None:
        keep(*given)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(DataSet, "keep", once)
        assert command("calibrate", place / "in", *WINDOW, "-o", out) == 130
    assert len(list(out.glob("recording=*"))) == 1
    assert not (out / "_summary.json").exists()
    command("calibrate", place / "in", *WINDOW, "-o", out)
    tables = [{name: content for name, content in state(at).items() if name.endswith("drivers.parquet")}
              for at in (out, place / "out")]  # fmt: skip
    assert tables[0] == tables[1]
    assert (out / "_summary.json").read_bytes() == (place / "out" / "_summary.json").read_bytes()


def test_prediction_leaves_each_driver_out_of_its_own(place: Path, tmp_path: Path) -> None:
    (place / "in" / "bad.csv").unlink()
    given = ("predict", place / "in", "--drivers", place / "out", "-o", tmp_path / "predicted")
    assert command(*given) == 0
    predicted, known = pd.read_parquet(tmp_path / "predicted"), pd.read_parquet(place / "out")
    assert len(predicted) == len(known)
    assert predicted["a"].notna().all()


def test_a_diagnosis_of_many_counts_verdicts_and_laws(place: Path, tmp_path: Path) -> None:
    out, names = tmp_path / "out", ("a", "b")
    assert command("diagnose", *(place / "in" / name for name in names), "--jobs", 1, "-o", out) == 0
    summary = json.loads((out / "_summary.json").read_text())
    assert summary["verdicts"] == {"none": 2}  # too few drivers for more
    assert summary["recordings"] == {"done": 2, "failed": 0}
    assert {path.name for path in next(out.glob("recording=*")).iterdir()} >= {"_diagnosis.json", "_model.json"}
    links = re.findall(r'<a href="(recording[^"]+)"', (out / "_report.html").read_text(encoding="utf-8"))
    pages = [out / unquote(link) for link in links]
    assert sorted(pages) == sorted(out.glob("recording=*/_report.html"))
    assert len(pages) == 2
    assert "Verdict: nothing was found" in pages[0].read_text(encoding="utf-8")
    assert len(pd.read_parquet(out))  # whose readers skip the pages


def test_several_recordings_do_not_go_into_one_table(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [place / "in" / name / "r.parquet" for name in ("a", "b")]
    assert command("calibrate", *given, "-o", place / "all.parquet") == 2
    assert "several recordings go into a folder" in capsys.readouterr().err


def test_folders_stand_for_the_recordings_in_them(tmp_path: Path) -> None:
    for name in ("day/01_tracks.csv", "day/01_tracksMeta.csv", "day/01_recordingMeta.csv", "day/x.net.xml",
                 "day/deeper/r.txt.gz", "day/README.md", "day/_summary.json", "whole/period=1/part.parquet",
                 "parts/part-0.parquet", "parts/part-1.parquet"):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    found = recordings_of([tmp_path / "day", tmp_path / "whole", tmp_path / "parts"])
    names = [str(path.relative_to(tmp_path)) for path in found]
    assert names == ["day/01_tracks.csv", "day/deeper/r.txt.gz", "whole", "parts"]
    assert [is_one(tmp_path / name) for name in ("day", "whole", "parts", "day/README.md")] == [False, True, True, True]


def test_a_recordings_content_includes_what_lies_beside_it(tmp_path: Path) -> None:
    tracks, about = tmp_path / "01_tracks.csv", tmp_path / "01_tracksMeta.csv"
    tracks.write_text("t")
    alone = digest(tracks)
    about.write_text("m")
    assert alone == ownership.sha256(tracks)
    assert digest(tracks) != alone


@pytest.mark.parametrize("label", ["0750-0805", "750", "p750", "pp1", "a/b", "50%", "Straße 1"])
def test_labels_come_back_from_folders(label: str, tmp_path: Path) -> None:
    name = as_folder(label)
    assert "/" not in name
    assert as_label(name) == label
    (tmp_path / f"period={name}").mkdir()
    pd.DataFrame({"a": np.ones(1)}).to_parquet(tmp_path / f"period={name}" / "d.parquet")
    assert isinstance(pd.read_parquet(tmp_path)["period"].iloc[0], str)
