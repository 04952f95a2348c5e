"""The recorded demand as reacting vehicles: conserved, repeatable, with the types it was given."""

import os
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.closed_loop.run import run_case
from analysis.closed_loop.settings import Case
from idm_sumo.cli import main
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.reading import write_parquet
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.closed_loop import populations
from idm_sumo.sumo.closed_loop import run as closed_loop
from idm_sumo.sumo.closed_loop.demand import demand_of
from idm_sumo.sumo.closed_loop.ego import Ego
from idm_sumo.sumo.closed_loop.measurement import as_recording
from idm_sumo.sumo.closed_loop.signs import SLOWEST_SIGN, boundary_signs, boundary_speeds
from idm_sumo.sumo.gui import gui_binary
from idm_sumo.sumo.session import load_libsumo, simulation
from tests.helpers.builders import Car, recording

SPEED = 12.0  # m/s
HEADWAY = 40  # frames between two cars in a lane
DRIVER = np.array([1.2, 1.5, 1.0, 2.0, 0.0])


def through(vehicle: int, lane: int, first_frame: int, x: float = 0.5, speed: float = SPEED) -> Car:
    frames = min(int((US101.length - x) / speed / FRAME_STEP), 1200 - first_frame)
    return Car(vehicle, x, lane, speed, first_frame=first_frame, frames=frames)


def two_minutes() -> Recording:
    """Cars in three lanes at constant speed; some are on the road when it begins."""
    cars = [through(1, 2, 0, 300.0), through(2, 3, 0, 200.0), through(3, 2, 0, 200.0)]
    number = 3
    for lane in (2, 3, 4):
        for first in range(5 * lane, 1100, HEADWAY):
            number += 1
            cars.append(through(number, lane, first))
    return recording(*cars, period="0750-0752")


@pytest.fixture(scope="module")
def recorded() -> Recording:
    return two_minutes()


@pytest.fixture(scope="module")
def demand(recorded: Recording) -> pd.DataFrame:
    return demand_of(recorded)


def run(
    folder: Path, recorded: Recording, demand: pd.DataFrame, theta: np.ndarray = DRIVER, *, seed: int = 1,
    ego: Ego | None = None,
    model: str = "LC2013", downstream: bool = True,
) -> closed_loop.Outcome:  # fmt: skip
    files = written(folder, recorded, demand, theta, model=model, downstream=downstream)
    return closed_loop.run(files, folder / "run.parquet", seed=seed, ego=ego)


def written(
    folder: Path, recorded: Recording, demand: pd.DataFrame, theta: np.ndarray = DRIVER, *, model: str = "LC2013",
    downstream: bool = True,
) -> closed_loop.RunFiles:  # fmt: skip
    lane_change = populations.lane_change_attributes(model, {})
    types = populations.calibrated_types(demand, np.tile(theta, (len(demand), 1)), lane_change, US101.speed_limit)
    return closed_loop.write_run(
        folder / "simulation", "drivers", recorded, demand, types, options=populations.SUBLANE.get(model, ()),
        signs=boundary_signs(recorded) if downstream else [],
    )  # fmt: skip


def test_everybody_departs_in_time_or_is_reported(tmp_path: Path, recorded: Recording, demand: pd.DataFrame) -> None:
    outcome = run(tmp_path, recorded, demand)
    assert sorted(outcome.departures["vehicle"]) == sorted(recorded.table[c.VEHICLE].unique())
    assert outcome.departures["departed_s"].notna().all()
    assert outcome.late.empty
    assert outcome.incidents.collisions == 0
    driven = as_recording(outcome, recorded, demand, "drivers")
    assert set(driven.table[c.VEHICLE]) == set(recorded.table[c.VEHICLE])
    first = driven.table.groupby(c.VEHICLE)[[c.FRAME, c.X, c.SPEED]].first()
    twin = recorded.table.groupby(c.VEHICLE)[[c.FRAME, c.X, c.SPEED]].first()
    pd.testing.assert_frame_equal(first[[c.FRAME, c.X]], twin[[c.FRAME, c.X]], check_exact=False, atol=1e-3)
    assert first[c.SPEED][first.index.isin([1, 2, 3])].to_numpy() == pytest.approx(SPEED, abs=1e-3)
    assert first[c.SPEED].between(SPEED - 1e-3, driven.table[c.SPEED].max()).all()


def test_who_finds_no_room_is_reported_with_its_delay(tmp_path: Path) -> None:
    standing = [Car(n, 3.0, 3, 0.0, first_frame=0 if n == 1 else 30, frames=300) for n in (1, 2)]
    jam = recording(*standing)
    outcome = run(tmp_path, jam, demand_of(jam), np.array([0.1, 1.5, 1.0, 2.0, 0.0]), downstream=False)
    blocked = outcome.departures.set_index("vehicle").loc[2]
    assert outcome.late["vehicle"].tolist() == [2]
    assert blocked["delay_s"] > 0.5


