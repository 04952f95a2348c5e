"""Grades and tables of blind trials."""

from __future__ import annotations

import json
import math

import pandas as pd
import pytest

from tests.simulators.campaign import run as campaign
from tests.simulators.campaign.scores import outcome, scored, sized
from tests.simulators.campaign.tables import laws, summarise

PLAN = {"underlying": "idm", "noise": "white", "sigma": 0.3, "form": "usual", "density": "congested", "lanes": 4,
    "only_lane": 1,
        "place": [200.0, 300.0], "time": [100.0, 200.0]}  # fmt: skip


def cause(name, value=0.4, ci95=(0.3, 0.5)):
    return {"name": name, "parameters": {"size": {"value": value, "unit": "1", "ci95": list(ci95)}}}


def trial(group, effects, causes=(), verdict=None, unexplained=(), **more):
    gain = {"base": 1.0, "extended": 0.9, "difference": 0.1}
    verdict = verdict or ("named" if causes else "none")
    found = {"verdict": verdict, "causes": list(causes), "unexplained": list(unexplained), "gain": gain}
    return {"group": group, "name": "+".join(effects) or "none", "size": "mid", "effects": effects, "found": found,
            "plan": PLAN, "seed": 1, "seconds": 9.0,
            "achievable": {"base": 1.0, "extended": 0.8, "drivers": 9} if effects else None, **more}  # fmt: skip


SEAM = {"covariate": "position and time", "position_m": [190.0, 310.0], "time_s": [0.0, 400.0]}


@pytest.mark.parametrize(
    ("one", "expected"),
    [
        (trial("none", {}), "silent"),
        (trial("none", {}, verdict="unknown"), "false alarm"),
        (trial("none", {}, [cause("location")]), "false alarm"),
        (trial("single", {"location": 0.4}, [cause("location")]), "right"),
        (trial("single", {"location": 0.4}, [cause("location"), cause("hysteresis")]), "right and more"),
        (trial("single", {"location": 0.4}, [cause("hysteresis"), cause("location")]), "wrong"),
        (trial("single", {"location": 0.4}), "silent"),
        (trial("single", {"location": 0.4}, verdict="unknown"), "unknown"),
        (trial("pair", {"location": 0.4, "hysteresis": 0.2}, [cause("location")]), "one of two"),
        (trial("pair", {"location": 0.4, "hysteresis": 0.2}, [cause("location"), cause("hysteresis")]), "right"),
        (trial("outside", {"distraction": 0.4}, [cause("location")]), "wrong"),
        (trial("outside", {"distraction": 0.4}, verdict="unknown", unexplained=[SEAM]), "right"),
        (trial("outside", {"distraction": 0.4}, verdict="unknown",
            unexplained=[{**SEAM, "position_m": [400.0, 500.0]}]),
         "unknown, elsewhere"),
        (trial("one lane", {"hysteresis": 0.4}, [{**cause("hysteresis"), "where": {"lanes": [2]}}]), "right"),
        (trial("one lane", {"hysteresis": 0.4}, [{**cause("hysteresis"), "where": {"lanes": [3]}}]), "all lanes"),
        (trial("one lane", {"hysteresis": 0.4}, [{**cause("hysteresis"), "where": None}]), "all lanes"),
    ],
)  # fmt: skip
def test_outcomes(one, expected):
    assert outcome(one) == expected


def test_sizes_and_gains():
    trials = pd.DataFrame([
        trial("single", {"location": 0.5}, [cause("location")]), trial("single", {"location": 0.5}), trial("none", {}),
        trial("pair", {"location": 0.1, "hysteresis": 0.4},
            [cause("hysteresis"), cause("location", -0.2, (-0.3, 0.1))]),
        trial("some drivers", {"location": 0.5}, [cause("location")]),
    ])  # fmt: skip
    rows, sizes = scored(trials), sized(trials)
    assert rows["realised"][0] == pytest.approx(0.5)
    assert rows["gain_class"].tolist()[:3] == ["5 % or more", "5 % or more", ""]
    assert math.isnan(rows["realised"][1])
    assert sizes["name"].tolist() == ["location", "hysteresis", "location"]
    assert sizes["error"].tolist() == pytest.approx([0.2, 0.0, 1.0])
    assert sizes["covered"].tolist() == [True, True, True]  # an interval across zero begins there
    of_some = cause("location")
    of_some["parameters"]["share"] = {"value": 0.4, "unit": "1", "ci95": [0.3, 0.5]}
    sizes = sized(pd.DataFrame([trial("some drivers", {"location": 0.5}, [of_some])]))
    assert sizes["error"].tolist() == pytest.approx([0.2])


