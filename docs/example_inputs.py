"""Write small inputs for the quickstart: ``python docs/example_inputs.py -o DIR``.

A road as plain XML of SUMO with traffic for it, a platoon in OpenACC's layout and a motorway in highD's. All numbers
are invented; the drivers follow the IDM behind a first vehicle that speeds up and slows down.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

Floats = npt.NDArray[np.float64]

LENGTH, WIDTH = 4.6, 1.9  # m, of a car
NODES = '<nodes><node id="a" x="0" y="0"/><node id="b" x="2000" y="0"/></nodes>'
EDGES = '<edges><edge id="road" from="a" to="b" numLanes="3" speed="30"/></edges>'
TYPE = '<vType id="{0}" carFollowModel="IDM" tau="{1}" accel="{2}" decel="{3}" minGap="{4}" speedDev="0"{5}/>'
DRIVERS = (("calm", 1.6, 1.2, 1.8, 2.5, ""), ("quick", 0.9, 2.0, 2.5, 1.8, ""),
           ("truck", 1.9, 0.8, 1.5, 3.0, ' vClass="truck" length="12"'))  # fmt: skip
FLOW = '<flow id="f" type="any" route="all" begin="0" end="60" vehsPerHour="4000" departLane="best" departSpeed="20"/>'
HIGHD_LANES = (21.0, 24.75, 28.5)  # m, markings of the lower carriageway, whose y points down
HIGHD_SECTION, HIGHD_RATE, HIGHD_LIMIT = 420.0, 25.0, 36.11  # m, Hz, m/s


def platoon(cars: int, seconds: float, step: float, speed: float, limit: float, rng: np.random.Generator) -> Floats:
    """Return fronts (m) of cars that follow each other.

    Parameters
    ----------
    cars : int
    seconds, step : float
        s.
    speed, limit : float
        Mean speed of the first car, and everybody's desired speed (m/s).
    rng : numpy.random.Generator

    Returns
    -------
    ndarray of float64, shape (moments, cars)
        The first car's starts at 0.
    """
    t = np.arange(0.0, seconds, step)
    phase, period = rng.uniform(0, 2 * np.pi, 2), rng.uniform(15, 40, 2)
    first = speed * (1 + 0.12 * np.sin(2 * np.pi * t[:, None] / period + phase).sum(axis=1))
    a, b, T, d0 = rng.uniform([[0.8], [1.2], [0.9], [1.5]], [[2.0], [2.5], [1.8], [3.0]], (4, cars))
    x, v = np.zeros((len(t), cars)), np.full(cars, first[0])
    x[0] = -np.concatenate([[0.0], np.cumsum(LENGTH + (d0 + 1.15 * T * speed)[1:])])
    for k in range(len(t) - 1):
        gap = np.concatenate([[np.inf], x[k, :-1] - x[k, 1:] - LENGTH])
        rate = v - np.concatenate([[first[k]], v[:-1]])
        wanted = d0 + np.maximum(0.0, T * v + v * rate / (2 * np.sqrt(a * b)))
        v = np.maximum(0.0, v + step * a * (1 - (v / limit) ** 4 - (wanted / gap) ** 2))
        v[0] = first[k + 1]
        x[k + 1] = x[k] + step * v
    return x


def write_road(folder: Path) -> None:
    """Write nodes, edges and traffic for netconvert and SUMO.

    Parameters
    ----------
    folder : Path
    """
    types = "".join(TYPE.format(*one) for one in DRIVERS)
    routes = f'<vTypeDistribution id="any">{types}</vTypeDistribution><route id="all" edges="road"/>{FLOW}'
    (folder / "road.nod.xml").write_text(NODES, encoding="utf-8")
    (folder / "road.edg.xml").write_text(EDGES, encoding="utf-8")
    (folder / "road.rou.xml").write_text(f"<routes>{routes}</routes>", encoding="utf-8")


def write_openacc(path: Path, rng: np.random.Generator) -> None:
    """Write five minutes of six cars.

    Parameters
    ----------
    path : Path
    rng : numpy.random.Generator
    """
    x = platoon(6, 300.0, 0.1, 24.0, 33.0, rng)
    columns = {"Time": 0.1 * np.arange(len(x))}
    columns |= {f"Speed{n + 1}": np.gradient(x[:, n], 0.1) for n in range(x.shape[1])}
    columns |= {f"IVS{n}": x[:, n - 1] - x[:, n] - LENGTH for n in range(1, x.shape[1])}
    table = pd.DataFrame(columns).to_csv(index=False, float_format="%.3f")
    path.write_text(f"#Location,invented\n#Length,{LENGTH}\n{table}", encoding="utf-8")


def write_highd(folder: Path, rng: np.random.Generator) -> None:
    """Write two lanes of a motorway, its cars and its markings.

    Parameters
    ----------
    folder : Path
    rng : numpy.random.Generator
    """
    tracks = pd.concat([_highd_lane(lane, rng) for lane in (0, 1)], ignore_index=True)
    tracks.to_csv(folder / "01_tracks.csv", index=False, float_format="%.3f")
    cars = tracks.groupby("id")["frame"].agg(["min", "max"]).set_axis(["initialFrame", "finalFrame"], axis=1)
    cars.assign(**{"class": "Car", "drivingDirection": 2}).to_csv(folder / "01_tracksMeta.csv")
    about = {"id": 1, "frameRate": HIGHD_RATE, "speedLimit": HIGHD_LIMIT, "upperLaneMarkings": "",
             "lowerLaneMarkings": ";".join(map(str, HIGHD_LANES))}  # fmt: skip
    pd.DataFrame([about]).to_csv(folder / "01_recordingMeta.csv", index=False)


def _highd_lane(lane: int, rng: np.random.Generator) -> pd.DataFrame:
    """Return the rows of one lane, as long as its cars are within the section."""
    front = platoon(30, 75.0, 1 / HIGHD_RATE, 24.0 + 3.0 * (lane == 0), HIGHD_LIMIT, rng)
    speed = np.gradient(front, 1 / HIGHD_RATE, axis=0)
    frame, car = np.nonzero((front >= LENGTH) & (front <= HIGHD_SECTION))
    number = 100 * lane + car + 1
    return pd.DataFrame({
        "frame": frame + 1, "id": number, "x": front[frame, car] - LENGTH,
        "y": 0.5 * (HIGHD_LANES[lane] + HIGHD_LANES[lane + 1] - WIDTH), "width": LENGTH, "height": WIDTH,
        "xVelocity": speed[frame, car], "yVelocity": 0.0,
        "xAcceleration": np.gradient(speed, 1 / HIGHD_RATE, axis=0)[frame, car], "yAcceleration": 0.0,
        "precedingId": np.where((car > 0) & (front[frame, car - 1] <= HIGHD_SECTION), number - 1, 0),
        "laneId": 5 + lane,
    })  # fmt: skip


def main() -> None:
    """Write all of them into a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    write_road(folder)
    write_openacc(folder / "platoon.csv", rng)
    write_highd(folder, rng)
    print(f"wrote a road, a platoon and a motorway into {folder}")


if __name__ == "__main__":
    main()
