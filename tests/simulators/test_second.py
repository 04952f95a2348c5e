"""The second simulator: sound traffic, effects as described, nothing shared with finder or first one."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from idm_sumo.recordings.reading import read_recording
from tests.simulators import second as elsewhere
from tests.simulators.campaign import second as campaign_elsewhere
from tests.simulators.campaign.scores import outcome
from tests.simulators.second import cases, effects, gain, laws, road, scenes, view
from tests.simulators.second.checks import true_accelerations, true_gaps
from tests.simulators.second.respond import wish

FOLDER = Path(elsewhere.__file__).parent
DRIVER = np.array([28.0, 1.4, 2.0, 1.3, 1.8])


def test_it_shares_no_code_with_the_finder_or_the_first_simulator():
    for file in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            named = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            theirs = [one for one in named if one.startswith(("idm_sumo", "tests", "analysis"))]
            assert all(one.startswith("tests.simulators.second") for one in theirs), file.name


def test_a_recording_is_sound_traffic_in_the_official_layout(tmp_path):
    (case,) = elsewhere.plan(
        7, {**dict.fromkeys(("single", "some_drivers", "one_lane", "pair", "outside"), 0), "null": 1}
    )
    got, faults = elsewhere.make(7, 1, case)
    assert not faults
    assert true_gaps(got).min() > 0.0
    assert np.abs(true_accelerations(got)).max() < 6.0
    got["table"].to_parquet(tmp_path / "r.parquet", index=False)
    read = read_recording(tmp_path / "r.parquet")
    assert len(read.table) == len(got["table"])
    told = elsewhere.truth(1, case, got, faults)
    assert told["planted"] == []
    assert told["recording"]["vehicles"] == got["table"]["Vehicle_ID"].nunique()


@pytest.mark.parametrize("law", laws.LAWS)
def test_every_law_keeps_a_steady_gap_and_brakes_when_it_closes(law):
    number = laws.LAWS.index(law)
    gaps = np.linspace(3.0, 80.0, 400)
    steady = np.array([laws.acceleration(number, gap, 12.0, 12.0, DRIVER) for gap in gaps])
    assert steady[0] < 0.0 < steady[-1]
    assert laws.acceleration(number, 8.0, 12.0, 6.0, DRIVER) < laws.acceleration(number, 8.0, 12.0, 12.0, DRIVER) + 1e-9


def behind_a_leader(**columns: float) -> np.ndarray:
    see = np.zeros(view.COLUMNS)
    see[[view.S, view.V, view.VL, view.V2, view.REAR, view.SLOWER]] = 18.0, 12.0, 11.0, -1.0, 500.0, 12.0
    for name, value in columns.items():
        see[getattr(view, name)] = value
    return see


def driven(name: str, size: float, **columns: float) -> tuple[float, float]:
    """Return what an IDM driver does (m/s2) without and with an effect in its usual form."""
    hidden = view.Effect(name, effects.CATALOGUE.index(name), 0, size, q=12.0, position=(100.0, 200.0)).row()
    see = behind_a_leader(**columns)
    none, all_ = np.zeros(1), np.ones(1)
    return tuple(wish(0, see, DRIVER, np.array([hidden]), touched, -1) for touched in (none, all_))


def test_effects_are_as_the_catalogue_has_them():
    plain, slowed = driven("location", -0.2, X=150.0)
    assert slowed - plain == pytest.approx(-0.2)
    plain, elsewhere_ = driven("location", -0.2, X=250.0)
    assert plain == elsewhere_
    plain, beside = driven("adjacent_lane_friction", 0.05, SLOWER=8.0)
    assert beside - plain == pytest.approx(-0.05 * 4.0)
    plain, behind_truck = driven("leader_class", 0.3, CLASS=3.0)
    longer = np.array([28.0, 1.4 * 1.3, 2.0, 1.3, 1.8])
    assert behind_truck == pytest.approx(laws.idm(18.0, 12.0, 11.0, longer))
    plain, blind = driven("perception_threshold", 1.5)
    assert blind == pytest.approx(laws.idm(18.0, 12.0, 12.0, DRIVER))


def test_its_trials_are_records_that_the_campaign_grades(tmp_path):
    trials = campaign_elsewhere.trials(1, 3, 5)
    assert {one["group"] for one in trials} == {"none", "single", "pair", "outside", "some drivers", "one lane"}
    assert sum(one["group"] == "none" for one in trials) == 3
    nothing = next(one for one in trials if one["group"] == "none")
    told = {"verdict": "none", "causes": [], "unexplained": [], "gain": None}
    record = campaign_elsewhere.run_trial(nothing, tmp_path, lambda file, _: {**told, "bytes": file.stat().st_size})
    assert record["found"]["bytes"] > 100_000
    assert outcome(record) == "silent"
    again = campaign_elsewhere.run_trial(nothing, tmp_path, lambda *_: pytest.fail("a kept case ran again"))
    assert again["found"] == record["found"]


@pytest.mark.parametrize("name", ["reaction_delay", "adjacent_lane_friction"])
def test_true_drivers_without_noise_drive_what_was_driven(name):
    rng = np.random.default_rng(3)
    scene = scenes.draw_scene(rng, [name]) | {"law": "idm", "lanes": 3, "seconds": 60.0}
    scene["lane_factors"], scene["driver_noise"]["sigma"] = (1.2, 1.0, 0.8), 0.0
    hidden = cases.hide(rng, {"kind": "single", "names": [name], "size": ["large"], "usual": [True]}, scene, 1.0)
    world, _, memory = cases.drive(rng, scene, hidden)
    errors = []
    for driver, see, starts in gain.some_tracks(memory):
        lag = round(world.lag[driver] / road.DT)
        film = gain.as_filmed(see, lag, rng, {"kind": "white", "sigma_m": 0.0})
        given = (
            film,
            film[:, view.X].copy(),
            starts,
            0,
            view.rows_of(hidden),
            world.touched[driver],
            lag,
        )
        errors.append([gain.driver_error(world.theta[driver], out, *given) for out in (gain.NOBODY, gain.ALL)])
    without, with_it = np.median(errors, axis=0)
    assert with_it < 0.01 < without


def test_an_effect_is_worth_what_drivers_cannot_make_up_for():
    (case,) = elsewhere.plan(
        4, {**dict.fromkeys(("null", "some_drivers", "one_lane", "pair", "outside"), 0), "single": 1}
    )
    case |= {"names": ["time_of_day"], "size": ["large"], "usual": [True]}
    got, _ = elsewhere.make(4, 1, case)
    few = {**got, "memory": got["memory"][got["memory"][:, 0] % 25 == 0]}
    told = elsewhere.worth(few, 4)
    assert told["drivers"] > 5
    assert told["extended"] < 0.97 * told["base"]
