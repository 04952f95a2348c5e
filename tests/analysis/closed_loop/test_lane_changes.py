"""``--lane-change fit`` leaves a file that gives the same run again."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from idm_sumo.cli import main
from idm_sumo.sumo.closed_loop.lane_change_fit import BOUNDS, RUNS

LOOP = ("--types", "krauss", "--replay-bias", "0", "--jobs", "1")


def test_fitted_parameters_are_left_and_can_be_used_again(platoons: Path, tmp_path: Path) -> None:
    fit, again = tmp_path / "fit", tmp_path / "again"
    main(
        [
            "interactive",
            str(platoons),
            *LOOP,
            "--lane-change",
            "fit",
            "--lane-change",
            "lcLookaheadLeft=2",
            "-o",
            str(fit),
        ]
    )
    trials = pd.read_csv(fit / "tables" / "lane_change_fit.csv")
    assert trials["half"].tolist() == [1] * RUNS + [2, 2]
    assert trials["with"].tolist()[-2:] == ["default", "fitted"]
    left = json.loads((fit / "lane_change.json").read_text())["parameters"]
    assert set(left) == set(BOUNDS)
    assert left["lcLookaheadLeft"] == "2"
    best = trials[trials["half"] == 1].sort_values("misfit", kind="stable").iloc[0]
    assert all(float(left[name]) == pytest.approx(best[name]) for name in BOUNDS if name != "lcLookaheadLeft")
    main(["interactive", str(platoons), *LOOP, "--lane-change", str(fit / "lane_change.json"), "-o", str(again)])
    one, other = (pd.read_csv(folder / "tables" / "closed_loop.csv") for folder in (fit, again))
    pd.testing.assert_frame_equal(one, other)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (None, "no such file"),
        ("{", "lane.json"),
        ("[]", "has no lane change parameters"),
        ('{"model": "SL2015", "parameters": {}}', "is for SL2015"),
        ('{"model": "LC2013", "parameters": {"lcSpeed": 1}}', "is no parameter of LC2013"),
    ],
)
def test_a_file_that_is_none_is_said_in_one_line(
    platoons: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None, complaint: str
) -> None:
    file = tmp_path / "lane.json"
    if content is not None:
        file.write_text(content)
    with pytest.raises(SystemExit, match="2"):
        main(["interactive", str(platoons), *LOOP, "--lane-change", str(file), "-o", str(tmp_path / "out")])
    assert complaint in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "out").exists()
