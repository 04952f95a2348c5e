"""What a diagnosis leaves on disk: the contract, tables, pictures and the page; and the uncertainty that they show."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from analysis.diagnosis import contract as contract_module
from analysis.diagnosis import report as diagnosis_report
from analysis.diagnosis import words as diagnosis_words
from analysis.diagnosis.answer import answer, spoken
from analysis.diagnosis.content import contract
from analysis.diagnosis.contract import Diagnosis as Contract
from analysis.diagnosis.contract import schema, write_diagnosis
from analysis.diagnosis.curves import clustered_mean, curves, lag_response, map_of
from analysis.diagnosis.effect_picture import in_the_plane
from analysis.diagnosis.held_out import three_drivers
from analysis.diagnosis.outcome import outcome_of
from analysis.diagnosis.report import groups
from analysis.diagnosis.tables import causes_table, laws_table
from idm_sumo.calibration.driver_table import check_departures, read_drivers
from idm_sumo.cli import main
from idm_sumo.diagnosis import CauseFound, Detectable, Diagnosis, Estimate, Gain, Region, RuledOut, Scan, Unexplained
from idm_sumo.diagnosis.result import Law, LawCompared
from idm_sumo.models.effects import CATALOGUE, Cause, Effect, ExtendedModel
from idm_sumo.models.effects.telling import Telling
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.roads.us101 import US101
from tests.helpers import runs
from tests.helpers.pairs import pair


def residuals(drivers=40, windows=3, moments=24, seed=1) -> pd.DataFrame:
    """Return residuals of made drivers: too far ahead at 200 to 300 m, which the extension halves."""
    rng = np.random.default_rng(seed)
    vehicle, window, lag = np.meshgrid(
        np.arange(drivers), np.arange(windows), 0.5 * np.arange(1, moments + 1), indexing="ij"
    )
    position = 50 + 150 * window + 10 * lag
    there = -1.0 * ((position > 200) & (position < 300))
    own = rng.normal(0, 0.3, (drivers, windows, 1))
    noise = own + rng.normal(0, 0.1, position.shape)
    shape = position.shape
    return pd.DataFrame({
        "vehicle": vehicle.ravel(), "window": (vehicle * windows + window).ravel(), "lag": lag.ravel(),
        "position": position.ravel(), "time": (10.0 * vehicle + 15 * window + lag).ravel(),
        "speed": rng.uniform(5, 15, shape).ravel(), "gap": rng.uniform(5, 40, shape).ravel(),
        "approach_rate": rng.normal(0, 1, shape).ravel(), "leader_acceleration": rng.normal(0, 1, shape).ravel(),
        "since_change": np.where(vehicle % 2, 1e6, lag).ravel(), "lane": (1 + vehicle % 5).ravel(), "leader_class": 0,
        "adjacent_difference": np.nan, "rear_gap": np.inf,
        "base": (there + noise).ravel(), "extended": (0.5 * there + noise).ravel(),
    })  # fmt: skip


def named() -> Diagnosis:
    """Return a diagnosis that names a place."""
    alpha = {"alpha": Estimate(-0.12, "m/s^2", (-0.15, -0.09))}
    cause = CauseFound(
        "location", alpha, Region((200.0, 300.0)), 2e-6, "All slow down there.", ("measurement_artefact",)
    )
    model = ExtendedModel(
        TEXTBOOK, US101.speed_limit, causes=(Cause("location", {"alpha": -0.12, "x_1": 200.0, "x_2": 300.0}),)
    )
    table = residuals()
    drivers = pd.DataFrame({
        "period": "p", "vehicle": np.arange(40), "held_out": np.arange(40) % 2 == 0, "windows": 3,
        "base_ade": np.linspace(0.5, 1.5, 40), "extended_ade": np.linspace(0.45, 1.4, 40),
    })  # fmt: skip
    edges = np.linspace(0, 600, 25)
    scan = Scan(
        "position", "m", edges, np.where((edges[:-1] >= 200) & (edges[:-1] < 300), -0.1, 0.0), np.full(24, 0.02)
    )
    return Diagnosis(
        verdict="named", causes=(cause,), without_gain=(), unexplained=(),
        gain=Gain("ade_m", 1.0, 0.9, 0.1, (0.05, 0.15), 20),
        other_gains=(Gain("fde_m", 2.0, 1.8, 0.2, (0.1, 0.3), 20), Gain("collisions", 0.0, 0.0, 0.0, (0.0, 0.0), 20)),
        ruled_out=(RuledOut("reaction_delay", 0.4, ("hysteresis",), Estimate(0.02, "s", (-0.05, 0.09)),
            "chance makes as much"),
                   RuledOut("hysteresis", 0.9, ())),
        untestable={"leader_class": "no classes were recorded"},
        detectable=(Detectable("reaction_delay", "tau", "s", 0.2, 3, 4),),
        model=model, base_model=ExtendedModel(TEXTBOOK, US101.speed_limit), residuals=table, drivers=drivers,
        scans=(scan,),
        excluded={"no leader for 12 s": 3}, notes=("a note",), seconds={"fit": 1.0},
    )  # fmt: skip


def silent() -> Diagnosis:
    one = named()
    return replace(
        one, verdict="none", causes=(), model=one.base_model, gain=replace(one.gain, extended=1.0, difference=0.0)
    )


def write(found: Diagnosis, folder, monkeypatch) -> None:
    """Write what ``diagnose`` leaves; only the finding itself, tested elsewhere, is given."""
    recording = folder.parent / "recording.parquet"
    pair(12, 7).to_parquet(recording)
    monkeypatch.setattr(diagnosis_report, "diagnose", lambda *_args, **_more: found)
    diagnosis_report.diagnose_file(recording, folder, location="us-101", seed=1, jobs=1, command=["x", "diagnose"])


def test_the_folder_holds_all_of_it(tmp_path, monkeypatch) -> None:
    write(named(), tmp_path / "out", monkeypatch)
    content = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert content["verdict"] == "named"
    assert content["causes"][0]["parameters"]["alpha"] == {"value": -0.12, "unit": "m/s^2", "ci95": [-0.15, -0.09]}
    assert content["causes"][0]["where"]["position_m"] == [200.0, 300.0]
    low, high = content["causes"][0]["where"]["time_s"]
    assert low < high  # where no bound is known, what was seen
    assert set(content) == {
        "verdict", "causes", "unexplained", "gain", "ruled_out", "without_gain", "untestable", "law", "law_misfit",
        "detectable",
    }  # fmt: skip
    assert content["causes"][0]["where"]["lanes"] is None
    assert content["law"] == "idm"
    out = content["ruled_out"][0]
    assert (out["name"], out["value"], out["ci95"], out["unit"]) == ("reaction_delay", 0.02, [-0.05, 0.09], "s")
    needed = schema()["$defs"]["Cause"]["required"]
    assert set(content["causes"][0]) == set(needed)
    assert content["detectable"] == [
        {"name": "reaction_delay", "symbol": "tau", "unit": "s", "size": 0.2, "found": 0.75, "of": 4}
    ]
    assert content["untestable"] == {"leader_class": "no classes were recorded"}
    assert ExtendedModel.read(tmp_path / "out" / "model.json").causes[0].values["x_2"] == 300.0
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("<img ") == 7
    assert "://" not in page.split("<body>")[1]
    for words in (
        "All slow down there",
        "cannot be told from measurement artefact",
        "no classes were recorded",
        "chance makes as much",
        "of 0.2 s in 3 of 4",
    ):
        assert words in page
    record = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert record["settings"]["seed"] == 1
    assert record["inputs"][0]["sha256"]
    assert record["versions"]["numpy"]
    tables = {path.stem for path in (tmp_path / "out" / "tables").glob("*.csv")}
    assert {
        "drivers",
        "residual_curves",
        "causes",
        "gains",
        "ruled_out",
        "untestable",
        "detectable",
        "scans",
        "laws",
    } <= tables


def test_the_schema_in_the_repository_is_that_of_the_contract() -> None:
    kept = Path(contract_module.__file__).parent / "diagnosis.schema.json"
    assert json.loads(kept.read_text(encoding="utf-8")) == schema()


def test_a_cause_at_a_bound_says_so_and_on_how_many_drivers_it_rests() -> None:
    (cause,) = named().causes
    found = replace(named(), causes=(replace(cause, effective_drivers=31.4, at_bound=True),))
    said = answer(outcome_of(found))
    assert "The size of location is at the bound of what is searched: it may be larger." in said.limits
    assert "it rests on about 31 drivers" in said.basis[1]
    table = causes_table(found.causes)
    assert table["value"].tolist()[0].endswith("(bound)")
    (written,) = contract(found)["causes"]
    assert (written["effective_drivers"], written["at_bound"]) == (31.4, True)


def test_a_verdict_without_causes_says_what_would_have_been_seen() -> None:
    said = answer(outcome_of(silent()))
    assert said.what == "No cause was found: these data show nothing beyond the IDM."
    assert "1.00 m off on average; the model is left as it is" in said.better
    assert diagnosis_words.law_sentence(silent()) == ""
    assert diagnosis_words.detectable_sentences(silent()) == [
        "reaction delay, injected into these very drivers (tau): of 0.2 s in 3 of 4"
    ]
    assert contract(silent())["causes"] == []


@pytest.mark.parametrize(
    ("difference", "margin", "moves", "clearly"),
    [(0.1, 0.05, "falls from 1.000 to 0.900 m", True), (0.1, 0.2, "falls from 1.000 to 0.900 m", False),
     (-0.1, 0.05, "rises from 1.000 to 1.100 m", False)],
)  # fmt: skip
def test_a_gain_is_said_as_what_it_is(difference: float, margin: float, moves: str, clearly: bool) -> None:
    interval = (difference - margin, difference + margin)
    gain = replace(silent().gain, base=1.0, extended=1.0 - difference, difference=difference, ci95=interval)
    said = answer(outcome_of(replace(named(), gain=gain)))
    assert moves in said.better
    assert ("may be chance" not in said.better) is clearly
    assert any("not sure" in line for line in said.limits) is not clearly


TOLD = [(effect, telling) for effect in CATALOGUE for telling in effect.told]


def cause_of(effect: Effect, telling: Telling, sign: float = 1.0) -> CauseFound:
    """Return a cause of typical size."""
    values = {telling.symbol: 0.3} | {p.symbol: p.typical for p in effect.named_by({telling.symbol})}
    bounds = {"x_1": 200.0, "x_2": 300.0, "t_1": 2.0, "t_2": 200.0}
    values |= {symbol: bound for symbol, bound in bounds.items() if symbol in values}
    values[telling.symbol] *= sign
    estimates = {symbol: Estimate(value, "1", (value, value)) for symbol, value in values.items()}
    return CauseFound(effect.name, estimates, Region((200.0, 300.0), (2.0, 200.0)), 1e-6, "a sentence")


def test_every_magnitude_of_an_effect_is_told() -> None:
    for effect in CATALOGUE:
        magnitudes = {p.symbol for p in (*effect.parameters[:1], *filter(None, [effect.alternative]))}
        assert {one.symbol for one in effect.told} >= magnitudes, effect.name


@pytest.mark.parametrize(("effect", "telling"), TOLD, ids=[f"{e.name}-{t.symbol}" for e, t in TOLD])
def test_an_effect_is_told_in_engineering_units_and_drawn(effect: Effect, telling: Telling) -> None:
    for sign in (1.0, -1.0) if telling.less else (1.0,):
        cause = cause_of(effect, telling, sign)
        values = {symbol: one.value for symbol, one in cause.parameters.items()}
        modelled = Cause(effect.name, values)
        model = ExtendedModel(TEXTBOOK, US101.speed_limit, causes=(modelled,) if effect.parameters else ())
        outcome = outcome_of(replace(named(), causes=(cause,), model=model))
        said = answer(outcome)
        assert said.what.startswith("Drivers ")
        assert telling.advice in said.advice
        assert telling.symbol not in said.what.split()
        assert any(character.isdigit() for character in said.what)
        if effect.parameters:
            picture = in_the_plane(outcome, outcome.content.causes[0], modelled)
            with_it, without = (line.get_xydata() for line in picture.figure.axes[0].lines[:2])
            assert np.nanmax(np.abs(with_it - without)) > 0.01  # the effect is seen


def test_several_causes_of_some_drivers_and_one_lane_and_what_cannot_be_told_apart() -> None:
    (place,) = named().causes
    waves = CauseFound(
        "hysteresis", {"h": Estimate(0.2, "1", (0.1, 0.3))}, Region(lanes=(2,)), 1e-6, "s", ("reaction_delay",)
    )
    model = ExtendedModel(
        TEXTBOOK,
        US101.speed_limit,
        causes=(Cause("hysteresis", {"h": 0.2}, lanes=(2,), share=0.4), *named().model.causes),
    )
    said = answer(outcome_of(replace(named(), causes=(waves, place), model=model)))
    assert said.what.startswith("About 40% of the drivers keep longer headways while their leader accelerates")
    assert "time headway 1.28 s as the leader brakes, 1.92 s as it accelerates" in said.what
    assert "; and drivers hold back (acceleration lower by 0.12 m/s²)" in said.what
    assert "or it is “reaction delay: acts on past values of gap and speed”" in said.what
    assert said.where == (
        "The first happens through every wave of braking and accelerating, in lane 2; the second happens between 200 "
        "and 300 m."
    )
    assert "Hysteresis cannot be told from reaction delay." in said.limits


def test_the_models_are_shown_with_bounds_and_collisions() -> None:
    fitted = {"a": 1.0, "b": np.where(np.arange(40) % 4 == 0, 6.0, 2.0), "T": 1.4, "d0": 2.0, "d1": 0.0}
    crashes = Gain("collisions", 0.0, 0.006, -0.006, (-0.01, 0.0), 20)
    found = replace(named(), drivers=named().drivers.assign(**fitted), other_gains=(crashes,))
    said = answer(outcome_of(found)).models
    assert "time headway of 1.60 s" in said[0]
    assert said[1] == (
        "25% of the drivers have a parameter at a bound of what calibration allows, most often of b (25%)."
    )
    assert said[2] == (
        "The base model collides in 0.0% of the windows of held-out drivers, the extended model in 0.6%."
    )


def test_a_terminal_says_the_verdict_first() -> None:
    assert spoken(named())[0] == "verdict: named (location)"
    assert spoken(silent())[0] == "verdict: none"


def test_three_held_out_drivers_are_the_best_the_median_and_the_worst() -> None:
    drivers = named().drivers.assign(extended_ade=named().drivers["base_ade"] - np.arange(40) / 100)
    chosen = three_drivers(drivers)
    assert chosen["place"].tolist() == ["best", "median", "worst"]
    assert chosen["vehicle"].tolist()[0] == 38  # the last that was held out
    assert chosen["vehicle"].tolist()[2] == 0
    assert chosen["held_out"].all()


def test_the_law_that_drivers_follow_is_said_with_what_it_is_likelier_by() -> None:
    gain = replace(silent().gain, base=0.4, extended=0.3, difference=0.1, ci95=(0.05, 0.15), vehicles=20)
    likelier = replace(silent().gain, metric="unlikelihood", difference=2.0, ci95=(1.5, 2.5))
    by_law = {
        "idm": LawCompared(0.4, 0.0),
        "full_velocity_difference": LawCompared(0.41, 2.1),
        "krauss": LawCompared(0.5, -3.0),
    }
    found = replace(silent(), law=Law("full_velocity_difference", likelier, gain), by_law=by_law)
    said = diagnosis_words.law_sentence(found)
    assert "follow full velocity difference more likely than the IDM" in said
    assert "higher by 2.00 a driver (95 %: 1.50 to 2.50). On 20 held-out drivers" in said
    assert "0.300 m by it and 0.400 m by the IDM" in said
    table = laws_table(found)
    assert table["law"].tolist() == ["full velocity difference", "the IDM", "Krauss's safe speed"]
    assert "with the causes in the model" not in said
    without = by_law | {"krauss": LawCompared(0.3, 4.0)}
    assert "with the causes in the model; without them Krauss's safe speed would be likelier" in (
        diagnosis_words.law_sentence(replace(found, by_law=without))
    )


def test_a_drift_is_said_to_be_one() -> None:
    drift = CauseFound(
        "time_of_day", {"delta": Estimate(0.25, "1", (0.2, 0.3))}, Region(time_s=(2.0, 440.0)), 1e-9, "a drift"
    )
    said = answer(outcome_of(replace(silent(), verdict="named", causes=(drift,))))
    assert said.what == (
        "Drivers keep longer and longer time headways as the recording goes on (time headway 1.20 s in the beginning, "
        "2.00 s in the end)."
    )
    assert said.where == "This happens from 0:02 to 7:20 (min:s)."


def test_a_cause_of_one_lane_says_which(tmp_path, monkeypatch) -> None:
    found = named()
    gamma = {"gamma": Estimate(0.4, "1", (0.3, 0.5))}
    (cause,) = found.causes
    in_lane = replace(cause, name="acceleration_asymmetry", parameters=gamma, where=Region(lanes=(2,)))
    found = replace(found, causes=(in_lane,))
    said = answer(outcome_of(found))
    assert said.what.startswith("Drivers accelerate more weakly than the model, and brake as it does (60% of the")
    assert said.where == "This happens whenever they accelerate, in lane 2."
    write(found, tmp_path / "out", monkeypatch)
    where = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["causes"][0]["where"]
    assert set(where) == {"position_m", "time_s", "lanes"}
    assert where["lanes"] == [2]
    assert where["position_m"][0] < where["position_m"][1]  # of all that was seen
    assert where["time_s"][0] < where["time_s"][1]


def test_unknown_says_where_when_and_along_what() -> None:
    place = Unexplained("position", (300.0, 360.0), (300.0, 360.0), None, 1e-5)
    found = replace(silent(), verdict="unknown", unexplained=(place,))
    said = answer(outcome_of(found))
    assert "explained by no effect of the catalogue: it shows in position from 300 to 360" in said.what
    assert said.where == "It shows between 300 and 360 m."
    content = contract(found)
    assert content["unexplained"][0]["position_m"] == [300.0, 360.0]
    Contract.model_validate(content)


def test_what_is_there_without_gain_is_told_beside_causes_and_not_as_one() -> None:
    late = CauseFound("reaction_delay", {"tau": Estimate(0.23, "s", (0.17, 0.29))}, None, 1e-11, "present without gain")
    kept = contract(replace(silent(), without_gain=(late,)))
    assert kept["verdict"] == "none"
    assert kept["causes"] == []
    assert [(one["name"], one["parameters"]["tau"]["value"]) for one in kept["without_gain"]] == [
        ("reaction_delay", 0.23)
    ]
    found = replace(silent(), without_gain=(late,))
    said = answer(outcome_of(found))
    assert said.what == (
        "No cause improves the simulation. Present, but without gain: drivers react late (0.23 s after what they react "
        "to)."
    )


def test_nothing_is_left_when_the_contract_is_broken(tmp_path, monkeypatch) -> None:
    with pytest.raises(ValidationError):
        write(replace(named(), verdict="none"), tmp_path / "out", monkeypatch)
    assert not list(tmp_path.glob("*out*"))


@pytest.mark.parametrize(
    "change",
    [
        {"verdict": "maybe"},
        {"verdict": "unknown", "causes": []},
        {"extra": 1},
        {"ruled_out": [{"name": "memory", "p_value": 1.5, "confusable_with": []}]},
        {
            "gain": {
                "metric": "ade_m",
                "base": float("nan"),
                "extended": 1,
                "difference": 0,
                "ci95": [0, 0],
                "vehicles": 1,
                "held_out": True,
            }
        },
    ],
)
def test_what_breaks_the_contract_is_not_written(tmp_path, change) -> None:
    content = contract(named())
    write_diagnosis(tmp_path / "good.json", content)
    with pytest.raises(ValidationError):
        write_diagnosis(tmp_path / "bad.json", content | change)
    assert not (tmp_path / "bad.json").exists()


def test_intervals_are_over_drivers_not_frames() -> None:
    """Frames that repeat a driver's own value add nothing: the interval is that of one value a driver."""
    rng = np.random.default_rng(2)
    own = rng.normal(0, 1, 30)
    driver = np.repeat(np.arange(30), 200)
    mean, half, count = clustered_mean(np.repeat(own, 200), driver, np.zeros(6000, dtype=np.int64), 1)
    expected = 2.0452 * own.std(ddof=1) / np.sqrt(30)  # Student's t, 29 degrees of freedom
    np.testing.assert_allclose([mean[0], half[0], count[0]], [own.mean(), expected, 30], rtol=1e-3)