def test_the_same_seed_gives_the_same_file(tmp_path: Path, recorded: Recording, demand: pd.DataFrame) -> None:
    tables = [pd.read_parquet(run(tmp_path / str(n), recorded, demand).fcd) for n in range(2)]
    pd.testing.assert_frame_equal(*tables)


def test_trajectories_have_their_name_when_they_are_whole(
    tmp_path: Path, recorded: Recording, demand: pd.DataFrame
) -> None:
    """Of a worker that a cluster has lost touch with, a second one's are not touched."""
    folder, workshop = tmp_path / "fcd", tmp_path / "workshop"
    folder.mkdir()
    workshop.mkdir()
    seen: list[list[Path]] = []
    case = Case("drivers", 3, written(tmp_path, recorded, demand), 0)
    measured = run_case(
        folder, workshop, case, recorded, {"name": "drivers", "seed": 3},
        progress=lambda *_: seen.append(list(folder.iterdir())),
    )  # fmt: skip
    assert len(seen) > 1
    assert not any(seen)
    assert measured.outcome.fcd == folder / "drivers-seed3.parquet"
    assert len(pd.read_parquet(measured.outcome.fcd)) > 1000
    assert sorted(path.name for path in folder.iterdir()) == ["drivers-seed3.lane_changes.xml", "drivers-seed3.parquet"]
    assert list(workshop.iterdir()) == []


@pytest.mark.parametrize("model", populations.LANE_CHANGE_MODELS)
def test_both_lane_change_models_run(tmp_path: Path, recorded: Recording, demand: pd.DataFrame, model: str) -> None:
    assert run(tmp_path, recorded, demand, model=model).arrived > 0


def test_types_are_what_was_asked_for(tmp_path: Path, recorded: Recording, demand: pd.DataFrame) -> None:
    theta = np.tile(DRIVER, (len(demand), 1))
    theta[:, 2] = np.linspace(0.5, 2.5, len(demand))
    types = populations.calibrated_types(
        demand, theta, populations.lane_change_attributes("LC2013", {"lcSpeedGain": "3"}), US101.speed_limit
    )
    files = closed_loop.write_run(tmp_path, "drivers", recorded, demand, types)
    with simulation(["--route-files", str(files.routes)], net=files.net) as sumo:
        sumo.simulationStep()
        assert len(sumo.vehicle.getIDList()) == 3
        for row, vehicle in enumerate(demand[c.VEHICLE].head(3)):
            assert sumo.vehicle.getTau(str(vehicle)) == theta[row, 2]
            assert sumo.vehicle.getParameter(str(vehicle), "laneChangeModel.lcSpeedGain") == "3.00"
            assert sumo.vehicle.getLength(str(vehicle)) == 4.0


def test_a_lane_is_changed_where_a_typical_follower_brakes_comfortably(demand: pd.DataFrame) -> None:
    theta = np.tile(DRIVER, (len(demand), 1))
    gap, a, b = 17.0, *DRIVER[:2]
    wanted = gap * populations.assertiveness(theta)
    assert a * ((wanted / gap) ** 2 - 1.0) == pytest.approx(b)
    for given, expected in (({}, f"{populations.assertiveness(theta):.3g}"), ({"lcAssertive": "4"}, "4")):
        attributes = populations.lane_change_attributes("LC2013", given)
        types = populations.calibrated_types(demand, theta, attributes, US101.speed_limit)
        assert {element.get("lcAssertive") for element in types} == {expected}


@pytest.mark.parametrize("headway", [1.0, 3.5], ids=["free", "crowded"])
def test_the_written_configuration_alone_is_the_run(tmp_path: Path, recorded: Recording, headway: float) -> None:
    """Plain SUMO on what is written drives every vehicle as our run of the same seed did, who waits included."""
    demand, driver = demand_of(recorded, approach=True), DRIVER.copy()
    driver[2] = headway
    outcome = run(tmp_path, recorded, demand, driver, seed=3)
    assert (len(outcome.late) > 10) == (headway > 3.0)
    config, alone = tmp_path / "simulation" / "drivers.sumocfg", tmp_path / "alone.parquet"
    sumo = load_libsumo()
    sumo.start(["sumo", "-c", str(config), "--seed", "3", "--fcd-output", str(alone), *closed_loop.FCD])
    while sumo.simulation.getTime() < sumo.simulation.getEndTime():
        sumo.simulationStep()
    sumo.close()
    names = ["timestep_time", "vehicle_id", "vehicle_x", "vehicle_y", "vehicle_speed"]
    ours, plain = (pd.read_parquet(file)[names].sort_values(names[:2]) for file in (outcome.fcd, alone))
    pd.testing.assert_frame_equal(ours.reset_index(drop=True), plain.reset_index(drop=True))


