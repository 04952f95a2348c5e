"""Traffic of known IDM drivers in SUMO, as floating car data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.sumo.session import simulation
from tests.roads.networks import Network

LENGTH = 4.6  # m
STAY = 'lcStrategic="-1" lcSpeedGain="0" lcKeepRight="0" lcCooperative="0"'
BESIDE = 'lcOvertakeRight="1"'  # else SUMO brakes a driver above 60 km/h behind a slower vehicle on its left
FIRST = "first."  # begins the names of vehicles that drive a pattern


def draw(count: int, rng: np.random.Generator) -> pd.DataFrame:
    """Return ordinary drivers: ``a, b, T, d0``, one row each."""
    low, high = [0.8, 1.0, 0.9, 1.2], [2.2, 3.0, 2.0, 3.5]
    return pd.DataFrame(rng.uniform(low, high, (count, 4)), columns=["a", "b", "T", "d0"])


def write_routes(one: Network, drivers: pd.DataFrame, path: Path, seconds: float) -> dict[str, int]:
    """Write types, routes and vehicles, and return which driver each vehicle is."""
    types, vehicles, who = [], [], {}
    for name, edges in one.routes.items():
        types.append(f'<route id="{name}" edges="{edges}"/>')
    number = 0
    for name, lanes in one.lanes.items():
        for lane in lanes:
            for turn, depart in enumerate(np.arange(0.0, seconds, one.apart if name == "main" else 4 * one.apart)):
                driver = drivers.iloc[number % len(drivers)]
                first = FIRST if one.pattern and turn == 0 and name == "main" else ""
                vehicle = f"{first}{name}.{lane}.{turn}"
                change = STAY if name == "main" else ""
                types.append(
                    f'<vType id="{vehicle}" carFollowModel="IDM" accel="{driver.a:.6f}" decel="{driver.b:.6f}" '
                    f'emergencyDecel="9" tau="{driver["T"]:.6f}" minGap="{driver.d0:.6f}" length="{LENGTH}" '
                    f'maxSpeed="{one.limit}" speedFactor="1" speedDev="0" stepping="0.1" {BESIDE} {change}/>'
                )
                text = f'<vehicle id="{vehicle}" type="{vehicle}" route="{name}" depart="{depart:.1f}" '
                vehicles.append((depart, f'{text}departLane="{lane}" departSpeed="max" departPos="0"/>'))
                who[vehicle] = number % len(drivers)
                number += 1
    body = "".join(types) + "".join(text for _, text in sorted(vehicles))
    path.write_text(f"<routes>{body}</routes>")
    return who


def drive(one: Network, net: Path, routes: Path, fcd: Path, *, seconds: float, rng: np.random.Generator) -> None:
    """Run SUMO; the first vehicle of each lane drives waves."""
    options = ["--route-files", str(routes), "--fcd-output", str(fcd), "--fcd-output.acceleration", "true",
               "--precision", "6", "--no-warnings", "true", "--collision.action", "none"]  # fmt: skip
    waves = {}
    with simulation(options, net=net) as sumo:
        for step in range(round(seconds * 10)):
            for name in sumo.vehicle.getIDList():
                if name.startswith(FIRST):
                    if name not in waves:
                        waves[name] = rng.uniform(12, 40, 3), rng.uniform(0, 6.3, 3)
                    period, phase = waves[name]
                    swing = np.sin(2 * np.pi * step / 10 / period + phase).sum() / 3
                    sumo.vehicle.setSpeed(name, one.limit * (0.55 + 0.4 * swing))
            sumo.simulationStep()
