"""The surrogate's simulation: full traffic and a bottleneck downstream."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.siblings import scratch
from idm_sumo.sumo import network
from idm_sumo.sumo.session import simulation
from idm_sumo.sumo.surrogate.demand import Schedule

NETWORK = network.of(US101)
SECTION = ("entry", "weave", "exit")
AFTER_RAMPS = ("exit", "downstream")
BOTTLENECK = "outflow"
CONTROL_STEP = 2.0  # s between two changes of the speed signs
LAST_CHANCE = 170.0  # m along the weaving section of 213 m
LONGEST_CLEARING = 900.0  # s

# Mean speeds (m/s) of the real periods, which the speed signs keep: traffic jams before the
# weaving section and speeds up behind it, as on US-101, and waves travel upstream from the bottleneck.
TARGET_SPEED = (11.6, 8.5, 7.3)
WEAVE_SIGN = (12.8, 9.9, 8.2)  # m/s, while the section is as fast as it should be
AFTER_SIGN = (24.0, 12.0, 11.5)  # m/s, between the off-ramp and the bottleneck
BOTTLENECK_SIGN = (12.0, 10.5, 9.5)  # m/s, on average
SWAY = 3.0  # m/s, standard deviation of the sign at the bottleneck
SWAY_TIME = 60.0  # s, its correlation time
GAIN = 1.0  # m/s on the sign of the weaving section for 1 m/s too fast or too slow
SLOWEST_SIGN = 5.0  # m/s

# With ballistic steps the acceleration is constant within a step, so frames between two
# steps are known exactly (see `noise.between_steps`). This saves 4/5 of the time.
STEP = 0.5  # s
MARGIN = 20.0  # m, more than a step around the section
FRAMES_A_STEP = round(STEP / FRAME_STEP)

Trajectories = dict[str, npt.NDArray[Any]]


def run(routes: Path, schedule: Schedule, seed: int, progress: Callable[[float, float], None] | None) -> Trajectories:
    """Simulate and return one row a vehicle and step.

    Parameters
    ----------
    routes : Path
        SUMO route file; vehicles are named by their number.
    schedule : Schedule
        When to record.
    seed : int
        Seed of SUMO and of the bottleneck.
    progress : callable or None
        Called with the seconds simulated and their total.

    Returns
    -------
    dict of ndarray, shape (rows,)
        ``vehicle`` (int), ``step`` (int, 0 at the recording's first instant), ``x``, ``y`` (m),
        ``speed`` (m/s); sorted by vehicle and step.

    Raises
    ------
    InputError
        If SUMO cannot be loaded.
    """
    with scratch() as folder:
        fcd = folder / "fcd.parquet"
        options = (
            "--route-files", str(routes), "--seed", str(seed), "--step-method.ballistic", "true",
            "--lateral-resolution", f"{US101.widths[0]}", "--collision.action", "none", "--no-warnings", "true",
            "--fcd-output", str(fcd), "--fcd-output.attributes", "x,y,speed", "--precision", "4",
            # A step early: vehicles in the section by then belong to no period.
            "--device.fcd.begin", f"{schedule.begin - STEP:.1f}",
        )  # fmt: skip
        with simulation(options, net=NETWORK.file, step_length=STEP) as sumo:
            _simulate(sumo, schedule, np.random.default_rng([seed, 2]), progress)
        return _read(fcd, schedule)


def _simulate(
    sumo: Any, schedule: Schedule, rng: np.random.Generator, progress: Callable[[float, float], None] | None
) -> None:
    """Step until every recorded vehicle has left.

    The speed signs at the bottleneck change as time goes.
    """
    now, sway = 0.0, 0.0
    total = schedule.end + 120.0  # about how long it takes the section to empty
    decay = math.exp(-CONTROL_STEP / SWAY_TIME)
    while now < schedule.end or (_present(sumo) and now < schedule.end + LONGEST_CLEARING):
        now += CONTROL_STEP
        sumo.simulationStep(now)
        sway = decay * sway + SWAY * math.sqrt(1 - decay**2) * rng.normal()
        _set_signs(sumo, int(np.clip((now - schedule.begin) // schedule.period, 0, len(TARGET_SPEED) - 1)), sway)
        _give_up_lane_changes(sumo)
        if progress is not None:
            progress(min(now, total), total)


def _set_signs(sumo: Any, period: int, sway: float) -> None:
    """Show the speed limits (m/s) of this moment."""
    too_slow = TARGET_SPEED[period] - _mean_speed(sumo)
    signs = {"weave": WEAVE_SIGN[period] + GAIN * too_slow, BOTTLENECK: BOTTLENECK_SIGN[period] + sway}
    signs |= dict.fromkeys(AFTER_RAMPS, AFTER_SIGN[period])
    for edge, speed in signs.items():
        sumo.edge.setMaxSpeed(edge, float(np.clip(speed, SLOWEST_SIGN, US101.speed_limit)))


def _give_up_lane_changes(sumo: Any) -> None:
    """Reroute vehicles that missed the lane of their route.

    A vehicle that misses the off-ramp stays on the freeway; one that finds no gap to merge leaves again
    by the off-ramp. SUMO would have them wait at the lane's end until the weaving section is locked.
    """
    for name in sumo.edge.getLastStepVehicleIDs("weave"):
        if sumo.vehicle.getLanePosition(name) < LAST_CHANCE:
            continue
        leads_to = NETWORK.layout.off_ramp if sumo.vehicle.getLaneIndex(name) == 0 else BOTTLENECK
        if sumo.vehicle.getRoute(name)[-1] != leads_to:
            sumo.vehicle.setRoute(name, NETWORK.route("weave", leads_to))


def _present(sumo: Any) -> bool:
    """Whether a vehicle is in the section or enters it."""
    return any(sumo.edge.getLastStepVehicleNumber(edge) for edge in (*SECTION, "on_ramp", "off_ramp"))


def _mean_speed(sumo: Any) -> float:
    """Return the mean speed (m/s) of the section's vehicles."""
    counts = np.array([sumo.edge.getLastStepVehicleNumber(edge) for edge in SECTION], dtype=np.float64)
    speeds = np.array([sumo.edge.getLastStepMeanSpeed(edge) for edge in SECTION])
    return float((speeds * counts).sum() / counts.sum()) if counts.sum() else US101.speed_limit


def _read(fcd: Path, schedule: Schedule) -> Trajectories:
    """Read SUMO's floating car data, sorted by vehicle and step."""
    near = [("vehicle_x", ">", -MARGIN), ("vehicle_x", "<", US101.length + MARGIN)]
    table = pq.read_table(fcd, filters=near)
    vehicle = table["vehicle_id"].cast("int32").to_numpy()
    step = np.rint((table["timestep_time"].to_numpy() - schedule.begin) / STEP).astype(np.int32)
    order = np.lexsort((step, vehicle))
    columns = {"vehicle": vehicle, "step": step}
    columns |= {name: table[f"vehicle_{name}"].to_numpy() for name in ("x", "y", "speed")}
    return {name: values[order] for name, values in columns.items()}
