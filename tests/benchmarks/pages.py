"""Measure the pages in a browser: ``python -m tests.benchmarks.pages``.

Prints the size of a replay of ten dense seconds and its frames a second while it plays, and the size of a
time-space diagram of an hour with the time that a step of zooming takes. Run it on a quiet machine.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.page.page import render
from analysis.page.style import new_figure, save
from analysis.page.time_space import diagrams_of
from analysis.replay.player import Played, write_player
from idm_sumo.calibration import calibrate
from idm_sumo.evaluation.metrics import score
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_constant_velocity, drive_idm
from idm_sumo.sumo.surrogate.builtin import surrogate
from tests.helpers.browser import open_browser, resize, visit

HOUR = 36_000  # frames
VEHICLES = 8_000  # an hour on five lanes
SPEED = 10.0  # m/s
PLAYED = """
const done = arguments[arguments.length - 1];
document.getElementById("pace").value = "0.25"; document.getElementById("pace").dispatchEvent(new Event("change"));
document.getElementById("play").click();
let frames = 0; const begin = performance.now();
requestAnimationFrame(function count(now) {
  frames += 1;
  if (now - begin < 5000) requestAnimationFrame(count); else done(1000 * frames / (now - begin));
});
"""
ZOOMED = """
const done = arguments[arguments.length - 1], canvas = document.querySelector(".time-space canvas");
const box = canvas.getBoundingClientRect(), steps = 20; let left = steps; const begin = performance.now();
(function zoom() {
  if (left === 0) { done((performance.now() - begin) / steps); return; }
  const where = {clientX: box.left + box.width / 2, clientY: box.top + box.height / 2, bubbles: true, cancelable: true};
  canvas.dispatchEvent(new WheelEvent("wheel", {...where, deltaY: left > steps / 2 ? -120 : 120}));
  left -= 1; requestAnimationFrame(() => requestAnimationFrame(zoom));
})();
"""


def replay_page(folder: Path) -> Path:
    """Write the replay of a driver in dense traffic of the built-in recording."""
    whole = smooth(clean(read_recording(surrogate(minutes=4))))
    scenes = build_scenes(whole.of_period(whole.periods[0]), Window())
    one = scenes.subset(np.array([len(scenes) // 2]))
    driven = {"idm_oracle": drive_idm(one, calibrate(one)), "constant_velocity": drive_constant_velocity(one)}
    played = [Played(name, trajectories) for name, trajectories in driven.items()]
    table = pd.concat([score(one, trajectories).assign(method=name) for name, trajectories in driven.items()])
    page = folder / "replay.html"
    write_player(page, whole, one, played, table[["method", "ade_m", "fde_m"]], title="a replay", answer="")
    return page


def hour_of_traffic() -> Recording:
    """Return an hour in which a vehicle enters each lane every 2.2 s."""
    steps = int(US101.length / SPEED * 10)
    vehicle = np.repeat(np.arange(VEHICLES), steps)
    step = np.tile(np.arange(steps), VEHICLES)
    frame = (vehicle * HOUR) // VEHICLES + step
    lane = vehicle % US101.main_lanes + 1
    table = pd.DataFrame({
        c.PERIOD: "0750-0850", c.VEHICLE: vehicle + 1, c.FRAME: frame, c.TIME: frame / 10, c.X: SPEED * step / 10,
        c.Y: US101.lane_center(lane), c.SPEED: SPEED + np.sin(frame / 300), c.ACCELERATION: 0.0, c.HEADING: 0.0,
        c.LENGTH: 4.5, c.WIDTH: 1.8, c.CLASS: c.CAR, c.LANE: lane, c.LEADER: 0, c.HEADWAY: np.nan,
    })  # fmt: skip
    return Recording.from_table(table, road=US101, source="an hour")


def hour_page(folder: Path) -> Path:
    """Write a report with the diagram of an hour."""
    figure, _ = new_figure()
    save(figure, folder / "comparison.png")
    page = folder / "hour.html"
    render(
        page, "comparison/report.html.j2", title="An hour", findings="", not_measured="", figures=folder,
        diagrams=diagrams_of({"recorded": hour_of_traffic()}), sections=[], notes=[],
    )  # fmt: skip
    return page


def measure(driver: Any, page: Path, script: str) -> float:
    """Return what a script of the page tells when it is done."""
    resize(driver, 1280)
    driver.set_script_timeout(120)
    visit(driver, page)
    return float(driver.execute_async_script(script))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch, open_browser() as chromium:
        replayed, hour = replay_page(Path(scratch)), hour_page(Path(scratch))
        rate, step_ms = measure(chromium, replayed, PLAYED), measure(chromium, hour, ZOOMED)
        print(f"replay of ten seconds: {replayed.stat().st_size / 1e6:.2f} MB, {rate:.0f} frames a second")
        print(f"time-space diagram of an hour: {hour.stat().st_size / 1e6:.2f} MB, {step_ms:.0f} ms a step of zooming")
