"""The same kind of recording, driven by SUMO, with effects on its drivers' headway.

Nothing of the car-following is ours here. What acts on the time headway can be hidden (a place, a time, a truck ahead,
the own speed): it is set anew, driver by driver, before each step.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import libsumo
import numpy as np
import numpy.typing as npt

from tests.simulators.first.plans import Plan

SUMO, MIXED = "SUMO ", "mixed"
MIX = ("IDM", "EIDM", "Krauss")  # each driver draws one
SUMO_MODELS = (*(SUMO + name for name in MIX), SUMO + MIXED)
IN_SUMO = ("location", "time_of_day", "leader_class", "speed_dependent_headway")  # what can be hidden
STEP = 0.1  # s
BEFORE, AFTER = 300.0, 250.0  # m of road outside the recorded section
CONTROL = 60.0  # m behind it, from where on vehicles keep to the speed that the road beyond allows
WARM_UP = 240.0  # s: the road fills, and waves run up it
SPARE = 150  # vehicles a lane that come and go before, or wait outside
SIGHT = 150.0  # m
HEADWAYS = {"light": 3.0, "moderate": 1.6, "congested": 1.5}  # s, between arrivals in a lane
TRUCK = 3
Floats = npt.NDArray[np.float64]
Headway = Callable[[float, float, float, bool], float]


def run(
    chosen: Plan, length: Floats, kind: npt.NDArray[np.int64], theta: Floats, caps: Floats
) -> tuple[Floats, Floats, npt.NDArray[np.int8]]:
    """Return position (m), speed (m/s) and lane (0 leftmost), each of shape ``(vehicles, frames)``.

    Outside the section the position is NaN and the lane -1.

    Parameters
    ----------
    chosen : Plan
    length, kind, theta
        Of the vehicles: m, class, and ``v0, T, a, b, s0``.
    caps : float64, shape (lanes, steps)
        Speed (m/s) that the road behind the section allows, in equal steps over the whole time.
    """
    n, frames = len(kind), int(chosen.minutes * 600) + 1
    x, v = np.full((n, frames), np.nan), np.full((n, frames), np.nan)
    lane = np.full((n, frames), -1, dtype=np.int8)
    factor, needs_leader = _headway_factor(chosen), "leader_class" in chosen.effects
    kept = np.full(n, np.nan)  # the headway that each has: SUMO is told of changes only
    with tempfile.TemporaryDirectory() as folder:
        files = _written(Path(folder), chosen, length, kind, theta)
        libsumo.start(["sumo", *files, "--step-length", str(STEP), "--no-step-log", "true", "--no-warnings", "true",
                       "--step-method.ballistic", "true", "--seed", str(chosen.seed % 2**31), "--time-to-teleport",
                       "-1"])  # fmt: skip
        try:
            for frame in range(-round(WARM_UP / STEP), frames):
                libsumo.simulationStep()
                cap = caps[:, int((frame * STEP + WARM_UP) / (frames * STEP + WARM_UP) * caps.shape[1])]
                for number, at, speed, on in _drivers(chosen.lanes):
                    if frame >= 0 and 0.0 <= at <= chosen.length:
                        x[number, frame], v[number, frame], lane[number, frame] = at, speed, on
                    if at > chosen.length + CONTROL:
                        libsumo.vehicle.setSpeed(str(number), float(cap[on]))
                    elif chosen.effects:
                        truck = needs_leader and _is_behind_a_truck(number, kind)
                        own = float(theta[number, 1]) * factor(at, frame * STEP, speed, truck)
                        if own != kept[number]:
                            libsumo.vehicle.setTau(str(number), own)
                            kept[number] = own
        finally:
            libsumo.close()
    return x, v, lane


def _drivers(lanes: int) -> Iterator[tuple[int, float, float, int]]:
    """Yield number, position in the section's coordinate, speed and lane (0 leftmost) of everybody on the road."""
    get = libsumo.vehicle
    for name in get.getIDList():
        yield int(name), get.getLanePosition(name) - BEFORE, get.getSpeed(name), lanes - 1 - get.getLaneIndex(name)


