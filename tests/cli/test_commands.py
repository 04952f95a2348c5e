"""The command line as a user meets it: results where they were asked for, one line and exit 2 where not."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from idm_sumo.cli import main
from idm_sumo.models.effects import Cause, ExtendedModel
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.roads.us101 import US101
from tests.helpers.ngsim_files import official
from tests.helpers.platoons import platoon_recording

METHODS = [
    "constant_velocity", "idm_average", "idm_prediction", "idm_rollout", "idm_residual", "idm_first_gap", "idm_pooled",
    "idm_typical", "idm_hierarchical", "idm_oracle",
]  # fmt: skip


@pytest.fixture(scope="module")
def recording(platoons: Path) -> Path:
    return platoons


@pytest.fixture(scope="module")
def drivers(platoon_drivers: Path) -> Path:
    return platoon_drivers


@pytest.fixture(scope="module")
def study(platoon_study: Path) -> Path:
    return platoon_study


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must fail; return its one line."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    error = [line for line in capsys.readouterr().err.splitlines() if not line.endswith(" ...")]
    assert len(error) == 1, error
    return error[0]


def test_help_of_every_command_teaches(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    for command in (
        "inspect",
        "surrogate",
        "fetch",
        "calibrate",
        "predict",
        "export",
        "replay",
        "reproduce",
        "compare",
        "interactive",
        "diagnose",
    ):
        assert command in text
        with pytest.raises(SystemExit) as stop:
            main([command, "--help"])
        assert stop.value.code == 0
        shown = capsys.readouterr().out
        assert "example:" in shown
        assert "--seed" in shown
        assert "--jobs" in shown
        assert "--verbose" in shown


def test_inspect_accounts_for_every_row(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["inspect", str(recording), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["read"] == len(pd.read_parquet(recording)) == found["used"] + sum(found["dropped"].values())


def test_calibrate_writes_one_row_a_driver(drivers: Path) -> None:
    table = pd.read_parquet(drivers)
    assert {"period", "vehicle", "a", "b", "T", "d0", "d1", "ade_m", "status", "at_bound"} <= set(table.columns)
    assert len(table) == 2 * 24
    assert set(table["period"]) == {"0750-0805", "0805-0820"}
    followers = table[table["status"] == "ok"]
    assert len(followers) >= 30
    assert followers["ade_m"].median() < 1.0


def test_predict_from_first_frames(recording: Path, drivers: Path, tmp_path: Path) -> None:
    main(["predict", str(recording), "--drivers", str(drivers), "-o", str(tmp_path / "predicted.csv")])
    table = pd.read_csv(tmp_path / "predicted.csv")
    assert len(table) == 2 * 24
    assert table[["a", "b", "T", "d0", "d1"]].notna().all(axis=None)
    assert (table["status"] != "ok").sum() == 2 * 4  # the platoons' first cars see nobody


def test_predict_through_the_rollout(recording: Path, drivers: Path, tmp_path: Path) -> None:
    main(
        ["predict", str(recording), "--method", "rollout", "--drivers", str(drivers), "-o", str(tmp_path / "p.parquet")]
    )
    table = pd.read_parquet(tmp_path / "p.parquet")
    assert len(table) == 2 * 24
    assert (table["T_low"] <= table["T"]).all()
    assert (table["status"] == "population: no leader seen").sum() == 2 * 4


def test_neighbours_need_calibrated_drivers(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "--drivers" in refused(["predict", str(recording), "-o", str(tmp_path / "p.csv")], capsys)


@pytest.mark.parametrize("backend", ["sumo", "kernel"])
def test_replay_leaves_trajectory_and_animation(recording: Path, tmp_path: Path, backend: str) -> None:
    out = tmp_path / "replay"
    main(["replay", str(recording), "--vehicle", "3", "--horizon", "40", "--backend", backend, "-o", str(out)])
    table = pd.read_parquet(out / "trajectory.parquet")
    assert len(table) == 41
    assert abs(table["x"] - table["recorded_x"]).mean() < 1.0
    assert (out / "replay.gif").read_bytes().startswith(b"GIF8")
    assert json.loads((out / "manifest.json").read_text())["parameters"]["T"] > 0


def test_replay_of_predicted_parameters(recording: Path, drivers: Path, tmp_path: Path) -> None:
    main(["replay", str(recording), "--vehicle", "3", "--period", "0805-0820", "--drivers", str(drivers),
          "--backend", "kernel", "--horizon", "10", "-o", str(tmp_path / "out")])  # fmt: skip
    table = pd.read_parquet(tmp_path / "out" / "trajectory.parquet")
    assert set(table["period"]) == {"0805-0820"}


def test_a_table_of_another_recordings_drivers_is_refused(
    recording: Path, drivers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = pd.read_parquet(drivers)
    table.assign(first_frame=table["first_frame"] + 1).to_parquet(tmp_path / "other.parquet")
    arguments = ["replay", str(recording), "--vehicle", "3", "--drivers", str(tmp_path / "other.parquet")]
    assert "belongs to another recording" in refused([*arguments, "-o", str(tmp_path / "out")], capsys)


def test_several_driver_tables_are_driven_in_one_replay(
    recording: Path, drivers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "slow<b>.parquet"
    pd.read_parquet(drivers).assign(T=3.0).to_parquet(other)
    given = [
        "replay",
        str(recording),
        "--vehicle",
        "3",
        "--period",
        "0805-0820",
        "--backend",
        "kernel",
        "--horizon",
        "10",
    ]
    both = ["--drivers", str(drivers), "--drivers", str(other)]
    main([*given, *both, "-o", str(tmp_path / "out")])
    scores = pd.read_csv(tmp_path / "out" / "scores.csv")
    assert scores["model"].tolist() == [drivers.stem, "slow<b>"]
    assert scores["ade_m"].nunique() == 2
    page = (tmp_path / "out" / "replay.html").read_text()
    assert "slow<b>" not in page
    assert "slow\\u003cb\\u003e" in page
    line = refused([*given, *both[:2], *both[:2], "-o", str(tmp_path / "no")], capsys)
    assert "different names" in line


def test_export_writes_types_and_a_run_that_sumo_takes(
    drivers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["export", str(drivers), "--parameters", "fitted", "-o", str(tmp_path / "fleet.rou.xml")])
    said = capsys.readouterr().out
    assert "linearised" in said  # what each choice costs
    assert "departures are late" in said
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fleet.net.xml", "fleet.rou.xml", "fleet.sumocfg"]
    assert (tmp_path / "fleet.rou.xml").read_text().count("<vType ") == 2 * 24
    main(["export", str(drivers), "--distribution", "-o", str(tmp_path / "fleet.add.xml")])
    assert "<vTypeDistribution " in (tmp_path / "fleet.add.xml").read_text()


def test_export_refuses_impossible_drivers(drivers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = pd.read_parquet(drivers)
    for column, value in (("T", float("nan")), ("a", -1.0), ("lane", 9)):
        bad = table.copy()
        bad[column] = bad[column].astype(float)
        bad.loc[3, column] = value
        bad.to_csv(tmp_path / "bad.csv", index=False)
        assert "bad.csv" in refused(["export", str(tmp_path / "bad.csv"), "-o", str(tmp_path / "x.rou.xml")], capsys)
    missing = ["export", str(drivers), "-o", str(tmp_path / "x.rou.xml"), "-n", str(tmp_path / "none.net.xml")]
    assert "none.net.xml" in refused(missing, capsys)
    assert [p.name for p in tmp_path.iterdir()] == ["bad.csv"]


def test_reproduce_writes_the_interface(study: Path) -> None:
    methods = pd.read_csv(study / "tables" / "methods.csv")
    assert list(methods["method"]) == METHODS
    assert list(methods.columns[:7]) == ["method", "ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "vehicles"]
    ade = methods.set_index("method")["ade_m"]
    assert ade["idm_oracle"] <= ade["idm_hierarchical"] + 0.02
    assert ade["idm_hierarchical"] < ade[["idm_average", "idm_prediction", "idm_pooled", "constant_velocity"]].min()
    assert len(pd.read_csv(study / "tables" / "features.csv")) == 7
    assert list(pd.read_csv(study / "tables" / "frames.csv")["frames"]) == [2, 4, 6, 10, 20]
    assert pd.read_csv(study / "tables" / "neighbours.csv")["k"].is_monotonic_increasing
    page = (study / "report.html").read_text()
    assert "data:image/png;base64" in page
    assert "://" not in page.replace("http-equiv", "")
    assert json.loads((study / "manifest.json").read_text())["largest_backend_difference_m"] < 1e-3


def test_again_and_by_kernels_all_tables_are_the_same(recording: Path, study: Path, tmp_path: Path) -> None:
    """The same command twice, byte for byte, is compared where the wheel is tested."""
    main(["reproduce", str(recording), "-o", str(tmp_path / "kernel"), "--quick", "--no-agents", "--backend", "kernel"])
    names = sorted(table.name for table in (study / "tables").iterdir())
    assert names == sorted(table.name for table in (tmp_path / "kernel" / "tables").iterdir())
    for name in names:
        sumo, kernel = (pd.read_csv(folder / "tables" / name) for folder in (study, tmp_path / "kernel"))
        pd.testing.assert_frame_equal(sumo, kernel, atol=1e-5)


def test_a_later_run_replaces_an_earlier_result_but_nothing_else(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine"
    out.mkdir()
    (out / "thesis.tex").write_text("years of work")
    line = refused(["reproduce", str(recording), "-o", str(out), "--quick", "--no-agents"], capsys)
    assert str(out) in line
    assert (out / "thesis.tex").read_text() == "years of work"


BAD = {
    "empty.txt": ("", "empty"),
    "words.txt": ("once upon a time\n", "words.txt"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_recordings(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, hint = BAD[name]
    path = tmp_path / name
    path.write_text(content)
    out = tmp_path / "out"
    for command in (["inspect", str(path)], ["reproduce", str(path), "-o", str(out)],
                    ["calibrate", str(path), "-o", str(tmp_path / "d.parquet")]):  # fmt: skip
        assert hint in refused(command, capsys)
    assert sorted(p.name for p in tmp_path.iterdir()) == [name]


def test_text_in_a_number_names_row_and_column(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = platoon_recording(periods=1, platoons=1, cars=2, frames=30).astype(object)
    table.loc[7, "Local_Y"] = "fog"
    path = official(tmp_path / "text.txt", table)
    line = refused(["inspect", str(path)], capsys)
    assert "8" in line
    assert "Local_Y" in line


def test_metres_taken_for_feet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = platoon_recording(periods=1, platoons=2)
    for name in ("Local_X", "Local_Y", "v_Length", "v_Width", "Space_Headway"):
        table[name] *= 0.3048
    path = official(tmp_path / "metres.txt", table)
    assert "met" in refused(["calibrate", str(path), "-o", str(tmp_path / "d.parquet")], capsys)


def test_one_vehicle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = official(tmp_path / "one.txt", platoon_recording(periods=1, platoons=1, cars=1))
    assert "1 vehicle" in refused(["reproduce", str(path), "-o", str(tmp_path / "out")], capsys)
    assert not (tmp_path / "out").exists()


def test_no_test_period(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out")
    assert "0900-0915" in refused(["reproduce", str(recording), "-o", out, "--test", "0900-0915"], capsys)
    both = ["reproduce", str(recording), "-o", out, "--train", "0750-0805", "--test", "0750-0805"]
    assert "both" in refused(both, capsys)


def test_windows_too_short(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = official(tmp_path / "short.txt", platoon_recording(frames=60))
    assert "110 frames" in refused(["calibrate", str(path), "-o", str(tmp_path / "d.parquet")], capsys)


def test_unwritable_output(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    assert "file" in refused(["reproduce", str(recording), "-o", str(blocker)], capsys)
    assert "file" in refused(["reproduce", str(recording), "-o", str(blocker / "below")], capsys)
    assert "d.xlsx" in refused(["calibrate", str(recording), "-o", str(tmp_path / "d.xlsx")], capsys)


def test_a_typo_in_a_run_file_is_reported_with_its_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "run.toml"
    run.write_text("neighbors = 8\n")
    line = refused(["reproduce", "-c", str(run), "-o", str(tmp_path / "out")], capsys)
    assert "'neighbors'" in line
    assert "neighbours" in line
    run.write_text("horizon = 'long'\n")
    assert "'horizon'" in refused(["reproduce", "-c", str(run), "-o", str(tmp_path / "out")], capsys)
    run.write_text("= 3\n")
    assert "TOML" in refused(["reproduce", "-c", str(run), "-o", str(tmp_path / "out")], capsys)


def test_no_such_vehicle(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "99" in refused(["replay", str(recording), "--vehicle", "99", "-o", str(tmp_path / "out")], capsys)


def test_bad_options_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--minutes" in refused(["surrogate", "-o", "x.parquet", "--minutes", "soon"], capsys)
    assert "frobnicate" in refused(["frobnicate"], capsys)


def test_interrupted_run_leaves_nothing(recording: Path, tmp_path: Path) -> None:
    """A real interrupt, as from the keyboard, in the middle of the work."""
    script = (
        "import os, signal, sys, threading\n"
        "from idm_sumo.cli import main\n"
        "import analysis.reproduce.run as study\n"
        "whole = study.load_source\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background jobs ignore it
        "def interrupted(*given):\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    return whole(*given)\n"
        "study.load_source = interrupted\n"
        f"main(['reproduce', {str(recording)!r}, '-o', {str(tmp_path / 'out')!r}])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.returncode == 130
    assert "interrupted" in done.stderr.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("law", ["idm", "full_velocity_difference"])
def test_replay_with_an_extended_model_is_the_same_in_both_back_ends(
    law: str, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model.json"
    ExtendedModel(TEXTBOOK, US101.speed_limit, causes=(Cause("reaction_delay", {"tau": 0.5}),), law=law).write(model)
    for backend in ("sumo", "kernel"):
        main(
            [
                "replay",
                str(recording),
                "--vehicle",
                "4",
                "--model",
                str(model),
                "--backend",
                backend,
                "-o",
                str(tmp_path / backend),
            ]
        )
    one, other = (pd.read_parquet(tmp_path / backend / "trajectory.parquet") for backend in ("sumo", "kernel"))
    assert (one["x"] - other["x"]).abs().max() < 1e-3
    scores = pd.read_csv(tmp_path / "sumo" / "scores.csv")
    assert scores["model"].tolist() == ["idm_oracle", "extended"]
    assert scores["ade_m"].nunique() == 2
    kept = json.loads((tmp_path / "sumo" / "manifest.json").read_text())
    assert kept["model_file"]["causes"][0]["name"] == "reaction_delay"
    assert kept["model_file"]["law"] == law
    model.write_text("{")
    line = refused(
        ["replay", str(recording), "--vehicle", "4", "--model", str(model), "-o", str(tmp_path / "no")], capsys
    )
    assert "model.json" in line
    assert not (tmp_path / "no").exists()


def test_replay_takes_a_driver_for_one_without_what_some_have_if_that_is_nearer(
    recording: Path, tmp_path: Path
) -> None:
    model, given = tmp_path / "model.json", ["replay", str(recording), "--vehicle", "4", "--backend", "kernel"]
    stops = Cause("location", {"alpha": -1.4, "x_1": 0.0, "x_2": 1000.0}, share=0.3)
    late = Cause("reaction_delay", {"tau": 0.5})
    ExtendedModel(TEXTBOOK, US101.speed_limit, causes=(stops, late)).write(model)
    main([*given, "--model", str(model), "-o", str(tmp_path / "out")])
    kept = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert [cause["name"] for cause in kept["model_file"]["causes"]] == ["reaction_delay"]


def test_drivers_of_an_idm_are_refused_where_the_model_follows_another_law(
    recording: Path, drivers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model.json"
    ExtendedModel(TEXTBOOK, US101.speed_limit, law="krauss").write(model)
    given = ["--vehicle", "4", "--drivers", str(drivers), "--model", str(model), "-o", str(tmp_path / "no")]
    line = refused(["replay", str(recording), *given], capsys)
    assert "krauss" in line
    assert "leave --drivers out" in line
    assert not (tmp_path / "no").exists()


def test_export_takes_the_types_that_are_asked_for(drivers: Path, tmp_path: Path) -> None:
    table = pd.read_parquet(drivers)
    table["T_whole"] = table["T_whole"].fillna(table["T_refit"])  # of those whom no window tells anything
    for name, more, column in (
        ("whole", ["--parameters", "whole"], "T_whole"),
        ("fitted", ["--parameters", "fitted"], "T_refit"),
    ):
        target = tmp_path / f"{name}.rou.xml"
        main(["export", str(drivers), "--no-check", *more, "-o", str(target)])
        tau = {one.get("id"): float(one.get("tau", "nan")) for one in ElementTree.parse(target).getroot().iter("vType")}
        expected = {f"{row.period}.{row.vehicle}": getattr(row, column) for row in table.itertuples()}
        assert tau == pytest.approx(expected)
    assert not np.allclose(table["T_whole"], table["T_refit"])


def test_types_of_all_windows_have_no_d1(drivers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--parameters", "whole", "--without-d1", "linearised", "-o", str(tmp_path / "x.rou.xml")]
    assert "leave out --without-d1" in refused(["export", str(drivers), *asked], capsys)
    pd.read_parquet(drivers).drop(columns="T_whole").to_parquet(tmp_path / "less.parquet")
    less = ["export", str(tmp_path / "less.parquet"), "--parameters", "whole", "-o", str(tmp_path / "x.rou.xml")]
    assert "less.parquet: column" in refused(less, capsys)
