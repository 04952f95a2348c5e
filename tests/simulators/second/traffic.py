"""Drivers and traffic conditions, drawn from a generator."""

import numpy as np

from tests.simulators.second.road import DT

CARS = {"length": 4.6, "spread": 0.09, "factors": (1.0, 1.0, 1.0, 1.0, 1.0)}
TRUCKS = {"length": 13.0, "spread": 0.2, "factors": (0.8, 1.25, 1.2, 0.6, 0.9)}
MOTORCYCLES = {"length": 2.2, "spread": 0.05, "factors": (1.1, 0.8, 0.8, 1.4, 1.1)}
KINDS = {1: MOTORCYCLES, 2: CARS, 3: TRUCKS}


def draw_theta(rng, kind, means, spread):
    """Five parameters per driver, log-normal about the class means and cut at 2.2 standard deviations."""
    scatter = np.clip(rng.standard_normal((len(kind), 5)), -2.2, 2.2)
    factors = np.array([KINDS[k]["factors"] for k in kind])
    return means * factors * np.exp(scatter * spread - 0.5 * np.square(spread))


def choose_lanes(rng, kind, theta, lanes, selection):
    """Entry lanes in equal numbers; trucks and, by `selection`, slow drivers more to the right."""
    slow = selection * -np.log(theta[:, 0] / theta[:, 0].mean()) / 0.2 + 2.0 * (kind == 3)
    lane = np.empty(len(kind), np.int64)
    for block in range(0, len(kind), 4 * lanes):
        members = np.arange(block, min(len(kind), block + 4 * lanes))
        order = members[np.argsort(slow[members] + rng.standard_normal(len(members)))]
        lane[order] = 1 + np.arange(len(order)) * lanes // len(order)
    return lane


def draw_drivers(rng, count, scene):
    """Columns of `road.World` that describe `count` drivers of a scene."""
    shares = (scene["motorcycles"], 1.0 - scene["motorcycles"] - scene["trucks"], scene["trucks"])
    kind = rng.choice((1, 2, 3), count, p=shares)
    theta = draw_theta(rng, kind, np.array(scene["means"]), np.array(scene["spread"]))
    length = np.array([KINDS[k]["length"] for k in kind])
    length = length * np.exp(np.array([KINDS[k]["spread"] for k in kind]) * rng.standard_normal(count))
    van = (kind == 2) & (rng.random(count) < scene["vans"])
    length = np.where(van, length + rng.uniform(0.8, 1.6, count), length)
    lanes = scene["lanes"]
    lane = choose_lanes(rng, kind, theta, lanes, scene["selection"])
    due = 0.8 + rng.exponential(max(0.05, scene["headway"] - 0.8), count)
    return {
        "theta": theta, "length": length, "kind": kind, "lane0": lane, "due": due,
        "limit": rng.uniform(3.0, 5.5, count), "urge": scene["urge"] * np.exp(0.4 * rng.standard_normal(count)),
        "phase": rng.uniform(0, 2 * np.pi, count),
        "route": rng.uniform(0.2, 1.0, count) * scene["end"],
        "side": np.where(rng.random(count) < scene["routed"], rng.choice((-1, 1), count), 0),
    }  # fmt: skip


def queues(lane0, lanes):
    """Drivers of each entry lane in their order, cut to the shortest lane."""
    mine = [np.flatnonzero(lane0 == k) for k in range(1, lanes + 1)]
    shortest = min(map(len, mine))
    return np.array([q[:shortest] for q in mine])


def prevailing_speed(rng, scene, steps):
    """Speed in m/s that prevails past the section, per step and lane: oscillations, and stops in wavy traffic."""
    t = np.arange(steps) * DT
    swing = scene["swing"]

    def oscillation():
        periods, phases = rng.uniform(40, 150, 4), rng.uniform(0, 2 * np.pi, 4)
        return sum(np.sin(2 * np.pi * t / p + f) for p, f in zip(periods, phases, strict=True)) / 1.6

    common = oscillation()
    columns = []
    stops = np.cumsum(rng.uniform(*scene["stop_every"], 12)) if scene["stop_every"] else []
    for factor in scene["lane_factors"]:
        level = 1.0 + swing * (0.85 * common + 0.35 * oscillation())
        for at in stops:
            start, lasts = at + rng.normal(0, 4), rng.uniform(10, 22)
            level = np.where((t >= start) & (t < start + lasts), rng.uniform(0, 0.15), level)
        columns.append(scene["speed"] * factor * np.clip(level, 0.0, 2.2))
    smooth = np.exp(-np.arange(0, 150) * DT / 4.0)
    return np.stack([np.convolve(np.r_[np.full(149, c[0]), c], smooth / smooth.sum(), "valid") for c in columns], 1)
