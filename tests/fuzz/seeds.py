"""One small sound input of every kind, as the table or the values that mutations change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.irl.features import NAMES
from idm_sumo.models.idm import IDMParameters
from idm_sumo.recordings import columns as c
from idm_sumo.roads.us101 import US101
from tests.helpers import ngsim_files

FRAMES = 30
NETWORK = Path(__file__).with_name("ramp.net.xml")  # two edges, a lane more on the second, a ramp; made by netconvert


def ngsim() -> pd.DataFrame:
    """Return three cars in NGSIM's columns (feet)."""
    return ngsim_files.table(frames=FRAMES)


def fcd() -> pd.DataFrame:
    """Return the same as SUMO writes floating car data."""
    raw = ngsim()
    return pd.DataFrame({
        "timestep_time": raw["Frame_ID"] * 0.1, "vehicle_id": [f"car.{n}" for n in raw["Vehicle_ID"]],
        "vehicle_x": raw["Local_Y"] * 0.3048, "vehicle_y": -raw["Local_X"] * 0.3048, "vehicle_angle": 90.0,
        "vehicle_speed": raw["v_Vel"] * 0.3048, "vehicle_lane": "entry_3", "vehicle_length": 4.5,
    })  # fmt: skip


def fcd_on_network() -> pd.DataFrame:
    """Return two cars on the network of :data:`NETWORK`, across its junction."""
    return pd.concat([pd.DataFrame({
        "timestep_time": time, "vehicle_id": f"car.{vehicle}", "vehicle_x": x + 70.0, "vehicle_y": 38.4,
        "vehicle_angle": 90.0, "vehicle_type": "truck", "vehicle_speed": 20.0, "vehicle_pos": x + 70.0,
        "vehicle_lane": "in_1",
    }) for vehicle, time, x in cars(0.1)]).sort_values("timestep_time")  # fmt: skip


def corridor() -> list[str]:
    """Return edges in driving order."""
    return ["in", "out"]


def types() -> str:
    """Return a route file with vehicle types."""
    return (
        '<routes>\n<vType id="truck" vClass="truck" length="12.5" width="2.5"/>\n'
        '<vTypeDistribution id="all">\n<vType id="car" length="4.5"/>\n<vType id="van" vClass="delivery"/>\n'
        '</vTypeDistribution>\n<route id="r" edges="in out"/>\n<vehicle id="car.1" type="truck" depart="0"/>\n'
        "</routes>\n"
    )


def pairs() -> pd.DataFrame:
    """Return a follower and its leader."""
    t = 0.1 * np.arange(FRAMES)
    return pd.DataFrame({
        "period": "p1", "follower": 2, "leader": 1, "t": t, "x_follower": 12.0 * t, "x_leader": 30.0 + 12.0 * t,
        "leader_length": 4.5, "v_follower": 12.0,
    })  # fmt: skip


def named_pairs() -> pd.DataFrame:
    """Return the same under names that people use."""
    return pairs().rename(columns={"t": "time", "follower": "follower_id", "leader": "leader_id"})


def cars(step: float) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Return number, times (s) and positions of the front (m) of two cars behind each other."""
    time = step * np.arange(FRAMES)
    return [(vehicle, time, 100.0 - 40.0 * (vehicle - 1) + 20.0 * time) for vehicle in (1, 2)]


def highd() -> pd.DataFrame:
    """Return tracks as highD has them."""
    return pd.concat([pd.DataFrame({
        "frame": np.arange(1, FRAMES + 1), "id": vehicle, "x": x - 4.0, "y": 15.0, "width": 4.0, "height": 2.0,
        "xVelocity": 20.0, "yVelocity": 0.0, "xAcceleration": 0.0, "precedingId": vehicle - 1, "laneId": 3,
    }) for vehicle, _, x in cars(0.04)])  # fmt: skip


def highd_meta() -> pd.DataFrame:
    """Return what highD tells beside the tracks."""
    return pd.DataFrame({
        "id": [1, 2], "class": ["Truck", "Car"], "drivingDirection": 2, "frameRate": 25, "speedLimit": 33.33,
        "upperLaneMarkings": "2.0;6.0;9.0", "lowerLaneMarkings": "10.0;14.0;18.0",
    })  # fmt: skip


def exid() -> pd.DataFrame:
    """Return tracks as exiD has them."""
    return pd.concat([pd.DataFrame({
        "recordingId": 3, "trackId": vehicle, "frame": np.arange(FRAMES), "xCenter": x - 2.0, "yCenter": 0.0,
        "heading": 0.0, "width": 1.9, "length": 4.0, "lonVelocity": 20.0, "lonAcceleration": 0.0,
        "latLaneCenterOffset": "0.0", "laneletId": "1501", "leadId": vehicle - 1 or -1,
    }) for vehicle, _, x in cars(0.04)])  # fmt: skip


def tgsim() -> pd.DataFrame:
    """Return tracks as TGSIM has them."""
    return pd.concat([pd.DataFrame({
        "id": vehicle, "time": time, "xloc-kf": x - 2.0, "yloc-kf": 1500.0, "lane-kf": 2, "speed-kf": 20.0,
        "acceleration-kf": 0.0, "length-smoothed": 4.0, "width-smoothed": 1.9, "type-most-common": "small-vehicle",
        "av": "no", "run-index": 1,
    }) for vehicle, time, x in cars(0.1)])  # fmt: skip


def openacc() -> pd.DataFrame:
    """Return a platoon as OpenACC has it, without the lines before its columns."""
    table = pd.DataFrame({"Time": 0.1 * np.arange(FRAMES)})
    for place in (1, 2):
        table = table.assign(**{f"Speed{place}": 20.0, f"E{place}": 0.0, f"N{place}": 0.0, f"Driver{place}": 0.0})
    return table.assign(IVS1=30.0)


def i24() -> list[dict[str, object]]:
    """Return vehicles as I-24 MOTION has them."""
    return [{
        "_id": {"$oid": f"{vehicle:02d}"}, "direction": -1, "coarse_vehicle_class": 0, "length": 13.0, "width": 6.0,
        "timestamp": (1669118400.0 + time).tolist(), "x_position": (x / 0.3048).tolist(),
        "y_position": [-30.0] * FRAMES,
    } for vehicle, time, x in cars(0.04)]  # fmt: skip


def street() -> pd.DataFrame:
    """Return two cars in the 24 columns of NGSIM's streets."""
    return pd.concat([pd.DataFrame(dict(enumerate((
        vehicle, np.arange(FRAMES), FRAMES, 1118846980000 + 100 * np.arange(FRAMES), 6.0, x / 0.3048, 0, 0, 13.0, 6.0,
        2, 65.6, 0.0, 1, 0, 0, 0, 2, 2, 1, vehicle - 1, 0, 0, 0,
    )))) for vehicle, _, x in cars(0.1)])  # fmt: skip


