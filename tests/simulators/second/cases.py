"""Which cases a seed makes, and how one becomes a recording and its truth."""

from dataclasses import replace
from typing import Any

import numpy as np

from tests.simulators.second import camera, effects, outside, plant, road, scenes, traffic
from tests.simulators.second.laws import LAWS
from tests.simulators.second.simulate import run
from tests.simulators.second.view import rows_of

SIZES, SIZE_SHARES = ("small", "mid", "large"), (0.15, 0.45, 0.4)
LEAST_OUTSIDE, MOST_OUTSIDE = 0.16, 0.65  # m/s2, RMS of an effect outside the catalogue
LATE_S = 0.5  # s, reaction time from which only calm drivers keep their gaps
TRIES = 50
KINDS = ("null", "single", "some_drivers", "one_lane", "pair", "outside")
LANE_CAPABLE = ("acceleration_asymmetry", "hysteresis", "perception_threshold", "speed_dependent_headway",
                "multi_leader_anticipation", "location", "time_of_day", "reaction_delay")  # fmt: skip


def cycle(rng, names, count):
    """`count` names, each before any comes twice."""
    rounds = -(-count // len(names)) if count else 0
    return [name for _ in range(rounds) for name in rng.permutation(names)][:count]


def plan(seed: int, counts: dict[str, int]) -> list[dict[str, Any]]:
    """Cases in the order of their file numbers, which tell nothing about them."""
    rng = np.random.default_rng((seed, 0))
    # desired_speed shows by lane only, so it is drawn as a single but not for some drivers
    parts = [n for n in plant.NAMES if n != "desired_speed"]
    cases = [{"kind": "null", "names": []} for _ in range(counts["null"])]
    cases += [{"kind": "single", "names": [n]} for n in cycle(rng, plant.NAMES, counts["single"])]
    cases += [{"kind": "some_drivers", "names": [n]} for n in cycle(rng, parts, counts["some_drivers"])]
    cases += [{"kind": "one_lane", "names": [n]} for n in cycle(rng, LANE_CAPABLE, counts["one_lane"])]
    pairs = [sorted(map(str, rng.choice(parts, 2, replace=False))) for _ in range(counts["pair"])]
    cases += [{"kind": "pair", "names": names} for names in pairs]
    cases += [{"kind": "outside", "names": [n]} for n in cycle(rng, outside.NAMES, counts["outside"])]
    for number, case in enumerate(cases):
        case["size"] = [str(rng.choice(SIZES, p=SIZE_SHARES)) for _ in case["names"]]
        if case["kind"] != "single":
            case["size"] = [str(rng.choice(SIZES[1:])) for _ in case["names"]]
        case["usual"] = [bool(rng.random() < 2 / 3) for _ in case["names"]]
        # a null's law goes in turn, so that a third of the nulls is of another law than the IDM
        case["law"] = (str(rng.choice(LAWS[1:])) if number % 3 == 0 else "idm") if case["kind"] == "null" else None
    return [cases[i] for i in rng.permutation(len(cases))]


def hide(rng, case, scene, strength):
    """Effects of a case, with who has them."""
    if case["kind"] == "outside":
        return [plant.outside_effect(rng, case["names"][0], scene, strength)]
    made = zip(case["names"], case["size"], case["usual"], strict=True)
    hidden = [plant.catalogue_effect(rng, name, size, usual, scene) for name, size, usual in made]
    if case["kind"] == "some_drivers":
        hidden = [replace(e, share=round(rng.uniform(0.3, 0.6), 3)) for e in hidden]
    if case["kind"] == "one_lane":
        hidden = [replace(e, lane=int(rng.integers(1, scene["lanes"] + 1))) for e in hidden]
    return hidden


def drive(rng, scene, hidden):
    """Run the traffic of a scene; returns the world, the sums of squared effects, and what drivers saw."""
    steps = int((scene["warm"] + scene["seconds"]) / road.DT)
    count = int(scene["lanes"] * (scene["road_m"] / 9.0 + 0.75 * steps * road.DT))
    drivers = traffic.draw_drivers(rng, count, scene)
    touched = np.array([rng.random(count) < e.share for e in hidden], float).reshape(len(hidden), count)
    drivers["touched"] = np.ascontiguousarray(touched.T)
    spread = max([e.lag_spread for e in hidden], default=0.0)
    lag = max([e.lag for e in hidden], default=0.0)
    drivers["lag"] = rng.gamma(1.0 / spread**2, lag * spread**2, count) if spread else np.full(count, lag)
    world = road.new_world(drivers, steps)
    habits = (scene["keep_right"], scene["short_gaps"])
    noise = (scene["driver_noise"]["sigma"], float(np.exp(-road.DT / scene["driver_noise"]["memory_s"])))
    sums, memory = run(
        world, LAWS.index(scene["law"]), traffic.queues(drivers["lane0"], scene["lanes"]), rows_of(hidden),
        traffic.prevailing_speed(rng, scene, steps), (scene["start"], scene["end"], scene["zone"]),
        scene["road_m"], scene["warm"], noise, habits, int(rng.integers(2**31)),
    )  # fmt: skip
    return world, sums, memory


def attempt(seed, number, case, draw=0, strength=1.0, eager=0.0):
    """One try at a case: world, what drivers saw, clean rows, NGSIM table, scene, hidden effects and their RMS (m/s2).

    `draw` numbers the scenes tried; `eager` (m/s2) makes drivers take shorter gaps to the side, or longer ones.
    """
    rng = np.random.default_rng((seed, 1 + number, draw))
    scene = scenes.draw_scene(rng, case["names"])
    scene["law"] = case["law"] or scene["law"]
    scene["short_gaps"] += eager
    scene["urge"] *= np.exp(-0.25 * eager)
    hidden = hide(rng, case, scene, strength)
    late = max([e.lag for e in hidden], default=0.0) > LATE_S
    if late:
        scenes.calm(scene)
    world, sums, memory = drive(rng, scene, hidden)
    first = int(scene["warm"] / road.DT)
    table, clean = camera.film(world, rng, first, len(world.xs), (scene["start"], scene["end"]), scene["noise"])
    return {"world": world, "memory": memory, "clean": clean, "table": table, "scene": scene, "hidden": hidden,
            "late": late, "rms": np.sqrt(sums / max(1, len(memory)))}  # fmt: skip


def describe(effect, rms):
    """Entry of the truth for one effect."""
    forms = effects.OTHER_FORMS if effect.form else effects.USUAL_FORMS
    where = {}
    if effect.position[1] < 1e6:
        where["position_m"] = list(effect.position)
    if effect.time[1] < 1e6:
        where["time_s"] = list(effect.time)
    if effect.lane:
        where["lane"] = effect.lane
    if effect.share < 1.0:
        where["share_of_drivers"] = effect.share
    return {
        "name": effect.name, "size": effect.size, "usual_form": effect.form == 0, "parameters": effect.symbols,
        "form": forms.get(effect.name, "as in the catalogue"), "where": where or None, "rms": round(float(rms), 4),
    }  # fmt: skip
