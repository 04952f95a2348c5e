"""What is exported: SUMO validates it, runs it and reads every number back."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import parse

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import calibrate
from idm_sumo.calibration.departures import departures
from idm_sumo.calibration.without_d1 import linearise, refit_table
from idm_sumo.models import idm
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.sumo import network, session
from idm_sumo.sumo.closed_loop.insertion import departure_delays
from idm_sumo.sumo.export.courses import StraightRoads
from idm_sumo.sumo.export.distribution import export_distribution
from idm_sumo.sumo.export.routes import Exported, export_routes
from tests.helpers.builders import Car
from tests.helpers.builders import recording as of_cars
from tests.helpers.exports import PERIODS, drivers, read_types, sumo


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, Exported]:
    table = drivers()
    return table, export_routes(table, tmp_path_factory.mktemp("export") / "us101.rou.xml")


@pytest.mark.parametrize("integration", ["euler", "ballistic"])
def test_sumo_validates_and_runs_what_is_exported_without_a_word(tmp_path: Path, integration: str) -> None:
    result = export_routes(drivers(), tmp_path / "us101.rou.xml", integration=integration)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["us101.net.xml", "us101.rou.xml", "us101.sumocfg"]
    trips = tmp_path / "trips.xml"
    run = sumo(result.config_file, "--tripinfo-output", str(trips))
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    arrived = parse(trips).getroot().findall("tripinfo")
    assert {trip.attrib["id"] for trip in arrived} == set(result.vehicles["id"])
    assert all(float(trip.attrib["departDelay"]) == 0.0 for trip in arrived)


def test_the_schemas_are_really_consulted(exported: tuple[pd.DataFrame, Exported], tmp_path: Path) -> None:
    for path in exported[1].route_file.parent.iterdir():
        (tmp_path / path.name).write_text(path.read_text().replace('delta="4"', 'delta="four"'))
    run = sumo(tmp_path / "us101.sumocfg")
    assert run.returncode != 0
    assert "'four'" in run.stderr


def test_libsumo_reads_back_every_parameter(exported: tuple[pd.DataFrame, Exported]) -> None:
    table, result = exported
    by_id = table.assign(id=table["period"] + "." + table["vehicle"].astype(str)).set_index("id")
    with session.simulation(["-c", str(result.config_file)], net=result.net_file) as live:
        assert float(live.simulation.getOption("step-length")) == FRAME_STEP
        for name in result.vehicles["id"]:
            row, kind = by_id.loc[name], live.vehicletype
            assert kind.getAccel(name) == row["a"]
            assert kind.getDecel(name) == row["b"]
            assert kind.getTau(name) == row["T"]
            assert kind.getMinGap(name) == row["d0"]
            assert kind.getLength(name) == row["length_m"]
            assert kind.getWidth(name) == row["width_m"]
            assert kind.getMaxSpeed(name) == US101.speed_limit
            assert kind.getEmergencyDecel(name) == idm.EMERGENCY_BRAKING
            assert kind.getSpeedFactor(name) == 1.0
            assert kind.getSpeedDeviation(name) == 0.0
            assert kind.getActionStepLength(name) == FRAME_STEP


def test_vehicles_depart_when_where_and_as_fast_as_recorded(exported: tuple[pd.DataFrame, Exported]) -> None:
    table, result = exported
    where = network.of(US101).place(table["x_m"].to_numpy(), table["lane"].to_numpy())
    rows = table.assign(edge=where.edge, index=where.lane_index, position=where.position)
    rows.index = pd.Index(table["period"] + "." + table["vehicle"].astype(str))
    root = parse(result.route_file).getroot()
    ways = {route.attrib["id"]: route.attrib["edges"].split() for route in root.findall("route")}
    vehicles = root.findall("vehicle")
    assert len(vehicles) == len(table)
    depart = [float(vehicle.attrib["depart"]) for vehicle in vehicles]
    assert depart == sorted(depart)
    assert depart[0] == 0.0
    for vehicle in vehicles:
        row, said = rows.loc[vehicle.attrib["id"]], vehicle.attrib
        later = 900.0 if row["period"] == PERIODS[1] else 0.0  # the label says a quarter of an hour
        assert float(said["depart"]) == pytest.approx(row["depart_s"] - 0.1 + later, abs=1e-3)
        assert (ways[said["route"]][0], int(said["departLane"])) == (row["edge"], row["index"])
        assert float(said["departPos"]) == row["position"]
        assert float(said["departSpeed"]) == row["speed_m_s"]
        assert said["type"] == said["id"]


def test_equal_drivers_still_have_a_type_each(tmp_path: Path) -> None:
    table = drivers(a=1.0, b=2.0, T=1.5, d0=2.0, length_m=4.5, vehicle_class=2)
    result = export_routes(table, tmp_path / "equal.rou.xml")
    assert set(read_types(result.route_file)) == set(result.vehicles["id"])


def test_classes_and_shapes(exported: tuple[pd.DataFrame, Exported]) -> None:
    table, result = exported
    names = table["period"] + "." + table["vehicle"].astype(str)
    expected = table["vehicle_class"].map({0: "passenger", 1: "motorcycle", 2: "passenger", 3: "truck"})
    types = read_types(result.route_file)
    assert [types[name].attrib["vClass"] for name in names] == expected.tolist()
    assert [types[name].attrib["guiShape"] for name in names] == expected.tolist()


def test_several_windows_of_a_vehicle_have_names_of_their_own(tmp_path: Path) -> None:
    table = drivers(n=4, period="a b", vehicle=5, first_frame=[0, 100, 200, 300], depart_s=[0.0, 10.0, 20.0, 30.0])
    result = export_routes(table, tmp_path / "windows.rou.xml")
    assert result.vehicles["id"].tolist() == ["a_b.5.0", "a_b.5.100", "a_b.5.200", "a_b.5.300"]


def test_too_fast_a_departure_is_slowed_and_said(tmp_path: Path) -> None:
    result = export_routes(drivers(speed_m_s=30.0, lane=np.arange(30) % 5 + 1, x_m=3.0), tmp_path / "fast.rou.xml")
    assert "30 vehicles depart just below their maxSpeed" in result.notes[0]
    assert sumo(result.config_file).stderr == ""


def test_a_late_departure_is_reported_with_its_delay(tmp_path: Path) -> None:
    """The second of two vehicles at one place waits."""
    table = drivers(n=4, period="p", vehicle=[1, 2, 3, 4], depart_s=[0.0, 0.0, 0.0, 50.0], lane=[1, 1, 2, 1], x_m=3.0)
    delays = departure_delays(export_routes(table, tmp_path / "late.rou.xml").config_file).set_index("id")["delay_s"]
    assert sorted(delays[["p.1", "p.2"]] > 0) == [False, True]
    assert delays[["p.1", "p.2"]].max() < 60.0
    assert (delays[["p.3", "p.4"]] == 0.0).all()


def test_a_vehicle_that_sumo_never_inserts_is_reported(tmp_path: Path) -> None:
    """It could not stop where the auxiliary lane ends.

    It is fast on the on-ramp and its brake is weak.
    """
    table = drivers(n=2, period="p", vehicle=[1, 2], b=0.2, T=3.0, speed_m_s=[24.0, 8.0], lane=[7, 1], x_m=[170.0, 3.0])
    result = export_routes(table, tmp_path / "never.rou.xml")
    delays = departure_delays(result.config_file).set_index("id")["delay_s"]
    assert delays.to_dict() == {"p.1": np.inf, "p.2": 0.0}
    assert "p.1" in sumo(result.config_file).stderr


# What stands for d1.


def test_d1_needs_its_refit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a_refit"):
        export_routes(drivers(d1=2.0), tmp_path / "x.rou.xml")
    assert not list(tmp_path.iterdir())


def test_the_refit_is_what_is_exported(tmp_path: Path) -> None:
    table = drivers(d1=2.0, a_refit=1.25, b_refit=2.5, T_refit=1.75, d0_refit=3.5, refit_integration="euler")
    result = export_routes(table, tmp_path / "x.rou.xml")
    assert result.notes == ()
    kind = next(iter(read_types(result.route_file).values())).attrib
    assert [kind[name] for name in ("accel", "decel", "tau", "minGap")] == ["1.25", "2.5", "1.75", "3.5"]
    note = export_routes(table, tmp_path / "y.rou.xml", integration="ballistic").notes
    assert note == ("refitted under euler, exported for ballistic",)
    with pytest.raises(InputError, match=r"refit.*row 0"):
        export_routes(table.assign(T_refit=np.nan), tmp_path / "z.rou.xml")


def test_linearised_wants_the_same_gap_at_the_mean_speed(tmp_path: Path) -> None:
    mean = np.linspace(3.0, 18.0, 30)
    table = drivers(d1=2.0, mean_speed_m_s=mean)
    theta = table[list(idm.IDMParameters._fields)].to_numpy()
    linear = linearise(theta, mean, US101.speed_limit)
    assert (linear[:, 4] == 0.0).all()
    for row, plain, v in zip(theta, linear, mean, strict=True):
        gap = [idm.desired_gap(v, 0.0, *values, US101.speed_limit) for values in (row, plain)]
        assert gap[1] == pytest.approx(gap[0])
        nearby = [idm.desired_gap(v + 0.1, 0.0, *values, US101.speed_limit) for values in (row, plain)]
        assert nearby[1] - gap[1] == pytest.approx(nearby[0] - gap[0], rel=2e-2)
    result = export_routes(table, tmp_path / "x.rou.xml", without_d1="linearised")
    assert float(read_types(result.route_file)["0750-0805.10"].attrib["minGap"]) == linear[0, 3]
    with pytest.raises(InputError, match="mean_speed_m_s"):
        export_routes(drivers(d1=2.0), tmp_path / "y.rou.xml", without_d1="linearised")


def test_dropping_d1_is_said(tmp_path: Path) -> None:
    assert (
        "30 drivers was dropped" in export_routes(drivers(d1=2.0), tmp_path / "x.rou.xml", without_d1="none").notes[0]
    )


@pytest.mark.parametrize("choice", ["exact", "guess"])
def test_what_is_no_type_is_refused(tmp_path: Path, choice: str) -> None:
    with pytest.raises(InputError, match=rf"without_d1.*{choice}"):
        export_routes(drivers(), tmp_path / "x.rou.xml", without_d1=choice)


# Departures from scenes and recordings.


def recording() -> Recording:
    """Return three cars: leaving, passing, and entering."""
    t = np.arange(40) * 0.1
    rows = [(1, 300.0, 6, 8), (2, 20.0, 1, 1), (3, 100.0, 7, 6)]
    tables = [
        pd.DataFrame({
            c.PERIOD: PERIODS[0], c.VEHICLE: number, c.FRAME: 100 * number + np.arange(40),
            c.TIME: 1e9 + 10 * number + t,
            c.X: start + 25.0 * t, c.Y: US101.lane_center(min(first, 6)), c.SPEED: 20.0, c.ACCELERATION: 0.0,
            c.HEADING: 0.0,
            c.LENGTH: np.nan, c.WIDTH: np.nan, c.CLASS: 2, c.LANE: np.where(t < 3.0, first, last), c.LEADER: 0,
            c.HEADWAY: np.nan,
        })
        for number, start, first, last in rows
    ]  # fmt: skip
    return Recording.from_table(pd.concat(tables), road=US101, source="cars")


def test_departures_of_a_recording_know_the_way_out(tmp_path: Path) -> None:
    table = departures(recording()).set_index("vehicle")
    assert table["destination"].to_dict() == {1: "off_ramp", 2: "downstream", 3: "downstream"}
    assert table["depart_s"].to_dict() == pytest.approx({1: 10.0, 2: 20.0, 3: 30.0})
    assert table["lane"].to_dict() == {1: 6, 2: 1, 3: 7}
    assert (table["length_m"] == US101.car_length).all()
    some = drivers(n=4).head(2).assign(vehicle=[1, 3], period=PERIODS[0])
    result = export_routes(some, tmp_path / "x.rou.xml", departures=recording())
    edges = [route.attrib["edges"] for route in parse(result.route_file).getroot().findall("route")]
    assert sorted(edges) == ["on_ramp weave exit downstream", "weave off_ramp"]
    assert sumo(result.config_file).stderr == ""
    with pytest.raises(InputError, match=r"vehicle 77 .*no departure"):
        export_routes(some.assign(vehicle=[1, 77]), tmp_path / "y.rou.xml", departures=recording())


def test_departures_of_scenes_are_where_the_simulation_starts() -> None:
    scenes = build_scenes(recording(), Window(observed=10, horizon=20))
    table = departures(scenes).set_index("vehicle").loc[2]
    assert (table["first_frame"], table["lane"]) == (200, 1)
    assert table["depart_s"] == pytest.approx(20.9)  # the last observed frame, the tenth
    assert table["x_m"] == pytest.approx(20.0 + 25.0 * 0.9)


def test_drivers_are_exported_as_calibrate_returns_them(tmp_path: Path) -> None:
    cars = [
        Car(k, x=30.0 * k, lane=2, speed=12.0 + 0.4 * np.sin(0.1 * np.arange(60) + k), frames=60) for k in (1, 2, 3)
    ]
    scenes = build_scenes(of_cars(*cars), Window(observed=10, horizon=40))
    table = calibrate(scenes).assign(d1=1.0)
    alone = export_routes(table, tmp_path / "alone.rou.xml")
    assert any("d1, which SUMO lacks, is linearised" in note for note in alone.notes)
    assert sumo(alone.config_file).stderr == ""
    refitted = export_routes(table, tmp_path / "refitted.rou.xml", departures=scenes)
    assert not any("linearised" in note for note in refitted.notes)
    fitted = refit_table(table, scenes).set_index("vehicle")
    types = {element.attrib["id"]: element.attrib for element in parse(refitted.route_file).getroot().findall("vType")}
    for vehicle, row in fitted.iterrows():
        assert float(types[f"p1.{vehicle}"]["tau"]) == pytest.approx(row["T_refit"], rel=1e-12)


# Bad input: one line, nothing written.


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"lane": 9}, "lane = 9"), ({"x_m": 5000.0}, "vehicle 10 of period 0750-0805 has no lane"),
        ({"a": np.nan}, "a = nan"), ({"T": 99.0}, "T = 99"), ({"vehicle": 1}, "twice"),
        ({"speed_m_s": np.nan}, "speed_m_s"),
        ({"desired_speed_m_s": 0.0}, "desired_speed_m_s = 0"),
        ({"desired_speed_m_s": 40.0}, "below the desired speed 40 m/s"),
    ],
)  # fmt: skip
def test_bad_drivers_leave_nothing(tmp_path: Path, columns: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        export_routes(drivers(**columns), tmp_path / "x.rou.xml")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_driver_without_parameters_is_left_out_and_counted(tmp_path: Path) -> None:
    table = drivers()
    table.loc[3, ["a", "b", "T", "d0", "d1"]] = np.nan
    table.loc[3, "status"] = "too few frames"
    result = export_routes(table, tmp_path / "x.rou.xml")
    assert len(result.vehicles) == 29
    assert "1 drivers have no parameters" in result.notes[0]


def test_bad_networks(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(InputError, match="no such network"):
        export_routes(drivers(), out / "x.rou.xml", net_file=tmp_path / "no.net.xml")
    (tmp_path / "text.net.xml").write_text("no net")
    with pytest.raises(InputError, match="malformed XML"):
        export_routes(drivers(), out / "x.rou.xml", net_file=tmp_path / "text.net.xml")
    other = StraightRoads(1, (0.0, 100.0), 30.0).write_net(tmp_path)
    with pytest.raises(InputError, match="has no edge"):
        export_routes(drivers(), out / "x.rou.xml", net_file=other)
    slow = tmp_path / "slow.net.xml"
    slow.write_text(network.of(US101).file.read_text().replace('speed="24.5872"', 'speed="15.00"'))
    with pytest.raises(InputError, match="allows 15 m/s, below the desired speed"):
        export_routes(drivers(), out / "x.rou.xml", net_file=slow)
    assert not list(out.iterdir())
    assert len(export_routes(drivers(desired_speed_m_s=15.0), out / "x.rou.xml", net_file=slow).vehicles) == 30


def test_bad_output(tmp_path: Path) -> None:
    (tmp_path / "none").write_text("a file")
    with pytest.raises(InputError, match="is a file, not a folder"):
        export_routes(drivers(), tmp_path / "none" / "x.rou.xml")
    (tmp_path / "none").unlink()
    (tmp_path / "x.sumocfg").mkdir()
    with pytest.raises(InputError, match="was not written by `export`"):
        export_routes(drivers(), tmp_path / "x.rou.xml")
    assert [path.name for path in tmp_path.iterdir()] == ["x.sumocfg"]
    with pytest.raises(InputError, match="SUMO has no 'paper'"):
        export_routes(drivers(), tmp_path / "y.rou.xml", integration="paper")


# The population as one distribution.


def drawn(path: Path, folder: Path, vehicles: int = 400) -> pd.Series:
    """Return the types SUMO draws on another network."""
    net = StraightRoads(vehicles, (0.0, 500.0), 30.0).write_net(folder)
    routes = folder / "flow.rou.xml"
    ways = [
        f'<vehicle id="{i}" type="calibrated" depart="0"><route edges="road{i}"/></vehicle>' for i in range(vehicles)
    ]
    rows = "".join(ways)
    routes.write_text(f"<routes>{rows}</routes>")
    with session.simulation(["-a", str(path), "-r", str(routes), "--seed", "3"], net=net) as live:
        live.simulationStep()
        return pd.Series({name: live.vehicle.getTypeID(name).split("@")[0] for name in live.vehicle.getIDList()})


def test_every_driver_equally_often(tmp_path: Path) -> None:
    path = export_distribution(drivers(), tmp_path / "population.add.xml").file
    types = parse(path).getroot().findall("vTypeDistribution/vType")
    assert len(types) == 30
    assert {float(kind.attrib["probability"]) for kind in types} == {1 / 30}
    counts = drawn(path, tmp_path).value_counts()
    assert set(counts.index) <= {kind.attrib["id"] for kind in types}
    assert len(counts) > 25
    assert counts.sum() == 400


def test_representatives_are_real_drivers_with_their_shares(tmp_path: Path) -> None:
    table = drivers(n=40)
    for name, low, high in (("a", 0.6, 2.0), ("b", 1.0, 3.0), ("T", 0.8, 2.0), ("d0", 1.0, 3.0)):
        spread = 1.0 + 0.01 * np.sin(np.arange(40))
        table[name] = np.where(np.arange(40) < 10, low, high) * spread
    path = export_distribution(table, tmp_path / "two.add.xml", representatives=2).file
    kinds = [kind.attrib for kind in parse(path).getroot().iter("vType")]
    assert sorted(round(float(kind["probability"]), 9) for kind in kinds) == [0.25, 0.75]
    assert {float(kind["accel"]) for kind in kinds} <= set(table["a"])
    shares = drawn(path, tmp_path).value_counts(normalize=True)
    for kind in kinds:
        assert shares[kind["id"]] == pytest.approx(float(kind["probability"]), abs=0.08)


def test_badly_determined_drivers_do_not_stand_for_others(tmp_path: Path) -> None:
    table = drivers()
    table.loc[:9, "at_bound"] = "b,T"
    table.loc[10:14, "status"] = "no leader"
    written = export_distribution(table, tmp_path / "good.add.xml")
    assert len(list(parse(written.file).getroot().iter("vType"))) == written.types == written.drivers == 15
    assert "15 of 30 drivers are left out (10 a parameter at its bound, 5 no leader)" in written.notes[0]
    assert f"T {table['T'][15:].median():.2f} (all: {table['T'].median():.2f})" in written.notes[0]
    every = export_distribution(table, tmp_path / "every.add.xml", which="every")
    assert every.types == every.drivers == 30
    assert "left out" not in " ".join(every.notes)
    with pytest.raises(InputError, match="15 well-determined drivers cannot give 16 types"):
        export_distribution(table, tmp_path / "bad.add.xml", representatives=16)
    assert not (tmp_path / "bad.add.xml").exists()


def test_the_distribution_fits_sumos_schema(exported: tuple[pd.DataFrame, Exported], tmp_path: Path) -> None:
    path = export_distribution(exported[0], tmp_path / "population.add.xml", representatives=5).file
    run = sumo(exported[1].config_file, "--additional-files", str(path), "--end", "1")
    assert (run.returncode, run.stderr) == (0, "")
    for file in (path, exported[1].route_file, exported[1].config_file):
        assert "http://sumo.dlr.de/xsd/" in file.read_text()


def test_a_distribution_wants_what_its_drivers_want_relative_to_the_limit(tmp_path: Path) -> None:
    speeds = np.where(np.arange(30) < 10, 0.8, 1.2) * US101.speed_limit
    written = export_distribution(drivers(desired_speed_m_s=speeds), tmp_path / "population.add.xml")
    factors = [float(kind.attrib["speedFactor"]) for kind in parse(written.file).getroot().iter("vType")]
    assert sorted(factors) == pytest.approx([0.8] * 10 + [1.2] * 20)
    assert "--step-length 0.1" in written.notes[-1]
    assert "step-length 0.1" in written.file.read_text()


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("<connection ", "<konnection ", "no way from edge"),
        ('_4" index="4"', '_4" index="4" x="', "malformed XML"),
    ],
)
def test_a_network_that_is_no_build_of_ours_is_refused_before_anything_is_written(
    tmp_path: Path, old: str, new: str, complaint: str
) -> None:
    net = tmp_path / "other.net.xml"
    net.write_text(network.of(US101).file.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=complaint):
        export_routes(drivers(), tmp_path / "x.rou.xml", net_file=net)
    assert [path.name for path in tmp_path.iterdir()] == ["other.net.xml"]
