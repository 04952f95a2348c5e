"""Replayed vehicles x frames a second: the naive design against ours, in one run.

``pytest tests/benchmarks/test_replay_benchmark.py --benchmark-only`` (``-s`` prints the ratios).
"""

import time
from functools import cache

import numpy as np
import pandas as pd
import pytest

from idm_sumo.models import bicycle
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.simulation.rollout import Trajectories, drive_idm
from idm_sumo.sumo import network
from idm_sumo.sumo.replay.ghosts import replay_ghosts
from idm_sumo.sumo.replay.motion import Driver, Motion, advance, start_of
from idm_sumo.sumo.replay.one_vehicle import replay
from idm_sumo.sumo.session import simulation

DRIVER = np.array([1.4, 1.8, 1.1, 2.0, 1.0])
LANES = np.arange(1, US101.main_lanes + 1)
SECONDS: dict[str, float] = {}  # of each design, over the same scenes


def traffic(vehicles: int, frames: int, stay: int) -> Recording:
    """Return ``vehicles`` that take ``stay`` frames through the section, each in its lane."""
    rng, pace = np.random.default_rng(0), US101.length / (stay * FRAME_STEP)
    enters = np.linspace(-stay, frames - stay // 3, vehicles).round().astype(int)
    parts = []
    for number, enter in enumerate(enters, start=1):
        frame = np.arange(max(enter, 0), min(enter + stay, frames))
        seconds = (frame - enter) * FRAME_STEP
        lane = number % US101.main_lanes + 1
        parts.append(
            pd.DataFrame(
                {
                    c.PERIOD: "p", c.VEHICLE: number, c.FRAME: frame, c.TIME: seconds,
                    c.X: pace * seconds + 2 * np.sin(0.2 * seconds + number), c.SPEED: pace,
                    c.Y: US101.lane_center(lane) + rng.uniform(-1, 1), c.ACCELERATION: 0.0, c.HEADING: 0.0,
                    c.LENGTH: rng.choice([3.9, 4.7, 5.3]), c.WIDTH: 1.9, c.CLASS: 2, c.LANE: lane, c.LEADER: 0,
                    c.HEADWAY: np.nan,
                }
            )
        )  # fmt: skip
    return Recording.from_table(pd.concat(parts), road=US101)


@cache
def dense() -> Scenes:
    """Return about 190 vehicles at a time, 190 of them modelled for 50 frames."""
    return build_scenes(traffic(330, 700, 400), Window(observed=2, horizon=50)).subset(np.arange(60, 250))


def naive(scenes: Scenes) -> Trajectories:
    """Replay as one would first write it: all vehicles, a fresh simulation and a search of the net each time."""
    out, t = Trajectories.of(scenes), scenes.traffic
    for i in range(len(scenes)):
        with simulation(["--collision.action", "none", "--no-warnings", "true"], net=network.of(US101).file) as sumo:
            sumo.route.add("main", network.of(US101).mainline)
            _naive_one(sumo, scenes, i, out, t)
    return out


def _naive_one(sumo, scenes, i, out, t) -> None:
    length, lane_y, present = scenes.length[i], float(US101.lane_center(scenes.lane[i])), set()
    x, y, heading, speed = start_of(scenes, i)
    motion = Motion(*bicycle.center_of_front(x, y, heading, length), heading, speed)
    driver = Driver(DRIVER, US101.speed_limit, length, lane_y)
    for k in range(out.x.shape[1]):
        out.x[i, k], out.y[i, k], out.heading[i, k], out.speed[i, k] = x, y, motion.heading, motion.speed
        cells = t.cell(LANES, scenes.first_frame[i] + scenes.start + k)
        rows = np.concatenate([np.arange(t.offsets[cell], t.offsets[cell + 1]) for cell in cells])
        placed = {str(t.vehicle[row]): row for row in rows if t.vehicle[row] != scenes.vehicle[i]}
        where = {name: (t.x[row], t.y[row], t.length[row]) for name, row in placed.items()} | {"ego": (x, y, length)}
        for name, (front, lateral, long) in where.items():
            if name not in present:
                sumo.vehicle.add(name, "main")
                sumo.vehicle.setLength(name, long)
                present.add(name)
            sumo.vehicle.moveToXY(name, "", -1, front, lateral, 90.0, 2)
        for name in present - where.keys():
            sumo.vehicle.remove(name)
        present &= where.keys()
        sumo.simulationStep()
        leader = sumo.vehicle.getLeader("ego", 1000.0)
        row = placed[leader[0]] if leader and leader[0] else NOBODY
        gap = np.inf if row == NOBODY else leader[1] + sumo.vehicle.getMinGap("ego")
        out.leader[i, k], out.gap[i, k] = row, gap
        if k < out.acceleration.shape[1]:
            leader_speed = t.speed[row] if row != NOBODY else motion.speed
            out.acceleration[i, k], out.steering[i, k], motion, x, y = advance(motion, gap, leader_speed, driver)


DESIGNS = {
    "naive": naive,
    "one at a time": lambda scenes: replay(scenes, DRIVER),
    "ghosts": lambda scenes: replay_ghosts(scenes, DRIVER),
    "kernel": lambda scenes: drive_idm(scenes, DRIVER),
}


@pytest.mark.benchmark(group="190 vehicles for 50 frames among 190 others")
@pytest.mark.parametrize("design", DESIGNS)
def test_vehicles_and_frames_a_second(benchmark, design) -> None:
    scenes = dense()
    DESIGNS[design](scenes.subset(np.arange(1)))  # compile and load
    rounds = 1 if design == "naive" else 3
    driven = benchmark.pedantic(DESIGNS[design], args=(scenes,), rounds=rounds)
    SECONDS[design] = benchmark.stats.stats.min
    benchmark.extra_info["vehicles x frames a second"] = round(driven.x.size / SECONDS[design])
    benchmark.extra_info["times the naive design"] = round(SECONDS["naive"] / SECONDS[design], 1)
    print(f"\n{design}: {benchmark.extra_info}")
    np.testing.assert_allclose(driven.x, drive_idm(scenes, DRIVER).x, rtol=0, atol=1e-3)
    if design == "ghosts":
        assert SECONDS["naive"] > 8 * SECONDS[design]


@pytest.mark.benchmark(group="a whole period: 1,484 replays of ten seconds in one pass over 9,000 frames")
def test_a_whole_period_in_one_pass(benchmark) -> None:
    scenes = build_scenes(traffic(1620, 9000, 1050), Window())
    scenes = scenes.subset(np.linspace(0, len(scenes) - 1, 1484).astype(int))
    replay_ghosts(scenes.subset(np.arange(1)), DRIVER)
    begin = time.process_time()  # CPU seconds, so that other work on the machine does not count
    driven = benchmark.pedantic(replay_ghosts, args=(scenes, DRIVER), rounds=1)
    benchmark.extra_info["CPU seconds"] = round(time.process_time() - begin, 1)
    benchmark.extra_info["vehicles a frame"] = round(len(scenes.traffic.x) / scenes.traffic.frames)
    print(f"\n{benchmark.stats.stats.min:.1f} s, {benchmark.extra_info}")
    assert driven.x.shape == (1484, 101)
    np.testing.assert_allclose(driven.x, drive_idm(scenes, DRIVER).x, rtol=0, atol=1e-9)