def test_metres_behind_trucks_are_held_against_metres():
    kept = cause("leader_class", 3.0, (2.0, 4.0))
    kept["parameters"] = {"ell": kept["parameters"].pop("size")}
    one = trial("single", {"leader_class": 0.3}, [kept])
    assert sized(pd.DataFrame([one]))["planted"].tolist() == pytest.approx([0.3 * 1.25 * 9.0])
    assert sized(pd.DataFrame([one]))["form"].tolist() == ["other"]  # seconds are no metres
    assert sized(pd.DataFrame([{**one, "truth": {}}]))["planted"].tolist() == pytest.approx([4.5])


def test_pairs_are_counted_by_what_the_lesser_is_worth_beside_the_other(tmp_path):
    two, both = {"location": 0.1, "hysteresis": 0.4}, [cause("hysteresis"), cause("location")]
    best = {"base": 1.0, "extended": 0.8, "drivers": 9}
    trials = [
        trial("pair", two, both, achievable={**best, "without": [0.96, 0.9]}),
        trial("pair", two, both[:1], achievable={**best, "without": [0.96, 0.81]}),
        trial("pair", two, both, achievable={**best, "without": [0.805, 0.96]}),
    ]
    summarise(pd.DataFrame(trials), tmp_path)
    pairs = pd.read_csv(tmp_path / "pairs_by_what_the_lesser_is_worth.csv").set_index("lesser_class")
    assert pairs["recordings"].to_dict() == {"5 % or more": 1, "below 2 %": 2}
    assert pairs["good"].to_dict() == {"5 % or more": 1.0, "below 2 %": 0.5}


def test_what_is_there_without_gain_is_counted_apart(tmp_path):
    pair = trial("pair", {"location": 0.4, "hysteresis": 0.2}, [cause("location")])
    pair["found"]["without_gain"] = [cause("hysteresis"), cause("reaction_delay")]
    summarise(pd.DataFrame([pair, trial("single", {"location": 0.4})]), tmp_path)
    table = pd.read_csv(tmp_path / "present_without_gain.csv", index_col="group")
    assert table.loc["pair"].to_dict() == {"missed": 1, "missed_present": 1, "present_not_hidden": 1}
    assert table.loc["single"].to_dict() == {"missed": 1, "missed_present": 0, "present_not_hidden": 0}


def test_magnitudes_and_gains_add_up_by_form_and_car_following(tmp_path):
    trials = [trial("single", {"location": 0.5}, [cause("location", value)]) for value in (0.4, 0.5, 0.6)]
    trials[2]["plan"] = {**PLAN, "form": "other", "underlying": "fvd"}
    summarise(pd.DataFrame(trials), tmp_path)
    sizes = pd.read_csv(tmp_path / "magnitudes.csv")
    assert sizes[sizes["underlying"] == "all"].set_index("form")["median error"].to_dict() == {
        "usual": 0.1,
        "other": 0.2,
    }
    each = pd.read_csv(tmp_path / "sizes.csv")
    assert each["estimate"].tolist() == [0.4, 0.5, 0.6]
    assert each["seed"].notna().all()
    gains = pd.read_csv(tmp_path / "gain_realised.csv").set_index("of")
    assert gains["recordings"].to_dict() == {"all": 3, "no wish": 3, "mid": 3, "idm": 2, "fvd": 1}


