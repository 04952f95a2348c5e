"""The closed loop of an extended model against SUMO's IDM."""

import numpy as np
import pandas as pd
import pytest

from analysis.closed_loop.populations import refitted_for
from idm_sumo.cli import main
from idm_sumo.models.effects import Cause, ExtendedModel
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.reading import write_parquet
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.closed_loop import populations
from idm_sumo.sumo.closed_loop import run as closed_loop
from idm_sumo.sumo.closed_loop.demand import demand_of
from idm_sumo.sumo.closed_loop.extended_loop import ModelDrivers
from idm_sumo.sumo.closed_loop.measurement import as_recording
from tests.helpers.builders import Car, recording


@pytest.fixture(scope="module")
def recorded():
    """Two platoons that are on the road when it begins."""
    cars = [Car(5 * lane + k, 60.0 + 25 * k, lane, 12.0, frames=400) for lane in (2, 3) for k in range(5)]
    return recording(*cars, period="0750-0752")


def drive(folder, recorded, *causes, ours=True, has=None) -> tuple[pd.DataFrame, closed_loop.Outcome, int]:
    """Return frames, outcome and driven vehicle-steps of a run."""
    demand = demand_of(recorded)
    rng = np.random.default_rng(1)
    theta = rng.uniform([0.8, 1.0, 0.8, 1.5, 0.0], [1.6, 2.5, 1.4, 2.5, 0.0], (len(demand), 5))
    lane_change = populations.lane_change_attributes("LC2013", {"lcSpeedGain": "0", "lcStrategic": "-1"})
    types = populations.calibrated_types(demand, theta, lane_change, US101.speed_limit)
    files = closed_loop.write_run(folder / "simulation", "extended", recorded, demand, types)
    has = None if has is None else np.full(len(demand), has)
    drivers = (
        ModelDrivers(ExtendedModel(TEXTBOOK, US101.speed_limit, causes=causes), demand, theta, US101, has=has)
        if ours
        else None
    )
    outcome = closed_loop.run(files, folder / "run.parquet", ours=drivers)
    frames = as_recording(outcome, recorded, demand, "run").table
    return frames, outcome, 0 if drivers is None else drivers.driven_steps


@pytest.fixture(scope="module")
def plain(tmp_path_factory, recorded):
    """A run without any effect."""
    return drive(tmp_path_factory.mktemp("plain"), recorded)


def test_without_effects_all_drive_as_sumos_own_types(tmp_path, recorded, plain) -> None:
    theirs, _, none = drive(tmp_path, recorded, ours=False)
    ours, outcome, driven = plain
    assert none == 0
    assert driven > 0.9 * (ours[c.LANE] <= US101.main_lanes).sum()
    both = theirs.merge(ours, on=[c.VEHICLE, c.FRAME], suffixes=("", "_ours"))
    assert len(both) > 0.99 * len(theirs)
    apart = (both[c.X] - both["x_ours"]).abs()
    assert apart.max() < 1e-6
    assert outcome.incidents.collisions == 0


def test_a_slow_place_slows_all_vehicles_there(tmp_path, recorded, plain) -> None:
    slow, outcome, _ = drive(tmp_path, recorded, Cause("location", {"alpha": -0.4, "x_1": 300.0, "x_2": 450.0}))

    def speed(table: pd.DataFrame, begin: float, end: float) -> float:
        return float(table[table[c.X].between(begin, end)][c.SPEED].mean())

    assert speed(slow, 400, 450) < speed(plain[0], 400, 450) - 1.0
    assert speed(slow, 50, 150) == pytest.approx(speed(plain[0], 50, 150), abs=0.5)
    assert outcome.incidents.collisions == 0


def test_drivers_outside_the_share_drive_without_the_effect(tmp_path, recorded, plain) -> None:
    place = Cause("location", {"alpha": -0.4, "x_1": 300.0, "x_2": 450.0}, share=0.5)
    nobody, _, _ = drive(tmp_path / "nobody", recorded, place, has=False)
    pd.testing.assert_frame_equal(nobody, plain[0])
    slow, _, _ = drive(tmp_path / "some", recorded, place)
    last = (
        slow[slow[c.X] > 450.0].groupby(c.VEHICLE)[c.FRAME].min()
        - plain[0][plain[0][c.X] > 450.0].groupby(c.VEHICLE)[c.FRAME].min()
    )
    first = last[last.index % 5 == 4].to_numpy()  # of each lane, the vehicle without a leader
    assert (first > 0).tolist() == ExtendedModel(TEXTBOOK, US101.speed_limit, causes=(place,)).has_partial_causes(
        [14, 19]
    ).tolist()


@pytest.mark.parametrize("known", [True, False])
def test_the_share_is_as_the_drivers_table_says(known, tmp_path) -> None:
    model = ExtendedModel(
        TEXTBOOK, US101.speed_limit, causes=(Cause("reaction_delay", {"tau": 0.4}, share=0.5),), drivers="drivers.csv"
    )
    vehicles = np.arange(1, 9)
    own = pd.DataFrame({
        "period": "p", "vehicle": vehicles[:5], "a": 1.0, "b": 1.5, "T": 1.2, "d0": 2.0, "d1": 0.0,
        "desired_speed_m_s": 30.0,
    })  # fmt: skip
    if known:
        own["has_what_some_have"] = [1, 0, 0, 1, 1]
    own.to_csv(tmp_path / "drivers.csv", index=False)
    demand = pd.DataFrame({"vehicle": vehicles})
    _, _, has = refitted_for(model, tmp_path / "model.json", demand, "p", np.ones((8, 5)))
    expected = model.has_partial_causes(vehicles)
    if known:
        expected[:5] = own["has_what_some_have"]
    np.testing.assert_array_equal(has, expected)
    own["has_what_some_have"] = 2
    own.to_csv(tmp_path / "drivers.csv", index=False)
    with pytest.raises(InputError, match="has_what_some_have = 2 is impossible"):
        refitted_for(model, tmp_path / "model.json", demand, "p", np.ones((8, 5)))