def test_curves_show_the_place_and_leave_out_what_is_unknown() -> None:
    table = curves(residuals().assign(driver=lambda t: t["vehicle"]), ("base", "extended"))
    assert not {"leader_class", "adjacent_difference", "rear_gap"} & set(table["covariate"])
    place = table[(table["covariate"] == "position") & table["centre"].between(220, 280)]
    base, extended = (place[place["model"] == model] for model in ("base", "extended"))
    assert (base["ci_high"] < -0.3).all()
    np.testing.assert_allclose(extended["mean"].to_numpy(), base["mean"].to_numpy() / 2, atol=0.15)
    speed = table[(table["covariate"] == "speed") & (table["model"] == "base")]
    assert ((speed["ci_low"] < speed["mean"]) & (speed["drivers"] == 40)).all()


def test_the_map_is_empty_where_nobody_was() -> None:
    field = map_of(residuals(), "base", np.array([0.0, 200.0, 300.0, 2000.0]), np.array([0.0, 1e4, 2e4]))
    assert np.isnan(field[:, 1]).all()
    assert field[1, 0] < -0.5 < field[0, 0]


def test_the_lag_of_a_late_response_is_found() -> None:
    rng = np.random.default_rng(3)
    leader = rng.normal(0, 1, (60, 40))
    late = np.roll(leader, 2, axis=1) + rng.normal(0, 0.5, leader.shape)
    mean, half = lag_response(late, leader, np.arange(60), np.arange(-5, 6))
    assert np.argmax(mean) == 5 + 2
    assert mean[7] - half[7] > 0.5
    assert abs(mean[3]) < 0.2


