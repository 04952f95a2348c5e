"""Closed-loop runs: the recorded demand as vehicles that react."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration.place_speeds import PlaceSpeeds
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.sumo import network
from idm_sumo.sumo.closed_loop.demand import write_routes
from idm_sumo.sumo.closed_loop.ego import Ego
from idm_sumo.sumo.closed_loop.extended_loop import ModelDrivers
from idm_sumo.sumo.closed_loop.lane_change_output import changes_between_main_lanes
from idm_sumo.sumo.closed_loop.signs import SpeedSign, write_signs
from idm_sumo.sumo.export import run_recipe
from idm_sumo.sumo.export.translation import save
from idm_sumo.sumo.gui import gui_simulation
from idm_sumo.sumo.network import RoadNetwork
from idm_sumo.sumo.session import ALWAYS, simulation

ON_TIME = 0.05  # s, half a step
COUNTED = ("safety.emergencyBraking", "teleports.total")  # SUMO's names of its statistics
FCD = (
    "--fcd-output.acceleration", "true",
    "--precision", "4",
)  # fmt: skip


@dataclass(frozen=True)
class RunFiles:
    """SUMO's inputs of a population, named relative to each other.

    Attributes
    ----------
    net, routes, config : Path
    additional : Path or None
        The speeds that the road imposes.
    duration : float
        Recorded time (s).
    demand : pandas.DataFrame
        As of :func:`idm_sumo.sumo.closed_loop.demand.demand_of`.
    options : tuple of str
        Further options of ``sumo``.
    network : RoadNetwork
        What ``net`` is of.
    """

    net: Path
    routes: Path
    config: Path
    additional: Path | None
    duration: float
    demand: pd.DataFrame
    options: tuple[str, ...]
    network: RoadNetwork


@dataclass(frozen=True)
class Incidents:
    """What no traffic engineer wants to see.

    By SUMO's own counts.

    Attributes
    ----------
    collisions : int
        Pairs of vehicles that overlapped lengthwise in a lane.
    emergency_brakings : int
        Vehicle-steps of braking harder than a driver's comfortable deceleration allows to be safe.
    teleports : int
        Vehicles that SUMO moved on because they were stuck.
    """

    collisions: int = 0
    emergency_brakings: int = 0
    teleports: int = 0


@dataclass(frozen=True)
class Outcome:
    """Result of a run.

    Attributes
    ----------
    fcd : Path
        Parquet file of every vehicle every 0.1 s.
    departures : pandas.DataFrame
        ``vehicle, planned_s, departed_s, delay_s``, one row a vehicle of the demand: ``departed_s`` is NaN for one
        that found no room until the end, and its delay is what it had waited by then.
    incidents : Incidents
    arrived : int
        Vehicles that left the network.
    lane_changes : int
        Between main lanes within the section, by SUMO's own count.
    ego : pandas.DataFrame or None
        The Python-driven vehicle frame by frame.
    """

    fcd: Path
    departures: pd.DataFrame
    incidents: Incidents
    arrived: int
    lane_changes: int
    ego: pd.DataFrame | None

    @property
    def late(self) -> pd.DataFrame:
        """Vehicles that departed late or not at all."""
        return self.departures[self.departures["delay_s"] > ON_TIME]


def write_run(
    folder: Path, name: str, recording: Recording, demand: pd.DataFrame, types: Sequence[Element], *,
    signs: Sequence[SpeedSign] = (), places: PlaceSpeeds | None = None, options: Sequence[str] = (),
) -> RunFiles:  # fmt: skip
    """Write what SUMO needs to run one population.

    Parameters
    ----------
    folder : Path
        Created if it is missing.
    name : str
        ``NAME.rou.xml`` and ``NAME.sumocfg`` are written; network and speed signs are shared.
    recording : Recording
        One period; it says how long to run.
    demand, types
        Of :mod:`idm_sumo.sumo.closed_loop.demand` and :mod:`idm_sumo.sumo.closed_loop.populations`.
    signs : sequence of SpeedSign
        Speeds that the road imposes.
    places : PlaceSpeeds, optional
        Those at which vehicles may depart.
    options : sequence of str
        Further options of ``sumo``, ``--name value`` in turn.

    Returns
    -------
    RunFiles
    """
    folder.mkdir(parents=True, exist_ok=True)
    own = network.of(recording.road)
    net, routes, config = folder / own.file.name, folder / f"{name}.rou.xml", folder / f"{name}.sumocfg"
    if not net.is_file():
        shutil.copyfile(own.file, net)
    write_routes(recording.road, demand, types, routes, places)
    additional = None
    if signs:
        additional = folder / "speeds.add.xml"
        write_signs(signs, additional)
    frames = recording.table[c.FRAME]
    duration = float((frames.max() - frames.min() + 1) * FRAME_STEP)
    root = run_recipe.configuration(net.name, routes.name, run_recipe.EULER)
    _complete(root, additional, duration, options)
    save(root, config)
    return RunFiles(net, routes, config, additional, duration, demand, tuple(options), own)


def _complete(root: Element, additional: Path | None, duration: float, options: Sequence[str]) -> None:
    """Add the closed loop's own options to a configuration."""
    if additional is not None and (inputs := root.find("input")) is not None:
        SubElement(inputs, "additional-files", value=additional.name)
    if (time := root.find("time")) is not None:
        SubElement(time, "end", value=f"{duration:g}")
    if (processing := root.find("processing")) is not None:
        for name, value in zip(options[::2], options[1::2], strict=True):
            SubElement(processing, name.removeprefix("--"), value=value)


