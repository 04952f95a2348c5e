"""Conditions of a recording: road, traffic, drivers and noise, drawn so that a hidden effect can show."""

import numpy as np

from tests.simulators.second.laws import LAWS

WARM_S = 110.0  # s before the recording, until waves from downstream have crossed the section
UPSTREAM_M, DOWNSTREAM_M, ZONE_M = 300.0, 200.0, 220.0  # unseen stretches; in the zone a prevailing speed holds
LEAST_S = {3: 300.0, 4: 300.0, 5: 240.0, 6: 200.0}  # s, wider roads show the same number of drivers sooner
WAVY, SMOOTH, LIGHT = "wavy", "smooth", "light"
LIVELY = ("reaction_delay", "perception_threshold", "hysteresis", "acceleration_asymmetry", "multi_leader_anticipation",
          "slow_start", "brake_lights", "shaken", "speed_dependent_headway", "drawn_along")  # fmt: skip
DELICATE = ("reaction_delay", "late_beside_accident")  # a late driver needs a law that is stable with a delay


def draw_law(rng, names):
    """Law of the recording: the IDM in half of them."""
    others = LAWS[1:3] if set(names) & set(DELICATE) else LAWS[1:]
    return "idm" if rng.random() < 0.5 else str(rng.choice(others))


def draw_traffic(rng, names):
    """Kind of traffic with its prevailing speed (m/s), oscillation and entry headways."""
    kind = rng.choice((WAVY, SMOOTH, LIGHT), p=(0.6, 0.3, 0.1))
    if set(names) & set(LIVELY):
        kind = WAVY
    if "desired_speed" in names:
        kind = LIGHT
    if kind == LIGHT:
        return {"traffic": LIGHT, "speed": 40.0, "swing": 0.0, "stop_every": None, "headway": rng.uniform(2.6, 3.4)}
    speed = rng.uniform(7.0, 15.0) if kind == WAVY else rng.uniform(6.0, 15.0)
    swing = rng.uniform(0.3, 0.6) if kind == WAVY else rng.uniform(0.04, 0.12)
    stopping = kind == WAVY and (rng.random() < 0.5 or "slow_start" in names)
    every = (60.0, 100.0) if "slow_start" in names else (80.0, 150.0)
    every = every if stopping else None
    return {"traffic": str(kind), "speed": speed, "swing": swing, "headway": 1.0, "stop_every": every}


def draw_people(rng, names, light):
    """Drivers' means, spreads and classes, and their habits on lanes."""
    means = (rng.uniform(16, 20) if light else rng.uniform(24, 32), rng.uniform(1.15, 1.6), rng.uniform(1.8, 2.8),
             rng.uniform(1.0, 1.7), rng.uniform(1.5, 2.3))  # fmt: skip
    spread = np.minimum(rng.uniform(0.15, 0.30, 5), (0.2, 0.3, 0.3, 0.3, 0.3))
    trucks = rng.uniform(0.06, 0.1) if "leader_class" in names else rng.uniform(0.02, 0.08)
    bikes = rng.uniform(0.07, 0.09) if "motorcycle_beside" in names else rng.uniform(0.0, 0.02)
    movers = {"lane_change_relaxation", "pre_insertion", "courtesy_yielding"} & set(names)
    return {
        "means": tuple(map(float, means)), "spread": tuple(map(float, spread)), "trucks": trucks, "motorcycles": bikes,
        "vans": rng.uniform(0.25, 0.35) if "long_car_ahead" in names else rng.uniform(0.05, 0.2),
        "selection": rng.uniform(0.0, 1.5), "urge": rng.uniform(1.2, 2.5), "keep_right": rng.uniform(0.0, 1.0),
        "routed": rng.uniform(0.5, 0.7) if movers else rng.uniform(0.25, 0.55),
        "short_gaps": rng.uniform(2.0, 4.0) if "lane_change_relaxation" in names else rng.uniform(0.0, 1.0),
    }  # fmt: skip


def draw_noises(rng):
    """Driver noise (m/s2, s) and measurement noise (kind, m, s)."""
    kind = str(rng.choice(("white", "ar1", "smoothed"), p=(0.4, 0.4, 0.2)))
    memory = {"white": 0.0, "ar1": rng.uniform(0.3, 1.0), "smoothed": rng.uniform(0.15, 0.4)}[kind]
    return {
        "driver_noise": {"sigma": rng.uniform(0.1, 0.3), "memory_s": rng.uniform(1.0, 3.0)},
        "noise": {"kind": kind, "sigma_m": round(rng.uniform(0.1, 0.5), 3), "memory_s": round(memory, 3)},
    }


def duration(scene, vehicles):
    """Seconds after which about that many vehicles were seen, from the equilibrium flow and density."""
    speed = scene["expected_speed"]
    spacing = 5.5 + scene["means"][2] + 1.05 * scene["means"][1] * speed
    rate = scene["lanes"] * min(speed / spacing, 1.0 / max(scene["headway"], 1.0))
    there = rate * scene["section_m"] / speed
    return round(float(np.clip((vehicles - there) / rate, 0.0, 420.0)), 1)


def calm(scene):
    """Make drivers calmer and more alike: with a late response others fall into violent oscillations."""
    v0, headway, jam, acc, dec = scene["means"]
    scene["means"] = (v0, headway + 0.3, jam + 0.5, 0.65 * acc, 1.5 * dec)
    scene["spread"] = tuple(min(s, 0.2) for s in scene["spread"])
    scene["short_gaps"], scene["urge"], scene["routed"] = -1.5, 2.5 * scene["urge"], 0.5 * scene["routed"]


def draw_scene(rng, names):
    """All conditions of a recording in which the effects of these names are hidden."""
    scene = draw_traffic(rng, names)
    light = scene["traffic"] == LIGHT
    scene |= draw_people(rng, names, light) | draw_noises(rng)
    scene["law"] = draw_law(rng, names)
    scene["lanes"] = int(rng.choice((3, 4, 5, 6), p=(0.4, 0.3, 0.22, 0.08)))
    scene["section_m"] = float(round(rng.uniform(400, 700)))
    uneven = {"adjacent_lane_friction", "drawn_along"} & set(names)
    contrast = rng.uniform(0.2, 0.35) if uneven else rng.uniform(0.08, 0.22)
    slower = 1.0 - contrast * np.linspace(-1.0, 1.0, scene["lanes"])  # the right lanes are the slower ones
    scene["lane_factors"] = tuple(map(float, rng.permutation(slower) if rng.random() < 0.5 else slower))
    scene["expected_speed"] = min(scene["speed"], 0.9 * scene["means"][0]) * (0.9 if scene["stop_every"] else 1.0)
    few = rng.random() < 0.08 and "slow_start" not in names
    if few:  # a narrow road, so that they are few in a time long enough to see something
        scene["lanes"], scene["lane_factors"] = 3, scene["lane_factors"][:3]
    scene["seconds"] = duration(scene, rng.uniform(130, 200) if few else rng.uniform(400, 600))
    scene["seconds"] = max(scene["seconds"], 60.0 if few else LEAST_S[scene["lanes"]])
    scene |= {"warm": WARM_S, "start": UPSTREAM_M, "end": UPSTREAM_M + scene["section_m"]}
    scene |= {"zone": scene["end"] + DOWNSTREAM_M, "road_m": scene["end"] + DOWNSTREAM_M + ZONE_M}
    return scene