def _is_behind_a_truck(number: int, kind: npt.NDArray[np.int64]) -> bool:
    ahead = libsumo.vehicle.getLeader(str(number), SIGHT)
    return bool(ahead and ahead[0]) and bool(kind[int(ahead[0])] == TRUCK)


def _headway_factor(chosen: Plan) -> Headway:
    """Return by how much the headway is longer at a place, a time, a speed, behind a truck."""
    if beyond := set(chosen.effects) - set(IN_SUMO):
        raise ValueError(f"{', '.join(sorted(beyond))}: SUMO's drivers can have {', '.join(IN_SUMO)}")
    known: dict[str, Callable[[float], Headway]] = {
        "location": lambda e: lambda x, t, v, truck: 1.0 + e * (chosen.place[0] <= x < chosen.place[1]),
        "time_of_day": lambda e: lambda x, t, v, truck: 1.0 + e * (chosen.time[0] <= t < chosen.time[1]),
        "leader_class": lambda e: lambda x, t, v, truck: 1.0 + e * truck,
        "speed_dependent_headway": lambda e: lambda x, t, v, truck: min(max(1.0 + e * (v - 9.0) / 10.0, 0.4), 2.0),
    }  # fmt: skip
    each = [known[name](size) for name, size in chosen.effects.items()]
    return lambda x, t, v, truck: math.prod(one(x, t, v, truck) for one in each)


def _written(folder: Path, chosen: Plan, length: Floats, kind: npt.NDArray[np.int64], theta: Floats) -> list[str]:
    """Write a straight road and everybody who drives on it; return SUMO's options."""
    net, routes = folder / "road.net.xml", folder / "drivers.rou.xml"
    net.write_text(_road(chosen.lanes, BEFORE + chosen.length + AFTER), encoding="utf-8")
    rng = np.random.default_rng([chosen.seed, 5])
    model = chosen.underlying.removeprefix(SUMO)
    every = HEADWAYS[chosen.density] / chosen.lanes
    lines = ["<routes>", '<route id="along" edges="road"/>']
    for number, (v0, headway, a, b, s0) in enumerate(theta):
        own = str(rng.choice(MIX)) if model == MIXED else model
        lines.append(_element(
            "vType", id=f"driver{number}", carFollowModel=own, vClass="truck" if kind[number] == TRUCK else "passenger",
            maxSpeed=round(v0, 2), speedFactor=1.2, tau=round(headway, 3), accel=round(a, 3),
            decel=round(b + (own == "Krauss"), 3),
            minGap=round(s0, 3), length=round(length[number], 2), lcKeepRight=0, lcStrategic=0, lcAssertive=2,
            lcSpeedGain=round(5.0 * chosen.lane_changes * rng.lognormal(0.0, 0.4), 2),
            **({"sigma": round(rng.uniform(0.1, 0.4), 2)} if own == "Krauss" else {}),
        ))  # fmt: skip
        lines.append(_element("vehicle", id=number, type=f"driver{number}", route="along",
            depart=round(number * every, 1),
                              departLane="free", departPos="base", departSpeed="avg"))  # fmt: skip
    routes.write_text("\n".join([*lines, "</routes>"]), encoding="utf-8")
    return ["-n", str(net), "-r", str(routes)]


def _road(lanes: int, length: float) -> str:
    """Return a network of one straight edge."""
    each = "".join(
        _element(
            "lane", id=f"road_{k}", index=k, speed=30, length=length, shape=f"0,{3.6 * k:.1f} {length},{3.6 * k:.1f}"
        )
        for k in range(lanes)
    )
    ends = "".join(
        _element("junction", id=name, type="dead_end", x=at, y=0, incLanes=into, intLanes="", shape=f"{at},0 {at},9")
        for name, at, into in (("begin", 0.0, ""), ("end", length, " ".join(f"road_{k}" for k in range(lanes))))
    )
    return f'<net version="1.20"><edge id="road" from="begin" to="end">{each}</edge>{ends}</net>'


def _element(name: str, **attributes: object) -> str:
    return f"<{name} " + " ".join(f"{key}={quoteattr(str(value))}" for key, value in attributes.items()) + "/>"