def run(
    files: RunFiles, fcd: Path, *, seed: int = 1, ego: Ego | None = None, ours: ModelDrivers | None = None,
    gui: bool = False, progress: Progress = silent,
) -> Outcome:  # fmt: skip
    """Let SUMO run a population over the recorded time.

    Parameters
    ----------
    files : RunFiles
    fcd : Path
        Parquet to write, every vehicle every 0.1 s.
    seed : int
        SUMO's.
    ego : Ego, optional
        A vehicle of the demand that Python drives.
    ours : ModelDrivers, optional
        Drives the vehicles on the main lanes in place of SUMO's types.
    gui : bool
        Show it in sumo-gui.
    progress : Progress
        Called with the steps done and their total.

    Returns
    -------
    Outcome

    Raises
    ------
    InputError
        If SUMO refuses the inputs; with ``gui``, if there is no sumo-gui or no display.
    """
    recipe = [(f"--{name}", value) for name, value in run_recipe.options(run_recipe.EULER).items()]
    given = {"--step-length", *ALWAYS[::2]}
    options = [part for pair in recipe if pair[0] not in given for part in pair]
    options += [
        "--route-files",
        str(files.routes),
        "--seed",
        str(seed),
        "--no-warnings",
        "true",
        *files.options,
        *FCD,
    ]
    changes = fcd.with_suffix(".lane_changes.xml")
    options += ["--fcd-output", str(fcd), "--fcd-output.attributes", files.network.fcd_attributes]
    options += ["--lanechange-output", str(changes)]
    if files.additional is not None:
        options += ["--additional-files", str(files.additional)]
    start = gui_simulation if gui else simulation
    with start(options, net=files.net) as sumo:
        departed, incidents, arrived = _loop(sumo, files, ego, ours, progress)
    table, changed = _departures(files, departed), changes_between_main_lanes(changes, files.network)
    return Outcome(fcd, table, incidents, arrived, changed, None if ego is None else ego.table())


def _loop(
    sumo: Any, files: RunFiles, ego: Ego | None, ours: ModelDrivers | None, progress: Progress
) -> tuple[dict[str, float], Incidents, int]:
    """Step through the run.

    Return departures (s), incidents, and how many vehicles arrived.
    """
    departed: dict[str, float] = {}
    collisions: set[tuple[str, str]] = set()
    steps, arrived = round(files.duration / FRAME_STEP), 0
    for step in range(steps):
        sumo.simulationStep()
        for name in sumo.simulation.getDepartedIDList():
            departed[name] = step * FRAME_STEP
        arrived += sumo.simulation.getArrivedNumber()
        if sumo.simulation.getCollidingVehiclesNumber():
            collisions |= {(hit.collider, hit.victim) for hit in sumo.simulation.getCollisions()}
        if ours is not None:
            ours.drive(sumo, step)
        if ego is not None:
            ego.drive(sumo, step)
        if step % 100 == 0:
            progress("simulating", step, steps)
    progress("simulating", steps, steps)
    counts = [int(sumo.simulation.getParameter("", f"stats.{name}")) for name in COUNTED]
    return departed, Incidents(len(collisions), *counts), arrived


def _departures(files: RunFiles, departed: dict[str, float]) -> pd.DataFrame:
    """Return planned and actual departures with their delays."""
    vehicle, planned = files.demand[c.VEHICLE].to_numpy(), files.demand[d.DEPART].to_numpy()
    actual = np.array([departed.get(str(name), np.nan) for name in vehicle])
    waited = np.where(np.isnan(actual), files.duration, actual) - planned
    return pd.DataFrame(
        {
            "vehicle": vehicle,
            "planned_s": planned,
            "departed_s": actual,
            "delay_s": np.round(np.maximum(waited, 0.0), 1),
        }
    )