def test_accelerations_are_of_the_last_step_and_seconds(recorded) -> None:
    demand = demand_of(recorded)
    drivers = ModelDrivers(
        ExtendedModel(TEXTBOOK, US101.speed_limit), demand, np.tile([1.0, 1.5, 1.2, 2.0, 0.0], (len(demand), 1)), US101
    )
    time = np.arange(60) * FRAME_STEP
    speed = np.stack([5.0 + 0.5 * time, np.where(time < 4.0, 8.0, 9.0)])
    found = np.array([drivers._accelerations(np.array([3, 0]), now) for now in speed.T])
    np.testing.assert_array_equal(found[0], 0.0)  # unknown yet
    np.testing.assert_allclose(found[1:, :, 0], 0.5, atol=1e-9)
    np.testing.assert_allclose(found[[39, 40, 41, 55], 0, 1], [0.0, 10.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found[[39, 40, 55, 59], 1, 1], [0.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], atol=1e-9)


def test_a_delay_shows_and_the_same_run_twice_is_the_same(tmp_path, recorded, plain) -> None:
    one, other = (
        drive(tmp_path / name, recorded, Cause("reaction_delay", {"tau": 0.9}))[0] for name in ("one", "other")
    )
    pd.testing.assert_frame_equal(one, other)
    both = plain[0].merge(one, on=[c.VEHICLE, c.FRAME], suffixes=("", "_late"))
    apart = (both[c.X] - both["x_late"]).abs().mean()
    assert apart > 0.1
    known, _, _ = drive(tmp_path / "known", recorded, Cause("reaction_delay", {"tau": 0.9, "eta": 1.0}))
    both = plain[0].merge(known, on=[c.VEHICLE, c.FRAME], suffixes=("", "_late"))
    assert 0.1 < (both[c.X] - both["x_late"]).abs().mean() != apart


def four_cars(folder) -> list[str]:
    """Write four cars in a row; return the drive command."""
    cars = [Car(n, x, 3, 9.0, frames=300) for n, x in enumerate((280.0, 250.0, 222.0, 190.0), 1)]
    write_parquet(recording(*cars, period="0750-0752"), folder / "cars.parquet")
    return ["interactive", str(folder / "cars.parquet"), "--types", "drivers", "--model", str(folder / "model.json")]


def speeds(command, out) -> pd.Series:
    """Return each population's mean speed (m/s)."""
    main([*command, "--replay-bias", "0", "--jobs", "1", "-o", str(out)])
    table = pd.read_csv(next((out / "tables").glob("closed_loop*.csv")))
    return table.set_index("population")["mean_speed_m_s"]


@pytest.mark.parametrize("law", ["idm", "full_velocity_difference"])
def test_interactive_adds_the_extended_population(law, tmp_path, capsys) -> None:
    command = four_cars(tmp_path)
    model = ExtendedModel(
        TEXTBOOK, US101.speed_limit, causes=(Cause("location", {"alpha": -0.5, "x_1": 200.0, "x_2": 500.0}),), law=law
    )
    model.write(tmp_path / "model.json")
    speed = speeds(command, tmp_path / "out")
    assert speed["extended"] < speed["own-loop"] - 0.3
    # Parameters of IDM drivers are an IDM's: by another law all are the model's median driver.
    assert (abs(speed["own-loop"] - speed["drivers"]) < 0.05) == (law == "idm")
    assert "extended" in capsys.readouterr().out


def test_drivers_that_were_refitted_with_a_model_drive_by_it(tmp_path, capsys) -> None:
    command = four_cars(tmp_path)
    model = ExtendedModel(TEXTBOOK, US101.speed_limit, drivers="drivers.parquet")
    model.write(tmp_path / "model.json")
    with pytest.raises(SystemExit):
        main([*command, "--replay-bias", "0", "--jobs", "1", "-o", str(tmp_path / "none")])
    assert "drivers.parquet: no such file" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    own = pd.DataFrame({
        "period": "0750-0752", "vehicle": [1, 2, 3], "a": 1.0, "b": 1.5, "T": 1.2, "d0": 2.0, "d1": 0.0,
        "desired_speed_m_s": 6.0,
    })  # fmt: skip
    own.to_parquet(tmp_path / "drivers.parquet")
    speed = speeds(command, tmp_path / "out")
    assert speed["extended"] < speed["drivers"] - 3.0
    assert speed["own-loop"] == speed["extended"]  # the same drivers, and the model has no causes
    standing, without = own.assign(desired_speed_m_s=0.0), own.drop(columns="desired_speed_m_s")
    for wrong, said in ((standing, "= 0.0 is impossible"), (without, "is missing")):
        wrong.to_parquet(tmp_path / "drivers.parquet")
        with pytest.raises(SystemExit):
            speeds(command, tmp_path / "none")
        assert said in capsys.readouterr().err
