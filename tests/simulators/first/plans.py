"""What is planted: everything drawn from one seed, unless it is given."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

# Small, middle and large; the unit is the effect's own.
SIZES = {
    "reaction_delay": (0.2, 0.4, 0.8),  # s
    "multi_leader_anticipation": (0.1, 0.2, 0.4),
    "lane_change_relaxation": (0.3, 0.6, 1.0),
    "acceleration_asymmetry": (0.15, 0.3, 0.5),
    "leader_class": (0.15, 0.3, 0.5),
    "speed_dependent_headway": (0.08, 0.15, 0.3),  # per 10 m/s
    "perception_threshold": (0.3, 0.6, 1.0),  # m/s
    "hysteresis": (0.06, 0.12, 0.25),
    "adjacent_lane_friction": (0.02, 0.05, 0.1),  # 1/s
    "location": (0.06, 0.12, 0.25),  # m/s^2, slowing
    "time_of_day": (0.06, 0.12, 0.25),
    "desired_speed": (0.1, 0.2, 0.35),  # share taken off in one lane
    "vehicle_class": (0.15, 0.3, 0.5),  # trucks' own time headway
    "memory": (0.1, 0.25, 0.5),
    "follower_pressure": (0.1, 0.2, 0.4),  # m/s^2
    "courtesy_yielding": (0.15, 0.3, 0.6),
    "pre_insertion": (0.15, 0.3, 0.6),
    "measurement_artefact": (0.5, 1.0, 2.0),  # m, at a seam
    # Nobody's catalogue has these.
    "distraction": (0.15, 0.3, 0.6),  # share of drivers whose foot freezes for 3 s at a place
    "throttle_wave": (0.05, 0.1, 0.2),  # m/s^2, own oscillation of 9 s
    "lane_enforcement": (0.1, 0.2, 0.4),  # m/s^2, one lane slows for a stretch of time
    "beside_truck": (0.1, 0.2, 0.4),  # m/s^2, slows while a truck is alongside
    "late_for_a_while": (0.4, 0.8, 1.2),  # s, delay during a stretch of time only
    "brake_lights_across": (0.2, 0.4, 0.8),  # m/s^2, slows when somebody two lanes over brakes hard
    "weariness": (0.15, 0.3, 0.6),  # longer headway after own hard accelerations and brakings
}
OUTSIDE = ("distraction", "throttle_wave", "lane_enforcement", "beside_truck", "late_for_a_while",
           "brake_lights_across", "weariness")  # fmt: skip
CATALOGUE = tuple(name for name in SIZES if name not in OUTSIDE)
LEVELS = ("small", "mid", "large")
MODELS = ("idm", "fvd", "gipps")
UNDERLYING = MODELS[:2]  # that are drawn from the seed
NOISES = ("white", "correlated")  # and, where it is asked for, "smoothed"
FORMS = ("usual", "other", "third")  # of an effect; a third form only where it is asked for
DENSITIES = ("moderate", "congested")
BUSIEST = 0.7  # vehicles a second and lane, those on the road at the beginning included


@dataclass(frozen=True)
class Plan:
    """One recording to be made. ``effects`` maps a name to its magnitude; empty for none.

    ``place`` (m), ``time`` (s) and ``lane`` (0 leftmost) say where location, time and lane effects act;
    ``share`` is the share of drivers that have the effect, ``only_lane`` the only lane in which it acts (-1: all).
    """

    seed: int
    effects: dict[str, float] = field(default_factory=dict)
    form: str = "usual"
    underlying: str = "idm"
    noise: str = "white"
    sigma: float = 0.3
    density: str = "congested"
    drivers: int = 500
    minutes: float = 7.0
    lanes: int = 4
    length: float = 640.0
    spread: float = 0.25
    trucks: float = 0.06
    driver_noise: float = 0.2
    lane_changes: float = 1.0
    place: tuple[float, float] = (200.0, 350.0)
    time: tuple[float, float] = (120.0, 240.0)
    lane: int = 1
    share: float = 1.0
    only_lane: int = -1


def plan(
    seed: int, *, effect: str | tuple[str, ...] | None = "drawn", size: str | None = None, **given: object
) -> Plan:
    """Return a plan; ``effect=None`` plants nothing, a tuple of names plants several, by default one is drawn."""
    rng = np.random.default_rng(seed)
    minutes, length = float(given.get("minutes", 7.0)), float(given.get("length", 640.0))  # type: ignore[arg-type]
    begin, start = rng.uniform(0.15, 0.55) * length, rng.uniform(0.2, 0.5)
    drawn = Plan(
        seed=seed,
        underlying=str(rng.choice(UNDERLYING)),
        noise=str(rng.choice(NOISES)),
        sigma=float(rng.uniform(0.1, 0.5)),
        density=str(rng.choice(DENSITIES)),
        form=str(rng.choice(FORMS[:2])),
        lanes=int(rng.integers(3, 6)),
        place=(begin, begin + rng.uniform(0.15, 0.3) * length),
        time=(start, start + rng.uniform(0.25, 0.4)),  # of the recording
    )
    seconds = _seconds(minutes, int(given.get("drivers", drawn.drivers)), int(given.get("lanes", drawn.lanes)))  # type: ignore[call-overload]
    drawn = replace(drawn, lane=int(rng.integers(drawn.lanes)), time=(drawn.time[0] * seconds, drawn.time[1] * seconds))
    name = str(rng.choice(CATALOGUE[:11])) if effect == "drawn" else effect
    level = size or str(rng.choice(LEVELS))
    names = () if name is None else (name,) if isinstance(name, str) else name
    magnitudes = {one: SIZES[one][LEVELS.index(level)] for one in names}
    chosen = replace(drawn, effects=magnitudes, **given)  # type: ignore[arg-type]
    return replace(chosen, lane=min(chosen.lane, chosen.lanes - 1))


def _seconds(minutes: float, drivers: int, lanes: int) -> float:
    """Return about how long the recording lasts (s), or less: a time beyond its end would plant nothing."""
    return min(60.0 * minutes, drivers / (BUSIEST * lanes))