def test_recorded_speeds_are_imposed_behind_the_section(tmp_path: Path) -> None:
    slow = recording(
        *(through(n, 3, 60 * n, speed=5.0) for n in range(8)), *(through(20 + n, 2, 60 * n) for n in range(8))
    )
    speeds = boundary_speeds(slow)
    assert speeds.shape[1] == US101.main_lanes
    assert np.allclose(speeds[:, 1], SPEED)
    assert speeds.min() >= SLOWEST_SIGN
    demand = demand_of(slow)
    held, free = (
        as_recording(run(tmp_path / str(downstream), slow, demand, downstream=downstream), slow, demand, "")
        for downstream in (True, False)
    )
    at_the_end = [r.table[(r.table[c.X] > 600) & (r.table[c.LANE] == 2)][c.SPEED].mean() for r in (held, free)]
    assert at_the_end[0] == pytest.approx(SPEED, abs=1.5)
    assert at_the_end[1] > SPEED + 3.0


def test_our_ego_is_where_we_put_it_and_others_react_to_it(
    tmp_path: Path, recorded: Recording, demand: pd.DataFrame
) -> None:
    entering = demand[(demand["depart_s"] > 10) & (demand["lane"] == 3)].iloc[0]
    snail = np.array([0.1, 1.5, 15.0, 10.0, 0.0])
    ego = Ego(int(entering[c.VEHICLE]), US101, 3, snail, float(entering["length_m"]))
    outcome = run(tmp_path, recorded, demand, ego=ego)
    path = outcome.ego
    assert path is not None
    driven = as_recording(outcome, recorded, demand, "ego").table
    seen = driven[driven[c.VEHICLE] == entering[c.VEHICLE]]
    steps = min(len(path), len(seen))
    assert steps > 200
    assert np.allclose(path["x"][:steps], seen[c.X][:steps], atol=1e-3)
    assert np.allclose(path["y"], US101.lane_center(3), atol=0.05)
    assert outcome.incidents.collisions == 0
    behind = demand[(demand["lane"] == 3) & (demand["depart_s"] > entering["depart_s"])].iloc[0]
    without = as_recording(run(tmp_path / "b", recorded, demand), recorded, demand, "").table
    gone = [t[t[c.VEHICLE] == behind[c.VEHICLE]][c.SPEED].mean() for t in (driven, without)]
    assert gone[0] < gone[1] - 1.0


def test_a_recording_of_a_few_vehicles_or_of_several_periods_is_no_demand() -> None:
    with pytest.raises(InputError, match="a few of the vehicles only"):
        demand_of(recording(Car(1), has_leader_rows=False))
    first, second = two_minutes().table, recording(Car(1), period="0805-0820").table
    both = Recording.from_table(pd.concat([first, second]), road=US101, source="both")
    with pytest.raises(InputError, match="one period"):
        demand_of(both)


def test_lane_change_parameters_are_checked() -> None:
    with pytest.raises(InputError, match="is unknown; use one of LC2013, SL2015"):
        populations.lane_change_attributes("LC2015", {})
    with pytest.raises(InputError, match="lcPushy: is no parameter of LC2013"):
        populations.lane_change_attributes("LC2013", {"lcPushy": "1"})
    with pytest.raises(InputError, match="lcSpeedGain=fast: is not a number"):
        populations.lane_change_attributes("LC2013", {"lcSpeedGain": "fast"})
    assert populations.lane_change_attributes("SL2015", {"lcPushy": "1"})["lcPushy"] == "1"


def test_no_display_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if os.name == "posix" and os.uname().sysname == "Linux":
        with pytest.raises(InputError, match=r"--gui: (no display|sumo-gui is not installed)"):
            gui_binary()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory, recorded: Recording) -> Path:
    path = tmp_path_factory.mktemp("closed_loop") / "two_minutes.parquet"
    write_parquet(recorded, path)
    return path