def test_windows_with_a_leader_change_are_told_apart() -> None:
    table = groups(residuals().assign(driver=lambda t: t["vehicle"]))
    assert table["drivers"].tolist() == [20, 20]
    assert (table["base_ade_m"] > table["extended_ade_m"]).all()


def test_too_little_is_none_with_the_reason_and_code_0(tmp_path, capsys) -> None:
    """The real command, on a recording of a few pairs."""
    pd.concat([pair(12, 7), pair(31, 30)]).to_parquet(tmp_path / "pairs.parquet")
    main(["diagnose", str(tmp_path / "pairs.parquet"), "-o", str(tmp_path / "out"), "--jobs", "1"])
    assert "too little to say anything" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert content["verdict"] == "none"
    assert content["gain"]["vehicles"] == 0
    assert "too little" in (tmp_path / "out" / "report.html").read_text()
    assert ExtendedModel.read(tmp_path / "out" / "model.json").causes == ()


def test_a_planted_place_is_named_and_its_model_drives(tmp_path, slow_place) -> None:
    """From a file to a replay with the extended model, as a user goes; the finder is tested at length elsewhere."""
    planted, out = slow_place / "planted.txt", slow_place / "diagnosis"
    assert "location" in (slow_place / "said.txt").read_text()
    content = json.loads((out / "diagnosis.json").read_text())
    first = content["causes"][0]
    assert (content["verdict"], first["name"]) == ("named", "location")
    assert first["where"]["position_m"] == pytest.approx(runs.slow_place().place, abs=40)
    assert content["gain"]["ci95"][0] > 0
    curve = pd.read_csv(out / "tables" / "residual_curves.csv")
    assert {"base", "extended"} == set(curve["model"])
    drivers = pd.read_csv(out / "tables" / "drivers.csv")
    vehicle = str(drivers["vehicle"].iloc[len(drivers) // 2])
    model = str(out / "model.json")
    main(["replay", str(planted), "--vehicle", vehicle, "--backend", "kernel", "--model", model,
          "-o", str(tmp_path / "replay")])  # fmt: skip
    assert set(pd.read_csv(tmp_path / "replay" / "scores.csv")["model"]) == {"idm_oracle", "extended"}
    assert ExtendedModel.read(model).drivers == "drivers.parquet"
    own = read_drivers(out / "drivers.parquet")
    assert len(own) == len(drivers)
    assert own["desired_speed_m_s"].between(12.0, 50.0).all()
    check_departures(own)
