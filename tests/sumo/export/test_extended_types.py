"""Effects in SUMO's vehicle types: notes and behaviour in SUMO."""

from pathlib import Path
from xml.etree.ElementTree import TreeBuilder, XMLParser, parse

import numpy as np
import pytest

from idm_sumo.models.effects import CATALOGUE, Cause, ExtendedModel
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.us101 import US101
from idm_sumo.sumo.export.routes import Exported, export_routes
from idm_sumo.sumo.session import simulation
from tests.helpers.exports import drivers, sumo

EXPRESSED = {"reaction_delay", "vehicle_class", "time_of_day", "desired_speed"}


def model_of(*causes: Cause) -> ExtendedModel:
    return ExtendedModel(TEXTBOOK, US101.speed_limit, causes=causes)


def types_of(path: Path) -> dict[str, dict[str, str]]:
    return {kind.attrib["id"]: kind.attrib for kind in parse(path).getroot().findall("vType")}


@pytest.mark.parametrize(
    "effect", [effect for effect in CATALOGUE if effect.parameters], ids=lambda effect: effect.name
)
def test_every_cause_is_expressed_or_said_not_to_be_in_one_line_and_in_the_file(tmp_path, effect) -> None:
    values = {p.symbol: p.typical for p in effect.parameters}
    plain = export_routes(drivers(), tmp_path / "plain.rou.xml")
    result = export_routes(drivers(), tmp_path / "us101.rou.xml", model=model_of(Cause(effect.name, values)))
    said = [note for note in result.notes if note.startswith(effect.name)]
    assert len(said) == 1
    assert "\n" not in said[0]
    changed = types_of(result.route_file) != types_of(plain.route_file)
    if effect.name not in EXPRESSED:
        assert "no SUMO vehicle type" in said[0]
        assert not changed
    builder = XMLParser(target=TreeBuilder(insert_comments=True))
    comments = [node.text for node in parse(result.route_file, builder).getroot() if not isinstance(node.tag, str)]
    assert len(comments) == 1
    assert effect.name in comments[0]


def test_sumo_validates_and_runs_them_all(tmp_path) -> None:
    causes = (Cause("reaction_delay", {"tau": 0.4}), Cause("vehicle_class", {"theta": 0.4}),
              Cause("time_of_day", {"theta": 0.2, "t_1": 0.0, "t_2": 10.0}),
              Cause("desired_speed", {"delta": 0.1, "lane": 0.0}))  # fmt: skip
    table = drivers()
    result = export_routes(table, tmp_path / "us101.rou.xml", model=model_of(*causes), integration="ballistic")
    run = sumo(result.config_file)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    kinds = types_of(result.route_file)
    first = next(iter(kinds.values()))
    assert (first["carFollowModel"], first["actionStepLength"], first["speedFactor"]) == ("IDM", "0.8", "1.1")
    since = table["depart_s"] - table.groupby("period")["depart_s"].transform("min")
    expected = table["T"] * np.where(table["vehicle_class"] == 3, 1.4, 1.0) * np.where(since < 10, 1.2, 1.0)
    names = table["period"] + "." + table["vehicle"].astype(str)
    got = [float(kinds[name]["tau"]) for name in names]
    np.testing.assert_allclose(got, expected)
    assert float(first["maxSpeed"]) == pytest.approx(1.1 * US101.speed_limit)


def test_a_drift_is_expressed_by_departure(tmp_path) -> None:
    table = drivers()
    drift = Cause("time_of_day", {"delta": 0.2, "t_1": 0.0, "t_2": 10.0})
    result = export_routes(table, tmp_path / "us101.rou.xml", model=model_of(drift))
    since = table["depart_s"] - table.groupby("period")["depart_s"].transform("min")
    expected = table["T"] * np.interp(since, [0.0, 10.0], [0.8, 1.2])
    kinds = types_of(result.route_file)
    got = [float(kinds[name]["tau"]) for name in table["period"] + "." + table["vehicle"].astype(str)]
    np.testing.assert_allclose(got, expected, rtol=1e-3)
    assert "times 0.8 at 0 s to 1.2 at 10 s" in result.notes[-1]


@pytest.mark.parametrize("known", [True, False])
def test_a_cause_of_some_drivers_is_in_their_types_only(known, tmp_path) -> None:
    table = drivers()
    model = model_of(Cause("reaction_delay", {"tau": 0.4}, share=0.5), Cause("desired_speed", {"delta": 0.1}))
    has = np.arange(len(table)) % 3 == 0 if known else model.has_partial_causes(table["vehicle"])
    assert 0 < has.sum() < len(table)
    if known:
        table = table.assign(has_what_some_have=has.astype(int))
    result = export_routes(table, tmp_path / "us101.rou.xml", model=model)
    kinds = types_of(result.route_file)
    names = table["period"] + "." + table["vehicle"].astype(str)
    np.testing.assert_array_equal([kinds[name]["actionStepLength"] == "0.8" for name in names], has)
    assert all(kinds[name]["speedFactor"] == "1.1" for name in names)
    (said,) = (note for note in result.notes if note.startswith("reaction_delay"))
    assert f"{has.sum()} of {len(table)} drivers have it" in said