def test_the_command_leaves_a_whole_result(tmp_path: Path, file: Path) -> None:
    out = tmp_path / "out"
    main(
        [
            "interactive",
            str(file),
            "-o",
            str(out),
            "--types",
            "krauss",
            "--types",
            "default-idm",
            "--replay-bias",
            "0",
            "--jobs",
            "1",
        ]
    )
    table = pd.read_csv(out / "tables" / "closed_loop.csv")
    assert table["population"].tolist() == ["recorded", "krauss", "default-idm"]
    assert table["vehicles"].nunique() == 1
    assert sorted(table["rank"].dropna()) == [1, 2]
    simulated = table[table["population"] != "recorded"]
    assert (simulated["emergency_brakings"] >= 0).all()
    assert (simulated["teleports"] == 0).all()
    assert simulated["flow_error_share"].between(-0.5, 0.5).all()
    assert simulated["speed_profile_rmse_m_s"].between(0.0, 15.0).all()
    for name in (
        "figures/time_space.png",
        "figures/comparison.png",
        "report.html",
        "manifest.json",
        "fcd/krauss.parquet",
    ):
        assert (out / name).stat().st_size > 0
    assert "Closest to the recording is" in (out / "report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--lane-change", "lcSpeedGain"], "is not KEY=VALUE"),
        (["--lane-change", "lcSpeedGane=1"], "is no parameter of LC2013"),
        (["--lane-change-model", "LC2014"], "use one of LC2013, SL2015"),
        (["--types", "kraus"], "invalid choice"),
        (["--period", "0900-0915"], "no period '0900-0915'"),
        (["--ego", "9999", "--types", "krauss"], "--ego 9999: is not in period"),
        (["--seeds", "0"], "--seeds: must be from 1 to"),
        (["--drivers", "nowhere.parquet"], "nowhere.parquet: no such file"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_left(
    tmp_path: Path, file: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], complaint: str
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["interactive", str(file), "-o", str(tmp_path / "out"), *arguments])
    assert stopped.value.code == 2
    said = [line for line in capsys.readouterr().err.splitlines() if not re.fullmatch(r"\w[\w ]* \.\.\.", line)]
    assert len(said) == 1
    assert complaint in said[0]
    assert list(tmp_path.iterdir()) == []


def test_a_road_without_a_network_is_refused_with_what_can_be_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frame, file = np.arange(60), tmp_path / "street.txt"
    rows = [np.column_stack([
        np.full(60, vehicle), frame, np.full(60, 60), 1118846980000 + 100 * frame, np.full(60, 6.0),
        300 - 130 * vehicle + 6.5 * frame, np.zeros((60, 2)), np.full(60, 13.0), np.full(60, 6.0), np.full(60, 2),
        np.full(60, 65.0), np.zeros(60), np.ones(60), np.zeros((60, 3)), np.full((60, 2), 2), np.ones(60),
        np.full(60, vehicle - 1), np.zeros((60, 3)),
    ]) for vehicle in (1, 2)]  # fmt: skip
    np.savetxt(file, np.concatenate(rows), fmt="%.6f")
    with pytest.raises(SystemExit, match="2"):
        main(["interactive", str(file), "--replay-bias", "0", "-o", str(tmp_path / "out")])
    said = capsys.readouterr().err.splitlines()[-1]
    assert f"{file}: road " in said
    assert "traffic lights" in said
    assert "calibrate, predict and diagnose" in said
    assert not (tmp_path / "out").exists()


def test_drivers_of_another_recording_are_refused(
    tmp_path: Path, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drivers = pd.DataFrame({"period": "0750-0752", "vehicle": range(4, 40), "first_frame": 7})
    drivers.assign(a=1.0, b=1.5, T=1.2, d0=2.0, d1=0.0).to_csv(tmp_path / "others.csv", index=False)
    with pytest.raises(SystemExit) as stopped:
        main(["interactive", str(file), "-o", str(tmp_path / "out"), "--drivers", str(tmp_path / "others.csv")])
    assert stopped.value.code == 2
    assert "others.csv: belongs to another recording" in capsys.readouterr().err.splitlines()[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["others.csv"]


def test_compare_names_the_file_that_is_not_there(
    tmp_path: Path, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["compare", str(file), str(tmp_path / "none.parquet"), "-o", str(tmp_path / "out")])
    assert stopped.value.code == 2
    assert "none.parquet" in capsys.readouterr().err.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


def test_compare_leaves_a_figure_a_table_and_a_page(tmp_path: Path, file: Path) -> None:
    other = tmp_path / "other.parquet"
    write_parquet(two_minutes(), other)
    main(["compare", str(file), str(other), "-o", str(tmp_path / "out")])
    table = pd.read_csv(tmp_path / "out" / "tables" / "comparison.csv")
    assert table["gap_wasserstein_m"].iloc[1] == 0.0
    assert (tmp_path / "out" / "figures" / "comparison.png").is_file()
    assert (tmp_path / "out" / "report.html").is_file()