def reconstructed() -> pd.DataFrame:
    """Return two cars in the 10 columns of reconstructed NGSIM."""
    return pd.concat([pd.DataFrame(dict(enumerate((
        vehicle, np.arange(FRAMES), 2, x, 20.0, 0.0, 4.0, 2, 0, vehicle - 1,
    )))) for vehicle, _, x in cars(0.1)])  # fmt: skip


def reward() -> dict[str, object]:
    """Return a learned reward."""
    weights = {"weights": dict.fromkeys(NAMES, 0.5), "standard_errors": dict.fromkeys(NAMES, 0.1)}
    return {"wanted": weights, "free": weights, "held_out_log_likelihood": -1.0, "scale": 1.0, "shift": 0.1,
            "standing": 0, "features": list(NAMES)}  # fmt: skip


def curve() -> pd.DataFrame:
    """Return a learning curve."""
    steps = 6400 * np.arange(1, FRAMES + 1)
    return pd.DataFrame({
        "steps": steps, "episodes": 100, "mean_return": -1.0, "mean_length": 50.0, "collision_share": 0.1,
        "off_road_share": 0.1, "seconds": 1.5,
    })  # fmt: skip


def own() -> pd.DataFrame:
    """Return a recording in its own columns."""
    steps = np.arange(FRAMES)
    return pd.DataFrame({
        c.PERIOD: "p1", c.VEHICLE: 1, c.FRAME: steps, c.TIME: 0.1 * steps, c.X: 10.0 + 1.2 * steps,
        c.Y: float(US101.lane_center(3)), c.SPEED: 12.0, c.ACCELERATION: 0.0, c.HEADING: 0.0, c.LENGTH: 4.5,
        c.WIDTH: 1.8, c.CLASS: 2, c.LANE: 3, c.LEADER: 0, c.HEADWAY: np.nan,
    })  # fmt: skip


def drivers() -> pd.DataFrame:
    """Return a table of two drivers."""
    return pd.DataFrame({
        "period": "p1", "vehicle": [1, 2], "a": 1.5, "b": 2.0, "T": 1.2, "d0": 2.5, "d1": 0.5, "ade_m": 0.4,
        "status": "ok", "desired_speed_m_s": 24.6,
    })  # fmt: skip


def model() -> dict[str, object]:
    """Return an extended model with one cause."""
    base = {**IDMParameters(1.5, 2.0, 1.2, 2.5, 0.5)._asdict(), "desired_speed": 24.6}
    return {
        "format": "idm-sumo extended model 1", "source": "", "law": "idm", "reaction": 1.0, "base": base, "causes": [],
        "drivers": "",
    }  # fmt: skip


def run_file() -> str:
    """Return a run file."""
    return (
        'recordings = ["surrogate"]\nobserved = 10\nhorizon = 100\nneighbours = 8\nframe_counts = [2, 10]\nseed = 1\n'
    )


def policy() -> dict[str, np.ndarray]:
    """Return the arrays of a policy of one layer."""
    return {"w0": np.zeros((16, 2)), "b0": np.zeros(2), "facts": np.array('{"kind": "clone", "seed": 1}')}
