"""What a command line says of a recording: where it comes from, which vehicles it has."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from idm_sumo.cli import main
from idm_sumo.cli.console import progress_bar
from idm_sumo.cli.parser import build_parser
from idm_sumo.recordings.recording import SURROGATE_NOTICE
from idm_sumo.sumo.surrogate.make import write_layout
from tests.helpers.platoons import platoon_recording


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small file that says of itself that it is a surrogate."""
    path = tmp_path_factory.mktemp("simulated") / "mine.parquet"
    write_layout([platoon_recording()], path, ".parquet")
    return path


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of which one vehicle is too short for a window, and one never on a main lane."""
    table = platoon_recording(periods=1, platoons=1, cars=5)
    table = table[(table["Vehicle_ID"] != 5) | (table["Frame_ID"] < table["Frame_ID"].min() + 50)]
    table.loc[table["Vehicle_ID"] == 1, "Lane_ID"] = 6
    table.loc[table["Vehicle_ID"] == 2, "Preceding"] = 0
    path = tmp_path_factory.mktemp("short") / "short.parquet"
    table.to_parquet(path)
    return path


def test_a_surrogate_is_labelled_in_every_layout_that_can_hold_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix in (".parquet", ".csv"):
        path = tmp_path / f"renamed{suffix}"
        write_layout([platoon_recording(periods=1)], path, suffix)
        main(["inspect", str(path), "--json"])
        assert SURROGATE_NOTICE in json.loads(capsys.readouterr().out)["notes"]


@pytest.mark.parametrize(
    "command",
    [
        ["calibrate", "{}", "-o", "d.csv"],
        ["replay", "{}", "--vehicle", "3", "--backend", "kernel", "--horizon", "10", "-o", "replay"],
        ["interactive", "{}", "--types", "default-idm", "--replay-bias", "0", "-o", "loop"],
        ["diagnose", "{}", "-o", "diagnosis"],
    ],
    ids=lambda command: command[0],
)
def test_the_label_survives_on_the_terminal_and_on_pages(
    command: list[str],
    simulated: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    main([word.format(simulated) for word in command])
    assert f"note: {SURROGATE_NOTICE}" in capsys.readouterr().err.splitlines()
    for page in tmp_path.glob("*/report.html"):
        assert "Not measured: mine.parquet is a surrogate recording" in page.read_text()
    for manifest in tmp_path.glob("*/manifest.json"):
        assert any(SURROGATE_NOTICE in note for note in json.loads(manifest.read_text())["notes"])


def test_comparison_names_the_one_that_is_not_measured(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measured = tmp_path / "measured.parquet"
    platoon_recording().to_parquet(measured)
    main(["compare", str(measured), str(simulated), "-o", str(tmp_path / "out")])
    assert "Not measured: mine.parquet is a surrogate" in (tmp_path / "out" / "report.html").read_text()
    assert SURROGATE_NOTICE in capsys.readouterr().err
    main(["inspect", str(measured)])
    assert SURROGATE_NOTICE not in capsys.readouterr().out


def test_vehicles_are_listed_with_what_speaks_against_them(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["inspect", str(short), "--vehicles", "--json"])
    listed = pd.DataFrame(json.loads(capsys.readouterr().out)["vehicles"]).set_index("vehicle")
    assert list(listed.index) == [1, 2, 3, 4, 5]
    assert list(listed["eligible"]) == [False, True, True, True, False]
    assert "main lane" in listed.loc[1, "reason"]
    assert "110 frames" in listed.loc[5, "reason"]
    assert listed.loc[5, "frames"] == 50
    spans = listed["end_s"] - listed["start_s"]
    assert spans.loc[2:].tolist() == pytest.approx(((listed["frames"] - 1) * 0.1).loc[2:].tolist())
    main(["inspect", str(short), "--vehicles"])
    shown = capsys.readouterr().out.splitlines()
    rows = [line.split() for line in shown[shown.index("") + 2 :]]  # below the header
    assert [int(row[1]) for row in rows] == list(listed.index)
    assert ["yes" in row for row in rows] == list(listed["eligible"])


@pytest.mark.parametrize("vehicle", ["99", "5", "1"])
def test_replay_says_which_vehicles_can_be_used(
    vehicle: str, short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["replay", str(short), "--vehicle", vehicle, "-o", str(tmp_path / "out")])
    assert stop.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "vehicles 2-4 of" in line
    assert "--vehicles" in line


def test_the_built_in_recording_is_taken_by_its_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("IDM_SUMO_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    given = ["surrogate", "--minutes", "1"]
    main(["inspect", *given, "--vehicles", "--json"])
    vehicles = pd.DataFrame(json.loads(capsys.readouterr().out)["vehicles"])
    one = str(vehicles.loc[vehicles["eligible"], "vehicle"].iloc[0])
    main(["calibrate", *given, "-o", "drivers.csv"])
    main(["predict", *given, "--drivers", "drivers.csv", "-o", "predicted.csv"])
    main(["replay", *given, "--vehicle", one, "--backend", "kernel", "-o", "replay"])
    main(["interactive", *given, "--types", "default-idm", "--replay-bias", "0", "-o", "loop"])
    assert len(pd.read_csv("drivers.csv")) == len(pd.read_csv("predicted.csv"))
    assert len(list((tmp_path / "cache").iterdir())) == 1  # made once


NAMED = (
    ["inspect", "surrogate"],
    ["calibrate", "surrogate", "-o", "d.csv"],
    ["compare", "mine.csv", "surrogate", "-o", "out"],
    ["interactive", "surrogate", "-o", "out"],
    ["reproduce", "surrogate", "-o", "out"],
    ["irl", "train", "mine.csv", "surrogate", "-o", "out"],
)


@pytest.mark.parametrize("command", NAMED, ids=lambda command: command[0])
@pytest.mark.parametrize("make", [Path.touch, Path.mkdir], ids=["file", "folder"])
def test_the_word_is_refused_where_something_of_that_name_lies(
    command: list[str],
    make: Callable[[Path], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    make(Path("surrogate"))
    with pytest.raises(SystemExit) as stop:
        main(command)
    (line,) = capsys.readouterr().err.splitlines()
    assert stop.value.code == 2
    assert "give ./surrogate to read that" in line
    assert [path.name for path in tmp_path.iterdir()] == ["surrogate"]


def test_a_file_of_the_words_name_is_read_by_its_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    platoon_recording(periods=1, platoons=1, cars=2).to_csv("surrogate", index=False)
    main(["inspect", "./surrogate"])
    assert capsys.readouterr().out.splitlines()[0] == "surrogate"


def test_options_of_several_values_may_be_repeated() -> None:
    given = ["inspect", "r.csv", "--corridor", "a", "b", "--corridor", "c", "--route-files", "x", "--route-files", "y"]
    options = build_parser().parse_args(given)
    assert options.corridor == ["a", "b", "c"]
    assert options.route_files == [Path("x"), Path("y")]
    assert build_parser().parse_args(["inspect", "r.csv"]).corridor == []


def test_nobody_is_refused_who_does_not_name_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("surrogate").mkdir()
    assert build_parser().parse_args(["interactive", "-o", "out"]).recording is None
    assert build_parser().parse_args(["reproduce", "-o", "out"]).recording == []


def test_a_log_file_gets_one_line_a_stage_with_its_number(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar(["reading", "calibrating"]) as report:
        for stage in ("reading", "calibrating", "drawing"):
            for done in range(3):
                report(stage, done, 2)
    assert capsys.readouterr().err.splitlines() == ["reading 1 of 2 ...", "calibrating 2 of 2 ...", "drawing ..."]


def test_why_nobody_can_be_modelled_is_said(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = pd.read_parquet(short) if short.suffix == ".parquet" else pd.read_csv(short)
    table.assign(Preceding=table["Vehicle_ID"]).to_parquet(tmp_path / "own_leaders.parquet")
    with pytest.raises(SystemExit, match="2"):
        main(["calibrate", str(tmp_path / "own_leaders.parquet"), "-o", str(tmp_path / "d.parquet")])
    assert "wrong leader" in capsys.readouterr().err
