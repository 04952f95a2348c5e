"""SUMO drives exported types behind recorded leaders."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration.kernel import look_ahead
from idm_sumo.calibration.problem import Problem
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.siblings import scratch
from idm_sumo.sumo import network, session
from idm_sumo.sumo.export import run_recipe
from idm_sumo.sumo.export.courses import Course, StraightRoads, StudySection

Floats = npt.NDArray[np.float64]

# The stand-in for the leader is longer than any vehicle. Its front stays ahead of a follower that overlaps
# with the recorded leader, so SUMO and our kernel see the leader for the same time.
LEADER_LENGTH = 40.0  # m
ROOM = 200.0  # m, beyond the farthest vehicle
DECEL = "4.5"  # m/s², of a type that says none; a follower by Krauss expects its leader to brake as hard as itself


def drive_natively(
    problem: Problem,
    types: Sequence[Element],
    *,
    integration: str,
    d1: npt.ArrayLike = 0.0,
    lane_limit: float | None = None,
    lanes: int = 1,
) -> tuple[Floats, Floats]:
    """Let SUMO drive all drivers on straight lanes.

    Each is on a lane of its own behind its recorded leader.

    Parameters
    ----------
    problem : Problem
        Of ``n`` drivers over ``h`` frames (:func:`idm_sumo.calibration.problem.prepare`).
    types : sequence of Element
        The ``<vType>`` of each driver.
    integration : {"euler", "ballistic"}
    d1 : array_like, shape (n,) or ()
        m; where positive, ``minGap`` is set to ``minGap + d1 sqrt(v/v0)`` before every step.
    lane_limit : float, optional
        Speed limit (m/s); by default the largest desired speed.
    lanes : int
        Driving lanes a road: drivers share a road, side by side.

    Returns
    -------
    x, speed : float64, shape (n, h + 1)
        Front bumper (m), m/s, as SUMO reports them.

    Raises
    ------
    InputError
        If SUMO does not insert a vehicle.
    """
    n, h = problem.target.shape
    reach = float(problem.start_x.max() + problem.desired_speed.max() * h * FRAME_STEP)
    last = max(reach, float(problem.x.max(initial=reach))) + LEADER_LENGTH + ROOM
    first = min(float(problem.start_x.min()), float(problem.x.min(initial=np.inf)) - LEADER_LENGTH)
    course = StraightRoads(n, (first, last), lane_limit or float(problem.desired_speed.max()), lanes=lanes)
    return drive_on(course, problem, types, integration=integration, d1=d1)


def drive_on_our_network(
    problem: Problem, types: Sequence[Element], road: Road, lane: npt.ArrayLike, *, integration: str,
    d1: npt.ArrayLike = 0.0, net: Path | None = None,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Let SUMO drive the drivers on the road's network.

    There is one in each main lane at a time, without lane changes.

    Parameters
    ----------
    problem, types, integration, d1
        As of :func:`drive_natively`.
    road : Road
    lane : array_like of int, shape (n,)
        The recorded lane. Of several drivers of one lane all but one move to a lane that is free,
        which makes no difference to a driver: the lanes are parallel and straight.
    net : Path, optional
        Another build of the network.

    Returns
    -------
    x, speed : float64, shape (n, h + 1)
        As of :func:`drive_natively`.

    Raises
    ------
    InputError
        If SUMO does not insert a vehicle.
    """
    lane, extra = np.asarray(lane, dtype=np.int64), np.broadcast_to(np.asarray(d1, dtype=np.float64), len(types))
    n, h = problem.target.shape
    x, speed = np.empty((n, h + 1)), np.empty((n, h + 1))
    for begin in range(0, n, road.main_lanes):
        rows = np.arange(begin, min(begin + road.main_lanes, n))
        section = StudySection(_distinct(lane[rows], road.main_lanes), network.of(road), net)
        some = take(problem, rows)
        x[rows], speed[rows] = drive_on(
            section, some, [types[i] for i in rows], integration=integration, d1=extra[rows]
        )
    return x, speed


def drive_on(
    course: Course, problem: Problem, types: Sequence[Element], *, integration: str, d1: npt.ArrayLike = 0.0
) -> tuple[Floats, Floats]:
    """Let SUMO drive the drivers on a course.

    Parameters
    ----------
    course : Course
    problem, types, integration, d1
        As of :func:`drive_natively`.

    Returns
    -------
    x, speed : float64, shape (n, h + 1)
        As of :func:`drive_natively`.

    Raises
    ------
    InputError
        If SUMO does not insert a vehicle.
    """
    n, h = problem.target.shape
    extra = np.ascontiguousarray(np.broadcast_to(np.asarray(d1, dtype=np.float64), (n,)))
    x, speed = np.empty((n, h + 1)), np.empty((n, h + 1))
    x[:, 0], speed[:, 0] = problem.start_x, problem.start_speed
    with scratch() as folder:
        net, routes = course.write_net(folder), folder / "drivers.rou.xml"
        _write_vehicles(course, types, problem, routes)
        with session.simulation(_options(integration, routes), net=net) as sumo:
            _take_places(sumo, course, problem, n)
            with_d1 = np.flatnonzero(extra > 0.0).tolist()
            jam = np.array([float(element.get("minGap", "nan")) for element in types])
            for k in range(h):
                _place_leaders(sumo.vehicle, course, *leaders(problem, k, x[:, k]))
                for i in with_d1:
                    wanted = jam[i] + extra[i] * np.sqrt(speed[i, k] / problem.desired_speed[i])
                    sumo.vehicle.setMinGap(f"ego{i}", wanted)
                sumo.simulationStep()
                for i in range(n):
                    ego = f"ego{i}"
                    x[i, k + 1] = course.x_of(sumo.vehicle.getLaneID(ego), sumo.vehicle.getLanePosition(ego))
                    speed[i, k + 1] = sumo.vehicle.getSpeed(ego)
    return x, speed


