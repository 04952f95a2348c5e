"""Layouts of public data sets, with invented vehicles: two behind each other, a third in the lane beside."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.readers.layout import plain
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.units import FOOT
from idm_sumo.runtime.errors import InputError

LENGTH, SPEED, GAP = 4.0, 20.0, 30.0
FRONTS = {1: 100.0, 2: 100.0 - GAP - LENGTH, 3: 80.0}  # m, at the start
LANES = {1: 2, 2: 2, 3: 1}


def moments(step: float, seconds: float = 6.0) -> np.ndarray:
    return np.arange(round(seconds / step)) * step


def front(vehicle: int, time: np.ndarray) -> np.ndarray:
    return FRONTS[vehicle] + SPEED * time + 0.4 * time**2


def check(recording: Recording, *, lanes: dict[int, int] = LANES, tolerance: float = 1e-6) -> None:
    """Gaps, speeds and lanes are those of the invented vehicles, a row every 0.1 s."""
    table = recording.table.assign(**{c.PERIOD: recording.table[c.PERIOD].astype(str)})
    first, second = (table[table[c.VEHICLE] == number].set_index(c.FRAME) for number in (1, 2))
    gap = (first[c.X] - first[c.LENGTH] - second[c.X]).dropna()
    assert len(gap) == 60
    np.testing.assert_allclose(gap, GAP, atol=tolerance)
    time = first.index.to_numpy() * 0.1
    np.testing.assert_allclose(first[c.X] - first[c.X].iloc[0], front(1, time) - FRONTS[1], atol=tolerance)
    assert table.groupby(c.VEHICLE)[c.LANE].first().to_dict() == lanes
    np.testing.assert_allclose(table[c.Y], recording.road.lane_center(table[c.LANE]), atol=tolerance)
    account = recording.accounting
    assert account.total + sum(account.added.values()) == account.used + sum(account.dropped.values())


def highd(folder: Path, *, leftwards: bool = False, meta: bool = True) -> Path:
    time, parts = moments(0.04), []
    for vehicle in FRONTS:
        x = front(vehicle, time)
        middle = {1: 12.0, 2: 16.0}[LANES[vehicle]]  # lanes of 4 m from 10 to 18 m; left lies up when driving right
        middle = 28.0 - middle if leftwards else middle
        corner = 500.0 - x if leftwards else x - LENGTH
        parts.append(pd.DataFrame({
            "frame": np.arange(1, len(time) + 1), "id": vehicle, "x": corner, "y": middle - 1.0, "width": LENGTH,
            "height": 2.0, "xVelocity": (SPEED + 0.8 * time) * (-1 if leftwards else 1), "yVelocity": 0.0,
            "xAcceleration": 0.8 * (-1 if leftwards else 1), "precedingId": 1 if vehicle == 2 else 0,
            "laneId": LANES[vehicle] + 4 if not leftwards else 4 - LANES[vehicle],
        }))  # fmt: skip
    path = folder / "07_tracks.csv"
    pd.concat(parts).to_csv(path, index=False)
    if meta:
        markings = "10.0;14.0;18.0"
        about = {"id": 7, "frameRate": 25, "speedLimit": 33.33, "upperLaneMarkings": markings}
        about["lowerLaneMarkings"] = markings
        pd.DataFrame([about]).to_csv(folder / "07_recordingMeta.csv", index=False)
        cars = {"id": [1, 2, 3], "class": ["Car", "Truck", "Car"], "drivingDirection": 1 if leftwards else 2}
        pd.DataFrame(cars).to_csv(folder / "07_tracksMeta.csv", index=False)
    return path


@pytest.mark.parametrize("leftwards", [False, True])
@pytest.mark.parametrize("meta", [False, True])
def test_highd(tmp_path: Path, leftwards: bool, meta: bool) -> None:
    recording = read_recording(highd(tmp_path, leftwards=leftwards, meta=meta))
    check(recording)
    assert recording.accounting.total == 450
    np.testing.assert_allclose(recording.road.widths, 4.0)
    kinds = recording.table.groupby(c.VEHICLE)[c.CLASS].first().to_dict()
    assert kinds == ({1: c.CAR, 2: c.TRUCK, 3: c.CAR} if meta else {1: 0, 2: 0, 3: 0})
    assert recording.table.groupby(c.VEHICLE)[c.LEADER].first()[2] == 1
    if meta:
        assert recording.road.speed_limit == pytest.approx(33.33)


def test_a_missing_column_is_named_with_its_layout(tmp_path: Path) -> None:
    path = highd(tmp_path)
    pd.read_csv(path).drop(columns="height").to_csv(path, index=False)
    with pytest.raises(InputError, match="highD, but column height is missing"):
        read_recording(path)


def test_exid_on_a_bend(tmp_path: Path) -> None:
    time, radius, parts = moments(0.04), 2000.0, []
    for vehicle in FRONTS:
        offset = {1: 1.8, 2: -1.8}[LANES[vehicle]]
        turn = (front(vehicle, time) - LENGTH / 2) / radius  # all drive the same angle
        parts.append(pd.DataFrame({
            "recordingId": 3, "trackId": vehicle, "frame": np.arange(len(time)),
            "xCenter": (radius - offset) * np.sin(turn), "yCenter": radius - (radius - offset) * np.cos(turn),
            "heading": np.rad2deg(turn), "width": 1.9, "length": LENGTH, "lonVelocity": SPEED + 0.8 * time,
            "lonAcceleration": 0.8, "latLaneCenterOffset": "0.0", "laneletId": str(1500 + LANES[vehicle]),
            "leadId": 1 if vehicle == 2 else -1,
        }))  # fmt: skip
    path = tmp_path / "03_tracks.csv"
    pd.concat(parts).to_csv(path, index=False)
    recording = read_recording(path)
    check(recording, tolerance=0.15)  # along the way of the farthest vehicle, 1.8 m beside the middle
    assert recording.road.main_lanes == 2
    assert recording.table.groupby(c.VEHICLE)[c.LEADER].first().to_dict() == {1: 0, 2: 1, 3: 0}


@pytest.mark.parametrize("mark", ["-", "_"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_tgsim(tmp_path: Path, mark: str, direction: float) -> None:
    time, parts = moments(0.1), []
    for vehicle in FRONTS:
        parts.append(pd.DataFrame({
            "id": vehicle, "time": time, "xloc-kf": direction * (front(vehicle, time) - LENGTH / 2),
            "yloc-kf": 1500.0 + direction * 3.5 * LANES[vehicle], "lane-kf": LANES[vehicle], "speed-kf": SPEED,
            "acceleration-kf": 0.0, "length-smoothed": LENGTH, "width-smoothed": 1.9,
            "type-most-common": "small-vehicle", "av": "yes" if vehicle == 3 else "no", "run-index": 1,
        }))  # fmt: skip
    table = pd.concat(parts)
    table.columns = [name.replace("-", mark) for name in table.columns]
    table.to_csv(tmp_path / "tgsim.csv", index=False)
    recording = read_recording(tmp_path / "tgsim.csv")
    check(recording)
    assert "1 vehicles are automated, first 3" in recording.notes


def i24(path: Path, *, lines: bool = False, direction: float = 1.0) -> Path:
    time = moments(0.04)
    vehicles = [
        {"_id": {"$oid": f"{vehicle:02d}"}, "direction": -1, "coarse_vehicle_class": 0, "length": LENGTH / FOOT,
         "width": 6.0, "timestamp": (1669118400.0 + time).tolist(),
         "x_position": (direction * (front(vehicle, time) - LENGTH) / FOOT).tolist(),
         "y_position": [-6.0 - 12.0 * LANES[vehicle]] * len(time)} for vehicle in FRONTS
    ]  # fmt: skip
    path.write_text("\n".join(map(json.dumps, vehicles)) if lines else json.dumps(vehicles))
    return path


@pytest.mark.parametrize("lines", [False, True])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_i24_motion(tmp_path: Path, lines: bool, direction: float) -> None:
    recording = read_recording(i24(tmp_path / "day.json", lines=lines, direction=direction))
    check(recording, tolerance=1e-5)
    np.testing.assert_allclose(recording.road.widths, 12 * FOOT)
    assert recording.accounting.total == 450


def test_a_cut_json_is_refused(tmp_path: Path) -> None:
    path = i24(tmp_path / "day.json")
    path.write_text(path.read_text()[:-2000])
    with pytest.raises(InputError, match="vehicle 3 is no whole JSON object"):
        read_recording(path)


def test_an_openacc_platoon(tmp_path: Path) -> None:
    time = moments(0.1)
    table = pd.DataFrame({"Time": time})
    for place in (1, 2, 3):
        table[[f"Speed{place}", f"E{place}", f"N{place}", f"Driver{place}"]] = 0.0
        table[f"Speed{place}"] = SPEED + np.sin(time - 0.2 * place)
    for place in (1, 2):
        table[f"IVS{place}"] = GAP
    path = tmp_path / "platoon.csv"
    path.write_text("#Location,track\n#Vehicles,3\n#Length,4.6\n" + table.to_csv(index=False))
    recording = read_recording(path)
    assert not recording.has_leader_rows
    assert recording.table.groupby(c.VEHICLE)[c.LEADER].first().to_dict() == {2: 1, 3: 2}
    np.testing.assert_allclose(recording.table[c.HEADWAY], GAP + 4.6)
    second = recording.table[recording.table[c.VEHICLE] == 2]
    np.testing.assert_allclose(second[c.X], SPEED * time + np.cos(0.4) - np.cos(time - 0.4), atol=0.01)


def test_pneuma_is_refused_by_name_and_shown_the_doors(tmp_path: Path) -> None:
    path = tmp_path / "pneuma.csv"
    path.write_text(
        "track_id; type; traveled_d; avg_speed; lat; lon; speed; lon_acc; lat_acc; time\n1; Car; 100.0; 40\n"
    )
    with pytest.raises(InputError, match=r"pNEUMA, which has no lanes.*pairs.*our own columns"):
        read_recording(path)


def street(path: Path) -> Path:
    rows = []
    for vehicle, direction in ((1, 2), (2, 2), (3, 4), (4, 1)):
        frame = np.arange(60)
        y = (FRONTS[min(vehicle, 3)] + SPEED * frame * 0.1) / FOOT
        rows.append(np.column_stack([
            np.full(60, vehicle), frame, np.full(60, 60), 1118846980000 + 100 * frame, np.full(60, 6.0),
            y if direction == 2 else 2000 - y, np.zeros((60, 2)), np.full(60, LENGTH / FOOT), np.full(60, 6.0),
            np.full(60, 2), np.full(60, SPEED / FOOT), np.zeros(60), np.where(frame < 30, 1, 0), np.zeros((60, 3)),
            np.full(60, 2), np.full(60, direction), np.ones(60), np.full(60, vehicle == 2), np.zeros((60, 3)),
        ]))  # fmt: skip
    np.savetxt(path, np.concatenate(rows), fmt="%.6f")
    return path


def test_a_street_of_ngsim(tmp_path: Path) -> None:
    recording = read_recording(street(tmp_path / "street.txt"))
    assert recording.periods == ["northbound", "southbound"]
    assert recording.accounting.dropped == {"of a crossing street": 60}
    assert recording.road.has_signals
    assert (recording.table[c.LANE] == 1).all()  # within the junction the lane is kept
    assert (recording.table.groupby([c.PERIOD, c.VEHICLE], observed=True)[c.X].diff().dropna() > 0).all()


def test_reconstructed_ngsim(tmp_path: Path) -> None:
    frame = np.arange(60)
    rows = [np.column_stack([np.full(60, vehicle), frame, np.full(60, LANES[vehicle]), front(vehicle, frame / 10),
                             np.full(60, SPEED), np.zeros(60), np.full(60, LENGTH), np.full(60, 2), np.zeros(60),
                             np.full(60, vehicle == 2)]) for vehicle in FRONTS]  # fmt: skip
    np.savetxt(tmp_path / "recon.txt", np.concatenate(rows), fmt="%.6f")
    recording = read_recording(tmp_path / "recon.txt")
    check(recording, tolerance=1e-5)
    assert recording.is_smooth


def test_names_made_of_brackets_are_read_in_one_pass() -> None:
    assert plain("speed (m/s)") == plain("Speed[m/s]") == "speed"
    assert plain("[" * 1_000_000) == "[" * 1_000_000  # hours, if every bracket looked for its end