def test_a_cause_of_some_lanes_is_not_expressed_for_all(tmp_path) -> None:
    result = export_routes(
        drivers(), tmp_path / "us101.rou.xml", model=model_of(Cause("reaction_delay", {"tau": 0.6}, (2, 3)))
    )
    assert "reaction_delay in lane 2, 3: no SUMO vehicle type" in result.notes[-1]
    assert 'actionStepLength="0.1"' in result.route_file.read_text()


@pytest.mark.parametrize("by_lane", [{"lane": 2.0}, {"n": 4.0}])
def test_a_desired_speed_by_lane_is_not_expressed_for_all(by_lane, tmp_path) -> None:
    slower = Cause("desired_speed", {"delta": -0.2, **by_lane})
    result = export_routes(drivers(), tmp_path / "us101.rou.xml", model=model_of(slower))
    assert "desired_speed by lane: no SUMO vehicle type" in result.notes[-1]
    first = types_of(result.route_file)[f"{drivers()['period'][0]}.{drivers()['vehicle'][0]}"]
    assert float(first["maxSpeed"]) == pytest.approx(US101.speed_limit)


def test_a_delay_that_spares_the_own_speed_is_said_to_become_one_of_everything(tmp_path) -> None:
    of_all, spared = (
        export_routes(
            drivers(), tmp_path / f"{eta}.rou.xml", model=model_of(Cause("reaction_delay", {"tau": 0.6, "eta": eta}))
        )
        for eta in (0.0, 1.0)
    )
    assert "own speed late" in spared.notes[-1]
    assert "own speed" not in of_all.notes[-1]


def test_a_type_with_a_delay_drives_nearer_to_the_delayed_driver_than_one_without(tmp_path) -> None:
    """The reference is the exact delay behind SUMO's leader."""
    tau, frames = 0.4, 300
    time = np.arange(frames + 2) * FRAME_STEP
    leads = 11 + 2.5 * np.sin(2 * np.pi * time / 14) + np.sin(2 * np.pi * time / 5.3 + 1)
    distance = {}
    for name, causes in (("plain", ()), ("delayed", (Cause("reaction_delay", {"tau": tau}),))):
        table = drivers(2, a=1.0, b=2.0, T=1.2, d0=2.0, lane=2, x_m=[60.0, 38.0], speed_m_s=float(leads[0]),
            depart_s=0.0,
                        vehicle_class=2, length_m=4.5, period="p", vehicle=[1, 2])  # fmt: skip
        result = export_routes(table, tmp_path / f"{name}.rou.xml", model=model_of(*causes))
        leader, follower = drive(result, leads[:-1])
        distance[name] = np.abs(delayed(tau, leader, follower[0]) - follower[:, 0]).mean()
    assert distance["delayed"] < 0.5 * distance["plain"]


def drive(result: Exported, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (m) and speeds (m/s), shape (frames, 2).

    Leader and follower are the columns.
    """
    seen = []
    with simulation(["--route-files", str(result.route_file), "--no-warnings", "true"], net=result.net_file) as running:
        running.simulationStep()
        for name in ("p.1", "p.2"):
            running.vehicle.setLaneChangeMode(name, 0)
        running.vehicle.setSpeedMode("p.1", 0)
        for speed in speeds[1:].tolist():
            seen.append([(running.vehicle.getPosition(n)[0], running.vehicle.getSpeed(n)) for n in ("p.1", "p.2")])
            running.vehicle.setSpeed("p.1", speed)
            running.simulationStep()
    table = np.array(seen)
    return table[:, 0], table[:, 1]


def delayed(tau: float, leader: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return positions (m) of an IDM driver with delay.

    It acts on what was ``tau`` (s) ago; ballistic steps, written out.
    """
    late, (x, v), past, out = round(tau / FRAME_STEP), start, [], []
    for front, speed in leader:
        out.append(x)
        past.append((front - 4.5 - x, v, v - speed))
        gap, own, rate = past[max(len(past) - 1 - late, 0)]
        wanted = 2.0 + max(0.0, own * 1.2 + own * rate / (2 * np.sqrt(1.0 * 2.0)))
        a = 1.0 * (1 - (own / US101.speed_limit) ** 4 - (wanted / gap) ** 2)
        x, v = x + (v + 0.05 * a) * FRAME_STEP, v + a * FRAME_STEP
    return np.array(out)


def test_a_law_that_is_no_idm_is_said_to_be_our_loops_only(tmp_path) -> None:
    plain = export_routes(drivers(), tmp_path / "plain.rou.xml")
    result = export_routes(
        drivers(), tmp_path / "us101.rou.xml", model=ExtendedModel(TEXTBOOK, US101.speed_limit, law="krauss")
    )
    (said,) = [note for note in result.notes if note.startswith("law krauss")]
    assert "interactive --model" in said
    assert types_of(result.route_file) == types_of(plain.route_file)