def test_gains_are_told_apart_by_what_no_recording_shows(tmp_path):
    pair = trial("pair", {"pre_insertion": 0.4, "location": 0.5}, [cause("location"), cause("pre_insertion")])
    summarise(pd.DataFrame([trial("single", {"location": 0.5}, [cause("location")]), pair]), tmp_path)
    gains = pd.read_csv(tmp_path / "gain_realised.csv").set_index("of")
    assert gains["recordings"][["no wish", "a lane change to come"]].tolist() == [1, 1]


def test_tables_count_every_trial(tmp_path):
    trials = [trial("none", {}) for _ in range(3)] + [trial("none", {}, [cause("location")])]
    trials += [trial("single", {"location": 0.5}, [cause("location")]), trial("single", {"location": 0.5})]
    summarise(pd.DataFrame(trials), tmp_path)
    groups = pd.read_csv(tmp_path / "groups.csv").set_index("group")
    assert groups.loc["none", ["silent", "false alarm", "recordings"]].tolist() == [3, 1, 4]
    assert groups.loc["none", "good"] == 0.75
    assert groups.loc["none", "ci95"] == "0.19-0.99"  # exact binomial interval of 3 of 4
    assert groups.loc["single", "good"] == 0.5
    assert (tmp_path / "at_a_glance.png").exists()
    assert "| location | mid |" in (tmp_path / "README.md").read_text()


def test_seeds_do_not_depend_on_how_many_trials_there_are():
    few, many = campaign.trials(1, 3, 0), campaign.trials(2, 40, 0)
    assert all(one in many for one in few)
    assert len({one["seed"] for one in many}) == len(many)
    assert {one["seed"] for one in many}.isdisjoint(one["seed"] for one in campaign.trials(2, 40, 1))


def test_one_car_following_model_leaves_out_what_sumo_drives(tmp_path, monkeypatch):
    ran = []

    def run_trial(one, _folder):
        ran.append(one)
        return trial("none", {})

    monkeypatch.setattr(campaign, "run_trial", run_trial)
    campaign.main(["-o", str(tmp_path), "--cases", "1", "--nulls", "12", "--underlying", "gipps"])
    assert {one["underlying"] for one in ran} == {"gipps"}
    assert {"driven by SUMO", "in SUMO"}.isdisjoint({one.get("kind") for one in ran} | {one["group"] for one in ran})
    assert "single" in {one["group"] for one in ran}


def test_a_case_that_fails_does_not_stop_the_others(tmp_path, monkeypatch, capsys):
    def run_trial(one, _folder):
        if one["effect"] == "location":
            raise ValueError("no such place")
        return trial("none", {})

    monkeypatch.setattr(campaign, "run_trial", run_trial)
    with pytest.raises(SystemExit, match="1"):
        campaign.main(["-o", str(tmp_path), "--small"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 4
    assert [line for line in lines if "failed: " in line and "no such place" in line]
    assert (tmp_path / "groups.csv").exists()


def test_a_finished_case_is_not_run_again(tmp_path, monkeypatch):
    given = campaign.trials(1, 1, 0)[0]
    (tmp_path / f"{given['seed']}-none-mid.json").write_text(json.dumps({**given, "kept": True}))
    monkeypatch.setattr(campaign, "find", lambda *_: pytest.fail("ran again"))
    assert campaign.run_trial(given, tmp_path)["kept"]
    with pytest.raises(pytest.fail.Exception, match="ran again"):  # of another size: not the same trial
        campaign.run_trial({**given, "drivers": 40, "minutes": 0.5}, tmp_path)


@pytest.mark.parametrize("given", [["--small"], ["--drivers", "300"], ["--form", "usual"], ["--underlying", "idm"]])
def test_what_the_second_simulator_draws_itself_cannot_be_asked_for(given, tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        campaign.main(["-o", str(tmp_path), "--simulator", "second", *given])
    assert f"leave out {given[0]}" in capsys.readouterr().err


def test_the_law_that_was_taken_is_held_against_the_one_underneath():
    known = trial("none", {})
    known["found"]["law"] = "krauss"
    graded = scored(pd.DataFrame([known, trial("none", {})]))  # of the other one an older campaign says nothing
    assert laws(graded).to_dict("records") == [{"underlying": "idm", "krauss": 1}]
    assert laws(graded.iloc[1:]).empty