def take(problem: Problem, rows: npt.NDArray[np.int64]) -> Problem:
    """Return some drivers of a problem; the traffic stays whole.

    Parameters
    ----------
    problem : Problem
    rows : int64, shape (m,)
        Numbers of the drivers.

    Returns
    -------
    Problem
    """
    per_driver = ("start_x", "start_speed", "desired_speed", "own", "first_cell", "forward", "target", "lateral",
                  "counted", "behind", "ahead", "rear", "leader_speed")  # fmt: skip
    fields = problem._asdict()
    return Problem(**fields | {name: np.ascontiguousarray(fields[name][rows]) for name in per_driver})


@njit(cache=True)
def leaders(p, k, x):  # type: ignore[no-untyped-def]
    """Return every driver's leader at one frame.

    Parameters
    ----------
    p : Problem
        Of ``n`` drivers.
    k : int
        Frame since the start.
    x : float64, shape (n,)
        Front bumpers (m).

    Returns
    -------
    rear : float64, shape (n,)
        Rear bumper (m), infinite without a leader.
    speed : float64, shape (n,)
        m/s.
    """
    rear, speed = np.empty(x.shape[0]), np.empty(x.shape[0])
    for i in range(x.shape[0]):
        rear[i], speed[i] = look_ahead(p, i, k, x[i])
    return rear, speed


def _distinct(lanes: npt.NDArray[np.int64], main_lanes: int) -> list[int]:
    """Return a different main lane for each driver.

    A driver keeps its own where that is still free.
    """
    free = list(range(1, main_lanes + 1))
    given = []
    for lane in lanes.tolist():
        given.append(lane if lane in free else 0)
        if lane in free:
            free.remove(lane)
    return [lane or free.pop() for lane in given]


def _options(integration: str, routes: Path) -> list[str]:
    """Return SUMO's options.

    They are the exported recipe, except for what every session sets and what moved leaders need.
    """
    recipe = run_recipe.options(integration)
    recipe |= {"collision.action": "none", "no-warnings": "true", "route-files": str(routes)}
    skipped = ("step-length", "time-to-teleport")
    return [word for name, value in recipe.items() if name not in skipped for word in (f"--{name}", value)]


def _write_vehicles(course: Course, types: Sequence[Element], problem: Problem, path: Path) -> None:
    """Write types, drivers and the leaders' stand-ins.

    They get their places later.
    """
    root = Element("routes")
    for name, element in {element.attrib["id"]: element for element in types}.items():
        root.append(element)
        SubElement(root, "vType", id=f"leader.{name}", length=f"{LEADER_LENGTH:g}", lcOvertakeRight="1",
                   apparentDecel=element.get("apparentDecel", element.get("decel", DECEL)))  # fmt: skip
    for i, element in enumerate(types):
        own = element.attrib["id"]
        for name, kind, place in (("ego", own, course.lane_at(i, float(problem.start_x[i]))),
                                  ("leader", f"leader.{own}", course.garage(i))):  # fmt: skip
            edge, _, lane = place[0].rpartition("_")
            way = course.route(i).split()
            vehicle = SubElement(
                root, "vehicle", id=f"{name}{i}", type=kind, depart="0", departEdge=str(way.index(edge)),
                departLane=lane, departPos=repr(place[1]), departSpeed="0", insertionChecks="none",
            )  # fmt: skip
            SubElement(vehicle, "route", edges=" ".join(way))
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _take_places(sumo: Any, course: Course, problem: Problem, n: int) -> None:
    """Insert all vehicles and place the drivers at their starts."""
    sumo.simulationStep()
    vehicle = sumo.vehicle
    if missing := {f"{name}{i}" for name in ("ego", "leader") for i in range(n)} - set(vehicle.getIDList()):
        raise InputError(f"SUMO did not insert {min(missing)}; is its start on the network?")
    for i in range(n):
        for name in (f"ego{i}", f"leader{i}"):
            vehicle.setLaneChangeMode(name, 0)
        vehicle.setSpeedMode(f"leader{i}", 0)
        vehicle.moveTo(f"ego{i}", *course.lane_at(i, float(problem.start_x[i])))
        vehicle.setPreviousSpeed(f"ego{i}", float(problem.start_speed[i]))


def _place_leaders(vehicle: Any, course: Course, rear: Floats, speed: Floats) -> None:
    """Put stand-ins where the recorded leaders are.

    Without a recorded leader the stand-in waits in the garage.
    """
    for i, (bumper, leader_speed) in enumerate(zip(rear.tolist(), speed.tolist(), strict=True)):
        there = np.isfinite(bumper)
        lane, position = course.lane_at(i, bumper + LEADER_LENGTH) if there else course.garage(i)
        vehicle.moveTo(f"leader{i}", lane, position)
        vehicle.setPreviousSpeed(f"leader{i}", leader_speed if there else 0.0)
