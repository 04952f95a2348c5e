"""Roads of networks of one's own: numbers, places, and SUMO's traffic where the recording has it."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import calibrate, integrators
from idm_sumo.calibration.problem import prepare
from idm_sumo.calibration.status import leader_changes
from idm_sumo.calibration.without_d1 import REFIT, refit_table
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording, write_parquet
from idm_sumo.roads.pieces import shown
from idm_sumo.roads.straight import straight_road
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm
from idm_sumo.sumo import network
from idm_sumo.sumo.export.routes import export_routes
from idm_sumo.sumo.own_network import road_of
from idm_sumo.sumo.replay.one_vehicle import replay
from idm_sumo.sumo.replay.playback import play
from idm_sumo.sumo.session import simulation
from tests.fuzz.seeds import NETWORK
from tests.roads import networks, proof

SECONDS = 45.0
NEAR = 25.0  # m, of a leader that hides a light
BY_NAME = {"curve": networks.EVERY[1], "ramp": networks.RAMP, "city": networks.CITY}
pytestmark = pytest.mark.skipif(
    not shutil.which(networks.netconvert()), reason="netconvert is not there (package eclipse-sumo)"
)


@pytest.fixture(scope="module", params=list(BY_NAME))
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, proof.Truth]:
    folder = tmp_path_factory.mktemp(request.param)
    return request.param, proof.make(BY_NAME[request.param], folder, seconds=SECONDS)


def test_positions_of_sumo_come_back(made: tuple[str, proof.Truth], tmp_path: Path) -> None:
    name, truth = made
    recording = proof.recorded(BY_NAME[name], truth, tmp_path, step=0.1, noise=0.0)
    table, road = recording.table, recording.road
    number = {which: one for one, which in proof.named(recording, truth).items()}
    fcd = truth.fcd.assign(vehicle=truth.fcd["vehicle_id"].astype(str).map(number))
    fcd["frame"] = (fcd["timestep_time"] * 10).round().astype("int64")
    both = table.merge(fcd[["vehicle", "frame", "vehicle_x", "vehicle_y"]], on=["vehicle", "frame"])
    assert len(both) == len(table) > 1000
    place = shown(road, both[c.X], both[c.Y])
    assert np.hypot(place.x - both["vehicle_x"], place.y - both["vehicle_y"]).max() < 0.01


def test_sumo_shows_vehicles_where_they_were_and_agrees_with_the_kernels(
    made: tuple[str, proof.Truth], tmp_path: Path
) -> None:
    name, truth = made
    recording = proof.recorded(BY_NAME[name], truth, tmp_path, step=0.1, noise=0.0)
    scenes = build_scenes(recording, Window(observed=10, horizon=50))
    some = scenes.subset(np.arange(0, len(scenes), max(len(scenes) // 8, 1)))
    drivers = calibrate(some)
    ours, theirs = drive_idm(some, drivers), replay(some, drivers)
    assert np.abs(ours.x - theirs.x).max() < 1e-3
    assert len(recording.periods) == 1


def test_a_recording_keeps_its_network(made: tuple[str, proof.Truth], tmp_path: Path) -> None:
    name, truth = made
    recording = proof.recorded(BY_NAME[name], truth, tmp_path, step=0.1, noise=0.0)
    write_parquet(recording, tmp_path / "kept.parquet")
    again = read_recording(tmp_path / "kept.parquet")
    assert again.road == recording.road
    pd.testing.assert_frame_equal(again.table, recording.table)


def test_places_on_edges_come_back(made: tuple[str, proof.Truth]) -> None:
    name, truth = made
    road = road_of(truth.net, BY_NAME[name].corridor)
    net = network.of(road)
    x = np.linspace(1.0, road.length - 1.0, 50)
    outside = np.array([not any(p.internal and p.start < one < p.end for p in road.pieces) for one in x])
    for lane in range(1, road.main_lanes + 1):
        back, _, lanes = net.coordinates(net.place(x[outside], np.full(outside.sum(), lane)))
        np.testing.assert_allclose(back, x[outside], atol=1e-6)
        assert (lanes == lane).all()


def test_a_ramp_and_its_lane_are_side_lanes(tmp_path: Path) -> None:
    road = road_of(networks.build(networks.RAMP, tmp_path))
    assert road.main_lanes == 2
    assert [lane.kind for lane in road.side_lanes] == ["auxiliary", "on-ramp"]
    assert road.edges == ("before", "merge", "after")


def test_a_network_of_several_roads_asks_for_the_corridor(tmp_path: Path) -> None:
    net = networks.build(networks.CITY, tmp_path)
    with pytest.raises(InputError, match=r"more than one road.*--corridor"):
        road_of(net)
    assert road_of(net, ["west", "east"]).has_signals
    with pytest.raises(InputError, match="has no edge 'nowhere' for cars; it has east, north"):
        road_of(net, ["nowhere"])
    with pytest.raises(InputError, match="no way from edge 'east' to 'west'"):
        road_of(net, ["east", "west"])


def test_what_is_no_network_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.net.xml").write_text('<net><edge id="a">')
    with pytest.raises(InputError, match="line 1: malformed XML"):
        road_of(tmp_path / "bad.net.xml")
    with pytest.raises(InputError, match="no such file; name a network"):
        road_of(tmp_path / "none.net.xml")


def test_a_straight_road_has_a_network_without_netconvert(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IDM_SUMO_CACHE", str(tmp_path))
    road = straight_road("test", (3.5, 3.0), length=500.0, speed_limit=30.0)
    net = network.of(road)
    with simulation([], net=net.file) as sumo:
        sumo.route.add("main", net.mainline)
        sumo.vehicle.add("one", "main", departLane="1", departSpeed="30")
        for _ in range(300):
            sumo.simulationStep()
        assert sumo.vehicle.getLaneID("one") == "downstream_1"
        assert sumo.vehicle.getPosition("one")[1] == pytest.approx(float(road.lane_center(1)))


def test_a_straight_road_has_an_edge_every_hundred_metres(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IDM_SUMO_CACHE", str(tmp_path))
    net = network.of(straight_road("test", (3.5, 3.0), length=514.0, speed_limit=30.0, beside=True))
    ends = np.array(net.mainline_ends())
    assert np.diff(ends)[:-1] == pytest.approx(514.0 / 5, abs=0.02)
    assert (net.mainline_start(), ends[0], ends[-2], ends[-1]) == (-300.0, 0.0, 514.0, 1014.0)
    x, lane = np.array([-100.0, 5.0, 250.0, 513.0, 700.0]), np.array([1, 2, 1, 3, 3])
    where = net.place(x, lane)
    found_x, _, found_lane = net.coordinates(where)
    np.testing.assert_allclose(found_x, x)
    assert found_lane.tolist() == [1, 2, 1, 2, 2]  # who is beside the main lanes is put on the rightmost


def test_a_road_begins_where_its_first_edge_does_wherever_that_lies(made: tuple[str, proof.Truth]) -> None:
    name, truth = made
    assert network.of(road_of(truth.net, BY_NAME[name].corridor)).mainline_start() == 0.0


def test_exported_types_drive_as_calibrated_on_the_own_edges(made: tuple[str, proof.Truth], tmp_path: Path) -> None:
    name, truth = made
    recording = proof.recorded(BY_NAME[name], truth, tmp_path, step=0.1, noise=0.0)
    scenes = build_scenes(recording, Window(observed=10, horizon=50))
    drivers = calibrate(scenes)
    drivers = drivers.join(refit_table(drivers, scenes)[list(REFIT)])
    exported = export_routes(drivers, tmp_path / "own.rou.xml", road=recording.road)
    fcd = tmp_path / "own.parquet"
    options = ["--configuration-file", str(exported.config_file), "--fcd-output", str(fcd), "--precision", "6"]
    with simulation([*options, "--fcd-output.acceleration", "true"], net=exported.net_file) as sumo:
        for _ in range(round(10 * SECONDS)):
            sumo.simulationStep()
    driven = clean(read_recording(fcd, road=recording.road, route_files=[exported.route_file]))
    windows = build_scenes(driven, Window(observed=10, horizon=50, every=50))
    names = list(dict.fromkeys(pd.read_parquet(fcd)["vehicle_id"].astype(str)))
    who = pd.Index(exported.vehicles["id"]).get_indexer(pd.Index([names[n - 1] for n in windows.vehicle]))
    theta = drivers.set_index("vehicle").loc[exported.vehicles["vehicle"].to_numpy()[who]]
    problem = prepare(windows, desired_speed=theta["desired_speed_m_s"].to_numpy())
    ours, _ = integrators.drive(problem, theta[list(REFIT)].assign(d1=0.0), "euler")
    apart = np.abs(ours - windows.x[:, windows.start :]).max(axis=1)
    follows = (np.abs(np.diff(windows.y, axis=1)).max(axis=1) < 1.0) & (leader_changes(problem) == 0)
    gap = problem.rear - windows.x[:, windows.start :]
    follows &= (name != "city") | (gap < NEAR).all(axis=1)  # others may slow down for the light
    assert follows.sum() > 10
    assert apart[follows].max() < 0.001


def test_play_is_exact_on_a_straight_road(tmp_path: Path) -> None:
    truth = proof.make(networks.STRAIGHT, tmp_path, seconds=15.0)
    recording = proof.recorded(networks.STRAIGHT, truth, tmp_path, step=0.1, noise=0.0)
    assert play(clean(recording)).largest_deviation < 0.01


def grid(folder: Path, size: int) -> Path:
    """Return a town of streets in both directions."""
    net = folder / "grid.net.xml"
    generate = Path(networks.netconvert()).with_name("netgenerate")
    options = ["--grid", "--grid.number", str(size), "--grid.attach-length", "100", "--no-turnarounds", "true"]
    subprocess.run([str(generate), *options, "-o", str(net)], check=True, capture_output=True)
    return net


def test_a_town_asks_for_the_corridor_too(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"more than one road.*--corridor"):
        road_of(grid(tmp_path, 7))


def test_a_corridor_meets_no_edge_twice(tmp_path: Path) -> None:
    net = grid(tmp_path, 2)
    with pytest.raises(InputError, match="meets edge 'A0A1' twice"):
        road_of(net, ["A0A1", "B1B0", "A0A1"])


def test_a_road_of_a_thousand_edges_is_one_road(tmp_path: Path) -> None:
    nodes = "".join(f'<node id="{n}" x="{20 * n}" y="0"/>' for n in range(1201))
    edges = "".join(f'<edge id="e{n}" from="{n}" to="{n + 1}" numLanes="2" speed="30"/>' for n in range(1200))
    road = road_of(networks.build(networks.Network("long", nodes, edges, {}, {}), tmp_path))
    assert len(road.edges) == 1200
    assert road.length == pytest.approx(24_000.0, rel=0.01)  # SUMO counts 0.1 m for each of the junctions, too


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('length="182.50"', 'length="inf"', "line 17: lane 'in_0': length = 'inf' is impossible"),
        ('width="3.20" shape="0.00,35.20 182.50,35.20"', 'shape="0.00,35.20"', "its shape is not two points"),
        ('<edge id="out"', '<edge id="in"', "edge 'in' is there twice"),
        ('via=":b_1_0"', 'via=":b_9_0"', "not a sound SUMO network"),
        ("<net ", "<routes ", "root element is <routes>; a SUMO network has <net>"),
    ],
)
def test_what_is_wrong_in_a_network_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    text = NETWORK.read_text()
    assert old in text
    (tmp_path / "bad.net.xml").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=re.escape(complaint)):
        road_of(tmp_path / "bad.net.xml")
