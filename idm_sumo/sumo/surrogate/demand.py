"""Drivers of the surrogate recording: departures, routes, parameters."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import pandas as pd

from idm_sumo.recordings.columns import CAR, MOTORCYCLE, TRUCK
from idm_sumo.roads.us101 import OFF_RAMP, US101
from idm_sumo.sumo import network

# Vehicles that the real recording counted in its three periods of 15 minutes.
REAL_COUNTS = (2169, 2017, 1915)
PERIODS = len(REAL_COUNTS)
REAL_PERIOD = 900.0  # s

NETWORK = network.of(US101)
ON_RAMP = NETWORK.layout.on_ramp

# Assumed shares of vehicles that use a ramp, and of car-following models.
ON_RAMP_SHARE = 0.05
OFF_RAMP_SHARE = 0.035
MODELS = {"EIDM": 0.40, "Krauss": 0.30, "IDM": 0.20, "W99": 0.10}

CLASSES = {MOTORCYCLE: 0.007, CAR: 0.967, TRUCK: 0.026}
SUMO_CLASS = {MOTORCYCLE: "motorcycle", CAR: "passenger", TRUCK: "truck"}

ACTION_STEP = 1.0  # s, between two decisions of a driver; the acceleration stays constant meanwhile


class Schedule(NamedTuple):
    """Times of a surrogate recording, in seconds of the simulation.

    Attributes
    ----------
    begin : float
        First instant of the recording (s); before it the road fills.
    period : float
        Length of each of the three periods (s).
    """

    begin: float
    period: float

    @property
    def end(self) -> float:
        """Instant (s) after which entering vehicles are not recorded."""
        return self.begin + PERIODS * self.period


def draw_drivers(schedule: Schedule, rng: np.random.Generator) -> pd.DataFrame:
    """Return one row a driver, sorted by departure.

    Parameters
    ----------
    schedule : Schedule
        When to record.
    rng : numpy.random.Generator
        Source of the random draws.

    Returns
    -------
    pandas.DataFrame
        ``depart`` (s), ``on_ramp`` and ``off_ramp`` (bool), ``model``, ``vehicle_class``,
        ``length`` and ``width`` (m), and attributes of SUMO's vehicle types.
    """
    depart = _departures(schedule, rng)
    count = len(depart)
    drivers = pd.DataFrame({"depart": depart})
    drivers["on_ramp"] = rng.random(count) < ON_RAMP_SHARE
    drivers["off_ramp"] = rng.random(count) < OFF_RAMP_SHARE
    drivers["model"] = rng.choice(list(MODELS), count, p=list(MODELS.values()))
    drivers["vehicle_class"] = rng.choice(list(CLASSES), count, p=list(CLASSES.values()))
    _draw_sizes(drivers, rng)
    _draw_characters(drivers, rng)
    return drivers


def _departures(schedule: Schedule, rng: np.random.Generator) -> np.ndarray:
    """Return departures (s): a Poisson process with the recorded counts."""
    edges = schedule.begin + schedule.period * np.arange(PERIODS + 1)
    edges[0], edges[-1] = 0.0, edges[-1] + 30.0  # the road fills before and stays full to the end
    times = []
    for begin, end, real in zip(edges[:-1], edges[1:], REAL_COUNTS, strict=True):
        times.append(rng.uniform(begin, end, round(real / REAL_PERIOD * (end - begin))))
    return np.sort(np.concatenate(times)).round(1)


def _draw_sizes(drivers: pd.DataFrame, rng: np.random.Generator) -> None:
    """Add length and width (m).

    Car lengths follow the quartiles of US-101: 14.5, 15.5 and 17 ft.
    """
    count = len(drivers)
    kind = [drivers["vehicle_class"] == number for number in (MOTORCYCLE, CAR, TRUCK)]
    lengths = [rng.normal(2.2, 0.15, count), rng.normal(4.78, 0.55, count).clip(3.6, 6.7), rng.uniform(8, 19, count)]
    widths = [rng.normal(0.95, 0.08, count), rng.normal(1.95, 0.18, count).clip(1.5, 2.4), rng.normal(2.5, 0.08, count)]
    drivers["length"] = np.select(kind, lengths).round(2)
    drivers["width"] = np.select(kind, widths).round(2)


def _draw_characters(drivers: pd.DataFrame, rng: np.random.Generator) -> None:
    """Add each driver's own parameters, in SUMO's attribute names."""
    count = len(drivers)
    truck = (drivers["vehicle_class"] == TRUCK).to_numpy()

    def spread(median: float, sigma: float, low: float, high: float) -> np.ndarray:
        return np.clip(median * np.exp(rng.normal(0, sigma, count)), low, high)

    drivers["tau"] = spread(1.05, 0.3, 0.6, 2.5) * np.where(truck, 1.35, 1)
    drivers["minGap"] = spread(1.9, 0.3, 0.8, 4)
    drivers["accel"] = spread(1.3, 0.25, 0.6, 2.6) * np.where(truck, 0.6, 1)
    drivers["decel"] = spread(2.0, 0.25, 1, 4) + np.where(drivers["model"] == "Krauss", 1, 0)
    drivers["speedFactor"] = rng.normal(1.08, 0.1, count).clip(0.8, 1.4)
    drivers["sigma"] = rng.uniform(0.2, 0.5, count)
    drivers["cc2"] = rng.uniform(2, 6, count)
    uses_ramp = drivers["on_ramp"] | drivers["off_ramp"]
    drivers["lcSpeedGain"] = np.where(uses_ramp, 0.2, spread(1.0, 0.5, 0.2, 4))
    drivers["lcAssertive"] = np.where(uses_ramp, 4.0, rng.uniform(1, 2, count))


def write_routes(drivers: pd.DataFrame, path: Path) -> None:
    """Write the drivers as a SUMO route file.

    Parameters
    ----------
    drivers : pandas.DataFrame
        As of :func:`draw_drivers`; each driver gets a vehicle type of its own.
    path : Path
        File to write.
    """
    lines = ["<routes>"]
    for origin in ("upstream", ON_RAMP):
        for destination in ("outflow", "off_ramp"):
            edges = " ".join(NETWORK.route(origin, destination))
            lines.append(f'<route id="{origin} {destination}" edges="{edges}"/>')
    for number, driver in enumerate(drivers.itertuples(index=False)):
        lines += [_element("vType", _type_of(number, driver)), _element("vehicle", _trip_of(number, driver))]
    path.write_text("\n".join([*lines, "</routes>", ""]), encoding="utf-8")


def _type_of(number: int, driver: object) -> dict[str, object]:
    """Return the attributes of one driver's vehicle type."""
    get = driver.__getattribute__
    ramp = get("on_ramp") or get("off_ramp")
    own = {
        name: f"{get(name):.3f}"
        for name in ("tau", "minGap", "accel", "decel", "speedFactor", "lcSpeedGain", "lcAssertive")
    }
    model = {"Krauss": {"sigma": f"{get('sigma'):.2f}"}, "W99": {"cc1": own["tau"], "cc2": f"{get('cc2'):.2f}"}}
    return {
        "id": f"driver{number}", "carFollowModel": get("model"), "laneChangeModel": "SL2015",
        "vClass": SUMO_CLASS[get("vehicle_class")], "length": get("length"), "width": get("width"),
        "maxSpeed": 40, "emergencyDecel": 9, "actionStepLength": ACTION_STEP, **own,
        "lcKeepRight": 0, "lcStrategic": 6 if ramp else 1, "lcCooperative": 1 if ramp else 0.8,
        "lcPushy": 0.4 if ramp else 0, "lcLookaheadLeft": 4, "maxSpeedLat": 1.2, "minGapLat": 0.5,
        "latAlignment": "center",
        **model.get(get("model"), {}),
    }  # fmt: skip


def _trip_of(number: int, driver: object) -> dict[str, object]:
    """Return the attributes of one driver's departure.

    Drivers who leave by the off-ramp start on the right. Vehicles start behind the last one in
    their lane, so that a queue can grow back to the origin and vehicles still depart.
    """
    get = driver.__getattribute__
    origin, destination = (ON_RAMP if get("on_ramp") else "upstream"), ("off_ramp" if get("off_ramp") else "outflow")
    return {
        "id": number, "type": f"driver{number}", "route": f"{origin} {destination}", "depart": get("depart"),
        "departLane": 0 if get("on_ramp") or get("off_ramp") else "free",
        "departPos": 260 if get("on_ramp") else "last", "departSpeed": "avg", "insertionChecks": "collision",
        "arrivalPos": 80 if destination == "outflow" else round(float(NETWORK.place(OFF_RAMP + 150, 8).position), 1),
    }  # fmt: skip


def _element(tag: str, attributes: dict[str, object]) -> str:
    """Return one XML element."""
    return f"<{tag} " + " ".join(f"{name}={quoteattr(str(value))}" for name, value in attributes.items()) + "/>"
